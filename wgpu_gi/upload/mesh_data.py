"""The bottom level of the hierarchy: each mesh's BVH in local space, its triangles and vertices in leaf order.

Kept while the mesh is in use and its arrays stay the same; instances share it. Vertex attributes are packed:
directions in octahedral coordinates of 2 x 16 bits (Cigolle et al. 2014, "A Survey of Efficient Representations for
Independent Unit Vectors"), colours in 4 x 16 bits.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..float_limits import LARGEST_FACTOR
from ..scene.mesh_check import are_same, arrays_of
from ..scene.scene import Mesh
from .bvh import LEAF_FLAG
from .figures import Figure
from .mesh_trees import REBUILD, build_trees, refit_tree, tree_cost
from .node_quantization import QuantizationGrid
from .tree_builder import TreeBuilder
from .wide_bvh import WideBvh

NONE = 0xFFFFFFFF  # no instance, or a scene without root
SMOOTH, COLORED, MASKED, HAS_TANGENTS = 1, 2, 4, 8  # triangle flags, as wgsl/scene/geometry.wgsl


class Topology:
    """Stands for the triangles of a mesh, in leaf order, as the key of caches; a deformed mesh keeps it."""


@dataclass(eq=False)
class MeshData:
    """A mesh's arrays in leaf order: `corners` (m, 3, 3) float32, local; `indices` (m, 3) uint32 into `vertices`.

    `built_cost` is the cost of the tree when it was built; deforming the mesh may have made it more expensive.
    """

    mesh: Mesh
    arrays: tuple[Any, ...]  # of the mesh, as `arrays_of`
    topology: Topology
    bvh: WideBvh
    corners: NDArray[np.float32]
    indices: NDArray[np.uint32]
    material: NDArray[np.uint32]  # (m,) into mesh.materials
    flags: NDArray[np.uint32]  # (m,) without MASKED, which depends on the current alpha mode of the material
    vertices: NDArray[np.void]
    bounds: NDArray[np.float32]  # (2, 3)
    built_cost: float


@dataclass
class Placement:
    """The place of a mesh in the buffers of the scene.

    For a baked mesh, `baked` is the number of its instance; `tree` and `box` (2, 3) are its hierarchy and bounds in
    world space, relative to the origin. `figure`: what the device deforms; `data` has the pose it was built in.
    """

    data: MeshData
    nodes: slice
    triangles: slice
    vertices: slice
    grid: QuantizationGrid  # grid of the nodes in local space
    baked: int | None = None
    tree: WideBvh | None = None
    box: NDArray[np.float32] | None = None
    figure: Figure | None = None

    @property
    def bounds(self) -> NDArray[np.floating]:
        """A box around the mesh in local space, (2, 3)."""
        return self.data.bounds if self.figure is None else self.figure.box

    def corners(self, chosen: NDArray[np.integer] | slice) -> NDArray[np.floating]:
        """Return the corners of some triangles, given in leaf order, (n, 3, 3), local."""
        if self.figure is None:
            return self.data.corners[chosen]
        return self.figure.positions(self.data.indices[chosen])

    def holds(self, data: MeshData) -> bool:
        """Tell whether the data of a mesh has as many nodes, triangles and vertices as there is place for."""
        sizes = (len(data.bvh.child), len(data.corners), len(data.vertices))
        return sizes == tuple(part.stop - part.start for part in (self.nodes, self.triangles, self.vertices))

    def reference(self, child: int) -> int:
        """Convert a child reference of the mesh's own tree to a reference into the buffers of the scene."""
        return child + (self.triangles.start if child >= int(LEAF_FLAG) else self.nodes.start)


def prepare_meshes(
    meshes: list[Mesh], vertex_dtype: np.dtype, builder: TreeBuilder | None = None, former: Iterable[MeshData] = ()
) -> list[MeshData]:
    """Return the data of correct meshes with at least one triangle each.

    A mesh with the triangles of one of the `former`, the same array, is that mesh deformed: it keeps the tree,
    refitted, while that is good enough. Without `builder`, numpy builds the trees.
    """
    known = {(id(d.arrays[1]), len(d.arrays[0])): d for d in former}  # by triangles, and number of positions
    found: dict[int, MeshData] = {}
    for mesh in meshes:
        old = known.get((id(mesh.triangles), len(mesh.positions)))
        # The array may have been changed in place since.
        if old is not None and np.array_equal(np.asarray(mesh.triangles)[old.bvh.order], old.indices):
            tree = refit_tree(old.bvh, np.asarray(mesh.positions, np.float32), old.indices, builder)
            if tree_cost(tree) <= REBUILD * old.built_cost:
                found[id(mesh)] = _in_leaf_order(mesh, tree, old.built_cost, vertex_dtype, old)
    new = [mesh for mesh in meshes if id(mesh) not in found]
    for mesh, tree in zip(new, build_trees(new, builder), strict=True):
        found[id(mesh)] = _in_leaf_order(mesh, tree, tree_cost(tree), vertex_dtype)
    return [found[id(mesh)] for mesh in meshes]


def _in_leaf_order(
    mesh: Mesh, bvh: WideBvh, built_cost: float, vertex_dtype: np.dtype, old: MeshData | None = None
) -> MeshData:
    """Return the arrays of a mesh with its triangles in the order of the BVH's leaves; `old`: the mesh undeformed."""
    triangles = np.asarray(mesh.triangles)[bvh.order].astype(np.uint32) if old is None else old.indices
    arrays, topology = arrays_of(mesh), Topology() if old is None else old.topology
    corners = np.asarray(mesh.positions, np.float32)[triangles]
    material = np.zeros(len(triangles), np.uint32)
    if mesh.material_of_triangle is not None:
        material = np.asarray(mesh.material_of_triangle, np.uint32)[bvh.order]
    flags = np.zeros(len(triangles), np.uint32)
    if mesh.normals is not None:
        # A triangle is flat if one of its vertices has no normal.
        flags |= np.where(_all_corners((np.asarray(mesh.normals) != 0).any(1), triangles), SMOOTH, 0).astype(np.uint32)
    if mesh.tangents is not None:
        has_tangent = (np.asarray(mesh.tangents)[:, :3] != 0).any(1)
        flags |= np.where(_all_corners(has_tangent, triangles), HAS_TANGENTS, 0).astype(np.uint32)
    if mesh.colors is not None:
        flags |= np.uint32(COLORED)
    flat = corners.reshape(-1, 3)
    bounds = np.stack([flat.min(0), flat.max(0)])
    # Vertices hold everything but positions.
    kept = old is not None and are_same(arrays[1:], old.arrays[1:])
    vertices = old.vertices if old is not None and kept else _pack_vertices(mesh, vertex_dtype)
    return MeshData(mesh, arrays, topology, bvh, corners, triangles, material, flags, vertices, bounds, built_cost)


def _all_corners(has: NDArray[np.bool_], triangles: NDArray[np.uint32]) -> NDArray[np.bool_]:
    """Tell for each triangle (m, 3) whether all of its vertices have something."""
    return np.ones(len(triangles), np.bool_) if has.all() else np.asarray(has[triangles].all(1))


def _pack_vertices(mesh: Mesh, dtype: np.dtype) -> NDArray[np.void]:
    """Return the vertex attributes as the shaders' Vertex records."""
    vertices = np.zeros(len(mesh.positions), dtype)
    if mesh.normals is not None:
        vertices["normal"] = octahedral_encode(mesh.normals)
    if mesh.tangents is not None:
        # The lowest bit of the code holds the bitangent's sign, at a cost of half a quantisation step.
        code = octahedral_encode(mesh.tangents[:, :3]) & np.uint32(0xFFFFFFFE)
        vertices["tangent"] = code | (np.asarray(mesh.tangents)[:, 3] < 0)
    if mesh.colors is not None:
        bits = np.round(np.clip(mesh.colors.astype(np.float64), 0, 1) * 65535).astype(np.uint32)
        vertices["color"] = np.stack([bits[:, 0] | bits[:, 1] << 16, bits[:, 2] | bits[:, 3] << 16], 1)
    else:
        vertices["color"] = 0xFFFFFFFF
    for name, texcoords in (("texcoord0", mesh.texcoords0), ("texcoord1", mesh.texcoords1)):
        if texcoords is not None:
            vertices[name] = np.clip(texcoords.astype(np.float64), -LARGEST_FACTOR, LARGEST_FACTOR)
    return vertices


def octahedral_encode(directions: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return (n,) codes of two snorm16 for (n, 3) directions of any length; the zero vector encodes +Z."""
    v = np.asarray(directions, np.float64)
    total = np.abs(v).sum(1, keepdims=True)
    v = v / np.where(total > 0, total, 1)
    sign = np.where(v[:, :2] >= 0, 1.0, -1.0)
    folded = (1 - np.abs(v[:, 1::-1])) * sign
    xy = np.where(v[:, 2:] < 0, folded, v[:, :2])
    code = np.round(xy * 32767).astype(np.int32) & 0xFFFF
    return (code[:, 0] | code[:, 1] << 16).astype(np.uint32)
