"""Triangles as a mesh file gives them, in float64, and their way into a checked, centred, 32-bit Scene."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ..scene import Instance, Material, Mesh, Scene

# Squared distances must stay finite in 32 bits (3.4e38), with room for sums of them.
LARGEST_EXTENT = 1e15

# Twice the area over the squared longest edge below which the normal of a triangle drowns in the rounding of its
# 32-bit corners (6e-8 of its size); its area is then nothing that a picture could show.
SMALLEST_RELATIVE_AREA = 1e-10


@dataclass
class RawMesh:
    """One indexed mesh in float64, not yet checked; fields as in `Mesh`, `normals` only if the file has them."""

    positions: NDArray[np.float64]
    triangles: NDArray[np.int64]
    materials: list[Material] = field(default_factory=list)
    material_of_triangle: NDArray[np.uint32] | None = None
    normals: NDArray[np.float64] | None = None
    texcoords: NDArray[np.float64] | None = None
    colors: NDArray[np.float64] | None = None


def fans(ids: NDArray[np.int64], corner_counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cut polygons into fans about their first corner; return triangles (m, 3) and the face of each (m,)."""
    triangles_per_face = np.maximum(corner_counts - 2, 0)
    face = np.repeat(np.arange(len(corner_counts)), triangles_per_face)
    first = (np.cumsum(corner_counts) - corner_counts)[face]
    step = np.arange(len(face)) - (np.cumsum(triangles_per_face) - triangles_per_face)[face]
    return np.stack([ids[first], ids[first + step + 1], ids[first + step + 2]], axis=1), face


def clay() -> Material:
    """Return the matte light grey that surfaces without a material get: bright, but no closed room glows for ever."""
    return Material(name="clay", base_color=(0.8, 0.8, 0.8, 1.0))


def default_material(colors: NDArray | None) -> Material:
    """Return the material of triangles that have none: clay, or white where vertex colours multiply it."""
    return clay() if colors is None else Material(name="vertex colours")


def scene_from_raw(raw: RawMesh, name: str, source: str, notes: list[str]) -> Scene:
    """Check `raw`, drop what cannot be shown, move it to its box centre and return a Scene with one instance.

    Positions are stored relative to the centre of the bounding box, which goes into `world_from_local` in float64:
    a mesh a million metres away keeps the precision of one at the origin. `source` opens messages.
    Raises GiError for no faces, indices out of range, NaN or infinite vertices and boundless extent.
    """
    if len(raw.triangles) == 0 or len(raw.positions) == 0:
        raise GiError(f"{source} has no faces; point clouds and lines are not supported")
    low, high = int(raw.triangles.min()), int(raw.triangles.max())
    if low < 0 or high >= len(raw.positions):
        wrong = low if low < 0 else high
        raise GiError(f"{source}: a face uses vertex {wrong} of {len(raw.positions)}; the file is damaged")
    raw = _drop_unused_vertices(raw)
    finite = np.isfinite(raw.positions).all(1)
    if not finite.all():
        raise GiError(f"{source}: {np.count_nonzero(~finite)} vertices are NaN or infinite; repair the mesh")
    with np.errstate(over="ignore"):
        corners = np.stack([raw.positions.min(0), raw.positions.max(0)])
        # Halves first, so that the largest doubles do not overflow.
        centre = corners[0] / 2 + corners[1] / 2
        extent = float((corners[1] - corners[0]).max())
    if not extent < LARGEST_EXTENT:
        raise GiError(f"{source} is {extent:g} m across, too much for 32-bit arithmetic; scale it down")
    positions = (raw.positions - centre).astype(np.float32)
    solid = _solid_triangles(positions, raw.triangles)
    if not solid.any():
        raise GiError(f"{source}: all {len(solid)} triangles are degenerate (no area); nothing to render")
    if not solid.all():
        notes.append(f"{source}: {np.count_nonzero(~solid)} degenerate triangles (no area) were left out")
    mesh = Mesh(
        positions=positions,
        triangles=raw.triangles[solid].astype(np.uint32),
        materials=raw.materials or [default_material(raw.colors)],
        material_of_triangle=None if raw.material_of_triangle is None else raw.material_of_triangle[solid],
        normals=_unit_or_zero(raw.normals),
        texcoords0=_finite(raw.texcoords),
        colors=None if raw.colors is None else _finite(raw.colors.clip(0, 1)),
        name=name,
    )
    world_from_local = np.eye(4)
    world_from_local[:3, 3] = centre
    return Scene(instances=[Instance(mesh, world_from_local, name)], name=name, notes=notes)


def _drop_unused_vertices(raw: RawMesh) -> RawMesh:
    """Return `raw` without the vertices that no face uses: they must neither widen the bounds nor be an error."""
    used = np.zeros(len(raw.positions), bool)
    used[raw.triangles] = True
    if used.all():
        return raw
    new_index = np.cumsum(used) - 1
    return RawMesh(
        raw.positions[used],
        new_index[raw.triangles],
        raw.materials,
        raw.material_of_triangle,
        *(None if rows is None else rows[used] for rows in (raw.normals, raw.texcoords, raw.colors)),
    )


def _solid_triangles(positions: NDArray[np.float32], triangles: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Say for each triangle whether its rounded corners still span an area."""
    a, b, c = (positions[triangles[:, k]].astype(np.float64) for k in range(3))
    longest = np.maximum.reduce([((p - q) ** 2).sum(1) for p, q in ((a, b), (b, c), (c, a))])
    twice_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    solid: NDArray[np.bool_] = twice_area > SMALLEST_RELATIVE_AREA * longest
    return solid


def _finite(rows: NDArray[np.float64] | None) -> NDArray[np.float32] | None:
    """Return rows in 32 bits with zeros for what is not finite."""
    if rows is None:
        return None
    limit = float(np.finfo(np.float32).max)
    return np.where(np.abs(rows) <= limit, rows, 0.0).astype(np.float32)


def _unit_or_zero(normals: NDArray[np.float64] | None) -> NDArray[np.float32] | None:
    """Normalise rows; those without a direction become zero, which asks for the flat normal."""
    if normals is None:
        return None
    # Scale by the largest component first, so that squares neither overflow nor vanish.
    clean = np.where(np.isfinite(normals).all(1, keepdims=True), normals, 0.0).astype(np.float64)
    largest = np.abs(clean).max(1, keepdims=True)
    clean = clean / np.where(largest > 0, largest, 1.0)
    length = np.linalg.norm(clean, axis=1, keepdims=True)
    return (clean / np.where(length > 0, length, 1.0)).astype(np.float32)
