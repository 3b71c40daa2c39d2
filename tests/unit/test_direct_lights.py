"""The lights of deferred techniques: punctual lights, and sample lights that preserve their emitters' power."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.scene_dtypes import DTYPES

from wgpu_gi.gpu.wgsl.load import load
from wgpu_gi.pictures.color import linear_from_srgb
from wgpu_gi.scene.built_in.scenes import builtin_scene
from wgpu_gi.scene.built_in.shapes import box, quad, sphere
from wgpu_gi.scene.scene import DirectionalLight, Image, Instance, Material, Mesh, PointLight, Scene, SpotLight, Texture
from wgpu_gi.upload import direct_lights
from wgpu_gi.upload.direct_lights import (
    DIRECT_AREA,
    DIRECT_POINT,
    DIRECT_SPOT,
    DIRECT_SUN,
    build_direct_lights,
    lattice,
)
from wgpu_gi.upload.texture_sampling import sample_texture
from wgpu_gi.upload.two_level_bvh import TwoLevelBvh

VIEWS = load("deferred/shadow/views.wgsl")
DIRECT_LIGHT = VIEWS.struct_dtype("DirectLight")


def lights_of(scene, samples=16, use_range=False, hierarchy=None):
    """Return the records, with positions in world space."""
    hierarchy = hierarchy or TwoLevelBvh(DTYPES)
    hierarchy.update(scene.instances, {id(m): k for k, m in enumerate(scene.materials)})
    records = build_direct_lights(scene, hierarchy, DIRECT_LIGHT, samples, use_range)
    assert records.dtype == DIRECT_LIGHT
    for name in records.dtype.names:
        assert np.isfinite(records[name]).all()
    return records, records["position"] + hierarchy.origin


def lamp(x=0.0, size=(1.0, 1.0), color=(1.0, 1.0, 1.0), name="lamp", **fields):
    """A rectangle that emits downwards."""
    material = Material(name, emission=color, **fields)
    return Instance(quad((x, 3, 0), (size[0], 0, 0), (0, 0, size[1]), material))


def emitted(records):
    """Return radiance times area over all samples, (3,)."""
    return records["area"].astype(np.float64) @ records["color"]


def star_discrepancy(points):
    """Return the star discrepancy of points (n, 2), by all boxes whose corners are made of their coordinates."""
    x, y = np.meshgrid(np.append(points[:, 0], 1), np.append(points[:, 1], 1))
    below = ((points[:, 0] < x[..., None]) & (points[:, 1] < y[..., None])).mean(-1)
    within = ((points[:, 0] <= x[..., None]) & (points[:, 1] <= y[..., None])).mean(-1)
    return max(np.abs(below - x * y).max(), np.abs(within - x * y).max())


def nearest_distances(points):
    distance = np.linalg.norm(points[:, None] - points, axis=-1)
    return np.where(np.eye(len(points), dtype=bool), np.inf, distance).min(1)


# ------------------------------------------------------------------------------------------------ Punctual lights


def test_kinds_match_the_shaders():
    names = ("DIRECT_POINT", "DIRECT_SPOT", "DIRECT_SUN", "DIRECT_AREA")
    assert [getattr(direct_lights, name) for name in names] == [VIEWS.constants[name] for name in names]


def test_punctual_lights():
    spot = SpotLight((0, 2, 0), (3, -4, 0), 0.2, 0.5, 2.0, (0.5, 1, 2), range=4.0)
    scene = Scene([lamp()], [PointLight((1, 2, 3), 4.0, (1, 0, 0), range=5.0), spot, DirectionalLight((0, 0, 5), 3.0)])
    records, position = lights_of(scene, 1, use_range=True)
    assert records["kind"].tolist() == [DIRECT_POINT, DIRECT_SPOT, DIRECT_SUN, DIRECT_AREA]
    assert np.allclose(position[:2], [(1, 2, 3), (0, 2, 0)])
    assert np.allclose(records["color"], [(4, 0, 0), (1, 2, 4), (3, 3, 3), (1, 1, 1)])
    assert np.allclose(records["direction"][1:3], [(0.6, -0.8, 0), (0, 0, 1)])
    assert np.allclose(records["inverse_range"], [0.2, 0.25, 0, 0])
    scale, offset = records["cone_scale"][1], records["cone_offset"][1]
    assert offset - scale * (1 - math.cos(0.2)) == pytest.approx(1, abs=1e-5)
    assert offset - scale * (1 - math.cos(0.5)) == pytest.approx(0, abs=1e-5)
    assert (records["view_count"] == 0).all()
    assert (lights_of(scene)[0]["inverse_range"] == 0).all()


def test_lights_without_power_are_left_out():
    dark = [
        PointLight((0, 1, 0), 0.0),
        DirectionalLight((0, -1, 0), 1.0, (0, 0, 0)),
        SpotLight((0, 1, 0), (0, -1, 0), 0, 0),
    ]
    black = Texture(Image(np.zeros((2, 2, 4), np.uint8)))
    point = Mesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.uint32), [Material(emission=(1, 1, 1))])
    instances = [lamp(emission_texture=black), lamp(unlit=True), lamp(color=(0.0, 0.0, 0.0)), Instance(point)]
    assert len(lights_of(Scene(instances, dark))[0]) == 0
    assert len(lights_of(Scene())[0]) == 0


# ------------------------------------------------------------------------------------------------ Power


@pytest.mark.parametrize("samples", [1, 2, 7, 16, 64])
@pytest.mark.parametrize(
    "mesh",
    [
        quad((0, 0, 0), (3, 1, 0), (0, 1, 1), Material(emission=(3.0, 2.0, 0.5))),
        box((0, 0, 0), (5, 0.1, 4), Material(emission=(0.0, 2.0, 0.5))),
        sphere(subdivisions=2, material=Material(emission=(1e6, 2e-6, 0.5))),
    ],
    ids=["quad", "box", "sphere"],
)
def test_power_is_preserved(mesh, samples):
    records, _ = lights_of(Scene([Instance(mesh)]), samples)
    a, b, c = mesh.positions[mesh.triangles].astype(np.float64).transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert len(records) == samples and (records["kind"] == DIRECT_AREA).all()
    assert np.allclose(emitted(records), area * np.array(mesh.materials[0].emission), rtol=1e-5)
    assert np.allclose(records["color"], mesh.materials[0].emission, rtol=1e-5)
    assert np.allclose(np.linalg.norm(records["direction"], axis=1), 1, atol=1e-6)
    # All samples have similar power.
    assert records["area"].max() < 2.1 * area / samples


@pytest.mark.parametrize("samples", [1, 3, 16])
def test_every_material_has_a_sample_and_keeps_its_power(samples):
    instances = [lamp(2.0 * k, color=(10.0**k, 1.0, 0.0), name=str(k)) for k in range(-2, 3)]
    records, position = lights_of(Scene(instances), samples)
    assert len(records) == max(samples, 5)
    for k in range(-2, 3):
        mine = records[np.abs(position[:, 0] - 2 * k - 0.5) < 0.6]
        assert np.allclose(emitted(mine), (10.0**k, 1, 0), rtol=1e-5)


def test_samples_are_divided_by_power():
    """One for each material, the rest by power; a material's instances divide them by their power."""
    strong, weak = lamp(0, color=(3.0, 3.0, 3.0), name="strong"), lamp(5, name="weak")
    _, position = lights_of(Scene([strong, weak]), 18)
    assert (position[:, 0] < 3).sum() == 13
    one = lamp(0)
    large = np.diag([2.0, 1, 1, 1])
    large[0, 3] = 5
    _, position = lights_of(Scene([one, Instance(one.mesh, large)]), 9)
    assert (position[:, 0] > 3).sum() == 6
    both = lamp(5, name="both", double_sided=True)
    _, position = lights_of(Scene([lamp(0), both]), 11)
    assert (position[:, 0] > 3).sum() == 7


def test_many_lamps_of_one_material_share_few_samples():
    one = lamp()
    instances = []
    for k in range(100):
        matrix = np.eye(4)
        matrix[0, 3] = 3.0 * k
        instances.append(Instance(one.mesh, matrix))
    records, position = lights_of(Scene(instances), 10)
    assert np.allclose(emitted(records), 100, rtol=1e-5)
    assert np.allclose(np.floor(position[:, 0] / 30), np.arange(10))  # one for every ten


def test_textured_emitters():
    """Nine tenths of the lamp are black; samples lie on the rest, and preserve power and hue."""
    pixels = np.zeros((10, 20, 4), np.uint8)
    pixels[4:6, 5:10] = (255, 0, 0, 255)
    pixels[4:6, 10:15] = (0, 128, 255, 255)
    material = Material(emission=(2.0, 2.0, 2.0), emission_texture=Texture(Image(pixels), filter="nearest"))
    mesh = quad((0, 0, 0), (20, 0, 0), (0, 10, 0), material)
    mesh.texcoords0 = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32)  # v points down
    records, position = lights_of(Scene([Instance(mesh)]), 32)
    x, y = position[:, 0], 10 - position[:, 1]
    assert ((x > 5) & (x < 15) & (y > 4) & (y < 6)).all()
    red = x < 10
    assert (records["color"][red, 1:] == 0).all() and (records["color"][~red, 0] == 0).all()
    expected = 2 * np.array([10, 10 * linear_from_srgb(128 / 255), 10])
    assert np.allclose(emitted(records), expected, rtol=0.03)
    material.emission_texture = None
    assert np.allclose(emitted(lights_of(Scene([Instance(mesh)]), 32)[0]), 400, rtol=1e-5)


def test_masked_parts_do_not_emit():
    pixels = np.full((1, 2, 4), 255, np.uint8)
    pixels[0, 0, 3] = 0
    texture = Texture(Image(pixels), filter="nearest")
    material = Material(emission=(1.0, 1.0, 1.0), alpha_mode="mask", base_color_texture=texture)
    mesh = quad((0, 0, 0), (2, 0, 0), (0, 1, 0), material)
    mesh.texcoords0 = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32)
    records, position = lights_of(Scene([Instance(mesh)]))
    assert (position[:, 0] > 1).all() and np.allclose(emitted(records), 1, rtol=0.02)


def test_texture_sampling_is_bilinear_and_transformed():
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (3, 5, 4)).astype(np.uint8)
    mesh = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    mesh.texcoords1 = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    texture = Texture(Image(pixels), "repeat", "mirror", texcoord=1, offset=(0.3, 0.1), scale=(2, 3), rotation=0.5)
    weights = rng.dirichlet((1, 1, 1), 200)
    got = sample_texture(texture, mesh, np.broadcast_to(mesh.triangles[0], (200, 3)), weights)
    u, v = (weights @ mesh.texcoords1[mesh.triangles[0]] * (2, 3)).T
    sine, cosine = math.sin(0.5), math.cos(0.5)
    x, y = (cosine * u + sine * v + 0.3) * 5 - 0.5, (-sine * u + cosine * v + 0.1) * 3 - 0.5
    linear = np.concatenate([linear_from_srgb(pixels[..., :3] / 255), pixels[..., 3:] / 255], 2)
    tiled = np.tile(np.concatenate([linear, linear[::-1]]), (5, 8, 1))  # mirrored in v
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - column)[:, None], (y - row)[:, None]
    column, row = column + 10, row + 12
    top = tiled[row, column] * (1 - fx) + tiled[row, column + 1] * fx
    bottom = tiled[row + 1, column] * (1 - fx) + tiled[row + 1, column + 1] * fx
    assert np.allclose(got, top * (1 - fy) + bottom * fy, atol=1e-6)


# ------------------------------------------------------------------------------------------------ Places


def test_the_lattice_is_stratified():
    for count in (1, 2, 3, 4, 7, 16, 32, 100):
        points = lattice(count)
        assert np.allclose(np.sort(points, axis=0), (np.arange(count)[:, None] + 0.5) / count)
        if count > 3:
            assert nearest_distances(points).min() * count**0.5 > 0.8


@pytest.mark.parametrize("samples", [4, 8, 12, 16, 24, 32, 64])
def test_a_lamp_of_two_triangles_is_covered_evenly(samples):
    """Samples are stratified over the rectangle, not over each triangle, with a low discrepancy."""
    records, position = lights_of(builtin_scene("cornell"), samples)
    place = (position[:, [0, 2]] - (2.13, 2.27)) / (1.3, 1.05)
    assert ((place > 0) & (place < 1)).all() and np.allclose(position[:, 1], 5.478, atol=1e-5)
    assert (records["direction"][:, 1] < -0.999).all()
    rng = np.random.default_rng(0)
    assert star_discrepancy(place) < 0.6 * np.mean([star_discrepancy(rng.random((samples, 2))) for _ in range(20)])
    assert nearest_distances(place).min() * samples**0.5 > 0.65
    assert np.abs(place.mean(0) - 0.5).max() < 0.25 / samples**0.5
    for axis in (0, 1):  # an edge that is parallel to the lamp's side uncovers one sample after the other
        gaps = np.diff(np.sort(place[:, axis]), prepend=0, append=1)
        assert gaps.max() < 3.5 / samples


def test_samples_of_a_rotated_lamp_are_rotated():
    """Samples follow a rectangle, whichever way its triangles and axes lie."""
    rng = np.random.default_rng(1)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, (5, -3, 2)
    still, moved = lamp(size=(2.0, 1.0)), lamp(size=(2.0, 1.0))
    moved.world_from_local = matrix
    records, position = lights_of(Scene([still]))
    turned, turned_position = lights_of(Scene([moved]))
    assert np.allclose(turned_position, position @ turn.T + (5, -3, 2), atol=1e-5)
    assert np.allclose(turned["direction"], records["direction"] @ turn.T, atol=1e-5)


def test_a_sphere_emits_in_all_directions():
    records, position = lights_of(Scene([Instance(sphere(subdivisions=4, material=Material(emission=(1, 1, 1))))]), 48)
    assert ((records["direction"] * position).sum(1) > 0.99).all()
    assert np.abs(records["direction"].mean(0)).max() < 0.05
    assert nearest_distances(position).min() > 0.3 * (4 * math.pi / 48) ** 0.5


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_emitting_side(times, mirrored):
    """A lamp emits along its normal, transformed by the normal matrix, baked or not, mirrored or not."""
    matrix = np.diag([-1.0 if mirrored else 1.0, 1, 2, 1])
    one = lamp()
    records, position = lights_of(Scene([Instance(one.mesh, matrix) for _ in range(times)]))
    assert np.allclose(records["direction"], (0, -1, 0), atol=1e-6) and (records["both_sides"] == 0).all()
    assert ((position[:, 0] > 0) == (not mirrored)).all() and position[:, 2].max() > 1
    assert np.allclose(emitted(records), 2 * times, rtol=1e-5)
    two_sided, _ = lights_of(Scene([Instance(lamp(double_sided=True).mesh, matrix)]))
    assert (two_sided["both_sides"] == 1).all()
    assert np.allclose(emitted(two_sided), 2, rtol=1e-5)  # of each side


def test_other_lights_keep_their_samples():
    """The samples of other lamps stay put while one lamp moves and dims."""
    one = lamp(0)
    others = [lamp(5, name="other"), Instance(lamp(8).mesh), Instance(one.mesh, np.diag([1.0, 1, 3, 1]))]
    scene = Scene([one, *others, lamp(-30, name="far")])
    hierarchy = TwoLevelBvh(DTYPES)
    _, before = lights_of(scene, 40, hierarchy=hierarchy)
    one.world_from_local = np.eye(4)
    one.world_from_local[:3, 3] = (0.5, -1, 0.25)
    _, after = lights_of(scene, 40, hierarchy=hierarchy)
    moved = np.abs(after - before).max(1) > 1e-5
    assert 0 < moved.sum() < len(moved) and np.allclose((after - before)[moved], (0.5, -1, 0.25), atol=1e-5)
    scene.materials[1].emission = (0.97, 0.97, 0.97)
    _, dimmed = lights_of(scene, 40, hierarchy=hierarchy)
    assert np.allclose(dimmed, after, atol=1e-5)
