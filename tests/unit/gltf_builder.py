"""Builds small glTF files for tests; editing `json` makes damaged ones."""

from __future__ import annotations

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from wgpu_gi.scene.gltf.load import load_gltf
from wgpu_gi.scene.scene import Mesh

COMPONENT_TYPES = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)


class GltfBuilder:
    """Collects binary data and JSON; `glb` and `gltf` write files."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "buffers": [{"byteLength": 0}]}
        self.data = bytearray()

    def add(self, key: str, element: dict[str, Any]) -> int:
        """Append to a top-level array; return the index."""
        self.json.setdefault(key, []).append(element)
        return len(self.json[key]) - 1

    def view(self, data: bytes, **keys: Any) -> int:
        """Append bytes to the buffer; return the index of their buffer view."""
        self.data += b"\0" * (-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **keys}
        self.data += data
        return self.add("bufferViews", view)

    def accessor(self, values: Any, **keys: Any) -> int:
        """Append an array (n,) or (n, k) in its own component type; return the index of its accessor."""
        array = np.asarray(values)
        width = 1 if array.ndim == 1 else array.shape[1]
        base = {"bufferView": self.view(array.tobytes()), "count": len(array), "type": TYPES[width]}
        return self.add("accessors", {**base, "componentType": COMPONENT_TYPES[array.dtype.name], **keys})

    def primitive(self, positions: Any = TRIANGLE, indices: Any = None, **keys: Any) -> dict[str, Any]:
        """Return a primitive; arrays given by attribute name in `keys` become accessors, other keys stay."""
        attributes = {"POSITION": positions} | {k: v for k, v in keys.items() if k.isupper()}
        accessors = {k: v if isinstance(v, int) else self.accessor(v) for k, v in attributes.items()}
        primitive: dict[str, Any] = {"attributes": accessors, **{k: v for k, v in keys.items() if not k.isupper()}}
        if indices is not None:
            primitive["indices"] = self.accessor(indices)
        return primitive

    def mesh(self, *primitives: dict[str, Any], **keys: Any) -> int:
        """Append a mesh, of one triangle if no primitive is given; return its index."""
        return self.add("meshes", {"primitives": list(primitives) or [self.primitive()], **keys})

    def node(self, root: bool = True, **keys: Any) -> int:
        """Append a node, to the scene too if it is a root; return its index."""
        index = self.add("nodes", keys)
        if root:
            self.json.setdefault("scenes", [{"nodes": []}])[0]["nodes"].append(index)
        return index

    def image(self, pixels: Any, kind: str = "PNG", **keys: Any) -> int:
        """Append an image stored in a buffer view; return its index."""
        return self.add("images", {"bufferView": self.view(encode(pixels, kind)), **keys})

    def texture(self, pixels: Any, sampler: dict[str, Any] | None = None, kind: str = "PNG") -> int:
        """Append a texture with its image and sampler; return its index."""
        texture = {"source": self.image(pixels, kind)}
        if sampler is not None:
            texture["sampler"] = self.add("samplers", sampler)
        return self.add("textures", texture)

    def material(self, **keys: Any) -> int:
        """Append a material; return its index."""
        return self.add("materials", keys)

    def light(self, **keys: Any) -> int:
        """Append a light and a node that carries it; return the node's index."""
        lights = self.json.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})["lights"]
        node = keys.pop("node", {})
        lights.append(keys)
        return self.node(extensions={"KHR_lights_punctual": {"light": len(lights) - 1}}, **node)

    def glb_bytes(self) -> bytes:
        """Return the file as GLB."""
        self.json["buffers"][0]["byteLength"] = max(len(self.data), 1)
        return glb_bytes(json.dumps(self.json).encode(), bytes(self.data))

    def glb(self, folder: Path, name: str = "scene.glb") -> Path:
        """Write a GLB file."""
        path = folder / name
        path.write_bytes(self.glb_bytes())
        return path

    def gltf(self, folder: Path, uri: str | None = None, name: str = "scene.gltf") -> Path:
        """Write a .gltf file; its buffer is a data URI, or the file `uri`."""
        buffer = self.json["buffers"][0]
        buffer["byteLength"] = len(self.data)
        buffer["uri"] = uri or "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        if uri:
            (folder / uri).write_bytes(self.data)
        path = folder / name
        path.write_text(json.dumps(self.json))
        return path


def glb_bytes(text: bytes, binary: bytes = b"", version: int = 2, magic: bytes = b"glTF") -> bytes:
    """Return a GLB container of a JSON and a BIN chunk."""
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if binary:
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return magic + struct.pack("<II", version, 12 + len(chunks)) + chunks


def encode(pixels: Any, kind: str = "PNG") -> bytes:
    """Return (h, w[, c]) uint8 or uint16 pixels as an image file; WebP is lossless."""
    stream = io.BytesIO()
    options = {"lossless": True} if kind == "WEBP" else {}
    Image.fromarray(np.asarray(pixels)).save(stream, kind, **options)
    return stream.getvalue()


def triangle_scene() -> GltfBuilder:
    """Return a builder with one node that shows one triangle."""
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh())
    return builder


def only_mesh(builder: GltfBuilder, folder: Path) -> Mesh:
    """Load the builder's file and return its single mesh."""
    scene = load_gltf(builder.glb(folder))
    assert len(scene.meshes) == 1
    return scene.meshes[0]


def corners(mesh: Mesh) -> Any:
    """Return the corner positions of all triangles, (m, 3, 3)."""
    return mesh.positions[mesh.triangles]
