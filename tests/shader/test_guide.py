"""reference/guide.wgsl: the cells of the light rays that the path tracer guides."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.measure.wgsl_evaluator import Evaluator
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import DirectionalLight, Instance, PointLight, Scene, SpotLight

FUNCTIONS = """
// Returns the cell of the point of the square that a light ray is sampled with, and that of a point on the ray.
fn cells(u: vec2f, distance: f32) -> vec2f {
    let sent = sample_ray_of(lights[0], 0.5, u, u);
    let arrives = sent.ray.origin + distance * sent.ray.direction;
    return vec2f(vec2u(cell_of(0u, u), cell_towards(lights[0], 0u, arrives)));
}
"""
LIGHTS = [
    PointLight((0.3, 1.0, -0.2), 5.0),
    SpotLight((0.3, 1.0, -0.2), (0.2, -1.0, 0.4), 0.2, 0.6, 5.0),
    DirectionalLight((0.5, -1.0, 0.25), 2.0),
]


@pytest.mark.parametrize("light", LIGHTS, ids=lambda light: type(light).__name__)
def test_a_point_on_a_light_ray_lies_in_the_cell_that_the_ray_was_drawn_from(tmp_path, light):
    """Both strategies must agree on densities, or their weights do not add up to one."""
    scene = Scene([Instance(quad((-1, 0, 1), (2, 0, 0), (0, 0, -2), matte(0.5)))], [light])
    rng = np.random.default_rng(0)
    u, distance = rng.random((20_000, 2)).astype(np.float32), rng.uniform(0.1, 3, 20_000).astype(np.float32)
    got = Evaluator(tmp_path)(
        "reference/guide.wgsl", "cells(u(i), d(i))", "vec2f", functions=FUNCTIONS, scene=scene, u=u, d=distance
    )
    # Points near a cell's border may be rounded across it.
    assert (got[:, 0] == got[:, 1]).mean() > 0.998
    assert len(np.unique(got[:, 0])) == 1024
