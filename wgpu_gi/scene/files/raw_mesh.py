"""Turns the float64 triangles of a mesh file into a Scene of one checked, centred, float32 mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...float_limits import MAX_COORDINATE
from ..mesh_cleaning import has_area, unit_rows, used_vertices
from ..scene import Instance, Material, Mesh, Scene
from .notes import Notes
from .polygons import Floats, Ints, triangulate, usable_faces


@dataclass
class RawMesh:
    """One indexed mesh in float64, not yet checked; fields as in `Mesh`, `normals` only if the file has them."""

    positions: NDArray[np.float64]
    triangles: NDArray[np.int64]
    materials: list[Material] = field(default_factory=list)
    material_of_triangle: NDArray[np.uint32] | None = None
    normals: NDArray[np.float64] | None = None
    texcoords: NDArray[np.float64] | None = None
    texcoords1: NDArray[np.float64] | None = None
    colors: NDArray[np.float64] | None = None


@dataclass
class RawPoints:
    """Points without faces in float64: positions (n, 3), linear RGBA (n, 4) and normals of any length (n, 3)."""

    positions: Floats
    colors: Floats | None = None
    normals: Floats | None = None


@dataclass
class Attributes:
    """Rows of float64 that belong to vertices, corners or faces; fields as in `RawMesh`."""

    normals: Floats | None = None
    texcoords: Floats | None = None
    texcoords1: Floats | None = None
    colors: Floats | None = None

    def at(self, rows: Ints) -> Attributes:
        """Return the attributes of some rows."""
        return Attributes(*(None if all_rows is None else all_rows[rows] for all_rows in self.every()))

    def every(self) -> tuple[Floats | None, ...]:
        """Return the fields in order."""
        return self.normals, self.texcoords, self.texcoords1, self.colors


def polygon_mesh(
    positions: Floats,
    ids: Ints,
    corner_counts: Ints,
    source: str,
    notes: Notes,
    *,
    vertices: Attributes | None = None,
    corners: Attributes | None = None,
    faces: Attributes | None = None,
    materials: Sequence[Material] = (),
    material_of_face: NDArray[Any] | None = None,
) -> RawMesh:
    """Cut polygons into triangles; see `polygons.triangulate` for `ids`, `corner_counts` and what is left out.

    Attributes have a row for each position, for each of the `ids`, or for each polygon. Those of corners come before
    those of faces, and these before those of vertices. With values of corners or faces, triangles share no vertices.
    """
    corner, face = triangulate(positions, ids, corner_counts, source, notes)
    triangles = ids[corner]
    given = vertices or Attributes()
    others = [(corners, corner.ravel()), (faces, np.repeat(face, 3))]
    split = [each.at(rows).every() for each, rows in others if each and any(row is not None for row in each.every())]
    if split:
        split.append(given.at(triangles.ravel()).every())
        given = Attributes(*(next((r for r in field if r is not None), None) for field in zip(*split, strict=True)))
        positions = positions[triangles.ravel()]
        triangles = np.arange(len(positions)).reshape(-1, 3)
    material_of_triangle = None if material_of_face is None else material_of_face[face].astype(np.uint32)
    return RawMesh(positions, triangles, list(materials), material_of_triangle, *given.every())


def clay() -> Material:
    """Return the matte material of surfaces without one: albedo 0.8, so that light in a closed room dies out."""
    return Material(name="clay", base_color=(0.8, 0.8, 0.8, 1.0))


def default_material(colors: NDArray | None) -> Material:
    """Return the material of triangles without one: clay, or white if vertex colours multiply it."""
    return clay() if colors is None else Material(name="vertex colours")


def scene_from_raw(raw: RawMesh, name: str, source: str, notes: Notes) -> Scene:
    """Check `raw`, drop what cannot be shown, move it to its box centre and return a Scene with one instance.

    Positions are stored relative to the centre of the bounding box, which goes into `world_from_local` in float64:
    a mesh a million metres away keeps the precision of one at the origin. Messages begin with `source`.
    Triangles with a vertex that does not exist, or is not finite, are left out with a note. Raises GiError if none is
    left, and for boundless extent.
    """
    whole = usable_faces(
        raw.positions,
        raw.triangles.ravel(),
        np.full(len(raw.triangles), 3),
        np.arange(len(raw.triangles)) * 3,
        source,
        notes,
    )
    if not whole.all():
        of_triangle = raw.material_of_triangle
        raw = replace(
            raw,
            triangles=raw.triangles[whole],
            material_of_triangle=None if of_triangle is None else of_triangle[whole],
        )
    if len(raw.triangles) == 0:
        raise GiError(f"{source}: there are no faces to show. {' '.join(notes.sentences)[:300]}".rstrip())
    raw = _drop_unused_vertices(raw)
    centre = _centre(raw, source)
    positions = (raw.positions - centre).astype(np.float32)
    # Drop triangles without area, including those that lose it by rounding to float32.
    kept = has_area(positions, raw.triangles)
    if not kept.any():
        raise GiError(f"{source}: all {len(kept)} triangles are degenerate (no area); nothing to render")
    if not kept.all():
        notes.add(f"{source}: {np.count_nonzero(~kept)} degenerate triangles (no area) were left out")
    # Make the mesh and place it.
    mesh = Mesh(
        positions=positions,
        triangles=raw.triangles[kept].astype(np.uint32),
        materials=raw.materials or [default_material(raw.colors)],
        material_of_triangle=None if raw.material_of_triangle is None else raw.material_of_triangle[kept],
        normals=_unit_or_zero(raw.normals),
        texcoords0=_finite(raw.texcoords),
        texcoords1=_finite(raw.texcoords1),
        colors=None if raw.colors is None else _finite(raw.colors.clip(0, 1)),
        name=name,
    )
    world_from_local = np.eye(4)
    world_from_local[:3, 3] = centre
    return Scene(instances=[Instance(mesh, world_from_local, name)], name=name, notes=notes.sentences)


def _drop_unused_vertices(raw: RawMesh) -> RawMesh:
    """Return `raw` without the vertices that no face uses: they must neither widen the bounds nor be an error."""
    used = used_vertices(raw.triangles, len(raw.positions))
    if used.all():
        return raw
    new_index = np.cumsum(used) - 1
    return RawMesh(
        raw.positions[used],
        new_index[raw.triangles],
        raw.materials,
        raw.material_of_triangle,
        *(None if rows is None else rows[used] for rows in (raw.normals, raw.texcoords, raw.texcoords1, raw.colors)),
    )


def _centre(raw: RawMesh, source: str) -> NDArray[np.float64]:
    """Return the centre of the bounding box. Raises GiError for vertices that are too far apart."""
    low, high = raw.positions.min(0), raw.positions.max(0)
    with np.errstate(over="ignore"):
        extent = float((high - low).max())
    if not extent < MAX_COORDINATE:
        raise GiError(f"{source} is {extent:g} m across, too much for 32-bit arithmetic; scale it down")
    return low / 2 + high / 2  # halves first, so that the largest doubles do not overflow


def _finite(rows: NDArray[np.float64] | None) -> NDArray[np.float32] | None:
    """Return rows as float32, with zeros in place of values that are not finite."""
    if rows is None:
        return None
    limit = float(np.finfo(np.float32).max)
    return np.where(np.abs(rows) <= limit, rows, 0.0).astype(np.float32)


def _unit_or_zero(normals: NDArray[np.float64] | None) -> NDArray[np.float32] | None:
    """Normalise rows. A row without a direction becomes zero, which means the flat normal."""
    if normals is None:
        return None
    # Scale by the largest component first, so that squares neither overflow nor vanish.
    clean = np.where(np.isfinite(normals).all(1, keepdims=True), normals, 0.0).astype(np.float64)
    largest = np.abs(clean).max(1, keepdims=True)
    return unit_rows(clean / np.where(largest > 0, largest, 1.0))
