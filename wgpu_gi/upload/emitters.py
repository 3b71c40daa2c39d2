"""The emissive triangles of a scene, grouped by instance and material, and the power that they radiate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import REC709_LUMINANCE
from ..scene.scene import Instance, Material, Mesh
from .light_values import emitted_radiance
from .texture_atlas import mean_linear_color
from .texture_sampling import sample_texture
from .two_level_bvh import TwoLevelBvh


@dataclass
class EmittingPart:
    """The triangles of one emissive material in one instance of a mesh, in metres relative to the scene's origin.

    `corners` (n, 3, 3) and `vertices` (n, 3), indices into the mesh, follow the order of the BVH's barycentric weights.
    `sides` as in wgsl/scene/lights.wgsl: 1 emits from the side of edge1 x edge2, 2 from the other, 3 from both.
    """

    material: Material
    mesh: Mesh
    triangles: NDArray[np.int64]  # indices into the triangles of the BVH
    corners: NDArray[np.float64]
    vertices: NDArray[np.uint32]
    sides: int
    instance: int  # in the scene's list


def emitting_parts(instances: list[Instance], hierarchy: TwoLevelBvh) -> Iterator[EmittingPart]:
    """Yield all triangles that may emit, by instance; `hierarchy` must be up to date with `instances`."""
    for number, instance in enumerate(instances):
        place = hierarchy.placement(instance.mesh)
        for m, material in enumerate(instance.mesh.materials):
            if material.unlit or not emitted_radiance(material).any():
                continue
            chosen = np.flatnonzero(place.data.material == m)
            matrix = np.asarray(instance.world_from_local, np.float64)
            translation = matrix[:3, 3] - hierarchy.origin
            corners = place.data.corners[chosen].astype(np.float64) @ matrix[:3, :3].T + translation
            mirrored = np.linalg.det(matrix[:3, :3]) < 0
            # Barycentric weights must agree with how the BVH stores a mirrored triangle.
            turn = [0, 2, 1] if mirrored and place.baked is not None else [0, 1, 2]
            sides = 3 if material.double_sided else 2 if mirrored and place.baked is None else 1
            vertices = place.data.indices[chosen][:, turn]
            triangles = chosen + place.triangles.start
            yield EmittingPart(material, instance.mesh, triangles, corners[:, turn], vertices, sides, number)


def exitance(material: Material) -> float:
    """Return the radiant exitance of an emitter as luminance, averaged over its texture and summed over sides, W/m2."""
    color = emitted_radiance(material)
    if material.emission_texture is not None:
        color = color * mean_linear_color(material.emission_texture.image)
    return float(color @ REC709_LUMINANCE) * np.pi * (2 if material.double_sided else 1)


def radiance_at(part: EmittingPart, vertices: NDArray, weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the emitted radiance of points, (n, 3); zero where the alpha mask removes the surface."""
    material = part.material
    radiance = np.broadcast_to(emitted_radiance(material), (len(vertices), 3))
    if material.emission_texture is not None:
        radiance = radiance * sample_texture(material.emission_texture, part.mesh, vertices, weights)[:, :3]
    if material.alpha_mode == "mask":
        alpha = np.full(len(vertices), float(material.base_color[3]))
        if part.mesh.colors is not None:
            alpha *= np.einsum("nk,nk->n", weights, np.asarray(part.mesh.colors, np.float64)[vertices, 3])
        if material.base_color_texture is not None:
            alpha *= sample_texture(material.base_color_texture, part.mesh, vertices, weights)[:, 3]
        radiance = radiance * (alpha >= material.alpha_cutoff)[:, None]
    return radiance
