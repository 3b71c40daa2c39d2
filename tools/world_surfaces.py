"""The triangles of a scene in world space by material, for renderers without instances and glTF materials.

Emitters are flat-shaded; a double-sided one becomes two sheets a hair apart. A material that needs more than one
texture coordinate, or both a texture and vertex colours, raises GiError: see `_refuse`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wgpu_gi.errors import GiError
from wgpu_gi.scene.scene import Instance, Material, Mesh, Scene

Floats = NDArray[np.float64]


@dataclass
class Surface:
    """Triangles of one material in world space: `corners` (m, 3, 3) metres; other arrays are per corner, or None."""

    material: Material
    corners: Floats
    normals: Floats | None  # (m, 3, 3), any length
    texcoords: Floats | None  # (m, 3, 2) after the texture transform
    colors: Floats | None  # (m, 3, 4)


def surfaces(scene: Scene) -> list[Surface]:
    """Return the triangles of a scene in world space by material, smooth ones apart from flat ones.

    Leaves out triangles without area and those that a mask without a texture cuts out. Raises GiError like `_refuse`.
    """
    parts: dict[tuple[int, bool], list[Surface]] = {}
    for instance in scene.instances:
        for part in _parts(instance):
            _refuse(part)
            parts.setdefault((id(part.material), part.normals is None), []).append(part)
    return [_joined(same) for same in parts.values()]


def _parts(instance: Instance) -> Iterator[Surface]:
    """Yield an instance's triangles by material and smoothness."""
    mesh = instance.mesh
    triangles, placed = np.asarray(mesh.triangles, np.int64), _placed(instance)
    material_of = np.zeros(len(triangles), np.int64)
    if mesh.material_of_triangle is not None:
        material_of = np.asarray(mesh.material_of_triangle, np.int64)
    has_area = np.linalg.norm(_area_normals(placed[triangles]), axis=1) > 0
    normals = None if mesh.normals is None else np.asarray(mesh.normals, np.float64)
    smooth = np.zeros(len(triangles), bool) if normals is None else (normals != 0).any(1)[triangles].all(1)
    matrix = np.asarray(instance.world_from_local, np.float64)[:3, :3]
    for index, material in enumerate(mesh.materials):
        cut_out = material.alpha_mode == "mask" and material.base_color[3] < material.alpha_cutoff
        for is_smooth in (True, False):
            chosen = has_area & (material_of == index) & (smooth == is_smooth)
            if cut_out or not chosen.any():
                continue
            # glTF: under a mirroring transform the front is the clockwise side.
            t = triangles[chosen] if np.linalg.det(matrix) > 0 else triangles[chosen][:, ::-1]
            bent = None
            if is_smooth and normals is not None and not shines(material):
                unit = normals[t] / np.linalg.norm(normals[t], axis=-1, keepdims=True)
                bent = unit @ np.linalg.inv(matrix)
            colors = None if mesh.colors is None else np.clip(np.asarray(mesh.colors, np.float64)[t], 0.0, 1.0)
            plain = colors is None or bool((colors == 1.0).all())
            yield Surface(material, placed[t], bent, _texcoords(mesh, material, t), None if plain else colors)


def _placed(instance: Instance) -> Floats:
    matrix = np.asarray(instance.world_from_local, np.float64)
    return np.asarray(instance.mesh.positions, np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def _area_normals(corners: Floats) -> Floats:
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _texcoords(mesh: Mesh, material: Material, triangles: NDArray[np.int64]) -> Floats | None:
    """Return the texture coordinates of the corners, (m, 3, 2), v downwards; None without a texture."""
    texture = material.base_color_texture or material.emission_texture
    if texture is None:
        return None
    stored = mesh.texcoords1 if texture.texcoord else mesh.texcoords0
    uv = np.zeros((*triangles.shape, 2)) if stored is None else np.asarray(stored, np.float64)[triangles]
    # KHR_texture_transform: scale, then turn, then move.
    u, v = uv[..., 0] * texture.scale[0], uv[..., 1] * texture.scale[1]
    sine, cosine = math.sin(texture.rotation), math.cos(texture.rotation)
    return np.stack([cosine * u + sine * v + texture.offset[0], cosine * v - sine * u + texture.offset[1]], axis=-1)


def shines(material: Material) -> bool:
    """Tell whether a material emits."""
    return max(material.emission) > 0


def _refuse(part: Surface) -> None:
    """Raise GiError for a material that Mitsuba's plugins cannot express."""
    m = part.material
    textures = [t for t in (m.base_color_texture, m.emission_texture) if t is not None]
    masked = m.alpha_mode == "mask"
    reason = ""
    if m.unlit:
        reason = "it is unlit"
    elif any(t.wrap_u != t.wrap_v for t in textures):
        reason = "its texture wraps in one way along u and in another along v"
    elif len({(t.texcoord, t.offset, t.scale, t.rotation) for t in textures}) > 1:
        reason = "its base colour and its emission have different texture coordinates"
    elif part.colors is not None and m.base_color_texture is not None:
        reason = "it has a base colour texture and vertex colours"
    elif part.colors is not None and masked and (part.colors[..., 3] < 1).any():
        reason = "it has an alpha mask by vertex colours"
    elif masked and shines(m):
        reason = "it emits and has an alpha mask"
    if reason:
        raise GiError(f"material {m.name!r} cannot be converted for Mitsuba: {reason}; leave it out of the reference")


def _joined(parts: list[Surface]) -> Surface:
    """Join surfaces of one material; those without vertex colours become white."""
    colors = None
    if any(p.colors is not None for p in parts):
        colors = np.concatenate([np.ones((*p.corners.shape[:2], 4)) if p.colors is None else p.colors for p in parts])
    first = parts[0]
    normals = None if first.normals is None else np.concatenate([p.normals for p in parts if p.normals is not None])
    texcoords = [p.texcoords for p in parts if p.texcoords is not None]
    corners = np.concatenate([p.corners for p in parts])
    return Surface(first.material, corners, normals, np.concatenate(texcoords) if texcoords else None, colors)


def sheets(surface: Surface, distance: float) -> list[Surface]:
    """Return a surface, or the front and the back of a double-sided emitter, each `distance` off the surface."""
    if not (surface.material.double_sided and shines(surface.material)):
        return [surface]
    normals = _area_normals(surface.corners)
    step = (normals * (distance / np.linalg.norm(normals, axis=1, keepdims=True)))[:, None]
    texcoords, colors = surface.texcoords, surface.colors
    front = Surface(surface.material, surface.corners + step, None, texcoords, colors)
    turned = [None if values is None else values[:, ::-1] for values in (texcoords, colors)]
    return [front, Surface(surface.material, (surface.corners - step)[:, ::-1], None, *turned)]
