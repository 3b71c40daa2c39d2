"""glTF buffers, buffer views and accessors as numpy arrays, without copying where possible (glTF 2.0, section 3.6)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from . import compression as gltf_compression
from .document import Document
from .json_object import JsonObject

Array = NDArray[Any]

_INDEX_TYPES: dict[int, np.dtype[Any]] = {5121: np.dtype("u1"), 5123: np.dtype("<u2"), 5125: np.dtype("<u4")}
_COMPONENT_TYPES = _INDEX_TYPES | {5120: np.dtype("i1"), 5122: np.dtype("<i2"), 5126: np.dtype("<f4")}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}

# An accessor without a buffer view is all zeros, so its count is not bounded by data. Real files use that for sparse
# morph targets; 64 MiB (5 million positions) is far more than those need, and harmless to allocate.
_MAX_ZERO_BYTES = 64 << 20


class Accessors:
    """Reads the accessors of a document, and checks every count and offset against the size of the data."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._budget = document.budget
        self._accessors = document.array("accessors")
        self._views = document.array("bufferViews")
        self._buffers = document.array("buffers")
        self._data_of_buffer: dict[int, memoryview] = {}
        self._data_of_view: dict[int, tuple[memoryview, int]] = {}
        self._array_of_accessor: dict[int, Array] = {}

    def __len__(self) -> int:
        return len(self._accessors)

    def describe(self, index: int) -> JsonObject:
        """Return the JSON of accessor `index`."""
        return self._accessors[index]

    def read(self, index: int) -> Array:
        """Return accessor `index` as (count, components): float32 if it is normalized, else its component type.

        The array may be a read-only view of the file. Raises Damage for an accessor without a readable description or
        data, and GiError for one that reaches past its data.
        """
        if index not in self._array_of_accessor:
            accessor = self._accessors[index]
            values = self._raw(accessor)
            if accessor.flag("normalized") and values.dtype.kind != "f":
                self._budget.take(4 * values.size, accessor.where)
            self._array_of_accessor[index] = dequantise(accessor, values)
        return self._array_of_accessor[index]

    def view(self, index: int) -> tuple[memoryview, int]:
        """Return the bytes of buffer view `index`, decompressed, and its stride (0: tightly packed)."""
        if index not in self._data_of_view:
            view = self._views[index]
            meshopt = view.extension("EXT_meshopt_compression") or view.extension("KHR_meshopt_compression")
            if meshopt and (gltf_compression.has_meshopt() or not self._has_plain_data(view)):
                data, stride = gltf_compression.decode_meshopt(meshopt, self._slice(meshopt), self._budget)
            else:
                data, stride = self._slice(view), view.integer("byteStride", 0, high=1 << 16)
            self._data_of_view[index] = data, stride
        return self._data_of_view[index]

    def draco_mesh(self, extension: JsonObject) -> gltf_compression.DracoMesh:
        """Return the decoded mesh that a KHR_draco_mesh_compression extension points to."""
        return gltf_compression.decode_draco(extension, self.view(self.view_index(extension))[0], self._budget)

    def view_index(self, owner: JsonObject) -> int:
        """Return the index under `owner`'s key bufferView."""
        return owner.index("bufferView", len(self._views), "bufferViews")

    def _raw(self, accessor: JsonObject) -> Array:
        """Return the elements of an accessor in its component type, with sparse values inserted."""
        shape = accessor.integer("count"), accessor.choice("type", _COMPONENTS)
        dtype = accessor.choice("componentType", _COMPONENT_TYPES)
        if "bufferView" in accessor:
            values = self._elements(accessor, accessor, shape, dtype)
        elif (size := shape[0] * shape[1] * dtype.itemsize) <= _MAX_ZERO_BYTES:
            self._budget.take(size, accessor.where)
            values = np.zeros(shape, dtype)
        else:
            raise accessor.fatal(f"count {shape[0]} is not backed by any data")
        return self._with_sparse(accessor, values) if "sparse" in accessor else values

    def _with_sparse(self, accessor: JsonObject, base: Array) -> Array:
        """Return a copy of `base` with the accessor's sparse values inserted."""
        sparse = accessor.child("sparse")
        count = sparse.integer("count", high=len(base))
        places, replacements = sparse.child("indices"), sparse.child("values")
        dtype = places.choice("componentType", _INDEX_TYPES)
        indices = self._elements(accessor, places, (count, 1), dtype)[:, 0]
        if count and int(indices.max()) >= len(base):
            raise places.error(f"index {indices.max()} is beyond the {len(base)} elements")
        self._budget.take(base.nbytes, accessor.where)
        values = base.copy()
        values[indices] = self._elements(accessor, replacements, (count, base.shape[1]), base.dtype)
        return values

    def _elements(self, accessor: JsonObject, place: JsonObject, shape: tuple[int, int], dtype: np.dtype[Any]) -> Array:
        """Return a strided view of the buffer view that `place`, the accessor or a part of it, refers to."""
        index = self.view_index(place)
        data, stride = self.view(index)
        size = shape[1] * dtype.itemsize
        if shape[0] == 0:
            return np.zeros(shape, dtype)
        if 0 < stride < size:
            raise self._views[index].error(f"byteStride {stride} is less than one element of {accessor.where}")
        stride = stride or size
        offset = place.integer("byteOffset", 0)
        needed = offset + stride * (shape[0] - 1) + size
        if needed > len(data):
            raise place.fatal(f"reads past the end of bufferView {index} (needs {needed} bytes, has {len(data)})")
        return np.ndarray(shape, dtype, data, offset, (stride, dtype.itemsize))

    def _slice(self, view: JsonObject) -> memoryview:
        """Return the bytes of the buffer that a buffer view, or its compression extension, covers."""
        index = view.index("buffer", len(self._buffers), "buffers")
        data = self._buffer(index)
        offset, length = view.integer("byteOffset", 0), view.integer("byteLength")
        if offset + length > len(data):
            raise view.fatal(f"reads past the end of buffer {index} (needs {offset + length} bytes, has {len(data)})")
        return data[offset : offset + length]

    def _buffer(self, index: int) -> memoryview:
        """Return the bytes of a buffer: the GLB chunk, a file beside the scene, or a data URI."""
        if index not in self._data_of_buffer:
            buffer = self._buffers[index]
            if "uri" in buffer:
                data = memoryview(self._document.read_uri(buffer))
            elif index == 0 and self._document.binary is not None:
                data = self._document.binary
            else:
                raise buffer.error("it has no data (neither a uri nor a GLB chunk)")
            length = buffer.integer("byteLength", len(data))
            if length > len(data):
                raise GiError(
                    f"{buffer.where}: byteLength is {length}, but its data has {len(data)} bytes; the file is truncated"
                )
            self._data_of_buffer[index] = data[:length]
        return self._data_of_buffer[index]

    def _has_plain_data(self, view: JsonObject) -> bool:
        """Tell whether a compressed view also has uncompressed data, for readers without the decoder."""
        return "uri" in self._buffers[view.index("buffer", len(self._buffers), "buffers")]


def dequantise(accessor: JsonObject, values: Array) -> Array:
    """Return integers of a normalized accessor as float32 in [-1, 1] or [0, 1] (glTF 2.0, 3.6.2.2); else `values`."""
    if not accessor.flag("normalized") or values.dtype.kind == "f":
        return values
    scaled = values.astype(np.float32) / np.float32(np.iinfo(values.dtype).max)
    return np.maximum(scaled, np.float32(-1.0)) if values.dtype.kind == "i" else scaled
