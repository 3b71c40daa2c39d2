"""SSDO against references by Mitsuba 3 (`wgpu_gi.measure.references`) and by our path tracer."""

from __future__ import annotations

from functools import cache

import pytest
from helpers.marks import slow_but
from helpers.skies import gradient_sky

from wgpu_gi.camera import Camera
from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.measure.references import SIZE, layers_of, scene_of
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, grid, quad
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, PointLight, Scene
from wgpu_gi.settings import apply_quality, assign

# Bounds of bias and relMSE of direct light, of the bounce and of both: just above the measured values.
BOUNDS = {
    "cornell_point": [(0.001, 0.0005), (0.02, 0.075), (0.005, 0.019)],
    "courtyard_sky": [(0.003, 0.0045), (0.02, 0.012), (0.005, 0.0022)],
}
SMALL = (64, 36)
BY_CAMERAS = "ssdo.undecided=cameras"  # the system of the paper


def render(scene, *texts, size=SMALL, gi="ssdo", frames=16, quality="medium"):
    settings = Settings(gi=gi, diffuse=True, bounces=1, spp=256)
    apply_quality(settings, quality)
    settings.camera.jitter, settings.camera.frames = False, frames
    for text in texts:
        assign(settings, text)
    renderer = Renderer(scene, size=size, settings=settings)
    renderer.run(show=("direct", "indirect", "depth"), check=gi == "ssdo")
    return {name: renderer.read_back(name) for name in ("direct", "indirect", "depth")}


def full(layers):
    return layers["direct"] + layers["indirect"]


@pytest.mark.parametrize("name", BOUNDS)
def test_one_bounce_agrees_with_mitsuba(name):
    """At the defaults, with light from surfaces outside the picture."""
    got, truth = render(scene_of(name), size=SIZE), layers_of(name)
    pairs = [
        (got["direct"], truth["direct"]),
        (got["indirect"], truth["one"]),
        (full(got), truth["direct"] + truth["one"]),
    ]
    for (picture, expected), (most_bias, most_error) in zip(pairs, BOUNDS[name], strict=True):
        assert abs(bias(picture, expected)) <= most_bias
        assert relmse(picture, expected) <= most_error


def test_a_camera_above_a_closed_room_loses_no_light():
    """It sees the far side of the ceiling; near sides, which other cameras see, must take precedence."""
    truth = layers_of("cornell_point")["one"]
    inside, over = (
        render(scene_of("cornell_point"), BY_CAMERAS, f"ssdo.cameras={count}", size=SIZE)["indirect"]
        for count in (1, 3)
    )
    assert relmse(over, truth) <= 1.1 * relmse(inside, truth)
    assert bias(over, truth) >= bias(inside, truth) - 0.03


@pytest.mark.parametrize("quality", ["medium", "high"])
def test_walls_do_not_leak_where_a_camera_sees_behind_them(quality):
    """A spot lights a wall seen at a grazing angle; the camera above sees behind it."""
    layers = layers_of("cornell_spot")
    truth = layers["direct"] + layers["one"]
    inside, over = (
        relmse(full(render(scene_of("cornell_spot"), BY_CAMERAS, texts, size=SIZE, frames=8, quality=quality)), truth)
        for texts in ("ssdo.cameras=1", "ssdo.cameras=3")
    )
    assert over <= 1.15 * inside, (over, inside)


@pytest.mark.parametrize("count", [2, 4])
def test_walls_do_not_leak_where_layers_show_what_is_behind(count):
    """Layers show bright rooms behind the walls of a corridor. relMSE by layers: 1: 0.26, 2: 0.19, 4: 0.31."""
    layers = layers_of("leak_corridor_a")
    truth = layers["direct"] + layers["one"]
    before, behind = (
        relmse(full(render(scene_of("leak_corridor_a"), BY_CAMERAS, f"ssdo.layers={k}", size=SIZE, frames=8)), truth)
        for k in (1, count)
    )
    assert behind <= 1.25 * before, (behind, before)


def test_a_closed_room_in_the_sun_stays_dark():
    """The camera above sees all that is outside, but next to nothing of the sky, radiance 1, gets in."""
    walls = [
        quad((-2, 0, -5), (0, 0, 10), (0, 3, 0), matte(0.7)),
        quad((2, 0, -5), (0, 0, 10), (0, 3, 0), matte(0.7)),
        quad((-2, 0, -5), (4, 0, 0), (0, 3, 0), matte(0.7)),
        quad((-2, 0, 5), (4, 0, 0), (0, 3, 0), matte(0.7)),
        quad((-2, 3, -5), (4, 0, 0), (0, 0, 10), matte(0.7)),
        quad((-9, 0, -9), (0, 0, 18), (18, 0, 0), matte(0.7)),
    ]
    camera = Camera.look_at((0.3, 1.5, 4.5), (0, 1.4, -4))
    sun = DirectionalLight((0.4, -1.0, 0.2), 30.0)
    scene = Scene([Instance(wall) for wall in walls], [sun], Environment((1.0, 1.0, 1.0)), [camera])
    assert render(scene, size=(96, 54), frames=4)["direct"].mean() <= 1e-4


def sky_lit(lamp=0.0):
    scene = builtin.courtyard()
    scene.environment = Environment((0.3, 0.3, 0.3), gradient_sky(32, 8.0))
    scene.lights = [PointLight((-2.0, 3.0, -1.0), lamp, (1.0, 0.7, 0.4))] if lamp else []
    return scene


@cache
def truth_of(lamp):
    return render(sky_lit(lamp), gi="path")


@pytest.mark.parametrize(
    ("lamp", "most"), [(0.0, 0.045), (3.0, 0.05), pytest.param(40.0, 0.11, marks=pytest.mark.slow)]
)
def test_less_error_than_ambient_light_and_ambient_occlusion(lamp, most):
    """Under a sky alone, with a weak and with a strong lamp: relMSE as a share of that of unoccluded ambient light."""
    truth = full(truth_of(lamp))
    errors = {
        label: relmse(full(render(sky_lit(lamp), *texts, gi=gi)), truth)
        for label, gi, texts in (
            ("ssdo", "ssdo", ()),
            ("ssao", "ssao", ()),
            ("none", "none", ()),
        )
    }
    assert errors["ssdo"] <= most * errors["none"], errors
    assert errors["ssdo"] < errors["ssao"], errors


def test_environment_sampling_finds_a_small_sun():
    scene = Scene(
        [Instance(grid(8.0, material=matte(0.5))), Instance(box((-0.2, 0, -0.2), (0.2, 0.8, 0.2), matte(0.5)))],
        [],
        Environment((0.5, 0.5, 0.5), gradient_sky(64, 2e4)),
        [Camera.look_at((0.5, 1.4, 2.4), (0, 0.2, 0))],
    )
    truth = render(scene, gi="path")["direct"]
    by_cosine, by_environment = (
        relmse(render(scene, f"ssdo.sampling={name}", "ssdo.half_resolution=false")["direct"], truth)
        for name in ("cosine", "environment")
    )
    assert by_environment <= 0.5 * by_cosine, (by_environment, by_cosine)


def thin_board():
    """Build a thin board before an open floor: with one layer, all behind it counts as solid."""
    board = box((-0.9, 0.25, 0.95), (0.9, 1.0, 1.0), matte(0.5))
    floor = grid(8.0, material=matte(0.5))
    camera = Camera.look_at((0, 0.9, 3.2), (0, 0.4, 0))
    return Scene([Instance(floor), Instance(board)], [], Environment((1.0, 1.0, 1.0)), [camera])


def wall_beside():
    """Build a high wall just outside the picture of a floor."""
    wall = box((-1.9, 0, -6), (-1.7, 4, 4), matte((0.9, 0.3, 0.2)))
    floor = grid(16.0, material=matte(0.5))
    camera = Camera.look_at((0, 2.0, 0.5), (0, 0, 0))
    return Scene([Instance(floor), Instance(wall)], [], Environment((1.0, 1.0, 1.0)), [camera])


def roof_above():
    """Build a floor under a roof that is too high even for the wide lens."""
    roof = box((-3, 6.0, -3), (3, 6.2, 3), matte(0.5))
    camera = Camera.look_at((0, 1.0, 2.0), (0, 0, 0))
    return Scene([Instance(grid(16.0, material=matte(0.5))), Instance(roof)], [], Environment((1.0,) * 3), [camera])


@pytest.mark.parametrize(
    ("scene", "base", "better"),
    [
        (thin_board, ("ssdo.cameras=0",), ("ssdo.cameras=0", "ssdo.layers=2")),
        (wall_beside, ("ssdo.cameras=0",), ("ssdo.cameras=1",)),
        (roof_above, ("ssdo.cameras=1",), ()),
    ],
)
def test_layers_and_cameras_find_missing_occluders(scene, base, better):
    truth = full(render(scene(), gi="path"))
    before, after = (
        relmse(full(render(scene(), BY_CAMERAS, *texts, "ssdo.half_resolution=false")), truth)
        for texts in (base, better)
    )
    assert after <= 0.7 * before, (before, after)


@pytest.mark.parametrize("scene", [thin_board, wall_beside, roof_above])
def test_rays_decide_what_no_picture_shows(scene):
    """At most 1 % of the error of the picture alone, and the mean of the truth."""
    truth = full(render(scene(), gi="path"))
    by_rays, alone = (
        full(render(scene(), f"ssdo.undecided={undecided}", "ssdo.half_resolution=false"))
        for undecided in ("rays", "sky")
    )
    assert relmse(by_rays, truth) <= 0.01 * relmse(alone, truth)
    assert abs(bias(by_rays, truth)) <= 0.005


@pytest.mark.slow
def test_direct_light_converges_with_more_samples():
    """A box on a floor under a sky, r_max the scene's size, four layers and two cameras (section 7.2 of the paper)."""
    block = box((-0.5, 0, -0.4), (0.3, 0.8, 0.4), matte((0.8, 0.4, 0.2)))
    camera = Camera.look_at((0.4, 1.6, 2.6), (0, 0.3, 0))
    sky = Environment((1.0, 1.0, 1.0))
    scene = Scene([Instance(grid(4.0, material=matte(0.5))), Instance(block)], [], sky, [camera])
    truth = render(scene, gi="path")
    texts = (
        BY_CAMERAS,
        "ssdo.layers=4",
        "ssdo.cameras=2",
        "ssdo.radius=100",
        "ssdo.half_resolution=false",
        "ssdo.blur=false",
    )
    few = render(scene, *texts, "ssdo.directions=1", "ssdo.steps=8", frames=16)
    many = render(scene, *texts, "ssdo.directions=16", "ssdo.steps=64", frames=64)
    errors = [relmse(got["direct"], truth["direct"]) for got in (few, many)]
    # The remaining error comes from the size of pixels, mostly of the further cameras.
    assert errors[1] <= 0.5 * errors[0] and errors[1] <= 0.0015, errors
    assert abs(bias(many["direct"], truth["direct"])) <= 0.03


@pytest.mark.parametrize("bounces", [1, None])
@pytest.mark.parametrize("name", slow_but(("cornell_point",), ["cornell_area", "cornell_point", "cornell_spot"]))
def test_the_near_field_and_vpls_add_up(name, bounces):
    """Many-light with a near field: no light counts twice, and none is lost."""
    truth = layers_of(name)
    expected = truth["one"] if bounces == 1 else truth["one"] + truth["multi"]
    got = near_field(name, bounces, "ssdo.near_field=true")
    assert abs(bias(got, expected)) <= (0.01 if bounces == 1 else 0.03)
    assert relmse(got, expected) <= 0.012


def test_a_wide_near_field_loses_no_light():
    expected = layers_of("cornell_point")["one"]
    wide = near_field("cornell_point", 1, "ssdo.near_field=true", "ssdo.near_field_radius=0.3")
    assert abs(bias(wide, expected)) <= 0.01


def near_field(name, bounces, *texts):
    settings = Settings(gi="many-light", diffuse=True, bounces=bounces)
    settings.camera.jitter = False
    for text in texts:
        assign(settings, text)
    renderer = Renderer(scene_of(name), size=SIZE, settings=settings)
    renderer.run(show=("indirect",), check=True)
    return renderer.read_back("indirect")
