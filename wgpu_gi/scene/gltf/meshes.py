"""Meshes of a glTF file: the triangle primitives of each mesh checked, cleaned and merged into one `Mesh`.

Each primitive of points becomes a `Mesh` of its own, of discs or spheres; lines are left out.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...float_limits import MAX_COORDINATE
from ..files.points import points_scene
from ..files.raw_mesh import RawPoints
from ..mesh_cleaning import has_area, used_vertices
from ..scene import Material, Mesh
from . import compression as gltf_compression
from .accessors import Accessors
from .deformed_meshes import deformed_points, merged_skin, merged_targets, shown_points
from .document import Document
from .geometry import assemble
from .json_object import JsonObject
from .materials import Materials, some
from .morphs import Weights, rest_weights, target_count, target_names
from .vertices import ATTRIBUTES, Pose, VertexReader, Vertices

_POINTS, _TRIANGLES = 0, 4  # the primitive modes between are lines

PlacedMesh = tuple[Mesh, NDArray[np.float64]]  # a mesh and the matrix that places it in its glTF mesh

# Many primitives may share one accessor, so the size of a file does not bound its triangles. 2^27 triangles have
# 1.5 GiB of indices, more than a WebGPU buffer can hold.
_MAX_TRIANGLES = 1 << 27


@dataclass
class _Part:
    """Vertices and the triangles of all primitives of a mesh that share them."""

    vertices: Vertices
    is_baked: bool
    triangles: list[NDArray[np.uint32]] = field(default_factory=list)
    slots: list[NDArray[np.uint32]] = field(default_factory=list)  # each triangle's index into the mesh's materials


class Meshes:
    """The meshes of a document by index; each is read once for all instances in the same pose."""

    def __init__(
        self, document: Document, accessors: Accessors, materials: Materials, point_size: float | None
    ) -> None:
        self._document = document
        self._accessors = accessors
        self._materials = materials
        self._reader = VertexReader(document, accessors)
        self._descriptions = document.array("meshes")
        self._point_size = point_size
        self._meshes: dict[tuple[int, Pose], list[PlacedMesh]] = {}
        self._index_count = 0
        self._without_area: dict[str, int] = {}

    def __len__(self) -> int:
        return len(self._descriptions)

    def name(self, index: int) -> str:
        """Return the name of mesh `index`, or else its place in the file."""
        return self._descriptions[index].text("name") or f"meshes[{index}]"

    def weights(self, node: JsonObject, index: int) -> Weights:
        """Return the morph weights of mesh `index` at rest, as a node shows it."""
        return rest_weights(node, self._descriptions[index])

    def target_count(self, index: int) -> int:
        """Return the number of morph targets of mesh `index`."""
        return target_count(self._descriptions[index])

    def materials_of(self, indices: Iterable[int]) -> set[int | None]:
        """Return the indices of the materials that these meshes use; None is the default material."""
        return {self._material(p) for i in set(indices) for p in self._descriptions[i].objects("primitives")}

    def get(self, index: int, pose: Pose) -> list[PlacedMesh]:
        """Return mesh `index` in a pose: its triangles, and its points. Its materials must have been loaded.

        Raises SkinDamage for a skin that cannot be applied.
        """
        if (index, pose) not in self._meshes:
            self._meshes[index, pose] = self._read(index, pose)
        return self._meshes[index, pose]

    def note_left_out(self) -> None:
        """Note how many degenerate triangles were left out."""
        count = sum(self._without_area.values())
        if count:
            names, s = some(list(self._without_area)), "s" * (count > 1)
            self._document.notes.add(f"{count} degenerate triangle{s} (no area) were left out, in {names}.")

    def _material(self, primitive: JsonObject) -> int | None:
        return primitive.optional_index("material", len(self._materials), "materials")

    def _read(self, index: int, pose: Pose) -> list[PlacedMesh]:
        """Return a mesh merged from the triangle primitives, and one for each primitive of points."""
        # Collect the triangles by the vertices that they share.
        parts: dict[Hashable, _Part] = {}
        slot_of_material: dict[int | None, int] = {}
        placed: list[PlacedMesh] = []
        for number, primitive in enumerate(self._descriptions[index].objects("primitives")):
            with self._document.leaving_out("the primitive"):
                mode = primitive.integer("mode", _TRIANGLES, high=6)
                if _POINTS < mode < _TRIANGLES:
                    self._document.notes.add("Lines were left out; only triangles and points are shown.")
                elif "POSITION" not in primitive.child("attributes"):
                    raise primitive.error("it has no POSITION")
                elif mode == _POINTS:
                    placed.append(self._points(primitive, pose))
                else:
                    self._add(parts, slot_of_material, number, primitive, mode, pose)
        # Clean and merge them.
        finished = [self._finish(index, part) for part in parts.values()]
        finished = [part for part in finished if len(part.triangles[0])]
        if finished:
            materials = [self._materials.get(material) for material in slot_of_material]
            placed.insert(0, (self._merge(index, finished, materials, pose), np.eye(4)))
        if not placed:
            self._document.notes.add(f"Mesh {self.name(index)[:60]!r} was left out: it has no triangle with an area.")
        return placed

    def _points(self, primitive: JsonObject, pose: Pose) -> PlacedMesh:
        """Return a primitive of points as discs or spheres. Raises Damage if no point is finite."""
        vertices = self._reader.read(primitive, None, pose)
        if not np.isfinite(vertices["POSITION"]).all(axis=1).any():
            raise primitive.error("none of its points is finite")
        if not pose.is_baked:
            vertices = shown_points(vertices)
        positions, colors, normals = (vertices.get(name) for name in ("POSITION", "COLOR_0", "NORMAL"))
        assert positions is not None, "a primitive without positions is left out"
        self._document.budget.take(8 * 10 * len(positions), primitive.where)
        doubled = (None if values is None else values.astype(np.float64) for values in (colors, normals))
        points = RawPoints(positions.astype(np.float64), *doubled)
        shapes = points_scene(
            points, self._point_size, "", primitive.where, self._document.notes, self._document.budget
        ).instances[0]
        material = self._materials.get(self._material(primitive))
        if max(material.emission) > 0.0:
            self._document.notes.add("Points do not emit light; the emission of their materials was left out.")
            material = self._materials.copy_for_points(self._material(primitive))
        shapes.mesh.materials = [material]
        if not pose.is_baked:
            return deformed_points(shapes, vertices, pose.targets), np.eye(4)
        return shapes.mesh, shapes.world_from_local

    def _add(
        self,
        parts: dict[Hashable, _Part],
        slot_of_material: dict[int | None, int],
        number: int,
        primitive: JsonObject,
        mode: int,
        pose: Pose,
    ) -> None:
        """Add the triangles of a primitive, the mesh's `number`-th, to the part that has its vertices."""
        draco = self._reader.draco(primitive)
        key: Hashable = number
        if draco is not None or pose.joints is not None or not pose.is_baked:
            vertices = self._reader.read(primitive, draco, pose)
        else:
            key, vertices = self._reader.shared(primitive, pose)
        triangles = self._triangles(primitive, mode, draco, len(vertices["POSITION"]))
        slot = slot_of_material.setdefault(self._material(primitive), len(slot_of_material))
        part = parts.setdefault(key, _Part(vertices, pose.is_baked))
        part.triangles.append(triangles)
        part.slots.append(np.full(len(triangles), slot, np.uint32))

    def _triangles(
        self, primitive: JsonObject, mode: int, draco: gltf_compression.DracoMesh | None, vertex_count: int
    ) -> NDArray[np.uint32]:
        """Return the triangles (m, 3) of a primitive, with every index checked against its vertices."""
        if draco is not None:
            indices, mode = draco.triangles.reshape(-1), _TRIANGLES  # Draco decodes every mode to a list
        elif "indices" in primitive:
            values = self._accessors.read(primitive.index("indices", len(self._accessors), "accessors"))
            if values.dtype.kind != "u" or values.shape[1] != 1:
                raise primitive.error("indices must be unsigned integers (SCALAR)")
            indices = values[:, 0]
        else:
            indices = np.arange(vertex_count, dtype=np.uint32)
        self._index_count += len(indices)
        if self._index_count > 3 * _MAX_TRIANGLES:
            path = self._document.path.name
            raise GiError(f"{path} has more than {_MAX_TRIANGLES} triangles; split it into smaller files")
        self._document.budget.take(4 * len(indices) * (1 if mode == _TRIANGLES else 3), primitive.where)
        if mode == _TRIANGLES and len(indices) % 3:
            primitive.damage(f"{len(indices)} is not a multiple of 3; {len(indices) % 3} indices were left out")
        triangles = assemble(indices.astype(np.uint32), mode)
        if len(triangles) and int(triangles.max()) >= vertex_count:
            sound = (triangles < vertex_count).all(axis=1)
            left_out = f"{np.count_nonzero(~sound)} of {len(triangles)} triangles were left out"
            primitive.damage(f"index {triangles.max()} is beyond its {vertex_count} vertices; {left_out}")
            triangles = triangles[sound]
        return triangles

    def _finish(self, index: int, part: _Part) -> _Part:
        """Return `part` with its triangles in one array, without degenerate triangles and unused vertices."""
        triangles, slots = np.concatenate(part.triangles), np.concatenate(part.slots)
        # Meshes may share one large vertex buffer: take the range that this one uses.
        first, last = (int(triangles.min()), int(triangles.max())) if len(triangles) else (0, -1)
        vertices = {name: values[first : last + 1] for name, values in part.vertices.items()}
        triangles = triangles - np.uint32(first)
        # Drop triangles with a corner that is not finite.
        positions = vertices["POSITION"]
        in_range = np.abs(positions).max(axis=1) < MAX_COORDINATE  # false for NaN, too
        used = used_vertices(triangles, len(positions))
        if not in_range[used].all():
            vertex = int(np.flatnonzero(used & ~in_range)[0])
            sound = in_range[triangles].all(axis=1)
            self._document.notes.damage(
                f"{self._document.path.name}: mesh {self.name(index)[:60]!r}: vertex {first + vertex} has the position "
                f"{positions[vertex].tolist()}; {np.count_nonzero(~sound)} of {len(sound)} triangles were left out."
            )
            triangles, slots = triangles[sound], slots[sound]
            used = used_vertices(triangles, len(positions))
        # Drop degenerate triangles, then unused vertices. A pose may give an area to what is flat in the bind pose.
        kept = has_area(positions, triangles) if part.is_baked else _has_three_corners(triangles)
        dropped = len(kept) - int(np.count_nonzero(kept))
        if dropped:
            self._without_area[self.name(index)] = self._without_area.get(self.name(index), 0) + dropped
            triangles, slots = triangles[kept], slots[kept]
            used = used_vertices(triangles, len(positions))
        if not used.all():
            vertices = {name: values[used] for name, values in vertices.items()}
            triangles = (np.cumsum(used, dtype=np.uint32) - np.uint32(1))[triangles]
        return _Part(vertices, part.is_baked, [triangles], [slots])

    def _merge(self, index: int, parts: list[_Part], materials: list[Material], pose: Pose) -> Mesh:
        """Return one mesh of all parts; parts without an attribute that others have get its neutral value."""
        counts = [len(part.vertices["POSITION"]) for part in parts]
        rows = sum(len(neutral) for name, (_, neutral) in ATTRIBUTES.items() if any(name in p.vertices for p in parts))
        triangles = sum(len(part.triangles[0]) for part in parts)
        self._document.budget.take(4 * rows * sum(counts) + 16 * triangles, self._descriptions[index].where)
        starts = np.cumsum([0, *counts[:-1]]).astype(np.uint32)
        arrays: dict[str, NDArray[np.float32]] = {}
        for name, (_, neutral) in ATTRIBUTES.items():
            if any(name in part.vertices for part in parts):
                absent = [np.broadcast_to(neutral, (count, len(neutral))) for count in counts]
                # Concatenation copies, so the mesh no longer refers to the bytes of the file.
                arrays[name] = np.concatenate([p.vertices.get(name, a) for p, a in zip(parts, absent, strict=True)])
        slots = np.concatenate([part.slots[0] for part in parts])
        description = self._descriptions[index]
        return Mesh(
            positions=arrays["POSITION"],
            triangles=np.concatenate([part.triangles[0] + start for part, start in zip(parts, starts, strict=True)]),
            materials=materials,
            material_of_triangle=slots if len(materials) > 1 else None,
            normals=arrays.get("NORMAL"),
            tangents=arrays.get("TANGENT"),
            texcoords0=arrays.get("TEXCOORD_0"),
            texcoords1=arrays.get("TEXCOORD_1"),
            colors=arrays.get("COLOR_0"),
            name=description.text("name"),
            skin=merged_skin([part.vertices for part in parts]),
            morph_targets=merged_targets([part.vertices for part in parts], pose.targets, target_names(description)),
        )


def _has_three_corners(triangles: NDArray[np.uint32]) -> NDArray[np.bool_]:
    """Tell for each triangle (m, 3) whether its corners are different vertices."""
    a, b, c = triangles.T
    differ: NDArray[np.bool_] = (a != b) & (b != c) & (c != a)
    return differ
