"""Builds a binary glTF 2.0 file (.glb): the JSON's arrays, the binary chunk, and the header (sections 3.6 and 4.4)."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Hashable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...version import __version__

Json = dict[str, Any]

_COMPONENTS = {np.dtype("<f4"): 5126, np.dtype("<u4"): 5125}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class Glb:
    """The JSON of a file and its binary chunk. Elements that several others use are added once."""

    def __init__(self) -> None:
        self.root: Json = {"asset": {"version": "2.0", "generator": f"wgpu_gi {__version__}"}}
        self._data = bytearray()
        self._index_of: dict[tuple[str, Hashable], int] = {}
        self._extensions: set[str] = set()

    def add(self, key: str, element: Json) -> int:
        """Append to a top-level array; return the index."""
        self.root.setdefault(key, []).append(element)
        return len(self.root[key]) - 1

    def once(self, key: str, identity: Hashable, make: Callable[[], Json]) -> int:
        """Return the index in a top-level array of the element with `identity`, made and appended if it is new."""
        if (key, identity) not in self._index_of:
            self._index_of[key, identity] = self.add(key, make())
        return self._index_of[key, identity]

    def view(self, data: bytes) -> int:
        """Append bytes to the binary chunk, aligned to four; return the index of their buffer view."""
        self._data += b"\0" * (-len(self._data) % 4)
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(data)}
        self._data += data
        return self.add("bufferViews", view)

    def accessor(self, values: ArrayLike, dtype: str, **keys: object) -> int:
        """Append an array (n,) or (n, k) as "<f4" or "<u4"; return the index of its accessor, which also has `keys`."""
        array = np.ascontiguousarray(values, np.dtype(dtype))
        width = 1 if array.ndim == 1 else array.shape[1]
        kind = {"componentType": _COMPONENTS[array.dtype], "count": len(array), "type": _TYPES[width]}
        return self.add("accessors", {"bufferView": self.view(array.tobytes()), **kind, **keys})

    def node(self, name: str, matrix: ArrayLike, content: Json) -> int:
        """Append a node with a (4, 4) matrix; return its index."""
        columns = np.asarray(matrix, np.float64).T.ravel().tolist()
        return self.add("nodes", {"name": name, "matrix": columns, **content})

    def extend(self, owner: Json, name: str, content: Json) -> Json:
        """Add an extension to an object, unless it has that already; return the extension's object."""
        self._extensions.add(name)
        extension: Json = owner.setdefault("extensions", {}).setdefault(name, content)
        return extension

    def to_bytes(self) -> bytes:
        """Return the file; all numbers must be finite."""
        root = dict(self.root)
        if self._extensions:
            root["extensionsUsed"] = sorted(self._extensions)
        if self._data:
            root["buffers"] = [{"byteLength": len(self._data)}]
        # Chunks are padded to multiples of four bytes: JSON with spaces, binary data with zeros.
        text = json.dumps(root, separators=(",", ":"), allow_nan=False).encode()
        data = bytes(self._data)
        chunks = [(b"JSON", text + b" " * (-len(text) % 4)), (b"BIN\0", data + b"\0" * (-len(data) % 4))]
        body = b"".join(struct.pack("<I", len(chunk)) + kind + chunk for kind, chunk in chunks if chunk)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body
