"""The packing of SSDO's hits."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.measure.wgsl_evaluator import Evaluator

HIT_CODE = "ssdo/hit_code.wgsl"


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


def radiances():
    """Colours of every magnitude that bounces have; last, black."""
    rng = np.random.default_rng(0)
    colors = rng.uniform(0, 1, (5000, 3)) * 10 ** rng.uniform(-25, 30, (5000, 1))
    return np.concatenate([colors, [[0, 0, 0]]]).astype(np.float32)


def test_radiance_keeps_eight_bits_of_its_brightest_channel(evaluate):
    color = radiances()
    got = evaluate(HIT_CODE, "unpack_radiance(pack_radiance(color(i)))", "vec3f", color=color)
    assert np.all(np.abs(got - color) <= color.max(1, keepdims=True) / 255)
    # Rounding has no bias.
    assert (got / color.max(1, keepdims=True).clip(1e-30)).mean() == pytest.approx(
        (color / color.max(1, keepdims=True).clip(1e-30)).mean(), rel=1e-3
    )


def test_twice_the_radiance_is_exactly_twice(evaluate):
    color = radiances()
    once, twice = (
        evaluate(HIT_CODE, f"unpack_radiance(pack_radiance({k}.0 * color(i)))", "vec3f", color=color) for k in (1, 2)
    )
    assert np.array_equal(2 * once, twice)


def test_no_radiance_has_the_code_of_a_direction_that_hits_nothing(evaluate):
    color = np.array([[3.4e38] * 3, [1.7e38] * 3, [1e-30] * 3], np.float32)
    got = evaluate(HIT_CODE, "pack_radiance(color(i))", "u32", color=color)
    assert np.all(got < 0xFFFFFFFD)


def test_directions_and_weights_round_trip(evaluate):
    rng = np.random.default_rng(0)
    d = rng.normal(size=(5000, 3))
    d = (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)
    weight = rng.uniform(0, 1, (5000, 1)).astype(np.float32)
    given = "HitDirection(d(i), weight(i), true, false)"
    back = f"unpack_hit_direction(pack_hit_direction({given}))"
    got = evaluate(HIT_CODE, f"vec4f({back}.direction, {back}.weight)", "vec4f", d=d, weight=weight[:, 0])
    assert np.linalg.norm(got[:, :3] - d, axis=1).max() < 0.003
    assert np.abs(got[:, 3] - weight[:, 0]).max() <= 0.5 / 510 + 1e-6
    lit = "unpack_hit_direction(pack_hit_direction(HitDirection(d(i), 0.5, true, true)))"
    got = evaluate(HIT_CODE, f"vec2f({lit}.weight, select(0.0, 1.0, {lit}.has_light))", "vec2f", d=d)
    assert np.array_equal(got, np.ones_like(got))
