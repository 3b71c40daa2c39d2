"""The tree of emitters: leaves cover their triangles, nodes bound leaves, and the powers of textures add up."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.scene_dtypes import DTYPES

from wgpu_gi.gpu.wgsl.load import load
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import quad, sphere
from wgpu_gi.scene.scene import Image, Instance, Material, Scene, Texture
from wgpu_gi.upload.emitter_leaves import LEAF, TRIANGLE, cell_corners, cell_weights, divide
from wgpu_gi.upload.emitter_tree import HEADER, NO_EMITTERS, NODE, build_emitter_tree
from wgpu_gi.upload.emitters import emitting_parts
from wgpu_gi.upload.two_level_bvh import TwoLevelBvh


def hierarchy_of(scene):
    hierarchy = TwoLevelBvh(DTYPES)
    hierarchy.update(scene.instances, {id(m): k for k, m in enumerate(scene.materials)})
    return hierarchy


def parts_of(scene):
    return list(emitting_parts(scene.instances, hierarchy_of(scene)))


def lamp(radiance=1.0, **fields):
    return matte(0.0, "lamp", radiance, **fields)


def spotted(corner=(0, 0, 0), spots=((3, 5),), dark=0):
    """Return a quad of 2 m x 2 m whose texture of 32 x 32 texels has white spots."""
    pixels = np.full((32, 32, 4), dark, np.uint8)
    pixels[..., 3] = 255
    for at in spots:
        pixels[at] = 255
    material = Material(emission=(1.0, 1.0, 1.0), emission_texture=Texture(Image(pixels), filter="nearest"))
    mesh = quad(corner, (2, 0, 0), (0, 2, 0), material)
    mesh.texcoords0 = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32)
    return mesh


def medley():
    strip = quad((0, 3, 0), (5, 0, 0), (0, 0, 0.02), lamp(4.0, double_sided=False))
    return Scene([Instance(part) for part in (strip, sphere((3, 1, 1), 0.2, 2, lamp(9.0)), spotted((0, 0, -2)))])


def test_records_have_the_layout_of_the_shader():
    nodes = load("deferred/emitters/table.wgsl")
    assert (HEADER.itemsize, NODE.itemsize, LEAF.itemsize, TRIANGLE.itemsize) == (32, 32, 80, 16)
    assert nodes.bindings["emitters"].group == 1


@pytest.mark.parametrize("scene", [Scene([]), Scene([Instance(quad((0, 0, 0), (1, 0, 0), (0, 1, 0)))])])
def test_without_emitters_there_are_no_leaves(scene):
    table, leaves = build_emitter_tree(scene, hierarchy_of(scene))
    assert leaves == 0 and np.array_equal(table, NO_EMITTERS)


def test_leaves_cover_their_triangles():
    """Their areas add up, and a point of the unit square lies in the hull of its own leaf."""
    parts = parts_of(medley())
    found = divide(parts)
    area = sum(
        np.linalg.norm(np.cross(*(p.corners[:, 1:] - p.corners[:, :1]).transpose(1, 0, 2)), axis=1).sum() / 2
        for p in parts
    )
    assert found.leaves["area"].astype(float).sum() == pytest.approx(area, rel=1e-5)
    low, high = (getattr(cell_corners(found.leaves), name)(1) for name in ("min", "max"))
    rng = np.random.default_rng(0)
    for _ in range(20):
        cell = found.leaves["cell"].astype(float)
        weights = cell_weights(cell[:, :2] + rng.random((len(cell), 2)) * cell[:, 2:])
        edges = np.stack([found.leaves["edge1"], found.leaves["edge2"]], 1).astype(float)
        points = found.leaves["corner"] + (weights[:, 1:, None] * edges).sum(1)
        assert (points > low - 1e-5).all() and (points < high + 1e-5).all()


def test_strips_are_cut_across():
    """A lamp of 5 m x 2 cm has 256 leaves, most of them below 0.1 m; those at the tips have the same area."""
    strip = Scene([Instance(quad((0, 3, 0), (5, 0, 0), (0, 0, 0.02), lamp(double_sided=False)))])
    corners = cell_corners(divide(parts_of(strip)).leaves)
    lengths = np.ptp(corners, axis=1).max(1)
    assert np.median(lengths) < 0.1 and lengths.max() < 0.5


def test_bright_texels_have_leaves_of_their_own():
    """Two texels of 1024 send all light: it is that of few leaves."""
    found = divide(parts_of(Scene([Instance(spotted(spots=((3, 5), (20, 9))))])))
    share = np.sort(found.power / found.power.sum())[::-1]
    assert share[:16].sum() > 0.99
    assert found.power.sum() == pytest.approx(2 * (2 / 32) ** 2, rel=0.1)


def test_nodes_bound_their_leaves():
    """Spheres hold the leaves, cones the normals, and the powers of children add up."""
    scene = medley()
    table, count = build_emitter_tree(scene, hierarchy_of(scene))
    header = table[:2].reshape(1, -1).view(HEADER)[0]
    width = int(header["width"][0])
    assert count <= width < 2 * count
    nodes = table[2 : 2 + 4 * width].reshape(2 * width, -1).view(NODE)[:, 0]
    leaves = table[header["first_leaf"][0] :][: 5 * count].reshape(count, -1).copy().view(LEAF)[:, 0]
    corners = cell_corners(leaves)
    assert nodes["power"][1] == pytest.approx(1.0, abs=1e-5)
    inner = np.arange(1, width)
    assert np.allclose(nodes["power"][inner], nodes["power"][2 * inner] + nodes["power"][2 * inner + 1], atol=1e-6)
    for k in range(count):
        node = width + k
        while node:
            away = np.linalg.norm(corners[k] - nodes["centre"][node], axis=1)
            assert (away <= nodes["radius"][node] * (1 + 1e-5) + 1e-6).all()
            node //= 2


def test_every_instance_of_a_mesh_has_leaves():
    mesh = sphere((0, 0, 0), 0.2, 1, lamp())
    turned = np.diag([-1.0, 2.0, 1.0, 1.0])
    turned[:3, 3] = 3, 0, 0
    found = divide(parts_of(Scene([Instance(mesh), Instance(mesh, turned)])))
    keys = found.triangles[["triangle", "instance"]]
    assert len(np.unique(keys)) == len(keys) == 2 * len(mesh.triangles)
    assert (np.diff(keys["triangle"].astype(int)) >= 0).all()
