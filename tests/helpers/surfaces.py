"""Reads back a renderer's G-buffer: `wgsl/shared/gbuffer/surface.wgsl` in numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wgpu_gi.renderer import Renderer
from wgpu_gi.upload.mesh_data import NONE

COATED, UNLIT = 0x40000000, 0x80000000


@dataclass
class Surfaces:
    """Arrays (h, w, ...) of one G-buffer layer; triangle and instance are -1 where there is no surface."""

    seen: np.ndarray  # bool
    triangle: np.ndarray
    instance: np.ndarray
    depth: np.ndarray
    distance: np.ndarray
    normal: np.ndarray
    geometric_normal: np.ndarray
    base_color: np.ndarray
    roughness: np.ndarray
    metallic: np.ndarray
    coated: np.ndarray  # bool
    unlit: np.ndarray  # bool
    emission: np.ndarray


def read_surfaces(graph, name: str = "gbuffer", suffix: str = "") -> Surfaces:
    """Return a G-buffer layer of a graph that has run."""

    def read(part: str) -> np.ndarray:
        return graph.read_back(f"{name}/{part}{suffix}")

    ids = read("visibility").astype(np.int64)
    height, width = ids.shape[:2]
    ids = np.concatenate([ids, np.zeros_like(ids)], -1)[..., :2] - 1
    texels = read("surfaces").reshape(height, width, 4)
    material = texels[..., 3]
    color = np.stack([texels[..., 2] >> shift & 1023 for shift in (0, 10, 20)], -1) / 1023
    return Surfaces(
        ids[..., 0] >= 0,
        ids[..., 0],
        ids[..., 1],
        read("depth")[..., 0],
        read("distance")[..., 0],
        octahedral_decode(texels[..., 0]),
        octahedral_decode(texels[..., 1]),
        color**2,
        (material & 0xFFFF) / 65535,
        (material >> 16) / 65535,
        (texels[..., 2] & COATED) != 0,
        (texels[..., 2] & UNLIT) != 0,
        read("emission").reshape(height, width, 4)[..., :3],
    )


def octahedral_decode(code: np.ndarray) -> np.ndarray:
    """Decode unit vectors from octahedral codes of two 16-bit snorm numbers (Cigolle et al. 2014)."""
    snorm = np.stack([code & 0xFFFF, code >> 16], -1).astype(np.uint16).view(np.int16)
    xy = np.maximum(snorm / 32767, -1)
    z = 1 - np.abs(xy).sum(-1, keepdims=True)
    folded = (1 - np.abs(xy[..., ::-1])) * np.where(xy >= 0, 1, -1)
    v = np.concatenate([np.where(z < 0, folded, xy), z], -1)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def world_normals(renderer: Renderer, surfaces: Surfaces) -> np.ndarray:
    """Return the unit normals of the triangles in each pixel, on the counter-clockwise side, from the scene's data."""
    hierarchy = renderer._gpu.upload._hierarchy
    triangles = hierarchy.triangles[np.maximum(surfaces.triangle, 0)]
    normals = np.cross(triangles["edge1"].astype(np.float64), triangles["edge2"].astype(np.float64))
    entered = triangles["instance"] == NONE
    back = hierarchy.instances["local_from_world"][np.maximum(surfaces.instance, 0), :3, :3].astype(np.float64)
    # The stored rows are the images of the axes; normals transform by the inverse transpose.
    normals = np.where(entered[..., None], np.einsum("...c,...rc->...r", normals, back), normals)
    return normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-30)
