"""The glTF reader's materials, textures and images."""

from __future__ import annotations

import base64
from dataclasses import fields

import numpy as np
import pytest
from PIL import features
from unit.gltf_builder import encode, triangle_scene

from wgpu_gi.scene.check import check_scene
from wgpu_gi.scene.gltf.load import load_gltf
from wgpu_gi.scene.gltf.write import save_glb
from wgpu_gi.scene.scene import Material, Texture

RED = np.full((2, 2, 4), (255, 0, 0, 255), np.uint8)


def test_material_factors(tmp_path):
    builder = triangle_scene()
    builder.material(
        name="lamp",
        pbrMetallicRoughness={"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.6},
        emissiveFactor=[1, 0.5, 0],
        doubleSided=True,
        alphaMode="MASK",
        alphaCutoff=0.7,
        extensions={"KHR_materials_emissive_strength": {"emissiveStrength": 20}, "KHR_materials_unlit": {}},
    )
    builder.json["meshes"][0]["primitives"][0]["material"] = 0
    material = load_gltf(builder.glb(tmp_path)).materials[0]
    assert (material.name, material.base_color) == ("lamp", (0.1, 0.2, 0.3, 0.4))
    assert (material.metallic, material.roughness, material.emission) == (0.5, 0.6, (20.0, 10.0, 0.0))
    assert material.double_sided and material.unlit
    assert (material.alpha_mode, material.alpha_cutoff) == ("mask", 0.7)


def material_of(folder, builder=None, **keys):
    """Return the material and the notes of a file with one material."""
    builder = builder or triangle_scene()
    builder.json["meshes"][0]["primitives"][0]["material"] = builder.material(**keys)
    scene = load_gltf(builder.glb(folder))
    return scene.materials[0], scene.notes


def test_blending_is_kept(tmp_path):
    material, notes = material_of(tmp_path, alphaMode="BLEND", alphaCutoff=0.7)
    assert (material.alpha_mode, material.alpha_cutoff, notes) == ("blend", 0.5, [])


# Of each extension: values of a file, and the fields that they set.
LAYERS = {
    "ior": ({"ior": 1.33}, {"ior": 1.33}),
    "specular": (
        {"specularFactor": 0.5, "specularColorFactor": [0.2, 3.0, 1.0]},
        {"specular": 0.5, "specular_color": (0.2, 3.0, 1.0)},
    ),
    "clearcoat": (
        {"clearcoatFactor": 0.8, "clearcoatRoughnessFactor": 0.3},
        {"clearcoat": 0.8, "clearcoat_roughness": 0.3},
    ),
    "sheen": (
        {"sheenColorFactor": [0.5, 0.25, 1.0], "sheenRoughnessFactor": 0.4},
        {"sheen_color": (0.5, 0.25, 1.0), "sheen_roughness": 0.4},
    ),
    "transmission": ({"transmissionFactor": 0.9}, {"transmission": 0.9}),
    "volume": (
        {"thicknessFactor": 2.0, "attenuationDistance": 0.5, "attenuationColor": [0.1, 0.5, 1.0]},
        {"thickness": 2.0, "attenuation_distance": 0.5, "attenuation_color": (0.1, 0.5, 1.0)},
    ),
    "anisotropy": (
        {"anisotropyStrength": 0.6, "anisotropyRotation": -1.5},
        {"anisotropy": 0.6, "anisotropy_rotation": -1.5},
    ),
}
TEXTURES = {
    "specular": ("specularTexture", "specularColorTexture"),
    "clearcoat": ("clearcoatTexture", "clearcoatRoughnessTexture", "clearcoatNormalTexture"),
    "sheen": ("sheenColorTexture", "sheenRoughnessTexture"),
    "transmission": ("transmissionTexture",),
    "volume": ("thicknessTexture",),
    "anisotropy": ("anisotropyTexture",),
}


def without_textures(material):
    return {f.name: v for f in fields(Material) if not isinstance(v := getattr(material, f.name), Texture)}


@pytest.mark.parametrize("name", LAYERS)
def test_layers_set_their_fields_alone(tmp_path, name):
    """All other fields keep their default; an empty extension changes nothing."""
    values, expected = LAYERS[name]
    plain, _ = material_of(tmp_path)
    empty, _ = material_of(tmp_path, extensions={f"KHR_materials_{name}": {}})
    assert without_textures(empty) == without_textures(plain)
    builder = triangle_scene()
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = [f"KHR_materials_{name}"]
    material, notes = material_of(tmp_path, builder, extensions={f"KHR_materials_{name}": values})
    assert without_textures(material) == without_textures(plain) | expected
    assert notes == []


def test_textures_of_layers_survive_reading_and_writing(tmp_path):
    """Each with its own picture, coordinates and transform; the clear coat's normals have a scale and 16 bits."""
    builder = triangle_scene()
    extensions = {f"KHR_materials_{name}": dict(values) for name, (values, _) in LAYERS.items()}
    keys = [(name, key) for name, names in TEXTURES.items() for key in names]
    for k, (name, key) in enumerate(keys):
        kind = np.uint16 if key == "clearcoatNormalTexture" else np.uint8
        pixels = np.full((1, 2), 1000 * k, kind) if kind == np.uint16 else np.full((1, 2, 4), (k, 9, 8, 7), kind)
        transform = {"KHR_texture_transform": {"rotation": 0.1 * k}}
        info = {"index": builder.texture(pixels), "texCoord": k % 2, "extensions": transform}
        extensions[f"KHR_materials_{name}"][key] = info
    extensions["KHR_materials_clearcoat"]["clearcoatNormalTexture"]["scale"] = 0.25
    material, notes = material_of(tmp_path, builder, extensions=extensions)
    scene = load_gltf(tmp_path / "scene.glb")
    save_glb(tmp_path / "again.glb", scene)
    again = load_gltf(tmp_path / "again.glb")
    assert notes == again.notes == []
    for found in (material, again.materials[0]):
        for k, (_, key) in enumerate(keys):
            texture = getattr(found, "".join("_" * c.isupper() + c.lower() for c in key))
            first = 1000 * k if key == "clearcoatNormalTexture" else k
            assert texture.image.pixels[0, 0, 0] == first, key
            assert (texture.texcoord, texture.rotation) == (k % 2, pytest.approx(0.1 * k))
        assert found.clearcoat_normal_scale == 0.25
        assert without_textures(found) == without_textures(material)


@pytest.mark.parametrize(
    ("name", "key", "value", "field", "limited"),
    [
        ("ior", "ior", 0, "ior", 0.0),
        ("ior", "ior", 0.5, "ior", 1.0),
        ("ior", "ior", 1e9, "ior", 100.0),
        ("specular", "specularFactor", 1.5, "specular", 1.0),
        ("specular", "specularColorFactor", [-1, 2, 0], "specular_color", (0.0, 2.0, 0.0)),
        ("clearcoat", "clearcoatFactor", "x", "clearcoat", 0.0),
        ("sheen", "sheenColorFactor", [2, 0, 0], "sheen_color", (1.0, 0.0, 0.0)),
        ("transmission", "transmissionFactor", -1, "transmission", 0.0),
        ("volume", "thicknessFactor", -1, "thickness", 0.0),
        ("volume", "attenuationDistance", 0, "attenuation_distance", 1e-12),
        ("volume", "attenuationDistance", 3.4e38, "attenuation_distance", None),
        ("volume", "attenuationColor", [1, 1], "attenuation_color", (1.0, 1.0, 1.0)),
        ("anisotropy", "anisotropyStrength", 7, "anisotropy", 1.0),
    ],
)
def test_values_out_of_range_are_limited_with_a_note(tmp_path, name, key, value, field, limited):
    """Zero for the index of refraction, and the largest float for a distance, are what exporters write."""
    material, notes = material_of(tmp_path, extensions={f"KHR_materials_{name}": {key: value}})
    assert getattr(material, field) == limited
    check_scene(load_gltf(tmp_path / "scene.glb"))
    assert len(notes) == (value not in (0, 3.4e38) or (key == "attenuationDistance" and value == 0))
    assert all(key in note for note in notes)


def test_other_extensions_of_materials_are_noted(tmp_path):
    builder = triangle_scene()
    builder.json["extensionsUsed"] = ["KHR_materials_iridescence", "KHR_materials_sheen"]
    assert "'KHR_materials_iridescence'" in material_of(tmp_path, builder)[1][0]


def test_all_five_textures_with_samplers_and_transforms(tmp_path):
    builder = triangle_scene()
    sampler = {"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}
    colors = [np.full((1, 2, 4), (10 * i, 20, 30, 255), np.uint8) for i in range(5)]
    t = [builder.texture(c, sampler if i == 0 else None) for i, c in enumerate(colors)]
    transform = {"offset": [0.1, 0.2], "scale": [2, 3], "rotation": 0.5, "texCoord": 1}
    material = builder.material(
        pbrMetallicRoughness={
            "baseColorTexture": {"index": t[0], "extensions": {"KHR_texture_transform": transform}},
            "metallicRoughnessTexture": {"index": t[1], "texCoord": 1},
        },
        normalTexture={"index": t[2], "scale": 0.5},
        occlusionTexture={"index": t[3], "strength": 0.5},
        emissiveTexture={"index": t[4]},
    )
    other = builder.material(emissiveTexture={"index": t[4]})
    builder.json["meshes"][0]["primitives"][0]["material"] = material
    builder.json["meshes"][0]["primitives"].append(builder.primitive(material=other))
    m, shared = load_gltf(builder.glb(tmp_path)).materials
    textures = (
        m.base_color_texture,
        m.metallic_roughness_texture,
        m.normal_texture,
        m.occlusion_texture,
        m.emission_texture,
    )
    for texture, color in zip(textures, colors, strict=True):
        np.testing.assert_array_equal(texture.image.pixels, color)
    base = m.base_color_texture
    assert (base.wrap_u, base.wrap_v, base.filter, base.texcoord) == ("clamp", "mirror", "nearest", 1)
    assert (base.offset, base.scale, base.rotation) == ((0.1, 0.2), (2.0, 3.0), 0.5)
    plain = m.metallic_roughness_texture
    assert (plain.wrap_u, plain.wrap_v, plain.filter, plain.texcoord) == ("repeat", "repeat", "linear", 1)
    assert m.normal_scale == 0.5 and m.emission_texture.texcoord == 0
    assert shared.emission_texture.image is m.emission_texture.image


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP", "AVIF"])
def test_image_formats(tmp_path, kind):
    builder = triangle_scene()
    texture = builder.texture(np.full((8, 8, 3), (200, 100, 50), np.uint8), kind=kind)
    if kind == "AVIF" and not features.check("avif"):
        pytest.skip("this Pillow was built without AVIF")
    if kind in ("WEBP", "AVIF"):
        source = builder.json["textures"][texture].pop("source")
        builder.json["textures"][texture]["extensions"] = {f"EXT_texture_{kind.lower()}": {"source": source}}
    material = builder.material(pbrMetallicRoughness={"baseColorTexture": {"index": texture}})
    builder.json["meshes"][0]["primitives"][0]["material"] = material
    pixels = load_gltf(builder.glb(tmp_path)).materials[0].base_color_texture.image.pixels
    assert pixels.shape == (8, 8, 4) and pixels.dtype == np.uint8
    assert np.abs(pixels.astype(int) - (200, 100, 50, 255)).max() <= (0 if kind in ("PNG", "WEBP") else 3)


@pytest.mark.parametrize(
    ("pixels", "expected"),
    [
        (np.full((2, 2), 0x8000, np.uint16), (128, 128, 128, 255)),
        (np.full((2, 2), 7, np.uint8), (7, 7, 7, 255)),
        (np.full((2, 2, 2), (7, 9), np.uint8), (7, 7, 7, 9)),
    ],
)
def test_grey_images(tmp_path, pixels, expected):
    builder = triangle_scene()
    builder.json["meshes"][0]["primitives"][0]["material"] = builder.material(
        emissiveTexture={"index": builder.texture(pixels)}
    )
    image = load_gltf(builder.glb(tmp_path)).materials[0].emission_texture.image
    np.testing.assert_array_equal(image.pixels, np.broadcast_to(expected, (2, 2, 4)))


def test_external_image_and_data_uri_image(tmp_path):
    builder = triangle_scene()
    (tmp_path / "red.png").write_bytes(encode(RED))
    data_uri = "data:image/png;base64," + base64.b64encode(encode(RED)).decode()
    sources = [builder.add("images", {"uri": uri}) for uri in ("red.png", data_uri)]
    textures = [builder.add("textures", {"source": source}) for source in sources]
    builder.json["meshes"][0]["primitives"][0]["material"] = builder.material(
        normalTexture={"index": textures[0]}, emissiveTexture={"index": textures[1]}
    )
    material = load_gltf(builder.glb(tmp_path)).materials[0]
    np.testing.assert_array_equal(material.normal_texture.image.pixels, RED)
    np.testing.assert_array_equal(material.emission_texture.image.pixels, RED)
    assert material.normal_texture.image.name == "red.png"


def test_without_a_readable_image_the_factor_remains(tmp_path):
    builder = triangle_scene()
    images = [
        builder.add("images", {"uri": "nowhere.png"}),
        builder.add("images", {"bufferView": builder.view(encode(np.zeros((64, 64, 3), np.uint8))[:60])}),
        builder.add("images", {"bufferView": builder.view(b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(64))}),
    ]
    t = [builder.add("textures", {"source": image}) for image in images] + [builder.add("textures", {})]
    builder.json["meshes"][0]["primitives"][0]["material"] = builder.material(
        pbrMetallicRoughness={"baseColorFactor": [0.5, 0.5, 0.5, 1], "baseColorTexture": {"index": t[0]}},
        normalTexture={"index": t[1]},
        occlusionTexture={"index": t[2]},
        emissiveTexture={"index": t[3]},
    )
    scene = load_gltf(builder.glb(tmp_path))
    material = scene.materials[0]
    assert material.base_color == (0.5, 0.5, 0.5, 1.0)
    assert material.base_color_texture is material.normal_texture is material.occlusion_texture is None
    assert material.emission_texture is None and len(scene.notes) == 4
    assert "'nowhere.png' is missing" in scene.notes[1] and "textures[3]" in scene.notes[0]


@pytest.mark.parametrize(
    ("magnify", "minify", "expected"),
    [
        (None, None, ("linear", None, "linear")),
        (9728, None, ("nearest", None, "linear")),
        (9729, 9728, ("linear", "nearest", "none")),
        (9728, 9729, ("nearest", "linear", "none")),
        (9728, 9984, ("nearest", None, "nearest")),
        (9729, 9985, ("linear", None, "nearest")),
        (9729, 9986, ("linear", "nearest", "linear")),
        (9729, 9987, ("linear", None, "linear")),
    ],
)
def test_filters_of_samplers_are_kept(tmp_path, magnify, minify, expected):
    """Read, written and read again."""
    builder = triangle_scene()
    sampler = {key: value for key, value in (("magFilter", magnify), ("minFilter", minify)) if value}
    texture = builder.texture(np.full((1, 2, 4), 9, np.uint8), sampler)
    material = builder.material(pbrMetallicRoughness={"baseColorTexture": {"index": texture}})
    builder.json["meshes"][0]["primitives"][0]["material"] = material
    scene = load_gltf(builder.glb(tmp_path))
    save_glb(tmp_path / "again.glb", scene)
    for found in (scene, load_gltf(tmp_path / "again.glb")):
        t = found.materials[0].base_color_texture
        assert (t.filter, t.min_filter, t.mip_filter) == expected
