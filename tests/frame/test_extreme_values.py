"""Extreme values that the checks accept give finite pictures without negative light, in every technique."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.values import changes, everything

from wgpu_gi.errors import GiError
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.check import check_camera, check_scene
from wgpu_gi.scene.scene import Environment, PointLight

LIGHT = ("radiance", "direct", "indirect", "emission", "standard_error")


def accepted():
    """Return the changes that the checks accept."""
    found = []
    for change in changes():
        scene, camera = change.apply()
        try:
            check_scene(scene)
            check_camera(camera)
            found.append(change)
        except GiError:
            pass
    return found


def renderer(technique):
    scene, camera = everything()
    settings = Settings(gi=technique, spp=4)
    settings.camera.frames = 2
    return Renderer(scene, size=(12, 8), camera=camera, settings=settings)


def assert_finite(renderer, what):
    renderer.run()
    for name in renderer.buffers:
        values = renderer.read_back(name)
        assert np.isfinite(values).all(), f"{what}: {name}"
        assert name not in LIGHT or (values >= 0).all(), f"{what}: {name} is negative"


# Values that change the layers of materials compile pipelines, which takes most of the time.
EACH = 24
MARKS = [pytest.mark.slow, pytest.mark.timeout(600)]
SLOW = [pytest.param(technique, 4 * place, marks=MARKS) for place, technique in enumerate(TECHNIQUES)]


@pytest.mark.parametrize(("technique", "first"), [("path", 2), *SLOW])
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_pictures_of_extreme_values_are_finite(technique, first):
    """Every 24th value; other ones for each technique."""
    shown = renderer(technique)
    for change in accepted()[first::EACH]:
        shown.scene, shown.camera = change.apply()
        assert_finite(shown, change)


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_pictures_under_extreme_light_are_finite(technique):
    shown = renderer(technique)
    shown.scene.lights.append(PointLight((0, 1e-7, 0)))
    for power in (1e-300, 1e-35, 1e-12, 1e12, 1e20):
        for light in shown.scene.lights:
            light.intensity = power
        shown.scene.instances[0].mesh.materials[0].emission = (power, power / 2, 0.0)
        shown.scene.environment = Environment((power, 0.0, power / 4))
        assert_finite(shown, power)


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_a_sky_without_surfaces_renders(technique):
    """Cameras that a technique adds have no extent here."""
    shown = renderer(technique)
    shown.scene.instances = []
    assert_finite(shown, "no surfaces")


def test_standard_error_is_in_proportion_to_light():
    """A square of light neither overflows nor vanishes, as it is measured in units of the brightest light."""
    shown, errors = renderer("path"), []
    for exponent in (0, -90, 60):
        scene, _ = everything()
        for light in scene.lights:
            light.intensity *= 2.0**exponent
        scene.instances[0].mesh.materials[0].emission = (0.0, 0.0, 0.0)
        scene.environment = None
        shown.scene = scene
        shown.run()
        errors.append(shown.read_back("standard_error") * np.float32(2.0**-exponent))
    assert np.array_equal(errors[0], errors[1]) and np.array_equal(errors[0], errors[2]) and errors[0].any()
