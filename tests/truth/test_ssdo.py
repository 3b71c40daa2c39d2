"""Light in screen space against references by Mitsuba 3 (`helpers/references.py`) and by our path tracer."""

from __future__ import annotations

from functools import cache

import pytest
from helpers.marks import slow_but
from helpers.references import SIZE, layers_of, scene_of
from helpers.skies import gradient_sky

from wgpu_gi.camera import Camera
from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, grid, quad
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, PointLight, Scene
from wgpu_gi.settings import apply_quality, assign

# The most bias and relMSE of direct light, of the bounce and of both: what was measured, and little more.
BOUNDS = {
    "cornell_point": [(0.001, 0.0005), (0.245, 0.085), (0.06, 0.02)],
    "courtyard_sky": [(0.005, 0.008), (0.08, 0.035), (0.015, 0.007)],
}
SMALL = (64, 36)


def drawn(scene, *texts, size=SMALL, gi="ssdo", frames=16, quality="medium"):
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
def test_one_bounce(name):
    """At the defaults; what is missing of the bounce comes from surfaces that are in no picture."""
    got, truth = drawn(scene_of(name), size=SIZE), layers_of(name)
    pairs = [
        (got["direct"], truth["direct"]),
        (got["indirect"], truth["one"]),
        (full(got), truth["direct"] + truth["one"]),
    ]
    for (picture, expected), (most_bias, most_error) in zip(pairs, BOUNDS[name], strict=True):
        assert abs(bias(picture, expected)) <= most_bias
        assert relmse(picture, expected) <= most_error


def test_a_camera_over_a_closed_room_takes_no_light():
    """What it shows are the far sides of ceilings; near sides, which other cameras show, come first."""
    truth = layers_of("cornell_point")["one"]
    inside, over = (
        drawn(scene_of("cornell_point"), f"ssdo.cameras={count}", size=SIZE)["indirect"] for count in (1, 3)
    )
    assert relmse(over, truth) <= 1.1 * relmse(inside, truth)
    assert bias(over, truth) >= bias(inside, truth) - 0.03


@pytest.mark.parametrize("quality", ["medium", "high"])
def test_walls_that_another_camera_looks_behind_let_no_light_through(quality):
    """A spot lights a wall that is seen at a grazing angle; the camera above looks behind it."""
    layers = layers_of("cornell_spot")
    truth = layers["direct"] + layers["one"]
    inside, over = (
        relmse(full(drawn(scene_of("cornell_spot"), f"ssdo.cameras={k}", size=SIZE, frames=8, quality=quality)), truth)
        for k in (1, 3)
    )
    assert over <= 1.15 * inside, (over, inside)


@pytest.mark.parametrize("count", [2, 4])
def test_walls_that_layers_look_behind_let_no_light_through(count):
    """Behind the walls of a corridor layers show bright rooms: 0.26 with one layer, 0.19 with two, 0.31 with four."""
    layers = layers_of("leak_corridor_a")
    truth = layers["direct"] + layers["one"]
    before, behind = (
        relmse(full(drawn(scene_of("leak_corridor_a"), f"ssdo.layers={k}", size=SIZE, frames=8)), truth)
        for k in (1, count)
    )
    assert behind <= 1.25 * before, (behind, before)


def test_a_closed_room_in_the_sun_stays_dark():
    """Of the sky, whose radiance is 1, next to nothing gets in, though the camera above sees all that is outside."""
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
    assert drawn(scene, size=(96, 54), frames=4)["direct"].mean() <= 0.003


def sky_lit(lamp=0.0):
    scene = builtin.courtyard()
    scene.environment = Environment((0.3, 0.3, 0.3), gradient_sky(32, 8.0))
    scene.lights = [PointLight((-2.0, 3.0, -1.0), lamp, (1.0, 0.7, 0.4))] if lamp else []
    return scene


@cache
def truth_of(lamp):
    return drawn(sky_lit(lamp), gi="path")


@pytest.mark.parametrize(
    ("lamp", "most"), [(0.0, 0.06), (3.0, 0.065), pytest.param(40.0, 0.14, marks=pytest.mark.slow)]
)
def test_better_than_ambient_light_and_ambient_occlusion(lamp, most):
    """Under a sky, and under one with a weak and a strong lamp: a part of the error of ambient light, not occluded."""
    truth = full(truth_of(lamp))
    errors = {
        label: relmse(full(drawn(sky_lit(lamp), *texts, gi=gi)), truth)
        for label, gi, texts in (
            ("ssdo", "ssdo", ()),
            ("ssao", "ssao", ()),
            ("none", "none", ()),
        )
    }
    assert errors["ssdo"] <= most * errors["none"], errors
    assert errors["ssdo"] < errors["ssao"], errors


def test_directions_by_the_picture_find_a_small_sun():
    scene = Scene(
        [Instance(grid(8.0, material=matte(0.5))), Instance(box((-0.2, 0, -0.2), (0.2, 0.8, 0.2), matte(0.5)))],
        [],
        Environment((0.5, 0.5, 0.5), gradient_sky(64, 2e4)),
        [Camera.look_at((0.5, 1.4, 2.4), (0, 0.2, 0))],
    )
    truth = drawn(scene, gi="path")["direct"]
    by_cosine, by_picture = (
        relmse(drawn(scene, f"ssdo.sampling={name}", "ssdo.half_resolution=false")["direct"], truth)
        for name in ("cosine", "environment")
    )
    assert by_picture <= 0.5 * by_cosine, (by_picture, by_cosine)


def thin_board():
    """Build a board before an open floor: one layer takes all that is behind it for matter."""
    board = box((-0.9, 0.25, 0.95), (0.9, 1.0, 1.0), matte(0.5))
    floor = grid(8.0, material=matte(0.5))
    camera = Camera.look_at((0, 0.9, 3.2), (0, 0.4, 0))
    return Scene([Instance(floor), Instance(board)], [], Environment((1.0, 1.0, 1.0)), [camera])


def wall_beside():
    """Build a high wall that stands just beside the picture of a floor."""
    wall = box((-1.9, 0, -6), (-1.7, 4, 4), matte((0.9, 0.3, 0.2)))
    floor = grid(16.0, material=matte(0.5))
    camera = Camera.look_at((0, 2.0, 0.5), (0, 0, 0))
    return Scene([Instance(floor), Instance(wall)], [], Environment((1.0, 1.0, 1.0)), [camera])


def roof_above():
    """Build a floor under a roof that is higher than even a wide lens sees."""
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
def test_layers_and_cameras_show_what_is_missed(scene, base, better):
    truth = full(drawn(scene(), gi="path"))
    before, after = (
        relmse(full(drawn(scene(), *texts, "ssdo.half_resolution=false")), truth) for texts in (base, better)
    )
    assert after <= 0.7 * before, (before, after)


@pytest.mark.slow
def test_correct_as_samples_grow():
    """A box on a floor under a sky, r_max the scene's size, four layers and two cameras (section 7.2 of the paper)."""
    block = box((-0.5, 0, -0.4), (0.3, 0.8, 0.4), matte((0.8, 0.4, 0.2)))
    camera = Camera.look_at((0.4, 1.6, 2.6), (0, 0.3, 0))
    sky = Environment((1.0, 1.0, 1.0))
    scene = Scene([Instance(grid(4.0, material=matte(0.5))), Instance(block)], [], sky, [camera])
    truth = drawn(scene, gi="path")
    texts = ("ssdo.layers=4", "ssdo.cameras=2", "ssdo.radius=100", "ssdo.half_resolution=false", "ssdo.blur=false")
    few = drawn(scene, *texts, "ssdo.directions=1", "ssdo.steps=8", frames=16)
    many = drawn(scene, *texts, "ssdo.directions=16", "ssdo.steps=64", frames=64)
    errors = [relmse(got["direct"], truth["direct"]) for got in (few, many)]
    # What is left are pixels: those of the picture, and larger ones of the further cameras.
    assert errors[1] <= 0.5 * errors[0] and errors[1] <= 0.0015, errors
    assert abs(bias(many["direct"], truth["direct"])) <= 0.03


@pytest.mark.parametrize("bounces", [1, None])
@pytest.mark.parametrize("name", slow_but(("cornell_point",), ["cornell_area", "cornell_point", "cornell_spot"]))
def test_near_and_far_light_are_all_light(name, bounces):
    """Many-light with what is near by the picture instead: nothing counts twice, and nothing is lost."""
    truth = layers_of(name)
    expected = truth["one"] if bounces == 1 else truth["one"] + truth["multi"]
    got = near_by(name, bounces, "ssdo.near_field=true")
    assert abs(bias(got, expected)) <= (0.01 if bounces == 1 else 0.03)
    assert relmse(got, expected) <= 0.012


def test_a_wide_near_field_takes_more_of_the_light_and_loses_none():
    expected = layers_of("cornell_point")["one"]
    assert (
        abs(bias(near_by("cornell_point", 1, "ssdo.near_field=true", "ssdo.near_field_radius=0.3"), expected)) <= 0.02
    )
    # What the near field finds is left out: of the lights within reach whose surfaces the picture shows.
    bound = "gather.compensation=true"
    assert abs(bias(near_by("cornell_point", 1, "ssdo.near_field=true", bound), expected)) <= 0.01


def near_by(name, bounces, *texts):
    settings = Settings(gi="many-light", diffuse=True, bounces=bounces)
    settings.camera.jitter = False
    for text in texts:
        assign(settings, text)
    renderer = Renderer(scene_of(name), size=SIZE, settings=settings)
    renderer.run(show=("indirect",), check=True)
    return renderer.read_back("indirect")
