"""Samples textures on the CPU as wgsl/scene/materials.wgsl does: bilinear or nearest, without mip levels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import LINEAR_OF_CODE
from ..scene.scene import Mesh, Texture, Wrap

FARTHEST = 1.6e7  # texels from the corner, just below 2^24, above which float32 coordinates have no fraction


def sample_texture(
    texture: Texture, mesh: Mesh, vertices: NDArray, weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the linear RGBA colours (n, 4) of an sRGB-coded texture at points of a mesh.

    The points are given by `vertices` (n, 3) of the mesh and barycentric `weights` (n, 3). A mesh without texture
    coordinates is sampled at (0, 0).
    """
    uv = texture_coordinates(texture, mesh, vertices, weights)
    # Find the four texels around each point, or the nearest one.
    pixels = texture.image.eight_bit
    height, width = pixels.shape[:2]
    nearest = texture.filter == "nearest"
    texel = np.clip(uv * (width, height), -FARTHEST, FARTHEST) - (0.0 if nearest else 0.5)
    base = np.floor(texel).astype(np.int64)
    fraction = np.zeros_like(texel) if nearest else texel - base
    columns = [_wrap(base[:, 0] + k, width, texture.wrap_u) for k in (0, 1)]
    rows = [_wrap(base[:, 1] + k, height, texture.wrap_v) for k in (0, 1)]
    # Interpolate their linear colours.
    fx, fy = fraction[:, :1], fraction[:, 1:]
    top, bottom = (_decode(pixels[y, columns[0]]) * (1 - fx) + _decode(pixels[y, columns[1]]) * fx for y in rows)
    return top * (1 - fy) + bottom * fy


def texture_coordinates(
    texture: Texture, mesh: Mesh, vertices: NDArray, weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the coordinates (n, 2) at which a texture is sampled at points of a mesh, given as in `sample_texture`."""
    texcoords = mesh.texcoords1 if texture.texcoord else mesh.texcoords0
    raw = np.zeros((len(vertices), 2))
    if texcoords is not None:
        raw = np.einsum("nk,nkc->nc", weights, np.asarray(texcoords, np.float64)[vertices])
    # KHR_texture_transform: uv' = translation * rotation * scale * uv
    sine, cosine = np.sin(texture.rotation), np.cos(texture.rotation)
    return raw * texture.scale @ np.array([[cosine, -sine], [sine, cosine]]) + texture.offset


def _wrap(index: NDArray[np.int64], size: int, mode: Wrap) -> NDArray[np.int64]:
    """Wrap texel indices into 0..size - 1."""
    if mode == "clamp":
        return np.clip(index, 0, size - 1)
    if mode == "repeat":
        return index % size
    index = index % (2 * size)
    return np.where(index < size, index, 2 * size - 1 - index)


def _decode(codes: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return linear RGBA."""
    return np.concatenate([LINEAR_OF_CODE[codes[:, :3]], codes[:, 3:] / 255.0], 1)
