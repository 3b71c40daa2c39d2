"""One mesh prepared for the GPU: its hierarchy in local space, and its triangles and vertices in leaf order.

Built once per mesh and kept while the mesh is in use; instances only place it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from ..errors import GiError
from ..scene.scene import Mesh
from .bvh import Bvh, build_forest

BATCH = 1 << 17  # triangles whose hierarchies are built together; more would not be faster, but take more memory
SMOOTH, COLORED, MASKED, HAS_TANGENTS = 1, 2, 4, 8  # triangle flags, as wgsl/scene/geometry.wgsl


@dataclass(eq=False)
class MeshData:
    """Arrays in leaf order. `corners` (m, 3, 3) float32 local; `indices` (m, 3) uint32 into `vertices`."""

    mesh: Mesh
    bvh: Bvh
    corners: NDArray[np.float32]
    indices: NDArray[np.uint32]
    material: NDArray[np.uint32]  # (m,) into mesh.materials
    flags: NDArray[np.uint32]  # (m,) without MASKED, which may change with the material
    vertices: NDArray[np.void]
    bounds: NDArray[np.float32]  # (2, 3)


def prepare_meshes(meshes: list[Mesh], vertex_dtype: np.dtype) -> list[MeshData]:
    """Build the hierarchies of meshes of at least one triangle each and put their arrays in leaf order.

    Raises GiError for arrays that do not fit together and positions that are not finite.
    """
    for mesh in meshes:
        _check(mesh)
    prepared = []
    batches = np.cumsum([len(mesh.triangles) for mesh in meshes]) // BATCH
    for _, batch in groupby(zip(batches.tolist(), meshes, strict=True), lambda pair: pair[0]):
        together = [mesh for _, mesh in batch]
        corners = [np.asarray(mesh.positions, np.float32)[np.asarray(mesh.triangles)] for mesh in together]
        low = np.concatenate([c.min(1) for c in corners])
        high = np.concatenate([c.max(1) for c in corners])
        trees = build_forest(low, high, [len(c) for c in corners])
        prepared += [_in_leaf_order(*each, vertex_dtype) for each in zip(together, corners, trees, strict=True)]
    return prepared


def _in_leaf_order(mesh: Mesh, corners: NDArray[np.float32], bvh: Bvh, vertex_dtype: np.dtype) -> MeshData:
    triangles = np.asarray(mesh.triangles, np.int64)
    triangles, corners = triangles[bvh.order], np.ascontiguousarray(corners[bvh.order])
    material = np.zeros(len(triangles), np.uint32)
    if mesh.material_of_triangle is not None:
        material = np.asarray(mesh.material_of_triangle, np.uint32)[bvh.order]
    flags = np.zeros(len(triangles), np.uint32)
    if mesh.normals is not None:
        # One vertex without a normal makes its triangles flat.
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


def _check(mesh: Mesh) -> None:
    """Loaders keep to this; scenes made in code may not."""
    where, count = f"mesh {mesh.name!r}", len(mesh.positions)
    if np.shape(mesh.positions) != (count, 3) or np.shape(mesh.triangles) != (len(mesh.triangles), 3):
        raise GiError(f"{where}: positions must be (n, 3) and triangles (m, 3)")
    if not np.isfinite(mesh.positions).all():
        raise GiError(f"{where}: its positions must be finite")
    if int(np.min(mesh.triangles)) < 0 or int(np.max(mesh.triangles)) >= count:
        raise GiError(f"{where}: its triangles refer to vertices that it does not have; it has {count}")
    used = np.zeros(len(mesh.triangles)) if mesh.material_of_triangle is None else mesh.material_of_triangle
    if np.shape(used) != (len(mesh.triangles),):
        raise GiError(f"{where}: material_of_triangle must be ({len(mesh.triangles)},), an entry for each triangle")
    if int(np.min(used)) < 0 or int(np.max(used)) >= len(mesh.materials):
        raise GiError(f"{where}: its triangles refer to materials that it does not have; it has {len(mesh.materials)}")
    attributes = {"normals": 3, "tangents": 4, "texcoords0": 2, "texcoords1": 2, "colors": 4}
    for name, width in attributes.items():
        values = getattr(mesh, name)
        if values is not None and (np.shape(values) != (count, width) or not np.isfinite(values).all()):
            raise GiError(f"{where}: {name} must be finite and ({count}, {width}), a row for each vertex")


def _pack_vertices(mesh: Mesh, dtype: np.dtype) -> NDArray[np.void]:
    vertices = np.zeros(len(mesh.positions), dtype)
    if mesh.normals is not None:
        vertices["normal"] = octahedral_encode(mesh.normals)
    if mesh.tangents is not None:
        # The lowest bit of the code tells the side of the bitangent; it costs half a step of precision.
        code = octahedral_encode(mesh.tangents[:, :3]) & np.uint32(0xFFFFFFFE)
        vertices["tangent"] = code | (np.asarray(mesh.tangents)[:, 3] < 0)
    if mesh.colors is not None:
        bits = np.round(np.clip(mesh.colors, 0, 1) * 65535).astype(np.uint32)
        vertices["color"] = np.stack([bits[:, 0] | bits[:, 1] << 16, bits[:, 2] | bits[:, 3] << 16], 1)
    else:
        vertices["color"] = 0xFFFFFFFF
    for name, texcoords in (("texcoord0", mesh.texcoords0), ("texcoord1", mesh.texcoords1)):
        if texcoords is not None:
            vertices[name] = texcoords
    return vertices


def octahedral_encode(directions: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return (n,) codes of two snorm16 for (n, 3) directions of any length (Cigolle et al. 2014); zero gives +Z."""
    v = np.asarray(directions, np.float64)
    total = np.abs(v).sum(1, keepdims=True)
    v = v / np.where(total > 0, total, 1)
    sign = np.where(v[:, :2] >= 0, 1.0, -1.0)
    folded = (1 - np.abs(v[:, 1::-1])) * sign
    xy = np.where(v[:, 2:] < 0, folded, v[:, :2])
    code = np.round(xy * 32767).astype(np.int32) & 0xFFFF
    return (code[:, 0] | code[:, 1] << 16).astype(np.uint32)
