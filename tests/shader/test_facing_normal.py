"""scene/facing_normal.wgsl: shading normals face the viewer and, of normal maps, mirror the view above the surface."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.measure.wgsl_evaluator import Evaluator

LIBRARY = "scene/facing_normal.wgsl"
N = 100_000


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def dot(a, b):
    return (a * b).sum(-1)


@pytest.fixture
def normals(tmp_path):
    """Normals, sides and view directions, from vertical to 1e-3 degrees above the surface."""
    rng = np.random.default_rng(1)
    n, side = unit(rng.normal(size=(2, N, 3)))
    elevation, across = np.radians(90 * 10 ** rng.uniform(-5, 0, (N, 1))), rng.normal(size=(N, 3))
    across = unit(across - dot(across, side)[:, None] * side)
    to_eye = np.sin(elevation) * side + np.cos(elevation) * across
    evaluate = Evaluator(tmp_path)

    def facing(bumped):
        arrays = {"n": n.astype(np.float32), "side": side.astype(np.float32), "eye": to_eye.astype(np.float32)}
        call = f"facing_normal(n(i), side(i), eye(i), {bumped})"
        return evaluate(LIBRARY, call, "vec3f", **arrays).astype(np.float64)

    return n, side, to_eye, facing


@pytest.mark.parametrize("bumped", ["true", "false"])
def test_normals_face_the_viewer(normals, bumped):
    _, _, to_eye, facing = normals
    got = facing(bumped)
    assert np.allclose(np.linalg.norm(got, axis=1), 1, atol=1e-6)
    assert dot(got, to_eye).min() > 0.5e-3


def test_normals_that_face_the_viewer_stay(normals):
    n, side, to_eye, facing = normals
    mirrored = 2 * dot(n, to_eye)[:, None] * n - to_eye
    above = dot(side, mirrored) > np.minimum(0.9 * dot(side, to_eye), 0.01) + 1e-5
    stay = (dot(n, to_eye) > 0.0011) & above
    assert stay.sum() > 0.1 * N
    assert np.abs(facing("true")[stay] - n[stay]).max() < 1e-6
    faces = dot(n, to_eye) > 0.0011
    assert np.abs(facing("false")[faces] - n[faces]).max() < 1e-6


def test_bumps_mirror_the_view_above_the_surface(normals):
    """By the least turn: where a normal is turned, the mirrored direction is as high as the threshold."""
    n, side, to_eye, facing = normals
    got = facing("true")
    mirrored = 2 * dot(got, to_eye)[:, None] * got - to_eye
    height, threshold = dot(side, mirrored), np.minimum(0.9 * dot(side, to_eye), 0.01)
    # At 1 degree and more; below, the least cosine and rounding raise or lower it.
    view = dot(side, to_eye) > 0.02
    assert (height > threshold - 1e-3)[view].all()
    turned = view & (np.abs(got - n).max(1) > 1e-5) & (dot(n, side) > 0)
    assert turned.sum() > 1000 and np.abs(height - threshold)[turned].max() < 2e-3
