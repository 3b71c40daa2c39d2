"""Images of glTF files beyond plain PNG and JPEG: Basis Universal, 16 bits a channel, too many pixels."""

from __future__ import annotations

import base64
import struct
import zlib

import numpy as np
import pytest
from unit.gltf_builder import triangle_scene

from wgpu_gi.scene.files import image_files, png_writer
from wgpu_gi.scene.files.memory import MemoryBudget
from wgpu_gi.scene.files.notes import Notes
from wgpu_gi.scene.files.png_writer import encode_png
from wgpu_gi.scene.gltf import materials as gltf_materials
from wgpu_gi.scene.gltf.load import load_gltf

# 16 x 16 pixels of Basis Universal 2.10: four squares, of which the first is half transparent.
KTX2 = {
    "ETC1S": (
        "q0tUWCAyMLsNChoKAAAAAAEAAAAQAAAAEAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAADwAAACkAAAAJAAAAMgAAAAAAAAAmwAAAAAAAABj"
        "AQAAAAAAAAcAAAAAAAAAAAAAAAAAAAA8AAAAAAAAAAIAOACjAQIAAwMAAAgIAAAAAAAAAAA/AAAAAAAAAAAA/////0AAPw8AAAAAAAAAAP//"
        "//8fAAAAS1RYd3JpdGVyAEJhc2lzIFVuaXZlcnNhbCAyLjEwAAAGAAMANgAAAA0AAAAwAAAAAAAAAAAAAAAAAAAABQAAAAUAAAACAAAAE0AU"
        "AAEAAACIKRMIEEdAAAAACGhQst0DlAhgQoAAAAAACOqAEAIQBQAAAAAQogZodsk/0NIBVFVVVQUAAACoqqqqAhTARAAAAAAAAOJBATABQAAA"
        "AAACuRABEQIGAACAYKOCCN7kDsAMAAAAAAAAUhIQAMsrjKUAdwM="
    ),
    "UASTC": (
        "q0tUWCAyMLsNChoKAAAAAAEAAAAQAAAAEAAAAAAAAAAAAAAAAQAAAAEAAAAAAAAAaAAAACwAAACUAAAALAAAAAAAAAAAAAAAAAAAAAAAAADA"
        "AAAAAAAAAAABAAAAAAAAAAEAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAABAAAAAAAAAAAAB/AwAAAAAAAAAA/////x8AAABLVFh3cml0ZXIA"
        "QmFzaXMgVW5pdmVyc2FsIDIuMTAAAAQAAAB/fwAAF5lWC7Cl8gAAAAAAAAAAABeZVguwpfIAAAAAAAAAAAAXhVbrvzKXAQAAAAAAAAAAF4VW"
        "678ylwEAAAAAAAAAABeZVguwpfIAAAAAAAAAAAAXmVYLsKXyAAAAAAAAAAAAF4VW678ylwEAAAAAAAAAABeFVuu/MpcBAAAAAAAAAAAXmUfr"
        "P8RnAQAAAAAAAAAAF5lH6z/EZwEAAAAAAAAAABeFR+s/MIgBAAAAAAAAAAAXhUfrPzCIAQAAAAAAAAAAF5lH6z/EZwEAAAAAAAAAABeZR+s/"
        "xGcBAAAAAAAAAAAXhUfrPzCIAQAAAAAAAAAAF4VH6z8wiAEAAAAAAAAAAA=="
    ),
}


def basisu_scene(data, fallback=None):
    """Return a triangle with a texture of KHR_texture_basisu, and with an image of its own if there is a `fallback`."""
    builder = triangle_scene()
    texture = builder.texture(np.full((4, 4, 3), fallback or (0, 0, 0), np.uint8))
    if fallback is None:
        builder.json["textures"][texture].pop("source")
    image = builder.add("images", {"bufferView": builder.view(data), "mimeType": "image/ktx2"})
    builder.json["textures"][texture]["extensions"] = {"KHR_texture_basisu": {"source": image}}
    material = builder.material(pbrMetallicRoughness={"baseColorTexture": {"index": texture}})
    builder.json["meshes"][0]["primitives"][0]["material"] = material
    return builder


@pytest.mark.parametrize("codec", KTX2)
def test_basis_universal_textures(tmp_path, codec):
    pytest.importorskip("opengl_basisu")
    scene = load_gltf(basisu_scene(base64.b64decode(KTX2[codec])).glb(tmp_path))
    y, x = np.mgrid[0:16, 0:16]
    red, green = np.where(x < 8, 200, 40), np.where(y < 8, 180, 60)
    expected = np.stack([red, green, np.full_like(red, 90), np.where((x < 8) & (y < 8), 128, 255)], -1)
    pixels = scene.materials[0].base_color_texture.image.pixels
    assert pixels.dtype == np.uint8 and np.abs(pixels.astype(int) - expected).max() <= 3
    assert not scene.notes


def test_without_the_transcoder_the_other_image_or_a_note_remains(tmp_path, monkeypatch):
    monkeypatch.setattr(image_files, "has_basisu", lambda: False)
    monkeypatch.setattr(gltf_materials, "has_basisu", lambda: False)
    data = base64.b64decode(KTX2["UASTC"])
    scene = load_gltf(basisu_scene(data, (9, 8, 7)).glb(tmp_path))
    assert scene.materials[0].base_color_texture.image.pixels[0, 0].tolist() == [9, 8, 7, 255] and not scene.notes
    scene = load_gltf(basisu_scene(data).glb(tmp_path), notes=Notes(strict=True))
    assert scene.materials[0].base_color_texture is None
    (note,) = scene.notes
    assert "pip install opengl_basisu" in note


@pytest.mark.parametrize("length", [12, 40, 80, 200, 300, 440])
def test_a_truncated_basis_texture_gives_way_to_the_other_image(tmp_path, length):
    pytest.importorskip("opengl_basisu")
    data = base64.b64decode(KTX2["UASTC"])[:length]
    scene = load_gltf(basisu_scene(data, (9, 8, 7)).glb(tmp_path))
    assert scene.materials[0].base_color_texture.image.pixels[0, 0].tolist() == [9, 8, 7, 255]
    assert len(scene.notes) == 1 and "was left out" in scene.notes[0]


def test_16_bits_are_kept_for_normal_maps(tmp_path):
    """With or without alpha, grey too; as a colour the same picture has the high bytes. Saving it keeps them."""
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 65536, (6, 5, 4)).astype(np.uint16)
    builder = triangle_scene()
    image = builder.add("images", {"bufferView": builder.view(encode_png(pixels)), "mimeType": "image/png"})
    other = builder.add("images", {"bufferView": builder.view(encode_png(pixels)), "mimeType": "image/png"})
    textures = [builder.add("textures", {"source": source}) for source in (image, other)]
    builder.json["meshes"][0]["primitives"][0]["material"] = builder.material(
        normalTexture={"index": textures[0]}, emissiveTexture={"index": textures[1]}
    )
    material = load_gltf(builder.glb(tmp_path)).materials[0]
    np.testing.assert_array_equal(material.normal_texture.image.pixels, pixels)
    np.testing.assert_array_equal(material.normal_texture.image.eight_bit, pixels >> 8)
    np.testing.assert_array_equal(material.emission_texture.image.pixels, pixels >> 8)


def test_16_bits_of_colours_without_alpha():
    """As most normal maps are; Pillow reads 8 of their bits."""
    pixels = np.random.default_rng(1).integers(0, 65536, (3, 4, 3)).astype(np.uint16)
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in pixels)
    header = struct.pack(">IIBBBBB", 4, 3, 16, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    png = b"\x89PNG\r\n\x1a\n" + b"".join(png_writer._chunk(*chunk) for chunk in chunks)
    with image_files.without_warnings():
        found = image_files.decode_image(image_files.open_image(png, MemoryBudget(), "x", deep=True), srgb=False)
    np.testing.assert_array_equal(found[..., :3], pixels)
    assert (found[..., 3] == 65535).all()


def test_large_textures_are_scaled_down_with_a_note(tmp_path):
    """A white texel of 16384 keeps its light: two texels become one of half the light, not of half the code."""
    pixels = np.zeros((2, 16384, 3), np.uint8)
    pixels[:, 4] = 255
    builder = triangle_scene()
    texture = builder.texture(pixels)
    builder.json["meshes"][0]["primitives"][0]["material"] = builder.material(
        emissiveTexture={"index": texture}, occlusionTexture={"index": texture}
    )
    scene = load_gltf(builder.glb(tmp_path), notes=Notes(strict=True))
    image = scene.materials[0].emission_texture.image
    assert image.pixels.shape == (1, 8192, 4) and image.pixels[0, 2].tolist() == [188, 188, 188, 255]
    (note,) = scene.notes
    assert "16384 x 2 pixels were scaled down to 8192 x 1" in note
