"""A glTF 2.0 file: its GLB chunks, its JSON root, and the files beside it that it refers to."""

from __future__ import annotations

import base64
import binascii
import json
import os
import re
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

from ...errors import GiError
from ..files.memory import MemoryBudget
from ..files.notes import Notes
from ..files.read import path_inside, read_file
from .json_object import JsonObject

_CHUNK_JSON = 0x4E4F534A
_CHUNK_BIN = 0x004E4942

# Matches URIs with a scheme or a drive letter, and absolute paths.
_OUTSIDE = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:|[/\\]")

# Extensions that are implemented; a file that requires any other one is refused.
SUPPORTED_EXTENSIONS = {
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_transform",
}


class Document:
    """The JSON of a glTF file (`root`), its binary chunk or None, its budget, and the notes of the load."""

    def __init__(self, path: Path, budget: MemoryBudget, notes: Notes) -> None:
        self.path = path
        self.budget = budget
        self.notes = notes
        self._arrays: dict[str, list[JsonObject]] = {}
        data = read_file(path, "scene file")
        self.binary: memoryview | None = None
        if data[:4] == b"glTF":
            text, self.binary = _split_glb(path.name, data)
        elif path.suffix.lower() == ".glb":
            raise GiError(f"{path.name} is not a GLB file: it does not begin with 'glTF'; export or download it again")
        else:
            text = memoryview(data)
        self.root = _parse_json(path.name, text)
        self._check_version()
        self._check_extensions()

    def array(self, key: str) -> list[JsonObject]:
        """Return one of the top-level arrays ("nodes", "meshes", ...) as objects; empty if absent."""
        if key not in self._arrays:
            self._arrays[key] = self.named_objects(self.root.values(key), key)
        return self._arrays[key]

    def named_objects(self, elements: list[Any], key: str) -> list[JsonObject]:
        """Return the elements of the array `key` as objects whose errors tell their index and name."""
        objects = []
        for i, element in enumerate(elements):
            name = element.get("name") if isinstance(element, dict) else None
            label = f" {name[:40]!r}" if isinstance(name, str) and name else ""
            objects.append(JsonObject(element, f"{self.path.name}: {key}[{i}]{label}"))
        return objects

    def read_uri(self, owner: JsonObject) -> bytes:
        """Return the bytes of `owner`'s uri: a data URI, or a file inside the folder of the scene.

        Raises GiError for a path that leaves the folder, a broken data URI or an unreadable file, and FileNotFoundError
        with the rest of a sentence for a missing or empty file.
        """
        uri = owner.text("uri", None)
        if uri[:5].lower() == "data:":
            return _decode_data_uri(owner, uri)
        name = unquote(uri)
        target = None if _OUTSIDE.match(uri) or _OUTSIDE.match(name) else path_inside(self.path.parent, name)
        if target is None:
            raise owner.error(f"uri {uri[:80]!r} leaves the scene's folder; put the file there and correct the uri")
        # Unlike Path, os.path returns False for names that no file can have.
        if not os.path.isfile(target) or os.path.getsize(target) == 0:
            raise FileNotFoundError(f"file {name[:80]!r} is missing or empty")
        return read_file(target, f"file of {self.path.name}")

    def _check_version(self) -> None:
        if "asset" not in self.root:
            raise GiError(f"{self.path.name} is JSON but not glTF: it has no asset.version")
        asset = self.root.child("asset")
        for key in ("version", "minVersion"):
            version = asset.text(key, None if key == "version" else "2.0")
            if version.split(".")[0] != "2" or (key == "minVersion" and version != "2.0"):
                raise asset.error(f"{key} is {version[:20]!r}, only glTF 2.0 can be read; convert the file")

    def _check_extensions(self) -> None:
        lists = {key: self.root.values(key) for key in ("extensionsRequired", "extensionsUsed")}
        for key, entries in lists.items():
            if not all(isinstance(entry, str) for entry in entries):
                raise self.root.error(f"{key} must be a list of names")
        unknown = sorted(set(lists["extensionsRequired"]) - SUPPORTED_EXTENSIONS)
        if unknown:
            names = ", ".join(map(repr, unknown))
            raise GiError(f"{self.path.name} requires {names}, which are not supported; export without them")
        ignored = sorted(set(lists["extensionsUsed"]) - SUPPORTED_EXTENSIONS)
        if ignored:
            self.notes.add(f"Extensions that are not supported and were ignored: {', '.join(map(repr, ignored))}.")


def _split_glb(name: str, data: bytes) -> tuple[memoryview, memoryview | None]:
    """Return the JSON and the BIN chunk of a GLB file (glTF 2.0, section 4.4); other chunks are skipped."""
    if len(data) < 12:
        raise GiError(f"{name} is truncated: {len(data)} bytes are too few for a GLB header; download it again")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise GiError(f"{name} is GLB version {version}, only version 2 can be read; convert the file")
    if length > len(data):
        raise GiError(f"{name} is truncated: it announces {length} bytes and has {len(data)}; download it again")
    chunks: dict[int, memoryview] = {}
    view, offset = memoryview(data)[:length], 12
    while offset + 8 <= length:
        size, kind = struct.unpack_from("<II", view, offset)
        if offset + 8 + size > length:
            raise GiError(
                f"{name}: the chunk at byte {offset} announces {size} bytes, but {length - offset - 8} remain; "
                "the file is damaged"
            )
        chunks.setdefault(kind, view[offset + 8 : offset + 8 + size])
        offset += 8 + size
    if _CHUNK_JSON not in chunks:
        raise GiError(f"{name} has no JSON chunk; the file is damaged")
    return chunks[_CHUNK_JSON], chunks.get(_CHUNK_BIN)


def _parse_json(name: str, text: memoryview) -> JsonObject:
    try:
        value = json.loads(bytes(text).decode("utf-8-sig").rstrip("\0"))
    except (ValueError, RecursionError) as error:
        raise GiError(f"{name} is not valid JSON ({error}); the file is damaged or not glTF") from error
    if not isinstance(value, dict):
        raise GiError(f"{name} is JSON but not glTF: its top level is not an object")
    return JsonObject(value, f"{name}: root")


def _decode_data_uri(owner: JsonObject, uri: str) -> bytes:
    """Return the payload of a base64 or percent-encoded data URI."""
    header, comma, payload = uri.partition(",")
    if not comma:
        raise owner.error("its data URI has no comma; the file is damaged")
    try:
        raw = unquote_to_bytes(payload)
        return base64.b64decode(raw, validate=True) if header.lower().endswith(";base64") else raw
    except (binascii.Error, ValueError) as error:
        raise owner.error(f"its data URI is not valid base64 ({error}); the file is damaged") from error
