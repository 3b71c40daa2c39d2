"""Scenes as `tools/make_references.py` gives them to Mitsuba 3, against closed forms.

Needs the [truth] extra and LLVM, and is skipped without them.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.pictures import looking
from make_references import import_mitsuba, main, render
from mitsuba_scene import camera_rays, pixel_centres

import wgpu_gi as gi
from wgpu_gi.errors import GiError
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import quad, sphere
from wgpu_gi.scene.scene import Environment, Image, Instance, Material, Scene, SpotLight, Texture

try:
    mitsuba = import_mitsuba()
except GiError as error:
    pytest.skip(str(error), allow_module_level=True)

SIZE = (12, 8)
rng = np.random.default_rng(5)


def shoot(scene, camera=None, *, spp=2, size=SIZE, **how):
    layers = render(mitsuba, scene, camera or scene.cameras[0], size, spp=spp, runs=2, **how)
    layers["full"] = layers["emit"] + layers["direct"] + layers["one"] + layers["multi"]
    return layers


def rays(camera, size):
    return [v.reshape(size[1], size[0], 3) for v in camera_rays(camera, size, pixel_centres(size))]


def floor_points(scene, size=SIZE):
    origins, directions = rays(scene.cameras[0], size)
    return origins - directions * (origins[..., 1:2] / directions[..., 1:2])


def wall(material, texcoords=((0, 1), (1, 1), (1, 0), (0, 0)), name="wall"):
    """A unit square at z = 0 whose left bottom corner is the origin, and an orthographic view of it."""
    mesh = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), material, name)
    mesh.texcoords0 = np.array(texcoords, np.float32)
    return mesh, looking((0, 0, -1), (0.5, 0.5, 1.0), height=1.0)


def test_point_light_has_its_closed_form():
    """L = rho I h / (pi (h2 + r2)^1.5), the same in every sample; more bounces add nothing."""
    scene = builtin.plane_point(height=2.0, intensity=10.0)
    layers = shoot(scene)
    radius2 = (floor_points(scene)[..., ::2] ** 2).sum(-1)
    expected = 0.5 * 10 * 2 / (math.pi * (4 + radius2) ** 1.5)
    assert layers["direct"] == pytest.approx(np.repeat(expected[..., None], 3, -1), rel=1e-5)
    assert layers["se_full"].max() < 1e-6
    assert np.abs(layers["one"]).max() < 1e-6 and layers["emit"].max() == 0


@pytest.mark.parametrize(("inner", "outer"), [(0.0, 30.0), (10.0, 13.0), (20.0, 20.0), (5.0, 75.0)])
def test_spot_light_has_the_fall_off_of_gltf(inner, outer):
    """The point light times saturate((cos - cos outer) / max(0.001, cos inner - cos outer))^2."""
    scene = builtin.plane_point(height=2.0, intensity=10.0)
    direction = np.array([0.2, -1.0, 0.1])
    scene.lights = [SpotLight((0, 2, 0), direction, math.radians(inner), math.radians(outer), 10.0)]
    size = (48, 32)
    to_floor = floor_points(scene, size) - (0, 2, 0)
    distance = np.linalg.norm(to_floor, axis=-1)
    cosine = to_floor @ direction / (distance * np.linalg.norm(direction))
    inside, outside = math.cos(math.radians(inner)), math.cos(math.radians(outer))
    fall_off = np.clip((cosine - outside) / max(0.001, inside - outside), 0, 1) ** 2
    expected = fall_off * 0.5 * 10 * 2 / (math.pi * distance**3)
    found = shoot(scene, size=size)["direct"][..., 1]
    # Mitsuba's fall-off is a texture, whose resolution shows at a hard edge.
    assert np.mean(np.abs(found - expected)) < 1e-3 * expected.mean()
    assert found == pytest.approx(expected, abs=(2e-3 if inner < outer else 0.05) * expected.max())


def test_sun_and_constant_sky_have_their_closed_forms():
    layers = shoot(builtin.plane_sun(lux=3.0, zenith_deg=60.0))
    assert layers["direct"] == pytest.approx(0.5 * 3 * 0.5 / math.pi, rel=1e-5)
    ball = shoot(builtin.furnace(albedo=0.5, sky=2.0), spp=64)
    hit = ball["depth"] > 0
    assert ball["emit"][~hit] == pytest.approx(2.0) and ball["emit"][hit].max() == 0
    assert ball["full"][hit].mean() == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("rotation", [0.0, 1.0])
def test_environment_picture_has_our_orientation(rotation):
    """u = atan2(x, -z)/2pi + rotation/2pi, v = acos(y)/pi, bilinear between pixel centres, the poles clamped."""
    image = rng.random((6, 10, 3)).astype(np.float32)
    sky = Environment((1.0, 2.0, 3.0), image, rotation)
    far_away = quad((0, -1e3, 0), (1e-3, 0, 0), (0, 0, 1e-3), matte(0.5))
    for direction in [(0, 0, -1), (1, 0.3, 0), (-1, -0.5, 1), (0.01, 1, 0), (0, -0.9, 0.3)]:
        camera = gi.Camera.look_at((0, 0, 0), direction, yfov_deg=80)
        found = shoot(Scene([Instance(far_away)], environment=sky, cameras=[camera]))["emit"]
        x, y, z = np.moveaxis(rays(camera, SIZE)[1], -1, 0)
        column = ((np.arctan2(x, -z) + rotation) / (2 * math.pi) % 1) * 10 - 0.5
        row = np.clip(np.arccos(y) / math.pi * 6 - 0.5, 0, 5)
        left, top = np.floor(column).astype(int), np.minimum(np.floor(row).astype(int), 4)
        a, b = (column - left)[..., None], (row - top)[..., None]
        rows = [image[top + k, left % 10] * (1 - a) + image[top + k, (left + 1) % 10] * a for k in (0, 1)]
        assert found == pytest.approx((rows[0] * (1 - b) + rows[1] * b) * (1, 2, 3), abs=2e-3)


def test_double_sided_emitters_light_both_sides():
    """In a closed box whose walls emit and reflect on both sides, L = Le / (1 - rho)."""
    layers = shoot(builtin.closed_box(emission=1.0, albedo=0.5), spp=256)
    assert layers["emit"] == pytest.approx(1.0)
    for name, expected in [("direct", 0.5), ("one", 0.25), ("multi", 0.25)]:
        assert layers[name].mean() == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("mirrored", [False, True])
def test_emitters_shine_from_the_counter_clockwise_side(mirrored):
    lamp, front = wall(Material(emission=(1.0, 2.0, 3.0)))
    # A mirrored instance keeps its front: the side that was counter-clockwise before mirroring.
    place = np.diag([-1.0, 1.0, 1.0, 1.0]) if mirrored else np.eye(4)
    place[0, 3] = float(mirrored)
    scene = Scene([Instance(lamp, place)], cameras=[front])
    assert shoot(scene)["emit"][:, 4:8] == pytest.approx(np.broadcast_to((1.0, 2.0, 3.0), (8, 4, 3)))
    assert shoot(scene, looking((0, 0, 1), (0.5, 0.5, -1.0), height=1.0))["emit"].max() == 0


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"filter": "nearest"},
        {"wrap_u": "clamp", "wrap_v": "clamp", "offset": (-0.4, 0.3)},
        {"wrap_u": "mirror", "wrap_v": "mirror", "scale": (2.5, 3.0)},
        {"rotation": 0.5, "scale": (2.0, 1.5), "offset": (0.1, 0.2)},
    ],
)
def test_base_color_texture_is_decoded_filtered_and_transformed(changes):
    """Exact sRGB decoding before the filter, wrap modes, and KHR_texture_transform."""
    pixels = rng.integers(0, 256, (4, 5, 4)).astype(np.uint8)
    texture = Texture(Image(pixels), **changes)
    mesh, camera = wall(Material(base_color=(1.0, 0.5, 0.25, 1.0), base_color_texture=texture))
    found = shoot(Scene([Instance(mesh)], [], Environment(), [camera]), size=(16, 16))["albedo"]
    at = (np.arange(16) + 0.5) / 16
    u, v = np.meshgrid(at * texture.scale[0], at * texture.scale[1])
    sine, cosine = math.sin(texture.rotation), math.cos(texture.rotation)
    u, v = cosine * u + sine * v + texture.offset[0], -sine * u + cosine * v + texture.offset[1]
    code = pixels[..., :3] / 255.0
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)

    def wrapped(index, size):
        if texture.wrap_u == "clamp":
            return np.clip(index, 0, size - 1)
        if texture.wrap_u == "mirror":
            return np.minimum(index % (2 * size), 2 * size - 1 - index % (2 * size))
        return index % size

    shift = 0.5 if texture.filter == "linear" else 0.0
    x, y = u * 5 - shift, v * 4 - shift
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    a, b = ((x - column)[..., None], (y - row)[..., None]) if shift else (0.0, 0.0)
    texel = [[linear[wrapped(row + j, 4), wrapped(column + i, 5)] for i in (0, 1)] for j in (0, 1)]
    expected = (texel[0][0] * (1 - a) + texel[0][1] * a) * (1 - b) + (texel[1][0] * (1 - a) + texel[1][1] * a) * b
    assert found == pytest.approx(expected * (1.0, 0.5, 0.25), abs=1e-4)


def test_alpha_mask_lets_the_view_and_the_sun_through():
    """A wall has holes where bilinear alpha x 0.9 is below 0.5; the sun lights a second wall through them."""
    alpha = rng.integers(0, 256, (4, 4))
    pixels = np.full((4, 4, 4), 255, np.uint8)
    pixels[..., 3] = alpha
    holes = Texture(Image(pixels), wrap_u="clamp", wrap_v="clamp")
    front, camera = wall(Material("holes", (0.5, 0.5, 0.5, 0.9), alpha_mode="mask", base_color_texture=holes))
    back = quad((-1, -1, -1), (3, 0, 0), (0, 3, 0), matte(0.8))
    lit = Scene([Instance(front), Instance(back)], [gi.DirectionalLight((0.0, 0.0, -1.0), math.pi)], None, [camera])
    layers = shoot(lit, size=(32, 32))
    at = (np.arange(32) + 0.5) / 32 * 4 - 0.5
    low = np.clip(np.floor(at).astype(int), 0, 3)
    high = np.clip(np.floor(at).astype(int) + 1, 0, 3)
    weight = at - np.floor(at)
    rows = alpha[low] * (1 - weight[:, None]) + alpha[high] * weight[:, None]
    smooth = (rows[:, low] * (1 - weight) + rows[:, high] * weight) / 255 * 0.9
    sure = np.abs(smooth - 0.5) > 0.03
    hole = smooth < 0.5
    assert hole.any() and (~hole).any()
    assert layers["depth"][hole & sure] == pytest.approx(2.0) and layers["depth"][~hole & sure] == pytest.approx(1.0)
    # Passing a hole is no bounce, for camera rays and for light.
    assert layers["direct"][hole & sure] == pytest.approx(0.8, rel=1e-4)
    assert layers["direct"][~hole & sure] == pytest.approx(0.5, rel=1e-4)


def test_vertex_colors_and_normals_are_interpolated():
    mesh, camera = wall(matte(0.5))
    corner = np.array([[0, 0, 0, 1], [1, 0, 0, 1], [1, 1, 0, 1], [0, 1, 0, 1]], np.float32)
    mesh.colors = corner
    mesh.normals = np.array([[0, 0, 1]] * 4, np.float32) + np.float32(0.3) * (corner[:, :3] - np.float32(0.5))
    mesh.normals[:, 2] = 1.0
    # Squeezed along x, so that normals transform differently from vectors.
    layers = shoot(Scene([Instance(mesh, np.diag([0.5, 1, 1, 1]))], [], Environment(), [camera]), size=(16, 16))
    y, x = ((np.mgrid[:16, :16] + 0.5) / 16) * [[[-1]], [[1]]] + [[[1]], [[0]]]
    inside = x < 0.5
    assert layers["albedo"][inside] == pytest.approx(np.stack([x, y / 2, 0 * x], -1)[inside] * [1, 1, 1], abs=1e-4)
    nearly = np.stack([2 * 0.3 * (2 * x - 0.5), 0.3 * (y - 0.5), np.ones_like(x)], -1)
    nearly /= np.linalg.norm(nearly, axis=-1, keepdims=True)
    assert (layers["normal"] * nearly).sum(-1)[inside].min() > 0.999


@pytest.mark.parametrize("height", [None, 4.0], ids=["perspective", "orthographic"])
def test_jitter_does_not_shift_the_picture(height):
    scene = builtin.plane_point()
    camera = looking((-0.3, -1.0, 0.2), (0.6, 2.0, -0.9), height)
    centred, jittered = (shoot(scene, camera, spp=128, size=(36, 24), jitter=jitter) for jitter in (False, True))
    for name in ("depth", "normal", "albedo"):
        assert (centred[name] == jittered[name]).all()
    # A shift by one pixel would change the picture more than five times as much as jitter does.
    a, b = centred["full"], jittered["full"]
    for axis in (0, 1):
        assert np.abs(a - b).mean() < 0.2 * np.abs(np.diff(b, axis=axis)).mean()


def test_equal_commands_write_equal_files(tmp_path, capsys):
    out = tmp_path / "ball.npz"
    assert main(["furnace", "--size", "8x6", "--spp", "32", "--runs", "4", "--env", "1,2,3", "-o", str(out)]) == 0
    assert "noise as relMSE" in capsys.readouterr().out
    with np.load(out) as file:
        assert {file[name].dtype for name in file.files if name != "meta"} == {np.dtype(np.float16)}
        assert file["emit"][0, 0] == pytest.approx([1, 2, 3])
    again = tmp_path / "again.npz"
    assert main(["furnace", "--size", "8x6", "--spp", "32", "--runs", "4", "--env", "1,2,3", "-o", str(again)]) == 0
    assert again.read_bytes() == out.read_bytes()


def test_depth_does_not_depend_on_the_distance_to_the_origin():
    ball = sphere(subdivisions=2, material=matte(0.5))
    place = np.eye(4)
    place[:3, 3] = 1e6
    camera = looking((0, 0, -1), (1e6, 1e6, 1e6 + 3), height=2.5)
    near = shoot(Scene([Instance(ball)], [], Environment(), [looking((0, 0, -1), (0, 0, 3), height=2.5)]), spp=4)
    far = shoot(Scene([Instance(ball, place)], [], Environment(), [camera]), spp=4)
    assert far["depth"] == pytest.approx(near["depth"], abs=1e-4)
