"""Small bright texels in large emission textures light a floor as their area does, whatever finds them."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.form_factors import polygon_form_factor
from helpers.pictures import shoot

from wgpu_gi.camera import Camera
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import grid, quad
from wgpu_gi.scene.scene import Image, Instance, Material, Scene, Texture
from wgpu_gi.techniques.deferred.direct import DirectSettings

ALBEDO = (700 / 1023) ** 2  # exact in the G-buffer, which stores square roots in 10 bits
SIZE = (24, 24)
WALL = 2.0  # metres a side


def lamps(size, side, count, seed=0):
    """Return a picture of `size` texels a side that is black but for lamps of `side` texels, and their first texels."""
    rng = np.random.default_rng(seed)
    first = np.stack(np.meshgrid(*[np.arange(count)] * 2), -1).reshape(-1, 2) * (size // count)
    first = first + rng.integers(0, size // count - side, first.shape)
    pixels = np.zeros((size, size, 4), np.uint8)
    for row, column in first:
        pixels[row : row + side, column : column + side] = 255
    return pixels, first


def lit_floor(pixels, radiance, **texture):
    """Return a wall with an emission texture at z = -1 above a floor, of which a camera sees 2 m x 2 m."""
    picture = Texture(Image(pixels), filter="nearest", **texture)
    material = Material(base_color=(0, 0, 0, 1), emission=(radiance,) * 3, emission_texture=picture)
    wall = quad((-WALL / 2, 0.25, -1.0), (WALL, 0, 0), (0, WALL, 0), material)
    wall.texcoords0 = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32)
    camera = Camera.look_at((0, 0.125, 0), (0, 0, 0), up=(0, 0, -1))
    camera.orthographic_height = 2.0
    return Scene([Instance(grid(8.0, material=matte(ALBEDO))), Instance(wall)], cameras=[camera])


def expected_light(first, side, size, radiance):
    """Return the floor's radiance (24, 24): the sum of the lamps' form factors."""
    x = (np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1
    points = np.stack([*np.meshgrid(x, x)], -1).reshape(-1, 2)
    points = np.stack([points[:, 0], np.zeros(len(points)), points[:, 1]], 1)
    total = np.zeros(len(points))
    for row, column in first:
        left, right = (np.array([column, column + side]) / size - 0.5) * WALL
        top, bottom = 0.25 + (1 - np.array([row, row + side]) / size) * WALL
        corners = np.array([(left, bottom, -1), (right, bottom, -1), (right, top, -1), (left, top, -1)])
        total += polygon_form_factor(corners, points, np.array([0.0, 1.0, 0.0]))
    return ALBEDO * radiance * total.reshape(SIZE[::-1])


def direct_light(scene, way):
    """Return direct light by one of the ways to find emitters."""
    if way == "path":
        return shoot(scene, SIZE, show=("direct",), bounces=0, spp=64)["direct"]
    direct = DirectSettings(emitters=way, samples=256)
    settings = Settings(gi="none", diffuse=True, direct=direct, camera=CameraSettings(jitter=False, frames=16))
    renderer = Renderer(scene, size=SIZE, settings=settings)
    renderer.run(show=("direct",), check=True)
    return renderer.read_back("direct").astype(np.float64)


@pytest.mark.parametrize("way", ["path", "rays", "maps"])
@pytest.mark.parametrize(("size", "side", "count"), [(64, 8, 3), (512, 4, 4), (2048, 2, 4)])
def test_lamps_of_few_texels_have_their_form_factor(way, size, side, count):
    """From 1 / 7 of the wall down to 1 / 65,536."""
    pixels, first = lamps(size, side, count)
    radiance = size**2 / (len(first) * side**2)
    got = direct_light(lit_floor(pixels, radiance), way)[..., 0]
    expected = expected_light(first, side, size, radiance)
    # Pixel by pixel within the noise of 64 samples, or of the shape of 256 fixed lights; the mean within two standard
    # errors of 576 such pixels.
    assert np.sqrt(((got - expected) ** 2).mean()) < 0.25 * expected.mean()
    assert got.mean() == pytest.approx(expected.mean(), rel=0.02)


@pytest.mark.parametrize("way", ["path", "rays", "maps"])
def test_a_transformed_texture_shines_where_it_is_seen(way):
    """Turned by half and mirrored in u: a picture turned upside down."""
    pixels, first = lamps(256, 4, 2, seed=2)
    turned = dict(rotation=np.pi, offset=(1.0, 1.0), scale=(-1.0, 1.0))
    flipped = first.copy()
    flipped[:, 0] = 256 - 4 - first[:, 0]
    got = direct_light(lit_floor(pixels, 1000.0, **turned), way)[..., 0]
    expected = expected_light(flipped, 4, 256, 1000.0)
    assert np.sqrt(((got - expected) ** 2).mean()) < 0.25 * expected.mean()
    assert got.mean() == pytest.approx(expected.mean(), rel=0.02)


def test_many_light_finds_the_bounce_of_small_lamps():
    """Light in a corner by 16 lamps of 4 texels of 1024 x 1024 each, against the path tracer."""
    pixels, _ = lamps(1024, 2, 4)
    scene = lit_floor(pixels, 1024**2 / (16 * 4))
    scene.instances.append(Instance(quad((-1, 0, -1), (0, 2, 0), (0, 0, 2), matte(ALBEDO))))
    scene.cameras[0].world_from_view = Camera.look_at((1.5, 1.5, 2.0), (-0.5, 0.4, -0.5)).world_from_view
    scene.cameras[0].orthographic_height = None
    pictures = {}
    for name, settings in {"path": dict(gi="path", spp=192, bounces=12), "many": dict(gi="many-light")}.items():
        renderer = Renderer(scene, size=(24, 14), settings=Settings(diffuse=True, **settings))
        renderer.run(show=("indirect",))
        pictures[name] = renderer.read_back("indirect").astype(np.float64)
    assert pictures["many"].mean() == pytest.approx(pictures["path"].mean(), rel=0.05)
