"""Direct light of an occluded environment against the path tracer."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.pictures import shoot
from helpers.skies import gradient_sky

from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.built_in.scenes import courtyard
from wgpu_gi.scene.scene import Environment

SIZE = (96, 54)
# Environments, and the most bias and relMSE of the default preset.
SKIES = {
    "constant": (Environment((0.15, 0.2, 0.28)), 0.01, 0.02),
    "gradient": (Environment(image=gradient_sky(64)), 0.03, 0.02),
    "sun": (Environment(image=gradient_sky(64, 2000.0)), 0.03, 0.03),
}


def courtyard_under(environment):
    scene = courtyard()
    scene.lights, scene.environment = [], environment
    return scene


@pytest.mark.parametrize("name", SKIES)
def test_occluded_environment_agrees_with_the_path_tracer(name):
    environment, most_bias, most_error = SKIES[name]
    scene = courtyard_under(environment)
    truth = shoot(scene, SIZE, show=("direct", "depth"), bounces=0, spp=256)
    settings = Settings(gi="many-light", bounces=0, diffuse=True, camera=CameraSettings(jitter=False))
    renderer = Renderer(scene, size=SIZE, settings=settings)
    renderer.run(show=("direct",), check=True)
    seen = truth["depth"] > 0
    got, wanted = renderer.read_back("direct")[seen], truth["direct"][seen]
    assert abs(bias(got, wanted)) <= most_bias
    assert relmse(got, wanted) <= most_error


def test_an_unoccluded_sky_has_visibility_one():
    """A floor without occluders: sampled visibility is 1 without noise, for any picture."""
    scene = courtyard_under(Environment(image=gradient_sky(16, 50.0)))
    scene.instances = scene.instances[-1:]
    pictures = []
    for rays in (0, 1):
        settings = Settings(gi="many-light", bounces=0, diffuse=True, camera=CameraSettings(jitter=False, frames=2))
        settings.environment.rays = rays
        renderer = Renderer(scene, size=SIZE, settings=settings)
        renderer.run(show=("direct",))
        pictures.append(renderer.read_back("direct"))
    assert pictures[0].any()
    assert np.allclose(pictures[0], pictures[1], rtol=1e-4)
