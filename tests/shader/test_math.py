"""common/math.wgsl against numpy: packings, frames, normalisation at the ends of the range."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.measure.wgsl_evaluator import Evaluator
from wgpu_gi.upload.mesh_data import octahedral_encode

MATH = "common/math.wgsl"


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


def directions(count=20_000):
    """Unit vectors all over the sphere; first the axes and their like, with zeros of both signs."""
    rng = np.random.default_rng(0)
    special = [
        (x, y, z) for x in (-1, -0.0, 0.0, 1) for y in (-1, -0.0, 0.0, 1) for z in (-1, -0.0, 0.0, 1) if x or y or z
    ]
    near_poles = rng.normal(size=(200, 3)) * 10 ** rng.uniform(-9, -1, (200, 1))
    near_poles[:, 2] = np.where(np.arange(200) % 2, 1, -1)
    d = np.concatenate([special, near_poles, rng.normal(size=(count, 3))])
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def test_octahedral_codes_round_trip(evaluate):
    """Normals as the upload packs them come back within 3 steps of 16-bit snorm."""
    d = directions()
    code = octahedral_encode(d)
    got = evaluate(MATH, "octahedral_decode(unpack2x16snorm(code(i)))", "vec3f", code=code)
    assert np.allclose(np.linalg.norm(got, axis=1), 1, atol=1e-6)
    assert np.linalg.norm(got - d, axis=1).max() < 3 / 32767


def test_octahedral_code_of_axes_is_exact(evaluate):
    axes = np.concatenate([np.eye(3), -np.eye(3)]).astype(np.float32)
    got = evaluate(MATH, "octahedral_decode(unpack2x16snorm(code(i)))", "vec3f", code=octahedral_encode(axes))
    assert np.allclose(got, axes, atol=1e-6)


def test_frame_from_normal_is_orthonormal(evaluate):
    """Orthonormal, right-handed, with the normal as third axis: all over the sphere, poles and -0 included."""
    n = directions()
    columns = [evaluate(MATH, f"frame_from_normal(n(i))[{k}]", "vec3f", n=n).astype(np.float64) for k in range(3)]
    frame = np.stack(columns, -1)
    assert np.isfinite(frame).all()
    assert np.array_equal(columns[2].astype(np.float32), n)
    assert np.abs(frame.transpose(0, 2, 1) @ frame - np.eye(3)).max() < 1e-6
    assert np.allclose(np.linalg.det(frame), 1, atol=1e-6)


def test_normalize_or_works_over_the_range_of_float32(evaluate):
    rng = np.random.default_rng(0)
    # Denormal numbers may be zero to a GPU; 1e-37 is normal.
    v = rng.normal(size=(2000, 3)) * 10 ** rng.uniform(-36, 37.5, (2000, 1))
    v = v.astype(np.float32)
    expected = v.astype(np.float64) / np.linalg.norm(v.astype(np.float64), axis=1, keepdims=True)
    got = evaluate(MATH, "normalize_or(v(i), vec3f(0.0, 0.6, 0.8))", "vec3f", v=v)
    assert np.allclose(got, expected, atol=1e-6)
    assert np.allclose(np.linalg.norm(got, axis=1), 1, atol=1e-6)


def test_normalize_or_falls_back_without_a_direction(evaluate):
    """Zero, infinite and NaN vectors give the fallback; denormal ones give it or their direction."""
    inf, nan = np.inf, np.nan
    bad = [(0, 0, 0), (-0.0, 0, -0.0), (inf, 0, 0), (1, -inf, 1), (inf, inf, inf)]
    bad += [(nan, nan, nan), (nan, 1, 0), (1, nan, 0), (0, 1, nan), (1, 1, nan), (nan, 0, 0), (nan, inf, 0)]
    got = evaluate(MATH, "normalize_or(v(i), vec3f(0.0, 0.6, 0.8))", "vec3f", v=np.array(bad, np.float32))
    assert np.allclose(got, (0, 0.6, 0.8), atol=1e-6)
    tiny = np.array([(1e-40, 0, 0), (0, -1e-44, 0)], np.float32)
    got = evaluate(MATH, "normalize_or(v(i), vec3f(0.0, 0.6, 0.8))", "vec3f", v=tiny)
    assert np.allclose(np.linalg.norm(got, axis=1), 1, atol=1e-6)


def test_is_finite_checks_every_component(evaluate):
    inf, nan = np.inf, np.nan
    v = np.array([(0, 0, 0), (1e38, -1e-40, 3), (inf, 0, 0), (0, -inf, 0), (0, 1, nan), (-nan, 0, inf)], np.float32)
    got = evaluate(MATH, "select(0.0, 1.0, is_finite(v(i)))", "f32", v=v)
    assert got.tolist() == [1, 1, 0, 0, 0, 0]


def test_luminance_and_max3_agree_with_numpy(evaluate):
    color = np.random.default_rng(0).uniform(0, 10, (100, 3)).astype(np.float32)
    assert np.allclose(evaluate(MATH, "luminance(color(i))", "f32", color=color), color @ [0.2126, 0.7152, 0.0722])
    assert np.allclose(evaluate(MATH, "luminance(vec3f(1.0))", "f32", count=1), 1)
    assert np.array_equal(evaluate(MATH, "max3(color(i))", "f32", color=color), color.max(1))
