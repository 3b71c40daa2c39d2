"""Meshes of a glTF file: the triangle primitives of each mesh checked, cleaned and merged into one `Mesh`."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...float_limits import MAX_COORDINATE
from ..mesh_cleaning import has_area, used_vertices
from ..scene import Material, Mesh
from . import compression as gltf_compression
from .accessors import Accessors, Array, dequantise
from .document import Document
from .geometry import assemble, clean_attribute
from .json_object import JsonObject
from .materials import Materials, some
from .skins import apply_skin

_Vertices = dict[str, NDArray[np.float32]]  # keys: attribute names of glTF

_SKIN_BYTES = 12 * 8  # of the blended matrix of a vertex
_TRIANGLES = 4  # the lower primitive modes are points and lines

# The vertex attributes of a Mesh, each with the component counts that glTF allows and a neutral value. Primitives that
# lack the attribute get this value if others of the mesh have it.
_ATTRIBUTES: dict[str, tuple[tuple[int, ...], NDArray[np.float32]]] = {
    "POSITION": ((3,), np.zeros(3, np.float32)),
    "NORMAL": ((3,), np.zeros(3, np.float32)),
    "TANGENT": ((4,), np.zeros(4, np.float32)),
    "TEXCOORD_0": ((2,), np.zeros(2, np.float32)),
    "TEXCOORD_1": ((2,), np.zeros(2, np.float32)),
    "COLOR_0": ((3, 4), np.ones(4, np.float32)),
}

# Many primitives may share one accessor, so the size of a file does not bound its triangles. 2^27 triangles have
# 1.5 GiB of indices, more than a WebGPU buffer can hold.
_MAX_TRIANGLES = 1 << 27


@dataclass
class _Part:
    """Vertices and the triangles of all primitives of a mesh that share them."""

    vertices: _Vertices
    triangles: list[NDArray[np.uint32]] = field(default_factory=list)
    slots: list[NDArray[np.uint32]] = field(default_factory=list)  # each triangle's index into the mesh's materials


class Meshes:
    """The meshes of a document by index; each is read once and shared by its instances."""

    def __init__(self, document: Document, accessors: Accessors, materials: Materials) -> None:
        self._document = document
        self._accessors = accessors
        self._materials = materials
        self._descriptions = document.array("meshes")
        self._meshes: dict[Hashable, Mesh | None] = {}
        self._vertices_of_accessors: dict[Hashable, _Vertices] = {}
        self._index_count = 0
        self._without_area: dict[str, int] = {}

    def __len__(self) -> int:
        return len(self._descriptions)

    def name(self, index: int) -> str:
        """Return the name of mesh `index`, or else its place in the file."""
        return self._descriptions[index].text("name") or f"meshes[{index}]"

    def materials_of(self, indices: Iterable[int]) -> set[int | None]:
        """Return the indices of the materials that these meshes use; None is the default material."""
        return {self._material(p) for i in set(indices) for p in self._descriptions[i].objects("primitives")}

    def get(self, index: int, skin: int | None, joints: NDArray[np.float64] | None) -> Mesh | None:
        """Return mesh `index`, posed by the joint matrices (k, 4, 4) of `skin` if it has one.

        None if it has no triangle with an area. Its materials must have been loaded.
        """
        if (index, skin) not in self._meshes:
            self._meshes[index, skin] = self._read(index, joints)
        return self._meshes[index, skin]

    def note_left_out(self) -> None:
        """Note how many degenerate triangles were left out."""
        count = sum(self._without_area.values())
        if count:
            names, s = some(list(self._without_area)), "s" * (count > 1)
            self._document.notes.add(f"{count} degenerate triangle{s} (no area) were left out, in {names}.")

    def _material(self, primitive: JsonObject) -> int | None:
        if "material" not in primitive:
            return None
        return primitive.index("material", len(self._materials), "materials")

    def _read(self, index: int, joints: NDArray[np.float64] | None) -> Mesh | None:
        """Return a mesh merged from its triangle primitives."""
        # Collect the triangles by the vertices that they share.
        parts: dict[Hashable, _Part] = {}
        slot_of_material: dict[int | None, int] = {}
        for number, primitive in enumerate(self._descriptions[index].objects("primitives")):
            mode = primitive.integer("mode", _TRIANGLES, high=6)
            if mode < _TRIANGLES:
                self._document.notes.add("Points and lines were left out; only triangles are shown.")
                continue
            if "POSITION" not in primitive.child("attributes"):
                self._document.notes.add(f"{primitive.where} was left out: it has no POSITION.")
                continue
            draco = self._draco(primitive)
            if draco is not None or joints is not None:
                part = parts[number] = _Part(self._vertices(primitive, draco, joints))
            else:
                key, vertices = self._shared_vertices(primitive)
                part = parts.setdefault(key, _Part(vertices))
            triangles = self._triangles(primitive, mode, draco, len(part.vertices["POSITION"]))
            slot = slot_of_material.setdefault(self._material(primitive), len(slot_of_material))
            part.triangles.append(triangles)
            part.slots.append(np.full(len(triangles), slot, np.uint32))
        # Clean and merge them.
        finished = [self._finish(index, part) for part in parts.values()]
        finished = [part for part in finished if len(part.triangles[0])]
        if not finished:
            self._document.notes.add(f"Mesh {self.name(index)[:60]!r} was left out: none of its triangles has an area.")
            return None
        return self._merge(index, finished, [self._materials.get(material) for material in slot_of_material])

    def _shared_vertices(self, primitive: JsonObject) -> tuple[Hashable, _Vertices]:
        """Return a key of the accessors of a primitive, and its vertices, read once for all primitives with the key."""
        attributes = primitive.child("attributes").raw
        key = tuple(repr(attributes.get(name)) for name in _ATTRIBUTES)
        if key not in self._vertices_of_accessors:
            self._vertices_of_accessors[key] = self._vertices(primitive, None, None)
        return key, self._vertices_of_accessors[key]

    def _draco(self, primitive: JsonObject) -> gltf_compression.DracoMesh | None:
        """Return the Draco mesh of a primitive; None without one, or if only the uncompressed data can be read."""
        extension = primitive.extension("KHR_draco_mesh_compression")
        if extension is None:
            return None
        attributes = primitive.child("attributes")
        position = self._accessors.describe(attributes.index("POSITION", len(self._accessors), "accessors"))
        if "bufferView" in position and not gltf_compression.has_draco():
            return None
        return self._accessors.draco_mesh(extension)

    def _attribute(self, primitive: JsonObject, name: str, draco: gltf_compression.DracoMesh | None) -> Array | None:
        """Return a dequantised vertex attribute; None if the primitive does not have it."""
        attributes = primitive.child("attributes")
        if name not in attributes:
            return None
        index = attributes.index(name, len(self._accessors), "accessors")
        if draco is not None and name in draco.attributes:
            return dequantise(self._accessors.describe(index), draco.attributes[name])
        return self._accessors.read(index)

    def _vertices(
        self, primitive: JsonObject, draco: gltf_compression.DracoMesh | None, joints: NDArray[np.float64] | None
    ) -> _Vertices:
        """Return the attributes of a primitive as float32 arrays of equal length, posed by `joints`."""
        found = {name: self._attribute(primitive, name, draco) for name in _ATTRIBUTES}
        arrays = {name: values for name, values in found.items() if values is not None}
        if "NORMAL" not in arrays:
            arrays.pop("TANGENT", None)  # tangents without normals are to be ignored (glTF 2.0, 3.7.2.1)
        count = len(arrays["POSITION"])
        for name, values in arrays.items():
            widths, _ = _ATTRIBUTES[name]
            if values.shape[1] not in widths:
                raise primitive.error(f"{name} must have {widths[-1]} components, not {values.shape[1]}")
            if len(values) != count:
                raise primitive.error(f"{name} has {len(values)} elements for {count} positions; the file is damaged")
        # Most attributes become float32 arrays of their own; four bytes a component bound them all.
        size = sum(4 * values.size for values in arrays.values())
        self._document.budget.take(size if joints is None else size + _SKIN_BYTES * count, primitive.where)
        vertices = {name: self._cleaned(primitive, name, values) for name, values in arrays.items()}
        if joints is not None:
            # Absurd weights give positions that are not finite; _finish raises an error for them.
            with np.errstate(over="ignore", invalid="ignore"):
                apply_skin(vertices, joints, primitive, lambda name: self._attribute(primitive, name, draco))
        return vertices

    def _cleaned(self, primitive: JsonObject, name: str, values: Array) -> NDArray[np.float32]:
        """Return an attribute in the form of a Mesh, with a note if some of its values are not finite."""
        cleaned, bad = clean_attribute(name, values)
        if bad:
            self._document.notes.add(f"{primitive.where}: {bad} values of {name} are not finite; they were left out.")
        return cleaned

    def _triangles(
        self, primitive: JsonObject, mode: int, draco: gltf_compression.DracoMesh | None, vertex_count: int
    ) -> NDArray[np.uint32]:
        """Return the triangles (m, 3) of a primitive, with every index checked against its vertices."""
        if draco is not None:
            indices, mode = draco.triangles.reshape(-1), _TRIANGLES  # Draco decodes every mode to a list
        elif "indices" in primitive:
            values = self._accessors.read(primitive.index("indices", len(self._accessors), "accessors"))
            if values.dtype.kind != "u" or values.shape[1] != 1:
                raise primitive.error("indices must be unsigned integers (SCALAR); the file is damaged")
            indices = values[:, 0]
        else:
            indices = np.arange(vertex_count, dtype=np.uint32)
        self._index_count += len(indices)
        if self._index_count > 3 * _MAX_TRIANGLES:
            raise primitive.error(f"the file has more than {_MAX_TRIANGLES} triangles; split it into smaller files")
        if len(indices) and int(indices.max()) >= vertex_count:
            raise primitive.error(f"index {indices.max()} is beyond its {vertex_count} vertices; the file is damaged")
        self._document.budget.take(4 * len(indices) * (1 if mode == _TRIANGLES else 3), primitive.where)
        if mode == _TRIANGLES and len(indices) % 3:
            self._document.notes.add(
                f"{primitive.where}: {len(indices)} is not a multiple of 3; {len(indices) % 3} indices were left out."
            )
        return assemble(indices.astype(np.uint32), mode)

    def _finish(self, index: int, part: _Part) -> _Part:
        """Return `part` with its triangles in one array, without degenerate triangles and unused vertices."""
        triangles, slots = np.concatenate(part.triangles), np.concatenate(part.slots)
        # Meshes may share one large vertex buffer: take the range that this one uses.
        first, last = (int(triangles.min()), int(triangles.max())) if len(triangles) else (0, -1)
        vertices = {name: values[first : last + 1] for name, values in part.vertices.items()}
        triangles = triangles - np.uint32(first)
        # Check its positions.
        positions = vertices["POSITION"]
        used = used_vertices(triangles, len(positions))
        in_range = np.abs(positions).max(axis=1) < MAX_COORDINATE  # false for NaN, too
        if not in_range[used].all():
            vertex = int(np.flatnonzero(used & ~in_range)[0])
            raise GiError(
                f"{self._document.path.name}: mesh {self.name(index)[:60]!r}: vertex {first + vertex} has the position "
                f"{positions[vertex].tolist()}; repair the file"
            )
        # Drop degenerate triangles, then unused vertices.
        kept = has_area(positions, triangles)
        dropped = len(kept) - int(np.count_nonzero(kept))
        if dropped:
            self._without_area[self.name(index)] = self._without_area.get(self.name(index), 0) + dropped
            triangles, slots = triangles[kept], slots[kept]
            used = used_vertices(triangles, len(positions))
        if not used.all():
            vertices = {name: values[used] for name, values in vertices.items()}
            triangles = (np.cumsum(used, dtype=np.uint32) - np.uint32(1))[triangles]
        return _Part(vertices, [triangles], [slots])

    def _merge(self, index: int, parts: list[_Part], materials: list[Material]) -> Mesh:
        """Return one mesh of all parts; parts without an attribute that others have get its neutral value."""
        counts = [len(part.vertices["POSITION"]) for part in parts]
        rows = sum(len(neutral) for name, (_, neutral) in _ATTRIBUTES.items() if any(name in p.vertices for p in parts))
        triangles = sum(len(part.triangles[0]) for part in parts)
        self._document.budget.take(4 * rows * sum(counts) + 16 * triangles, self._descriptions[index].where)
        starts = np.cumsum([0, *counts[:-1]]).astype(np.uint32)
        arrays: dict[str, NDArray[np.float32]] = {}
        for name, (_, neutral) in _ATTRIBUTES.items():
            if any(name in part.vertices for part in parts):
                absent = [np.broadcast_to(neutral, (count, len(neutral))) for count in counts]
                # Concatenation copies, so the mesh no longer refers to the bytes of the file.
                arrays[name] = np.concatenate([p.vertices.get(name, a) for p, a in zip(parts, absent, strict=True)])
        slots = np.concatenate([part.slots[0] for part in parts])
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
            name=self._descriptions[index].text("name"),
        )
