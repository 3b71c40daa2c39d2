"""Decodes compressed glTF geometry, Draco and meshopt, with optional packages (extra `gltf`)."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ..files.memory import MemoryBudget
from .json_object import JsonObject

_DRACO_VERTEX_BYTES = 48  # position, normal, tangent and texture coordinates as floats

# The highest compression of the meshopt vertex codec: one control byte for 4 byte channels of 256 vertices. A higher
# ratio means that the announced size is wrong.
_MESHOPT_MAX_RATIO = 1024


@dataclass
class DracoMesh:
    """A decoded Draco stream: triangles (m, 3) uint32 and vertex arrays (n, k) by the attribute names of glTF."""

    triangles: NDArray[np.uint32]
    attributes: dict[str, NDArray[Any]]


def has_draco() -> bool:
    """Tell whether the Draco decoder is installed."""
    return importlib.util.find_spec("DracoPy") is not None


def has_meshopt() -> bool:
    """Tell whether the meshopt decoder is installed."""
    return importlib.util.find_spec("meshoptimizer") is not None


def decode_draco(extension: JsonObject, data: memoryview, budget: MemoryBudget) -> DracoMesh:
    """Return the mesh in `data`; `extension` maps attribute names to ids in the stream. Raises GiError."""
    decoder = _import("DracoPy", "Draco", extension)
    # Compression has no bound: a flat grid of 90,000 vertices takes 453 bytes.
    vertices, faces = _draco_counts(extension, bytes(data[:32]))
    budget.take(_DRACO_VERTEX_BYTES * vertices + 12 * faces, extension.where)
    try:
        mesh = decoder.decode(bytes(data))
        found = {int(a["unique_id"]): np.asarray(a["data"]) for a in mesh.attributes}
        triangles = np.asarray(mesh.faces, np.uint32).reshape(-1, 3)
    except Exception as error:  # the native decoder's own types; all mean bad data
        raise extension.error(f"its Draco data cannot be decoded ({error})") from error
    names = extension.child("attributes")
    attributes = {}
    for name in names.raw:
        unique_id = names.integer(name)
        if unique_id not in found:
            raise names.error(f"{name[:40]!r} is not in the Draco data")
        attributes[name] = found[unique_id].reshape(len(found[unique_id]), -1)
    return DracoMesh(triangles, attributes)


def _draco_counts(extension: JsonObject, data: bytes) -> tuple[int, int]:
    """Return the numbers of vertices and faces in the header of a Draco mesh. Raises GiError.

    Google, "Draco Bitstream Specification" 2.2, sections 2 to 4: DRACO, version, encoder, method, flags; then for
    sequential connectivity (method 0) faces and points, for edgebreaker (1) its type, vertices and faces, all varints.
    """
    if len(data) < 12 or data[:5] != b"DRACO" or data[7] != 1 or data[8] > 1:
        raise extension.error("its data is not a Draco mesh")
    if data[5:7] != b"\2\2" or int.from_bytes(data[9:11], "little") & 0x8000:
        raise extension.error("its Draco data is not of version 2.2 without metadata; compress the file again")
    at, counts = 11 + data[8], []
    for _ in range(2):
        length = next((k for k, byte in enumerate(data[at : at + 5], 1) if byte < 128), 0)
        if length == 0:
            raise extension.error("the header of its Draco data is damaged")
        counts.append(sum((byte & 127) << 7 * k for k, byte in enumerate(data[at : at + length])))
        at += length
    return (counts[0], counts[1]) if data[8] else (counts[1], counts[0])


def decode_meshopt(extension: JsonObject, data: memoryview, budget: MemoryBudget) -> tuple[memoryview, int]:
    """Return the decoded bytes of a view with EXT_meshopt_compression, and their stride. Raises GiError."""
    # Check what the extension announces.
    decoder = _import("meshoptimizer", "meshopt", extension)
    stride, count = extension.integer("byteStride", low=1, high=256), extension.integer("count")
    mode = extension.choice("mode", {name: name for name in ("ATTRIBUTES", "TRIANGLES", "INDICES")})
    names = {"NONE": "", "OCTAHEDRAL": "oct", "QUATERNION": "quat", "EXPONENTIAL": "exp"}
    filter_name = extension.choice("filter", names, "NONE")
    if (mode == "ATTRIBUTES" and stride % 4) or (mode != "ATTRIBUTES" and stride not in (2, 4)):
        raise extension.error(f"byteStride {stride} does not suit mode {mode}")
    if (filter_name == "oct" and stride not in (4, 8)) or (filter_name == "quat" and stride != 8):
        raise extension.error(f"byteStride {stride} does not suit its filter")
    if mode == "TRIANGLES" and count % 3:
        raise extension.error(f"count {count} is not a multiple of three")
    if count * stride > len(data) * _MESHOPT_MAX_RATIO:
        raise extension.error(f"announces {count * stride} bytes from {len(data)}")
    budget.take(count * stride, extension.where)
    # Decode it.
    try:
        if mode == "ATTRIBUTES":
            # A void dtype keeps the decoder from guessing what the bytes are.
            decoded = decoder.decode_vertex_buffer(count, stride, bytes(data), np.dtype((np.void, stride)))
            if filter_name:
                decoded = getattr(decoder, f"decode_filter_{filter_name}")(decoded, count, stride)
        else:
            decode = decoder.decode_index_buffer if mode == "TRIANGLES" else decoder.decode_index_sequence
            decoded = decode(count, stride, bytes(data))
    except Exception as error:  # the native decoder's own types; all mean bad data
        raise extension.error(f"its meshopt data cannot be decoded ({error})") from error
    return memoryview(decoded.tobytes())[: count * stride], stride


def _import(module: str, what: str, extension: JsonObject) -> ModuleType:
    """Return a decoder. Raises GiError that tells how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise GiError(
            f"{extension.where}: its geometry is {what}-compressed and the decoder is not installed; "
            f"run: pip install {module}"
        ) from error
