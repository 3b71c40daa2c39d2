"""The bounds of the plan against pictures in which what was left out is switched on by force."""

from __future__ import annotations

import re

import numpy as np
import pytest
from helpers.pictures import shoot

import wgpu_gi as gi
from wgpu_gi.camera import Camera
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import Environment, Instance, Material, Scene
from wgpu_gi.settings import assign
from wgpu_gi.techniques.shared.bounds import left_out
from wgpu_gi.upload.reflectance import coated_reflectance, largest_reflectance

SIZE = (32, 18)


@pytest.mark.parametrize(
    ("color", "roughness", "metallic"),
    [(0.0, 0.15, 0.0), (0.5, 1.0, 0.0), (0.3, 0.5, 1.0), (0.2, 0.6, 0.5), (0.8, 1.0, 1.0)],
)
def test_no_direction_reflects_more_than_the_largest_reflectance(color, roughness, metallic):
    """A floor under a sky of radiance 1 shows its directional albedo; some pixel comes close to the bound."""
    material = Material(base_color=(color,) * 3 + (1.0,), roughness=roughness, metallic=metallic)
    floor = quad((-500, 0, 500), (1000, 0, 0), (0, 0, -1000), material)
    camera = Camera.look_at((0, 1, 0), (0, 0.6, -2), (0, 1, 0), 60)
    scene = Scene([Instance(floor)], [], Environment((1.0, 1.0, 1.0)), [camera])
    found = shoot(scene, (8, 48), camera=camera, diffuse=False, show=("direct", "depth", "standard_error"), spp=256)
    rows = (found["depth"] > 0).all(1)
    albedo, noise = found["direct"][rows].mean((1, 2)), found["standard_error"][rows].mean() / 8**0.5
    bound = coated_reflectance(color, roughness, roughness, metallic > 0)
    assert albedo.max() <= bound + 4 * noise
    assert albedo.max() > 0.9 * bound - 0.05


def radiance(settings: Settings, *texts: str, scene: Scene, show: str = "radiance") -> tuple[np.ndarray, str]:
    """Return the picture with some settings, and the plan."""
    for text in ("camera.jitter=false", *texts):
        assign(settings, text)
    with Renderer(scene, size=SIZE, settings=settings) as renderer:
        renderer.run(show=(show,))
        return np.asarray(renderer.read_back(show), np.float64), str(renderer.plan())


def bound_of(plan: str, name: str) -> float:
    """Return the bound of a skipped pass: a share, or a radiance."""
    (line,) = [line for line in plan.splitlines() if line.startswith(f"{name} ")]
    percent = re.search(r"would add at most ([\d.e+-]+) % of the light", line)
    if percent:
        return float(percent[1]) / 100.0
    assert "would add nothing" in line, line
    return 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("technique", "name", "off", "on"),
    [
        ("path", "bounces/further", "bounces=1", "bounces=none"),
        ("ssil", "bounces/further", "ssil.bounces=1", "ssil.bounces=4"),
        ("ssil", "ssil/offscreen", "ssil.offscreen=none", "ssil.offscreen=cache"),
        ("ssdo", "ssdo/offscreen", "ssdo.offscreen=none", "ssdo.offscreen=cache"),
        ("ssdo", "bounces/further", "ssdo.bounce=false", "ssdo.bounce=true"),
        ("many-light", "gather/compensate", "gather.compensation=false", "gather.compensation=true"),
        ("many-light", "ism/refine", "ism.refine=false", "ism.refine=true"),
    ],
)
def test_what_is_switched_on_adds_no_more_than_its_bound(technique, name, off, on):
    """In Cornell's box, whose picture shows most of its surfaces: the added share of the light that they reflect."""
    scene = gi.load("cornell")
    basis = ["camera.frames=16", "spp=256"] + ["gather.visibility=ism"] * (name == "ism/refine")
    without, plan = radiance(Settings(gi=technique, diffuse=True), *basis, off, scene=scene)
    added, _ = radiance(Settings(gi=technique, diffuse=True), *basis, on, scene=scene)
    emission, _ = radiance(
        Settings(gi=technique, diffuse=True), "camera.frames=1", "spp=1", scene=scene, show="emission"
    )
    share = (added - without).sum() / (added - emission).sum()
    bound = bound_of(plan, name)
    if name == "ism/refine":
        assert bound == 0.0
        assert share < 0.01  # another drawing of the same shadows
    else:
        assert 0.0 < share <= bound


def test_a_picture_of_all_bounces_leaves_nothing_out():
    _, plan = radiance(Settings(gi="path", diffuse=True), "spp=1", scene=gi.load("cornell"))
    assert "bounces/further" not in plan


def test_the_sky_lights_no_pixel_beyond_its_bound():
    """All bounces of a sky's light, by the path tracer: at most the largest albedo times the sky."""
    scene = gi.load("courtyard")
    scene.lights, scene.environment = [], Environment((1.0, 2.0, 3.0))
    for material in scene.materials:
        material.emission = (0.0, 0.0, 0.0)
    camera = scene.cameras[0]
    found = shoot(scene, SIZE, camera=camera, show=("direct", "indirect", "standard_error"), spp=256)
    reflected = found["direct"] + found["indirect"]
    bound = largest_reflectance(scene, True) * 3.0
    assert (reflected <= bound + 4 * found["standard_error"]).all()
    assert reflected.max() > 0.5 * bound
    _, plan = radiance(Settings(gi="none", diffuse=True), "environment.ambient=false", scene=scene)
    assert f"at most {bound:.2g} W/(m2 sr) at a pixel" in plan


def test_a_room_of_one_albedo_attains_the_bound_of_bounces():
    """In a closed room whose walls all glow and reflect 0.6, the light of more than n scatterings is 0.6^n of all."""
    material = Material(base_color=(0.6, 0.6, 0.6, 1.0), emission=(1.0, 1.0, 1.0), double_sided=True)
    walls = [
        quad(corner, u, v, material)
        for corner, u, v in (
            ((-1, -1, -1), (2, 0, 0), (0, 0, 2)),
            ((-1, 1, -1), (2, 0, 0), (0, 0, 2)),
            ((-1, -1, -1), (0, 2, 0), (0, 0, 2)),
            ((1, -1, -1), (0, 2, 0), (0, 0, 2)),
            ((-1, -1, -1), (2, 0, 0), (0, 2, 0)),
            ((-1, -1, 1), (2, 0, 0), (0, 2, 0)),
        )
    ]
    scene = Scene([Instance(wall) for wall in walls], [])
    camera = Camera.look_at((0.2, 0.1, 0.3), (-1, -0.5, -1), (0, 1, 0), 70)
    scattered = {
        n: sum(
            shoot(scene, (8, 8), camera=camera, show=("direct", "indirect"), spp=256, bounces=n)[b].mean()
            for b in ("direct", "indirect")
        )
        for n in (1, None)
    }
    assert 1.0 - scattered[1] / scattered[None] == pytest.approx(left_out(0.6, 2), rel=0.03)
