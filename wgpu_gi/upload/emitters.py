"""The emissive triangles of a scene, grouped by instance and material, and the power that they radiate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import REC709_LUMINANCE
from ..scene.scene import Instance, Material, Mesh
from .light_values import emitted_radiance
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

    @cached_property
    def turn(self) -> NDArray[np.int64]:
        """The corner of each triangle at which its cells begin, of the shortest side; sides are compared rounded."""
        sides = np.linalg.norm(np.roll(self.corners, -1, 1) - self.corners, axis=2)
        return np.argmin(np.round(sides / np.maximum(sides.max(1, keepdims=True), 1e-300), 6), axis=1)

    def turned_corners(self) -> NDArray[np.float64]:
        """Return the corners (n, 3, 3) of triangles from `turn` on."""
        rows = np.arange(len(self.turn))
        return np.stack([self.corners[rows, (self.turn + k) % 3] for k in range(3)], 1)

    def weights_at(
        self, rows: NDArray[np.int64], turned: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
        """Return barycentric weights (n, 3) of points of the triangles `rows`, and their vertices.

        `turned`: weights of the corners in the order of `turned_corners`.
        """
        turn = self.turn[rows]
        own = np.stack([turned[np.arange(len(turn)), (k - turn) % 3] for k in range(3)], 1)
        return own, self.vertices[rows]

    def areas(self) -> NDArray[np.float64]:
        """Return the areas of triangles, m2."""
        edges = self.corners[:, 1:] - self.corners[:, :1]
        return np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2


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
            corners = place.corners(chosen).astype(np.float64) @ matrix[:3, :3].T + translation
            mirrored = np.linalg.det(matrix[:3, :3]) < 0
            # Barycentric weights must agree with how the BVH stores a mirrored triangle.
            turn = [0, 2, 1] if mirrored and place.baked is not None else [0, 1, 2]
            sides = 3 if material.double_sided else 2 if mirrored and place.baked is None else 1
            vertices = place.data.indices[chosen][:, turn]
            triangles = chosen + place.triangles.start
            yield EmittingPart(material, instance.mesh, triangles, corners[:, turn], vertices, sides, number)


def exitance(material: Material) -> float:
    """Return the radiant exitance of an emitter as luminance, summed over sides, W/m2; of a texture's white texels."""
    return float(emitted_radiance(material) @ REC709_LUMINANCE) * np.pi * (2 if material.double_sided else 1)


def radiance_at(part: EmittingPart, vertices: NDArray, weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the radiance of points before the alpha mask, (n, 3)."""
    radiance = np.broadcast_to(emitted_radiance(part.material), (len(vertices), 3))
    if part.material.emission_texture is not None:
        radiance = radiance * sample_texture(part.material.emission_texture, part.mesh, vertices, weights)[:, :3]
    return radiance


def opacity_at(part: EmittingPart, vertices: NDArray, weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 0 where the alpha mask removes the surface, else 1, (n, 1)."""
    material = part.material
    alpha = np.full(len(vertices), float(material.base_color[3]))
    if part.mesh.colors is not None:
        alpha *= np.einsum("nk,nk->n", weights, np.asarray(part.mesh.colors, np.float64)[vertices, 3])
    if material.base_color_texture is not None:
        alpha *= sample_texture(material.base_color_texture, part.mesh, vertices, weights)[:, 3]
    if material.alpha_mode == "blend":
        return np.clip(alpha, 0.0, 1.0)[:, None]
    kept = (alpha >= material.alpha_cutoff) | (material.alpha_mode != "mask")
    return kept[:, None].astype(np.float64)
