"""Invariances of every technique in TECHNIQUES, without a reference.

Layers that do not depend on the seed are compared pixel by pixel; noisy ones by their means, within the noise between
two seeds.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.marks import slow_but
from helpers.pictures import moved, translation
from helpers.skies import gradient_sky
from helpers.techniques import (
    LAYERS,
    SCENES,
    SIGMAS,
    assert_same,
    ball_on_a_floor,
    brighten,
    is_noisy,
    make_settings,
    noise_of,
    picture,
    read_all,
    reference,
    scaled,
    sigma_of,
    swap_channels,
    thousand_lights,
)

from wgpu_gi.camera import Camera
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, grid, mesh
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, PointLight, Scene, SpotLight
from wgpu_gi.techniques.deferred.shadow_views import ShadowSettings

QUICK = ("path", "none")  # the other techniques take minutes together
pytestmark = pytest.mark.parametrize("technique", slow_but(QUICK, TECHNIQUES))

# ------------------------------------------------------------------------------------------------ Scale and place


@pytest.mark.parametrize("factor", [1e-3, 1e3, 1024.0])
@pytest.mark.parametrize("name", SCENES)
def test_scale_does_not_matter(technique, name, factor):
    """A scene s times as large with intensities s2 times as high looks the same; powers of two change no digits."""
    expected, noise = reference(technique, name)
    got = picture(technique, scaled(SCENES[name](), factor))
    if factor == 1024.0:
        assert all(np.array_equal(got[layer], expected[layer]) for layer in LAYERS)
    else:
        assert_same(got, expected, noise)


@pytest.mark.parametrize("name", SCENES)
def test_translation_does_not_matter(technique, name):
    """A scene thousands of kilometres away looks the same."""
    expected, noise = reference(technique, name)
    got = picture(technique, moved(SCENES[name](), translation(1e6 + 1 / 3, -2e6, 3e6 + 0.1)))
    assert_same(got, expected, noise)


# ------------------------------------------------------------------------------------------------ Light is linear


@pytest.mark.parametrize("name", SCENES)
def test_twice_the_light_is_exactly_twice_the_picture(technique, name):
    """Bit for bit: powers of two change no digits."""
    once, _ = reference(technique, name)
    twice = picture(technique, brighten(SCENES[name](), 2.0))
    for layer in LAYERS:
        assert np.array_equal(2 * once[layer], twice[layer]), layer
    assert once["depth"].any()


@pytest.mark.parametrize("factor", [1e-6, 2.0**-20, 2.0**27, 1e8])
@pytest.mark.parametrize("name", ["cornell", "courtyard", "medley"])
def test_very_dim_and_very_bright_light_scale_the_picture(technique, name, factor):
    """A millionth and a hundred million times the light; powers of two near that scale the picture bit for bit."""
    (once, noise), got = reference(technique, name), picture(technique, brighten(SCENES[name](), factor))
    expected = {layer: factor * once[layer] for layer in LAYERS}
    if math.frexp(factor)[0] == 0.5:
        assert all(np.array_equal(expected[layer], got[layer]) for layer in LAYERS)
    else:
        assert_same(got, expected, {layer: factor * noise[layer] for layer in LAYERS})


def test_lights_add_up(technique):
    """Each light alone and all of them together, of every kind; an emitter's samples do not depend on other lights."""
    lights = [
        PointLight((1.0, 1.0, 1.0), 0.5, (1.0, 0.5, 0.2)),
        DirectionalLight((0.3, -1.0, 0.2), 0.5),
        SpotLight((-1.0, 2.0, 1.0), (0.5, -1.0, -0.5), 0.2, 0.5, 3.0),
    ]
    sky = Environment((0.2, 0.2, 0.2), gradient_sky(16, 20.0))
    parts = [*({"lights": [light]} for light in lights), {"emission": 20.0}, {"environment": sky}]
    together = {"lights": lights, "emission": 20.0, "environment": sky}
    whole = picture(technique, ball_on_a_floor(**together))
    alone = [picture(technique, ball_on_a_floor(**part)) for part in parts]
    sums = {layer: sum(p[layer] for p in alone) for layer in LAYERS}
    # Each part is at most as noisy as the whole.
    noise = noise_of(technique, whole, ball_on_a_floor(**together))
    noise = {layer: noise[layer] * math.sqrt(1 + len(parts)) for layer in LAYERS}
    assert_same(whole, sums, noise)


def test_layers_add_up(technique):
    for name in SCENES:
        layers, _ = reference(technique, name)
        total = layers["emission"] + layers["direct"] + layers["indirect"]
        assert np.allclose(total, layers["radiance"], rtol=1e-5)


@pytest.mark.parametrize("name", SCENES)
def test_swapped_channels_give_a_swapped_picture(technique, name):
    """Emitters share samples by luminance, so the medley's emitters are made grey here.

    Noise is not swapped with the channels, so the noise of both pictures counts.
    """
    scene, swapped = SCENES[name](), SCENES[name]()
    for material in scene.materials + swapped.materials if name == "medley" else ():
        material.emission, material.emission_texture = (material.emission[0],) * 3, None
    expected = picture(technique, scene)
    got = picture(technique, swap_channels(swapped))
    noises = noise_of(technique, expected, scene), noise_of(technique, got, swapped)
    back = {layer: np.roll(got[layer], 1, axis=-1) for layer in LAYERS}
    noise = {layer: np.concatenate([noises[0][layer], np.roll(noises[1][layer], 1, axis=-1)]) for layer in LAYERS}
    assert_same(back, expected, noise)


def test_a_thousand_lights_in_one_place_equal_one_bright_light(technique):
    """The light of one a thousand times as bright, although their shadow maps are small."""
    place, color = (1.0, 1.5, 1.0), (1.0, 0.6, 0.3)
    scene = ball_on_a_floor([PointLight(place, 2.0, color)])
    show = {"shadow": ShadowSettings()}
    expected = picture(technique, scene, **show)
    got = picture(technique, ball_on_a_floor([PointLight(place, 0.002, color) for _ in range(1000)]), **show)
    assert_same(got, expected, noise_of(technique, expected, scene, **show))


@pytest.mark.slow
@pytest.mark.parametrize("kind", [PointLight, SpotLight])
def test_a_thousand_lights_add_up(technique, kind):
    """Ten pictures of a hundred lights each are the picture of all thousand."""
    lights = thousand_lights(kind)
    size = (16, 12)
    shown = [picture(technique, ball_on_a_floor(lights[k::10]), size) for k in range(10)]
    expected = {layer: sum(p[layer] for p in shown) for layer in LAYERS}
    scene = ball_on_a_floor(lights)
    got = picture(technique, scene, size)
    assert_same(got, expected, noise_of(technique, got, scene, size))


# ------------------------------------------------------------------------------------------------ Albedo


@pytest.mark.parametrize("albedo", [0.0, 1.0])
def test_black_and_white_surfaces_have_their_closed_forms(technique, albedo):
    """Convex scenes, without interreflection: a ball in a sky, a floor under a sun, a floor under a lamp."""
    lux, height, intensity = 3.0, 2.0, 10.0
    show = {"diffuse": True, "size": (9, 9), "spp": 64}
    ball = picture(technique, builtin.furnace(albedo=albedo), **show)
    floor = picture(technique, builtin.plane_sun(lux, 60.0, albedo), **show)
    lamp = picture(technique, builtin.plane_point(height, intensity, albedo), **show)
    on_ball = ball["depth"] > 0
    assert ball["radiance"][on_ball].mean() == pytest.approx(albedo, rel=0.01)
    assert np.allclose(ball["radiance"][~on_ball], 1.0)
    assert np.allclose(floor["radiance"], albedo * lux * 0.5 / math.pi, rtol=1e-3)
    x, z = lamp["position"][..., 0], lamp["position"][..., 2]
    assert np.allclose(
        lamp["radiance"],
        (albedo * intensity * height / (math.pi * (height**2 + x**2 + z**2) ** 1.5))[..., None],
        rtol=1e-3,
    )


def test_black_surfaces_scatter_nothing(technique):
    for name in ("cornell", "courtyard", "medley"):
        scene = SCENES[name]()
        for material in scene.materials:
            material.base_color = (0.0, 0.0, 0.0, material.base_color[3])
        got = picture(technique, scene, diffuse=True)
        assert not got["direct"].any() and not got["indirect"].any()
        assert np.array_equal(got["radiance"], got["emission"])


# ------------------------------------------------------------------------------------------------ Cameras


def test_pictures_of_odd_sizes_share_their_middle_pixel(technique):
    """The ray through the middle of the picture is the same whatever the size, here to the middle of a wall."""
    camera = Camera.look_at((2.78, 2.73, -2.6), (2.0, 4.6, 5.592))
    middles = []
    for size in ((17, 13), (1, 1), (641, 359)):
        got = picture(technique, SCENES["cornell-point"](), size, camera=camera, spp=1)
        middles.append({name: got[name][size[1] // 2, size[0] // 2] for name in got})
    for middle in middles[1:]:
        for name in ("albedo", "normal", "depth", "emission"):
            assert np.allclose(middle[name], middles[0][name], rtol=1e-4, atol=1e-5), name
        if not is_noisy(technique):
            assert np.allclose(middle["radiance"], middles[0]["radiance"], rtol=1e-3) and middle["radiance"].all()


def test_a_picture_of_few_columns_is_lit(technique):
    got = picture(technique, SCENES["medley"](), (3, 2000), spp=1)
    assert got["radiance"].shape == (2000, 3, 3) and got["direct"].any()


@pytest.mark.parametrize("name", ["cornell-point", "courtyard", "plane-point"])
def test_close_camera_equals_a_farther_one_with_a_longer_lens(technique, name):
    """The same patch from 1e-4 m, and from 1e-2 m with a hundredth of the field of view."""
    seen = picture(technique, SCENES[name](), spp=1)
    hits = np.argwhere(seen["direct"].max(-1) > 0)
    for row, column in hits[:: max(len(hits) // 4, 1)]:
        at, normal = seen["position"][row, column], seen["normal"][row, column]
        shown = []
        for distance in (1e-2, 1e-4):
            up = (0, 0, -1) if abs(normal[1]) > 0.5 else (0, 1, 0)
            camera = Camera.look_at(at + normal * distance, at, up)
            camera.yfov = 2 * math.atan(0.5e-4 / distance)
            arguments = {"size": (5, 5), "camera": camera, "diffuse": True, "spp": 64}
            shown.append(picture(technique, SCENES[name](), **arguments))
            assert np.allclose(shown[-1]["depth"], distance, rtol=0.2)
        assert_same(
            shown[1], shown[0], noise_of(technique, shown[0], SCENES[name](), **arguments), mean=0.01, pixel=0.01
        )


@pytest.mark.parametrize("name", ["cornell", "cornell-point", "courtyard"])
def test_far_telephoto_camera_equals_a_parallel_projection(technique, name):
    """From 10 to 1e5 scene radii away.

    At 1e5 radii, float32 distances have steps of centimetres in a scene of metres, which is visible beside a light.
    """
    scene = SCENES[name]()
    radius = float(np.linalg.norm(np.diff(scene.bounds(), axis=0))) / 2
    centre, pose = scene.bounds().mean(0), scene.cameras[0].world_from_view

    def seen_from(distance, height=None):
        matrix = pose.copy()
        matrix[:3, 3] = centre + pose[:3, 2] * distance * radius
        camera = Camera(matrix, 2 * math.atan(0.5 / distance), height)
        return picture(technique, scene, camera=camera), camera

    expected, camera = seen_from(10.0, radius)
    noise = noise_of(technique, expected, scene, camera=camera)
    for distance, height, mean, pixel in (
        (1e3, None, 0.01, 0.02),
        (1e4, None, 0.01, 0.02),
        (1e5, None, 0.02, 0.15),
        (1e5, radius, 0.02, 0.15),
    ):
        assert_same(seen_from(distance, height)[0], expected, noise, mean=mean, pixel=pixel)


@pytest.mark.parametrize("size", [1e3, 1e4, 1e5])
def test_a_floor_to_the_horizon_does_not_change_the_foreground(technique, size):
    """A floor of 1 to 100 km under a small box gives the picture of a floor of 100 m."""

    def scene(width):
        block = box((-0.3, 0, -0.3), (0.3, 0.6, 0.3), matte((0.8, 0.4, 0.2)))
        lights = [PointLight((1.0, 2.0, 1.0), 10.0), DirectionalLight((0.2, -1.0, 0.1), 2.0)]
        camera = Camera.look_at((0.4, 0.9, 0.6), (0, 0.2, 0))
        return Scene([Instance(grid(width, material=matte(0.5))), Instance(block)], lights, cameras=[camera])

    expected = picture(technique, scene(100.0))
    noise = noise_of(technique, expected, scene(100.0))
    # Corners 5e4 m away round to 4 mm.
    assert_same(picture(technique, scene(size)), expected, noise, pixel=0.01, mean=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e2, 1e4])
def test_tessellation_does_not_change_the_picture(technique, size):
    """Above a giant triangle, a floor of a million triangles gives the picture of a floor of two."""

    def scene(cells):
        floor = grid(4.0, cells, matte(0.5))
        giant = mesh([(-size, -0.5, size), (size, -0.5, size), (0, -0.5, -size)], [(0, 1, 2)], matte((0.2, 0.4, 0.6)))
        ball = ball_on_a_floor().instances[1]
        lights = [PointLight((1.0, 1.5, 1.0), 5.0), DirectionalLight((0.4, -1.0, 0.2), 2.0)]
        camera = Camera.look_at((0, 2, 3), (0, 0.3, 0))
        return Scene([Instance(floor), Instance(giant), ball], lights, Environment((0.1, 0.1, 0.2)), [camera])

    assert scene(708).triangle_count > 1e6
    expected = picture(technique, scene(1))
    got = picture(technique, scene(708))
    assert_same(got, expected, noise_of(technique, expected, scene(1)))


@pytest.mark.parametrize("name", ["cornell", pytest.param("courtyard", marks=pytest.mark.slow)])
def test_half_the_size_has_the_same_mean(technique, name):
    """64 jittered frames resolve an edge to 1/64 pixel, and a lamp has 5 edge pixels."""
    fine, coarse = (picture(technique, SCENES[name](), size, frames=64) for size in ((32, 24), (16, 12)))
    noise = noise_of(technique, coarse, SCENES[name](), (16, 12), frames=64)
    for layer in LAYERS:
        off = np.abs(coarse[layer].mean((0, 1)) - fine[layer].mean((0, 1)))
        most = 0.02 * fine["radiance"].mean() + SIGMAS * sigma_of(noise[layer])
        if layer in ("radiance", "emission"):
            most = most + 5 / 64 * coarse["emission"].max((0, 1)) / (16 * 12)
        assert (off <= most).all(), (layer, off)


# ------------------------------------------------------------------------------------------------ Little to see


def test_cameras_that_face_away_see_only_the_sky(technique):
    """The picture equals that of an empty scene."""
    for sky in (None, Environment((0.5, 1.0, 2.0)), Environment((0.5, 1.0, 2.0), gradient_sky(16))):
        scene = SCENES["cornell"]()
        scene.environment = sky
        camera = Camera.look_at((2.78, 2.73, -2.6), (2.78, 2.73, -5.0))
        got = picture(technique, scene, camera=camera)
        assert not got["depth"].any() and not got["direct"].any() and not got["indirect"].any()
        assert np.array_equal(got["radiance"], got["emission"]) and got["radiance"].any() == (sky is not None)
        nowhere = picture(technique, Scene(environment=sky, cameras=[camera]))
        for layer in LAYERS:
            assert np.allclose(nowhere[layer], got[layer], rtol=1e-6)


def test_lights_without_surfaces_and_surfaces_without_lights_are_black(technique):
    lights = [PointLight((0, 0, 0)), DirectionalLight((0, -1, 0)), SpotLight((0, 0, -1), (0, 0, 1))]
    assert not picture(technique, Scene(lights=lights, cameras=[Camera()]))["radiance"].any()
    dark = picture(technique, ball_on_a_floor())
    assert dark["depth"].any() and not dark["radiance"].any()


# ------------------------------------------------------------------------------------------------ Light and surfaces


@pytest.mark.parametrize("depth", [0.01, 0.3])
def test_light_inside_a_wall_lights_nothing_in_view(technique, depth):
    """A centimetre below the face or in the middle of the wall, it lights nothing directly.

    Bounces may leak a thousandth of what it gives in front of the wall: rays can slip between triangles. Imperfect
    shadow maps leak somewhat more.
    """
    shown = []
    for z in (-5.5, -6.0 - depth):
        scene = builtin.courtyard()
        scene.environment, scene.lights = None, [PointLight((-4.0, 2.0, z), 1000.0)]
        shown.append(picture(technique, scene, (64, 36)))
    before, inside = shown
    assert before["direct"].any() and not inside["direct"].any()
    leak = 3e-3 if technique == "many-light" else 1e-3
    assert inside["radiance"].mean() <= leak * before["radiance"].mean()


@pytest.mark.parametrize("height", [0.0, 1e-7, 1e-4])
def test_light_touching_a_surface_is_finite(technique, height):
    """A light in the plane of a floor or of a box, and a spot that shines into the floor."""
    block = box((-0.3, 0, -0.3), (0.3, 0.6, 0.3), matte(0.9))
    lights = [
        PointLight((0.8, height, 0.8), 1.0),
        SpotLight((0.3 + height, 0.3, 0.0), (1, 0, 0), 0.3, 1.5, 1.0),
        SpotLight((-0.8, height, 0.8), (0, -1, 0), 0.3, 0.3, 1.0),
    ]
    for shining in ([lights[0]], [lights[1]], [lights[2]], lights):
        scene = Scene([Instance(grid(4.0, material=matte(0.5))), Instance(block)], shining)
        got = picture(technique, scene, camera=Camera.look_at((0.5, 2.0, 2.5), (0, 0.2, 0)))
        # The spot that shines into the floor lights nothing else.
        assert got["direct"].any() or shining == [lights[2]]


# ------------------------------------------------------------------------------------------------ Time


@pytest.mark.parametrize("name", ["cornell", "courtyard", pytest.param("medley", marks=pytest.mark.slow)])
def test_changing_back_restores_the_frame(technique, name):
    """After changes of camera, size and lights: bit for bit the first frame, and that of a new renderer."""
    scene = SCENES[name]()
    renderer = Renderer(scene, size=(24, 16), settings=make_settings(technique, frames=3))

    def shown():
        renderer.run(check=True)
        return read_all(renderer)

    home, first = renderer.camera, shown()
    away = home.position + np.array((0.1, 0.2, 0.0))
    renderer.camera = Camera.look_at(away, home.position - home.world_from_view[:3, 2])
    assert not np.array_equal(shown()["radiance"], first["radiance"])
    renderer.camera = home
    back = shown()
    renderer.size = (7, 5)
    shown()
    renderer.size = (24, 16)
    resized = shown()
    extra = PointLight((2.0, 2.0, 2.0), 50.0)
    scene.lights.append(extra)
    assert not np.array_equal(shown()["radiance"], first["radiance"])
    scene.lights.remove(extra)
    fresh = picture(technique, SCENES[name](), (24, 16), frames=3)
    for other in (back, resized, shown(), fresh):
        for buffer, values in first.items():
            # Motion depends on the previous frame.
            assert buffer == "motion" or np.array_equal(other[buffer], values), buffer


@pytest.mark.slow
def test_ten_thousand_frames_do_not_drift(technique):
    """A constant stays constant, and the mean of jittered frames equals the box-filtered fine picture.

    Techniques that sample new lights in each frame are slow, so they take 1,000 frames; their fine picture is too noisy
    for the second check.
    """
    frames = 10_000 if technique in QUICK else 1_000
    settings = make_settings(technique, frames=frames, spp=frames, diffuse=True)
    settings.path.samples_per_run = 1

    def accumulated(scene):
        renderer = Renderer(scene, size=(8, 8), settings=settings)
        steps = 0
        while renderer.step(show=LAYERS):
            steps += 1
        assert steps >= frames
        return {layer: renderer.read_back(layer).astype(np.float64) for layer in LAYERS}

    flat = accumulated(builtin.plane_sun())
    once = picture(technique, builtin.plane_sun(), (8, 8), diffuse=True)
    assert np.allclose(flat["radiance"], once["radiance"], rtol=2e-5)
    if technique not in QUICK:
        return
    scene = builtin.cornell_point()
    got, fine = accumulated(scene), picture(technique, scene, (256, 256), diffuse=True)
    for layer in LAYERS:
        expected = fine[layer].reshape(8, 32, 8, 32, 3).mean((1, 3))
        off = got[layer] - expected
        # A pixel is the mean of 1,024 fine ones, along whose edges one in 32 is half wrong; noise hides that.
        error = abs(off.mean()) if is_noisy(technique) else np.abs(off).mean()
        assert error <= 5e-3 * expected.mean(), (layer, error / max(expected.mean(), 1e-300))
