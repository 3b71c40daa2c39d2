"""Converts the geometry of a stage to meshes, each once for all of its instances.

Meshes have polygons of any number of corners, holes, either winding, and subsets with materials of their own. Cubes,
spheres and other gprims are tessellated, points become discs or spheres.

Departures: a subdivision surface is shown as its control mesh, with smooth normals if it has none of its own.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ..files.points import points_scene
from ..files.polygons import Floats, Ints
from ..files.raw_mesh import RawMesh, RawPoints, clay, polygon_mesh, scene_from_raw
from ..scene import Instance, Material
from .gprims import gprim_mesh
from .materials import Materials
from .primvars import Values, attributes_of, primvar, widened
from .stage import Stage, rows, whole

_WHITE = (1.0, 1.0, 1.0)


class _Topology(NamedTuple):
    """The faces of a mesh: the vertices of their corners, their numbers of corners, and their indices in the file."""

    ids: Ints
    counts: Ints
    face: Ints
    corner: Ints


class Geometry:
    """Converts prims of a stage."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._materials = Materials(stage)
        self._known: dict[tuple[str, ...], Instance | None] = {}

    def part(self, prim: Any) -> Instance | None:
        """Return the mesh of a prim and where it lies in the prim's frame; None, with a note, if it cannot be shown.

        Prims of instances share a mesh if they have the same materials.
        """
        from pxr import Tf

        origin = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        subsets = self._materials.subsets(prim)
        bound = [self._materials.bound(prim), *(self._materials.bound(subset.GetPrim()) for subset in subsets)]
        key = (str(origin.GetPath()), *(str(material.GetPath()) if material else "" for material in bound))
        if key not in self._known:
            try:
                self._known[key] = self._convert(prim, bound, subsets)
            except Tf.ErrorException:
                self._stage.damage(f"{prim.GetPath()} was left out: it has values of a wrong type")
                self._known[key] = None
            except GiError as error:
                if "unpacks to" in str(error) or self._stage.notes.strict:
                    raise
                self._stage.damage(
                    f"{prim.GetPath()} was left out: {str(error).removeprefix(f'{self._where(prim)}: ')[:200]}"
                )
                self._known[key] = None
        return self._known[key]

    def _where(self, prim: Any) -> str:
        return f"{self._stage.source}: {prim.GetPath()}"

    def _convert(self, prim: Any, bound: list[Any], subsets: list[Any]) -> Instance | None:
        """Return the mesh of a prim. Raises GiError if it cannot be shown."""
        from pxr import UsdGeom

        stage, where = self._stage, self._where(prim)
        double_sided = bool(UsdGeom.Gprim(prim).GetDoubleSidedAttr().Get(stage.time))
        if prim.IsA(UsdGeom.Points):
            raw_points, size = self._points(prim)
            scale = float(np.linalg.norm(stage.world_from_stage[:3, 0]))
            scene = points_scene(raw_points, size, prim.GetName(), where, stage.notes, stage.budget, scale)
            return scene.instances[0]
        # Collect the surfaces, and the texture coordinates that their textures read.
        surfaces = [self._materials.surface(material) for material in bound]
        names = list(dict.fromkeys(name for surface in surfaces if surface for name in surface.texcoord_names))
        if len(names) > 2:
            stage.note(f"{prim.GetPath()}: of {len(names)} sets of texture coordinates, two are used")
        materials = [
            self._materials.material(surface, tuple(names), double_sided) if surface else None for surface in surfaces
        ]
        colored = not surfaces[0] or any(surface.uses_display_color for surface in surfaces if surface)
        raw = self._mesh(prim, names, colored, subsets) if prim.IsA(UsdGeom.Mesh) else gprim_mesh(prim, stage)
        if raw is None:
            stage.note(f"{prim.GetPath()} was left out: {prim.GetTypeName()} is not supported")
            return None
        if colored and raw.colors is None and not materials[0]:
            materials[0] = self._plain(prim)
        raw.materials = [
            material or (clay() if raw.colors is None else Material(name="colours")) for material in materials
        ]
        return scene_from_raw(raw, prim.GetName(), where, stage.notes).instances[0]

    def _plain(self, prim: Any) -> Material:
        """Return the material of a prim without one and without colours of its own."""
        constant = primvar(prim, "displayColor", self._stage, 3)
        if constant is None or not len(constant.rows):
            return clay()
        red, green, blue = constant.rows[0].clip(0, 1).tolist()
        return Material(name="display colour", base_color=(red, green, blue, 1.0))

    def _points(self, prim: Any) -> tuple[RawPoints, float | None]:
        """Return the points of a UsdGeomPoints and their mean diameter, None if the file has no widths."""
        from pxr import UsdGeom

        points = UsdGeom.Points(prim)
        positions = rows(points.GetPointsAttr(), self._stage, 3)
        if positions is None:
            raise GiError(f"{self._where(prim)}: it has no points")
        widths = rows(points.GetWidthsAttr(), self._stage, 1)
        size = None if widths is None or not len(widths) else float(widths.mean())
        if size is not None and widths is not None and (widths != widths[0]).any():
            self._stage.note(f"{prim.GetPath()}: all points are shown with their mean width")
        normals = rows(points.GetNormalsAttr(), self._stage, 3)
        colors = primvar(prim, "displayColor", self._stage, 3)
        count = len(positions)
        linear = None if colors is None else widened(colors, count)
        return RawPoints(positions, linear, normals if normals is not None and len(normals) == count else None), size

    def _mesh(self, prim: Any, names: list[str], colored: bool, subsets: list[Any]) -> RawMesh:
        """Return the triangles of a UsdGeomMesh with the attributes that its materials need."""
        from pxr import UsdGeom

        stage, mesh, time = self._stage, UsdGeom.Mesh(prim), self._stage.time
        positions = rows(mesh.GetPointsAttr(), stage, 3)
        counts, ids = whole(mesh.GetFaceVertexCountsAttr(), stage), whole(mesh.GetFaceVertexIndicesAttr(), stage)
        if positions is None or (counts < 0).any() or counts.sum() != len(ids):
            raise GiError(f"{self._where(prim)}: its faces do not fit their corners")
        stage.budget.take(10 * ids.nbytes, self._where(prim))
        topology = _without_holes(ids, counts, whole(mesh.GetHoleIndicesAttr(), stage))
        material_of_face = self._material_of_face(prim, subsets, len(counts))[topology.face]
        # Collect the attributes.
        normals = self._normals(prim, mesh)
        if normals is None and mesh.GetSubdivisionSchemeAttr().Get(time) != UsdGeom.Tokens.none:
            normals = Values(_smooth_normals(positions, topology), UsdGeom.Tokens.vertex)
        if mesh.GetSubdivisionSchemeAttr().Get(time) != UsdGeom.Tokens.none:
            stage.note("subdivision surfaces are shown as their control meshes")
        found = {
            "normals": normals,
            "texcoords": self._texcoords(prim, names, 0),
            "texcoords1": self._texcoords(prim, names, 1),
            "colors": primvar(prim, "displayColor", stage, 3) if colored else None,
        }
        if found["colors"] is not None and found["colors"].interpolation == UsdGeom.Tokens.constant:
            found["colors"] = found["colors"] if subsets else None
        placed = attributes_of(found, len(positions), len(counts), len(ids), stage, str(prim.GetPath()))
        raw = polygon_mesh(
            positions, topology.ids, topology.counts, self._where(prim), stage.notes,
            vertices=placed[0], faces=placed[1].at(topology.face), corners=placed[2].at(topology.corner),
            material_of_face=material_of_face if subsets else None,
        )  # fmt: skip
        if mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
            raw = replace(raw, triangles=raw.triangles[:, ::-1])
        return raw

    def _normals(self, prim: Any, mesh: Any) -> Values | None:
        """Return the normals of a mesh: the primvar comes before the attribute."""
        of_primvar = primvar(prim, "normals", self._stage, 3)
        if of_primvar is not None:
            return of_primvar
        values = rows(mesh.GetNormalsAttr(), self._stage, 3)
        return None if values is None or not len(values) else Values(values, mesh.GetNormalsInterpolation())

    def _texcoords(self, prim: Any, names: list[str], which: int) -> Values | None:
        """Return the texture coordinates of a set; v then points down."""
        found = primvar(prim, names[which], self._stage, 2) if which < len(names) else None
        return None if found is None else found._replace(rows=found.rows * (1.0, -1.0) + (0.0, 1.0))

    def _material_of_face(self, prim: Any, subsets: list[Any], face_count: int) -> NDArray[np.int64]:
        """Return the index of each face's material: 0 for that of the whole mesh, then those of the subsets."""
        result = np.zeros(face_count, np.int64)
        for k, subset in enumerate(subsets):
            faces = whole(subset.GetIndicesAttr(), self._stage)
            right = (faces >= 0) & (faces < face_count)
            if not right.all():
                self._stage.damage(f"{subset.GetPrim().GetPath()}: faces that do not exist: {np.count_nonzero(~right)}")
            result[faces[right]] = k + 1
        return result


def _without_holes(ids: Ints, counts: Ints, holes: Ints) -> _Topology:
    """Return the faces that are no holes."""
    kept = np.ones(len(counts), np.bool_)
    kept[holes[(holes >= 0) & (holes < len(counts))]] = False
    corner = np.repeat(kept, counts)
    return _Topology(ids[corner], counts[kept], np.flatnonzero(kept), np.flatnonzero(corner))


def _smooth_normals(positions: Floats, topology: _Topology) -> Floats:
    """Return the sum of the cross products of the edges at each vertex, (n, 3), zero where there are none."""
    ids, counts = topology.ids, topology.counts
    if not len(ids) or ids.min() < 0 or ids.max() >= len(positions):
        return np.zeros_like(positions)
    start = np.repeat(np.cumsum(counts) - counts, counts)
    place, count = np.arange(len(ids)) - start, np.repeat(counts, counts)
    here = positions[ids]
    after, before = (positions[ids[start + (place + step) % count]] - here for step in (1, -1))
    with np.errstate(over="ignore", invalid="ignore"):
        crosses = np.cross(after, before)
    return np.stack([np.bincount(ids, crosses[:, axis], len(positions)) for axis in range(3)], 1)
