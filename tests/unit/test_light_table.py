"""The table of light sources: probabilities, pdfs that agree with them, and emitting sides."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.anchors import corners_of
from helpers.scene_dtypes import DTYPES

from wgpu_gi.pictures.color import REC709_LUMINANCE, linear_from_srgb
from wgpu_gi.scene.built_in.shapes import box, grid, quad, sphere
from wgpu_gi.scene.scene import (
    DirectionalLight,
    Environment,
    Image,
    Instance,
    Material,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
    Texture,
)
from wgpu_gi.upload.environment_cdf import environment_cdf
from wgpu_gi.upload.light_table import (
    KIND_ENVIRONMENT,
    KIND_POINT,
    KIND_SPOT,
    KIND_SUN,
    KIND_TRIANGLE,
    build_light_table,
    light_direction,
)
from wgpu_gi.upload.two_level_bvh import TwoLevelBvh


def table_of(scene, hierarchy=None):
    """Return the light table and the hierarchy it refers to."""
    hierarchy = hierarchy or TwoLevelBvh(DTYPES)
    hierarchy.update(scene.instances, {id(m): k for k, m in enumerate(scene.materials)})
    cdf = environment_cdf(scene.environment) if scene.environment else None
    table = build_light_table(scene, hierarchy, cdf, DTYPES["lights"])
    check(table)
    return table, hierarchy


def check(table):
    """Assert what holds for any light table."""
    lights = table.lights
    assert lights.dtype == DTYPES["lights"]
    for field in lights.dtype.names:
        assert np.isfinite(lights[field]).all()
    if table.count == 0:
        assert len(lights) == 1 and not table.material_pdf and table.environment_pdf == 0
        return
    assert len(lights) == table.count and (lights["probability"] >= 0).all()
    assert lights["probability"].sum(dtype=np.float64) == pytest.approx(1, rel=1e-6)
    assert np.allclose(np.cumsum(lights["probability"].astype(np.float64)), lights["cumulative"], atol=1e-6)
    assert lights["cumulative"][-1] == 1 and (np.diff(lights["cumulative"], prepend=np.float32(0)) >= 0).all()
    # A number below one selects the first light with a larger cumulative value, which must have a probability.
    for choice in (0.0, 0.25, 0.5, 0.75, float(np.nextafter(np.float32(1), np.float32(0)))):
        assert lights["probability"][np.argmax(lights["cumulative"] > choice)] > 0


def areas(lights):
    return np.linalg.norm(np.cross(lights["edge1"].astype(np.float64), lights["edge2"]), axis=1) / 2


def lamp(size=1.0, x=0.0, color=(1.0, 1.0, 1.0), name="lamp", **fields):
    """A square that emits downwards."""
    material = Material(name, emission=color, **fields)
    return Instance(quad((x, 3, 0), (size, 0, 0), (0, 0, size), material))


FLOOR = Instance(grid(10.0, 2))


def test_no_lights():
    for scene in (Scene(), Scene([FLOOR]), Scene([FLOOR], environment=Environment())):
        assert table_of(scene)[0].count == 0


def test_records_have_the_layout_of_the_shader():
    """Fields of 16-byte aligned vectors; names, places and stride are those of the struct in the shader."""
    dtype = DTYPES["lights"]
    assert dtype.itemsize == 80
    offsets = {name: dtype.fields[name][1] for name in dtype.names}
    assert offsets == {
        **{"position": 0, "kind": 12, "edge1": 16, "triangle": 28, "edge2": 32, "sides": 44, "color": 48},
        **{"cumulative": 60, "probability": 64, "of_triangle": 68, "cell": 72},
    }
    lights = [PointLight((1, 2, 3), 5.0, name="p"), DirectionalLight((0, -2, 0), 7.0, (1, 0.5, 0))]
    table, hierarchy = table_of(Scene([FLOOR, lamp()], lights))
    words = np.frombuffer(table.lights.tobytes(), np.float32).reshape(-1, 20)
    assert len(words) == table.count == 4
    assert words[0, :3] == pytest.approx((1, 2, 3) - hierarchy.origin)
    assert words[1, 4:7].tolist() == [0, -1, 0] and words[1, 12:15].tolist() == [7, 3.5, 0]
    assert words[2, 12:15].tolist() == [1, 1, 1]


def test_punctual_lights():
    spot = SpotLight((0, 2, 0), (3, -4, 0), 0.2, 0.5, 2.0, (0.5, 1, 2))
    lights = [PointLight((1, 2, 3), 4.0, (1, 0, 0)), spot, DirectionalLight((0, 0, 5), 3.0)]
    table, hierarchy = table_of(Scene([FLOOR], lights))
    point, cone, sun = table.lights
    assert [r["kind"] for r in table.lights] == [KIND_POINT, KIND_SPOT, KIND_SUN]
    assert np.allclose(point["position"], (1, 2, 3) - hierarchy.origin) and np.allclose(point["color"], (4, 0, 0))
    assert np.allclose(cone["edge1"], (0.6, -0.8, 0)) and np.allclose(cone["color"], (1, 2, 4))
    scale, offset, _ = cone["edge2"]
    assert offset - scale * (1 - math.cos(0.2)) == pytest.approx(1, abs=1e-5)
    assert offset - scale * (1 - math.cos(0.5)) == pytest.approx(0, abs=1e-5)
    assert np.allclose(sun["edge1"], (0, 0, 1)) and np.allclose(sun["color"], 3)
    powers = np.array(
        [
            4 * REC709_LUMINANCE[0] * 4 * math.pi,
            2 * np.dot((0.5, 1, 2), REC709_LUMINANCE) * cone_integral(0.2, 0.5),
            3 * math.pi * hierarchy.radius**2,
        ]
    )
    assert np.allclose(table.lights["probability"], 0.5 * powers / powers.sum() + 0.5 / 3, rtol=1e-4)


def cone_integral(inner, outer):
    """Return the solid angle of a spot weighted by its fall-off, sr, by summing rings."""
    angle = (np.arange(200_000) + 0.5) / 200_000 * outer
    falloff = np.clip((np.cos(angle) - math.cos(outer)) / (math.cos(inner) - math.cos(outer)), 0, 1) ** 2
    return float((falloff * np.sin(angle)).sum()) * 2 * math.pi * outer / 200_000


@pytest.mark.parametrize("size", [1e-300, 1.0, 1e300])
def test_directions_of_any_length(size):
    assert np.allclose(light_direction(DirectionalLight((0, 3 * size, -4 * size))), (0, 0.6, -0.8))


def test_lights_without_power_get_no_probability():
    dark = [PointLight((0, 1, 0), 0.0), PointLight((0, 1, 0), 1.0, (0, 0, 0)), SpotLight((0, 1, 0), (0, -1, 0), 0, 0)]
    black = Texture(Image(np.zeros((2, 2, 4), np.uint8)))
    hidden = lamp(name="black", emission_texture=black)
    unlit = lamp(name="unlit", unlit=True)
    nothing = Instance(
        Mesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.uint32), [Material(emission=(1, 1, 1))])
    )
    scene = Scene([FLOOR, hidden, unlit, nothing, lamp(color=(0.0, 0.0, 0.0))], dark)
    assert table_of(scene)[0].count == 0
    scene.lights.append(PointLight((0, 1, 0), 1.0))
    table, _ = table_of(scene)
    assert table.count == 1 and table.lights["probability"][0] == 1 and not table.material_pdf


def test_triangles_without_area_are_never_chosen():
    mesh = box((0, 0, 0), (1, 1, 1), Material(emission=(1, 1, 1)))
    mesh.triangles = np.concatenate([[[0, 0, 1]], mesh.triangles, [[2, 2, 2], [0, 1, 1]]]).astype(np.uint32)
    table, _ = table_of(Scene([Instance(mesh)]))
    assert table.count == 15
    assert np.array_equal(table.lights["probability"] > 0, areas(table.lights) > 0)


def test_pdf_of_a_material_is_probability_over_area():
    """Shaders use both: a hit knows its material, a light sample its triangle."""
    rng = np.random.default_rng(0)
    spotted = Texture(Image(rng.integers(0, 256, (5, 7, 4)).astype(np.uint8)))
    shared = lamp(2.0, color=(3.0, 1.0, 0.1), name="shared", double_sided=True)
    instances = [
        *[
            FLOOR,
            lamp(1.0, 2.0, name="small"),
            shared,
            lamp(0.5, 4.0, (0.0, 0.0, 9.0), "pictured", emission_texture=spotted),
        ],
        Instance(sphere(subdivisions=1, material=shared.mesh.materials[0])),
        Instance(shared.mesh, np.diag([2.0, 1.0, 3.0, 1.0])),
    ]
    scene = Scene(instances, [PointLight((0, 2, 0), 10.0)], Environment(image=np.ones((4, 8, 3), np.float32)))
    table, hierarchy = table_of(scene)
    emitters = table.lights[table.lights["kind"] == KIND_TRIANGLE]
    assert len(emitters) == 2 + 2 + 2 + 80 + 2 and len(table.material_pdf) == 3
    for number, material in enumerate(scene.materials):
        mine = emitters[hierarchy.triangles["material"][emitters["triangle"]] == number]
        density = mine["probability"] / np.maximum(areas(mine), 1e-30)
        share = 1.0
        if material.emission_texture is not None:  # of a white texel's light; the mesh has no texture coordinates
            share = linear_from_srgb(spotted.image.pixels[[0, 0, -1, -1], [0, -1, 0, -1], 2] / 255).mean()
        assert np.allclose(density, share * table.material_pdf.get(id(material), 0.0), rtol=1e-5)
    assert table.lights["kind"][-1] == KIND_ENVIRONMENT
    assert table.environment_pdf == pytest.approx(table.lights["probability"][-1])


def test_textured_emitters_are_weighted_by_their_mean():
    half = np.zeros((4, 4, 4), np.uint8)
    half[:2] = 255
    plain = lamp(1.0, 0.0, (1.0, 1.0, 1.0), "plain")
    pictured = lamp(1.0, 2.0, (2.0, 2.0, 2.0), "pictured", emission_texture=Texture(Image(half)))
    table, _ = table_of(Scene([plain, pictured]))
    assert np.allclose(table.lights["probability"], 0.25)


def test_cells_of_a_textured_emitter_have_the_power_of_their_texels():
    """Lamps of a texel each in 128 x 128 texels, as in the shader: cells by their column and row of the unit square."""
    rng = np.random.default_rng(3)
    pixels = np.zeros((128, 128, 4), np.uint8)
    for row, column in rng.integers(0, 128, (12, 2)):
        pixels[row, column] = (255, 255, 255, 255)
    texture = Texture(Image(pixels), filter="nearest")
    pictured = lamp(2.0, 0.0, (3.0, 3.0, 3.0), "pictured", emission_texture=texture)
    pictured.mesh.texcoords0 = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32)
    table, hierarchy = table_of(Scene([pictured]))
    assert 12 <= len(table.lights) < 12 * 12
    # Draw points as `sample_emitter_point` does, and estimate the power by them.
    cells = 1 << np.floor(np.log2(table.lights["cell"])).astype(int)
    chosen = np.searchsorted(table.lights["cumulative"], rng.random(200_000), side="right")
    light = table.lights[chosen]
    u = (light["cell"] + rng.random((len(light), 2))) / cells[chosen] - 1
    left = np.sqrt(1 - u[:, 1])
    points = light["position"] + (u[:, 0] * left)[:, None] * light["edge1"] + (1 - left)[:, None] * light["edge2"]
    points = points + hierarchy.origin
    # Texture coordinates are an affine function of positions.
    corners = np.column_stack([pictured.mesh.positions, np.ones(4)])
    uv = (
        np.column_stack([points, np.ones(len(points))])
        @ np.linalg.lstsq(corners, pictured.mesh.texcoords0, rcond=None)[0]
    )
    column, row = np.clip(uv * 128, 0, 127).astype(int).T
    bright = pixels[row, column, 0] > 0
    estimates = bright / (light["probability"] * np.prod(cells[chosen], 1) / (areas(table.lights)[chosen]))
    expected = (pixels[..., 0] > 0).mean() * 4.0
    assert estimates.mean() == pytest.approx(expected, rel=0.02)
    assert bright.mean() > 0.4  # of samples that find a lamp
    assert estimates.std() < 2 * expected


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_emitting_side(times, mirrored):
    """A lamp emits along its normal, transformed by the normal matrix, baked or not, mirrored or not."""
    matrix = np.diag([-1.0 if mirrored else 1.0, 1, 2, 1])
    one = lamp()
    instances = [Instance(one.mesh, matrix) for _ in range(times)]
    table, hierarchy = table_of(Scene([FLOOR, *instances]))
    assert (hierarchy.placement(one.mesh).baked is None) == (times == 2)
    normal = np.cross((1, 0, 0), (0, 0, 1)) @ np.linalg.inv(matrix[:3, :3])
    for record in table.lights:
        side = np.cross(record["edge1"], record["edge2"]) * {1: 1, 2: -1}[int(record["sides"])]
        assert side @ normal > 0
        # Barycentric weights mean the same points as in the hierarchy, so textures agree.
        triangle = hierarchy.triangles[record["triangle"]]
        m = np.eye(4)
        if triangle["instance"] == 0xFFFFFFFF:
            m[:3] = hierarchy.instances[1]["world_from_local"][:, :3].T
        for field in ("edge1", "edge2"):
            assert np.allclose(m[:3, :3] @ triangle[field], record[field], atol=1e-6)
        first = corners_of(hierarchy.triangles[record["triangle"] : record["triangle"] + 1])[0, 0]
        assert np.allclose(m[:3, :3] @ first + m[:3, 3], record["position"], atol=1e-6)
    two_sided, _ = table_of(Scene([Instance(lamp(double_sided=True).mesh, matrix)]))
    assert (two_sided.lights["sides"] == 3).all()


def test_double_sided_emitters_have_twice_the_power():
    table, _ = table_of(Scene([lamp(1.0, 0.0), lamp(1.0, 3.0, double_sided=True)]))
    share = table.lights["probability"].reshape(2, 2).sum(1)
    assert np.allclose(share, [0.25 + 0.5 / 3, 0.25 + 1 / 3])


def test_a_lamp_beside_a_huge_sun_keeps_its_share():
    sun = DirectionalLight((0, -1, 0), 1e12)
    table, _ = table_of(Scene([FLOOR, lamp(0.01, color=(1e-6, 1e-6, 1e-6))], [sun]))
    assert table.lights["probability"][0] == pytest.approx(0.75)
    assert table.lights["probability"][1:].sum() == pytest.approx(0.25)
    many = Scene([FLOOR, *(lamp(0.01, k / 9, (1.0, 1.0, 1.0), str(k)) for k in range(9))], [sun])
    table, _ = table_of(many)
    assert (table.lights["probability"][1:] >= 0.999 * 0.5 / 10 / 2).all()


def test_lights_follow_their_instance():
    one = lamp()
    scene = Scene([FLOOR, one])
    table, hierarchy = table_of(scene)
    one.world_from_local = np.diag([2.0, 1, 1, 1])
    one.world_from_local[0, 3] = 5
    moved, _ = table_of(scene, hierarchy)
    assert np.allclose(areas(moved.lights), 2 * areas(table.lights))
    assert np.allclose(
        moved.lights["position"] + hierarchy.origin, table.lights["position"] * (2, 1, 1) + hierarchy.origin + (5, 0, 0)
    )


def test_black_environment_map():
    """It gets no probability, with other lights and without."""
    scene = Scene([FLOOR], environment=Environment(image=np.zeros((4, 8, 3), np.float32)))
    assert table_of(scene)[0].count == 0
    scene.lights.append(PointLight((0, 1, 0)))
    table, _ = table_of(scene)
    assert table.count == 1 and table.environment_pdf == 0
