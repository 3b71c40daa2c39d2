"""A glTF 2.0 file: its GLB chunks, its JSON root, and the files beside it that it refers to."""

from __future__ import annotations

import base64
import binascii
import json
import os
import re
import struct
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

from ...errors import GiError
from ..files.memory import MemoryBudget
from ..files.notes import Notes
from ..files.read import path_inside, read_file
from .json_object import Damage, JsonObject

_CHUNK_JSON = 0x4E4F534A
_CHUNK_BIN = 0x004E4942

# Matches URIs with a scheme or a drive letter, and absolute paths.
_OUTSIDE = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:|[/\\]")

# base64 has two alphabets; line breaks and blanks mean nothing in it.
_BASE64 = bytes.maketrans(b"-_", b"+/")
_WHITESPACE = b" \t\r\n\f"

# Extensions that are implemented; a file that uses or requires other ones is shown without them, with a note.
SUPPORTED_EXTENSIONS = {
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
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
        elif path.suffix.lower() == ".glb" and not data.lstrip().startswith(b"{"):
            raise GiError(f"{path.name} is not a GLB file: it does not begin with 'glTF'; export or download it again")
        else:
            text = memoryview(data)
        self.root = _parse_json(path.name, text, notes)
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
            objects.append(JsonObject(element, f"{self.path.name}: {key}[{i}]{label}", self.notes))
        return objects

    def read_uri(self, owner: JsonObject) -> bytes:
        """Return the bytes of `owner`'s uri: a data URI, or a file inside the folder of the scene.

        Raises Damage for a path that leaves the folder, a broken data URI and a missing or empty file.
        """
        uri = owner.text("uri", None)
        if uri[:5].lower() == "data:":
            return _decode_data_uri(owner, uri)
        # Some exporters do not escape the names of files; some systems store accents decomposed.
        names = [unquote(uri), uri]
        names += [unicodedata.normalize(form, unquote(uri)) for form in ("NFC", "NFD")]
        targets = [None if _OUTSIDE.match(name) else path_inside(self.path.parent, name) for name in names]
        if targets[0] is None:
            raise owner.error(f"uri {uri[:80]!r} leaves the scene's folder; put the file there and correct the uri")
        for target in targets:
            # Unlike Path, os.path returns False for names that no file can have.
            if target is not None and os.path.isfile(target) and os.path.getsize(target):
                return read_file(target, f"file of {self.path.name}")
        raise owner.error(f"file {names[0][:80]!r} is missing or empty; put it beside the scene")

    @contextmanager
    def leaving_out(self, part: str) -> Iterator[None]:
        """Turn Damage into a note that `part`, the subject of a sentence, was left out."""
        try:
            yield
        except Damage as error:
            self.notes.damage(f"{error}; {part} was left out.")

    def _check_version(self) -> None:
        asset = self.root.child("asset")
        for key in ("version", "minVersion"):
            version = asset.raw.get(key, "2.0" if key == "minVersion" else None)
            if isinstance(version, int | float) and version == 2:
                asset.damage(f"{key} must be the text '2.0', not a number")
                version = "2.0"
            if not isinstance(version, str) or not version:
                raise GiError(f"{self.path.name} is JSON but not glTF: it has no asset.version")
            if version.split(".")[0] != "2" or (key == "minVersion" and version != "2.0"):
                raise GiError(f"{asset.where}: {key} is {version[:20]!r}, only glTF 2.0 can be read; convert the file")

    def _check_extensions(self) -> None:
        used, required = (self._names(key) - SUPPORTED_EXTENSIONS for key in ("extensionsUsed", "extensionsRequired"))
        # A material is approximated without its extensions; other extensions may hold what is to be shown.
        surfaces = {name for name in required if name.startswith(("KHR_materials_", "EXT_materials_"))}
        for names, note in ((required - surfaces, self.notes.damage), (surfaces, self.notes.add)):
            if names:
                listed = ", ".join(map(repr, sorted(names)))
                note(f"{self.path.name} requires {listed}, not supported here; it is shown without.")
        if ignored := sorted(used - required):
            self.notes.add(f"Extensions that are not supported and were ignored: {', '.join(map(repr, ignored))}.")

    def _names(self, key: str) -> set[str]:
        """Return the texts in a list of the root."""
        entries = self.root.values(key)
        if not all(isinstance(entry, str) for entry in entries):
            self.root.damage(f"{key} must be a list of names; other entries were ignored")
        return {entry for entry in entries if isinstance(entry, str)}


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


def _parse_json(name: str, text: memoryview, notes: Notes) -> JsonObject:
    try:
        value = json.loads(bytes(text).decode("utf-8-sig").rstrip("\0"))
    except (ValueError, RecursionError) as error:
        raise GiError(f"{name} is not valid JSON ({error}); the file is damaged or not glTF") from error
    if not isinstance(value, dict):
        raise GiError(f"{name} is JSON but not glTF: its top level is not an object")
    return JsonObject(value, f"{name}: root", notes)


def _decode_data_uri(owner: JsonObject, uri: str) -> bytes:
    """Return the payload of a percent-encoded or base64 data URI; base64 may lack padding and have line breaks."""
    header, comma, payload = uri.partition(",")
    if not comma:
        raise owner.error("its data URI has no comma")
    raw = unquote_to_bytes(payload)
    if not header.lower().endswith(";base64"):
        return raw
    digits = raw.translate(_BASE64, _WHITESPACE).rstrip(b"=")
    try:
        return base64.b64decode(digits + b"=" * (-len(digits) % 4), validate=True)
    except (binascii.Error, ValueError) as error:
        raise owner.error(f"its data URI is not valid base64 ({error})") from error
