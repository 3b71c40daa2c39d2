"""Directional occlusion and the bounce of SSDO against closed forms.

The form factor of a point of a floor to a long wall of height h at the distance x is 1/2 (1 - x / sqrt(x^2 + h^2))
(Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-5 in the limit).
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, quad
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, Material, Scene
from wgpu_gi.settings import assign

HEIGHT = 3.0
LONG = 60.0  # metres to each side: twenty heights of the wall


def corner(lights=(), sky=None, albedo=0.5, wall=0.8):
    """Build a floor, y = 0, before a wall at z = 0, which is higher than the camera."""
    floor = quad((-LONG, 0, 0), (2 * LONG, 0, 0), (0, 0, 6), matte(albedo))
    upright = quad((-LONG, 0, 0), (2 * LONG, 0, 0), (0, HEIGHT, 0), matte(wall))
    camera = Camera.look_at((0, 1.7, 4.5), (0, 0.9, 0))
    return Scene([Instance(floor), Instance(upright)], list(lights), sky, [camera])


def render(scene, *texts, size=(64, 48), frames=32, gi="ssdo", diffuse=True):
    settings = Settings(gi=gi, diffuse=diffuse, camera=CameraSettings(jitter=False, frames=frames))
    for text in ("ssdo.steps=64", "ssdo.half_resolution=false", *texts):
        assign(settings, text)
    renderer = Renderer(scene, size=size, settings=settings)
    renderer.run(check=True)
    return {name: renderer.read_back(name).astype(np.float64) for name in renderer.buffers}


def floor_and_form_factor(got):
    """Return the pixels that show the middle of the floor, and their form factors to the wall."""
    _, y, z = np.moveaxis(got["position"], -1, 0)
    on_floor = (got["depth"] > 0) & (np.abs(y) < 1e-3) & (z > 0.2) & (z < 3.0)
    return on_floor, 0.5 * (1 - z / np.sqrt(z**2 + HEIGHT**2))


@pytest.mark.parametrize("sampling", ["cosine", "slices"])
def test_a_wall_hides_its_form_factor_of_the_sky(sampling):
    got = render(corner(sky=Environment((1.0, 2.0, 4.0))), f"ssdo.sampling={sampling}")
    on_floor, form_factor = floor_and_form_factor(got)
    expected = (0.5 * (1 - form_factor))[..., None] * (1.0, 2.0, 4.0)
    off = (got["direct"] / expected)[on_floor] - 1
    assert on_floor.sum() > 200
    assert abs(off.mean()) <= 0.005 and np.abs(off).mean() <= 0.02


@pytest.mark.parametrize("sampling", ["cosine", "slices"])
def test_a_wall_reflects_by_its_form_factor(sampling):
    """A horizontal sun lights only the wall: L = rho / pi times the wall's radiosity times its form factor."""
    lux = 3.0
    got = render(corner([DirectionalLight((0, 0, -1), lux, (1.0, 0.5, 0.25))]), f"ssdo.sampling={sampling}")
    on_floor, form_factor = floor_and_form_factor(got)
    expected = (0.5 / math.pi * 0.8 * lux * form_factor)[..., None] * (1.0, 0.5, 0.25)
    assert not got["direct"][on_floor].any()
    off = (got["indirect"] / expected)[on_floor] - 1
    assert abs(off.mean()) <= 0.015 and np.abs(off).mean() <= 0.05


def test_slices_of_an_open_plane_see_all_of_the_sky():
    """Every slice has the same measure, so a single frame has no noise."""
    floor = quad((-LONG, 0, -LONG), (0, 0, 2 * LONG), (2 * LONG, 0, 0), matte(0.5))
    camera = Camera.look_at((0, 1.7, 4.5), (0, 0.9, 0))
    scene = Scene([Instance(floor)], [], Environment((1.0, 2.0, 4.0)), [camera])
    got = render(scene, "ssdo.sampling=slices", "ssdo.undecided=sky", "ssdo.steps=16", frames=1)
    shows = got["depth"] > 0
    assert shows.any()
    # The G-buffer stores albedo in 10 bits.
    assert np.allclose(got["direct"][shows], (0.5, 1.0, 2.0), rtol=2e-3)
    assert np.ptp(got["direct"][shows], axis=0).max() <= 1e-5
    assert not got["indirect"].any()


@pytest.mark.parametrize("undecided", ["rays", "sky"])
def test_slices_have_the_mean_of_directions(undecided):
    """A corner with a box, lit by a sun and a sky, in pictures of 48x36; taps miss the most beside edges."""
    scene = corner([DirectionalLight((0.3, -1, -0.8), 3.0)], Environment((1.0, 1.0, 1.0)))
    scene.instances.append(Instance(box((-0.6, 0, 0.6), (0.2, 1.0, 1.3), matte((0.8, 0.4, 0.2)))))
    slices, directions = (
        render(scene, f"ssdo.sampling={sampling}", f"ssdo.undecided={undecided}", "ssdo.cameras=0", size=(48, 36))
        for sampling in ("slices", "cosine")
    )
    for name in ("direct", "indirect"):
        assert slices[name].mean((0, 1)) == pytest.approx(directions[name].mean((0, 1)), rel=0.04)


@pytest.mark.parametrize("half", ["true", "false"])
def test_a_white_wall_reflects_as_much_as_it_hides(half):
    """With albedo 1, a wall reflects as much of the sky as it hides, up to second bounces."""
    got = render(corner(sky=Environment((1.0, 1.0, 1.0)), albedo=1.0, wall=1.0), f"ssdo.half_resolution={half}")
    on_floor, form_factor = floor_and_form_factor(got)
    total = (got["direct"] + got["indirect"])[on_floor]
    # The missing second bounce is at most half of the wall's light, of which the floor sees at most half.
    assert total.max() <= 1.01 and total.min() >= 0.75
    off = got["direct"][on_floor] / (1 - form_factor)[on_floor][:, None] - 1
    # At half resolution, the worst pixels lie beside the wall: 0.08 to 0.18, as its edge falls on the pixels.
    assert np.abs(off).max() <= (0.16 if half == "true" else 0.1) and abs(off.mean()) <= 0.02


@pytest.mark.parametrize("sampling", ["slices", "cosine", "environment"])
def test_shadows_lack_the_colour_of_the_hidden_light(sampling):
    """The sky is red behind the wall and blue behind the camera: near the wall, red is missing."""
    picture = np.zeros((32, 64, 3), np.float32)
    picture[:, :, 1] = 1.0
    # Columns of -Z are the outermost; +Z is in the middle.
    picture[:, 16:48, 2], picture[:, :16, 0], picture[:, 48:, 0] = 1.0, 1.0, 1.0
    got = render(corner(sky=Environment((1.0, 1.0, 1.0), picture)), "ssdo.directions=8", f"ssdo.sampling={sampling}")
    on_floor, form_factor = floor_and_form_factor(got)
    near = on_floor & (got["position"][..., 2] < 1.0)
    red, green, blue = got["direct"][near].mean(0)
    # All that the wall hides is red.
    hidden = 0.5 * form_factor[near].mean()
    assert blue == pytest.approx(0.25, rel=0.03)
    assert red == pytest.approx(0.25 - hidden, abs=0.02)
    assert green == pytest.approx(0.5 - hidden, rel=0.03)
    grey = render(corner(sky=Environment((1.0, 1.0, 1.0), picture)), gi="ssao")
    grey_red, _, grey_blue = grey["direct"][near].mean(0)
    assert grey_red == pytest.approx(grey_blue, rel=0.01)


def test_senders_reflect_from_their_front_only():
    """A board lit from behind casts a shadow on the floor in front, and reflects no light to it."""
    board = quad((-1, 0.2, 1.0), (2, 0, 0), (0, 0.6, 0.0), matte(0.8, double_sided=True))
    floor = quad((-4, 0, -4), (0, 0, 8), (8, 0, 0), matte(0.5))
    camera = Camera.look_at((0, 2.2, 4.0), (0, 0.3, 1.0))
    scene = Scene([Instance(board), Instance(floor)], [DirectionalLight((0, 0, 1), 3.0)], None, [camera])
    got = render(scene, "ssdo.undecided=sky", frames=4)
    before = (got["depth"] > 0) & (np.abs(got["position"][..., 1]) < 1e-3) & (got["position"][..., 2] > 1.0)
    assert before.any() and not got["indirect"][before].any()


def glossy_corner(metallic, roughness, wide):
    """Build `corner` with a floor of a coated material; a `wide` lens sees all of the wall that the floor reflects."""
    scene = corner([DirectionalLight((0, 0, -1), 3.0, (1.0, 0.5, 0.25))])
    scene.instances[0].mesh.materials[0] = Material("", (0.9, 0.6, 0.3, 1.0), metallic, roughness)
    scene.cameras[0].yfov = math.radians(wide)
    return scene


@pytest.mark.parametrize(
    ("metallic", "roughness", "texts"),
    [(1.0, 0.1, ()), (1.0, 0.4, ("ssdo.half_resolution=true",)), (0.0, 0.3, ()), (1.0, 1.0, ())],
)
def test_coats_reflect_what_the_path_tracer_reflects(metallic, roughness, texts):
    scene = glossy_corner(metallic, roughness, 75)
    got = render(scene, *texts, "ssdo.blur=false", diffuse=False, size=(32, 24), frames=32)
    settings = Settings(gi="path", bounces=1, spp=128, camera=CameraSettings(jitter=False))
    truth = Renderer(scene, size=(32, 24), settings=settings)
    truth.run()
    # Pixels next to the wall are too coarse for matte floors, too.
    away = floor_and_form_factor(got)[0] & (got["position"][..., 2] > 0.8)
    off = got["indirect"][away].mean(0) / truth.read_back("indirect")[away].mean(0) - 1
    assert away.sum() > 100
    assert np.abs(off).max() <= 0.03


@pytest.mark.parametrize(
    ("metallic", "roughness", "pictured"),
    [
        (1.0, 0.2, False),
        pytest.param(0.0, 0.4, True, marks=pytest.mark.slow),
        (1.0, 0.8, True),
        pytest.param(1.0, 0.8, False, marks=pytest.mark.slow),
    ],
)
def test_coats_see_the_sky_past_a_wall(metallic, roughness, pictured):
    """The sky that a coated floor reflects before a dark wall, which hides the mirror direction of most pixels."""
    rows = np.linspace(2.0, 0.5, 16, dtype=np.float32)[:, None, None] * np.float32([1.0, 0.7, 0.4])
    picture = np.broadcast_to(rows, (16, 32, 3)).copy() if pictured else None
    scene = corner(sky=Environment((1.0, 1.0, 1.0), picture), wall=0.0)
    scene.instances[0].mesh.materials[0] = Material("", (0.9, 0.6, 0.3, 1.0), metallic, roughness)
    scene.cameras[0].yfov = math.radians(75)
    # The blur would smear the wall's edge over the few rows of pixels.
    texts = ("ssdo.blur=false", "ssdo.bounce=false", "ssdo.directions=16")
    got = render(scene, *texts, diffuse=False, size=(32, 24), frames=16)
    settings = Settings(gi="path", bounces=0, spp=256, camera=CameraSettings(jitter=False))
    truth = Renderer(scene, size=(32, 24), settings=settings)
    truth.run()
    on_floor = floor_and_form_factor(got)[0]
    off = got["direct"][on_floor].mean(0) / truth.read_back("direct")[on_floor].mean(0) - 1
    assert on_floor.sum() > 50 and np.abs(off).max() <= 0.03
