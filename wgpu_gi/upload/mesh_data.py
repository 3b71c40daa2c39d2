"""The bottom level of the hierarchy: each mesh's BVH in local space, its triangles and vertices in leaf order.

Built once per mesh and kept while the mesh is in use; instances share it. Vertex attributes are packed: directions in
octahedral coordinates of 2 x 16 bits (Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit
Vectors"), colours in 4 x 16 bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from ..float_limits import LARGEST_FACTOR
from ..scene.scene import Mesh
from .bvh import LEAF_FLAG, build_forest
from .node_quantization import QuantizationGrid
from .wide_bvh import WideBvh, collapse

BATCH = 1 << 17  # triangles whose BVHs are built together; more is not faster and takes more memory
NONE = 0xFFFFFFFF  # no instance, or a scene without root
SMOOTH, COLORED, MASKED, HAS_TANGENTS = 1, 2, 4, 8  # triangle flags, as wgsl/scene/geometry.wgsl


@dataclass(eq=False)
class MeshData:
    """A mesh's arrays in leaf order: `corners` (m, 3, 3) float32, local; `indices` (m, 3) uint32 into `vertices`."""

    mesh: Mesh
    bvh: WideBvh
    corners: NDArray[np.float32]
    indices: NDArray[np.uint32]
    material: NDArray[np.uint32]  # (m,) into mesh.materials
    flags: NDArray[np.uint32]  # (m,) without MASKED, which depends on the current alpha mode of the material
    vertices: NDArray[np.void]
    bounds: NDArray[np.float32]  # (2, 3)


@dataclass
class Placement:
    """The place of a mesh in the buffers of the scene.

    For a baked mesh, `baked` is the number of its instance; `tree` and `box` (2, 3) are its hierarchy and bounds in
    world space, relative to the origin.
    """

    data: MeshData
    nodes: slice
    triangles: slice
    vertices: slice
    grid: QuantizationGrid  # grid of the nodes in local space
    baked: int | None = None
    tree: WideBvh | None = None
    box: NDArray[np.float32] | None = None

    def reference(self, child: int) -> int:
        """Convert a child reference of the mesh's own tree to a reference into the buffers of the scene."""
        return child + (self.triangles.start if child >= int(LEAF_FLAG) else self.nodes.start)


def prepare_meshes(meshes: list[Mesh], vertex_dtype: np.dtype) -> list[MeshData]:
    """Build the BVHs of correct meshes with at least one triangle each and put their arrays in leaf order."""
    prepared = []
    batches = np.cumsum([len(mesh.triangles) for mesh in meshes]) // BATCH
    for _, batch in groupby(zip(batches.tolist(), meshes, strict=True), lambda pair: pair[0]):
        together = [mesh for _, mesh in batch]
        corners = [np.asarray(mesh.positions, np.float32)[np.asarray(mesh.triangles)] for mesh in together]
        low = np.concatenate([c.min(1) for c in corners])
        high = np.concatenate([c.max(1) for c in corners])
        trees = [collapse(tree) for tree in build_forest(low, high, [len(c) for c in corners])]
        prepared += [_in_leaf_order(*each, vertex_dtype) for each in zip(together, corners, trees, strict=True)]
    return prepared


def _in_leaf_order(mesh: Mesh, corners: NDArray[np.float32], bvh: WideBvh, vertex_dtype: np.dtype) -> MeshData:
    """Return the arrays of a mesh with its triangles in the order of the BVH's leaves."""
    triangles = np.asarray(mesh.triangles, np.int64)
    triangles, corners = triangles[bvh.order], np.ascontiguousarray(corners[bvh.order])
    material = np.zeros(len(triangles), np.uint32)
    if mesh.material_of_triangle is not None:
        material = np.asarray(mesh.material_of_triangle, np.uint32)[bvh.order]
    flags = np.zeros(len(triangles), np.uint32)
    if mesh.normals is not None:
        # A triangle is flat if one of its vertices has no normal.
        has_normal = (np.asarray(mesh.normals) != 0).any(1)
        flags |= np.where(has_normal[triangles].all(1), SMOOTH, 0).astype(np.uint32)
    if mesh.tangents is not None:
        has_tangent = (np.asarray(mesh.tangents)[:, :3] != 0).any(1)
        flags |= np.where(has_tangent[triangles].all(1), HAS_TANGENTS, 0).astype(np.uint32)
    if mesh.colors is not None:
        flags |= np.uint32(COLORED)
    flat = corners.reshape(-1, 3)
    bounds = np.stack([flat.min(0), flat.max(0)])
    return MeshData(
        mesh, bvh, corners, triangles.astype(np.uint32), material, flags, _pack_vertices(mesh, vertex_dtype), bounds
    )


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
