"""Which meshes are solids: watertight and not too thin."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, grid, quad, sphere
from wgpu_gi.scene.scene import Mesh
from wgpu_gi.upload.solid_meshes import is_thick, is_watertight


def without(mesh: Mesh, triangle: int) -> Mesh:
    return Mesh(mesh.positions, np.delete(mesh.triangles, triangle, 0), mesh.materials)


@pytest.mark.parametrize("mesh", [box((0, 0, 0), (1, 2, 3), matte(0.5)), sphere((0, 1, 0), 0.5)])
def test_boxes_and_spheres_are_watertight(mesh):
    """Even if each face has vertices of its own."""
    assert is_watertight(mesh)
    assert not is_watertight(without(mesh, 3))


@pytest.mark.parametrize("mesh", [quad((0, 0, 0), (1, 0, 0), (0, 1, 0), matte(0.5)), grid(2.0, 4)])
def test_sheets_are_not_watertight(mesh):
    assert not is_watertight(mesh)


def test_two_sheets_back_to_back_are_watertight():
    """A line crosses both or neither."""
    positions = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32)
    assert is_watertight(Mesh(positions, np.array([(0, 1, 2), (0, 2, 1)], np.uint32)))


@pytest.mark.parametrize(("depth", "expected"), [(2.0, True), (0.1, True), (0.02, False), (0.0, False)])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
def test_slabs_are_solids_down_to_a_thickness(depth, expected, scale):
    """Of any size, and with either orientation."""
    mesh = box((scale, 0, 0), (2 * scale, scale, depth * scale), matte(0.5))
    assert is_thick(mesh) == expected
    assert is_thick(Mesh(mesh.positions, mesh.triangles[:, ::-1])) == expected


def test_signed_zeros_are_equal_positions():
    """Half of the corners have negative zeros."""
    mesh = box((-1, 0, 0), (0, 1, 1), matte(0.5))
    positions = mesh.positions.copy()
    rows = np.arange(len(positions)) % 2 == 0
    positions[rows] = np.where(positions[rows] == 0, np.float32(-0.0), positions[rows])
    assert is_watertight(Mesh(positions, mesh.triangles))
