"""KHR_materials_pbrSpecularGlossiness as metallic roughness: closed forms, energy, textures."""

import numpy as np
import pytest
from unit.gltf_builder import TRIANGLE, GltfBuilder

from wgpu_gi.errors import GiError
from wgpu_gi.pictures.color import linear_from_srgb
from wgpu_gi.scene.files.memory import MemoryBudget
from wgpu_gi.scene.gltf.load import load_gltf
from wgpu_gi.scene.gltf.specular_glossiness import metallic_from_specular

NAME = "KHR_materials_pbrSpecularGlossiness"


def material_of(builder, tmp_path, extension, **keys):
    """Load a triangle whose material has the extension; return the material and the notes."""
    index = builder.material(name="old", extensions={NAME: extension}, **keys)
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = [NAME]
    coordinates = np.zeros((3, 2), np.float32)
    builder.node(mesh=builder.mesh(builder.primitive(TRIANGLE, material=index, TEXCOORD_0=coordinates)))
    scene = load_gltf(builder.glb(tmp_path))
    return scene.materials[0], scene.notes


@pytest.mark.parametrize(
    ("diffuse", "specular", "color", "metallic"),
    [
        ((0.5, 0.2, 0.1), (0.04, 0.04, 0.04), (0.5, 0.2, 0.1), 0.0),  # a dielectric keeps its colour
        ((0.5, 0.2, 0.1), (0.0, 0.0, 0.0), (0.5 / 0.96, 0.2 / 0.96, 0.1 / 0.96), 0.0),
        ((0.0, 0.0, 0.0), (0.9, 0.7, 0.3), (0.9, 0.7, 0.3), 1.0),  # a metal reflects its base colour
        ((0.0, 0.0, 0.0), (0.04, 0.04, 0.04), (0.0, 0.0, 0.0), 0.0),
        ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), 1.0),
    ],
)
def test_dielectrics_and_metals_keep_their_colours(diffuse, specular, color, metallic):
    found, m = metallic_from_specular(np.array(diffuse), np.array(specular))
    np.testing.assert_allclose(m, metallic, atol=1e-9)
    np.testing.assert_allclose(found, color, atol=1e-9)


def test_grey_surfaces_keep_diffuse_and_specular_reflectance():
    """c (1 - m) 0.96 = d (1 - s) and 0.04 (1 - m) + c m = s hold where the equation has a root in [0, 1].

    The blend of the two base colours by the squared metallic then has nothing to blend.
    """
    rng = np.random.default_rng(3)
    d, s = rng.uniform(0.0, 1.0, 2000), rng.uniform(0.04, 1.0, 2000)
    color, m = metallic_from_specular(np.repeat(d[:, None], 3, 1), np.repeat(s[:, None], 3, 1))
    c = color[:, 0]
    inner = (c < 1.0) & (m > 1e-4) & (m < 1.0 - 1e-4)
    assert np.count_nonzero(inner) > 500
    np.testing.assert_allclose((c * (1 - m) * 0.96)[inner], (d * (1 - s))[inner], atol=2e-6)
    np.testing.assert_allclose((0.04 * (1 - m) + c * m)[inner], s[inner], atol=2e-6)
    assert ((c >= 0) & (c <= 1) & (m >= 0) & (m <= 1)).all()


def test_factors_alone(tmp_path):
    extension = {"diffuseFactor": [0, 0, 0, 0.5], "specularFactor": [0.9, 0.7, 0.3], "glossinessFactor": 0.75}
    base = {"baseColorFactor": [0, 1, 0, 1], "roughnessFactor": 1}
    material, notes = material_of(GltfBuilder(), tmp_path, extension, pbrMetallicRoughness=base)
    np.testing.assert_allclose(material.base_color, (0.9, 0.7, 0.3, 0.5), atol=1e-9)
    assert material.metallic == pytest.approx(1.0) and material.roughness == 0.25
    assert notes == ["Specular-glossiness was converted to metallic roughness, in 'old'."]


def test_absent_factors_are_white_and_smooth(tmp_path):
    material, _ = material_of(GltfBuilder(), tmp_path, {})
    assert (material.base_color, material.metallic, material.roughness) == ((1, 1, 1, 1), 1.0, 0.0)


def test_textures_are_converted_texel_by_texel(tmp_path):
    """Left a dielectric, right a metal; the specular texture is twice as large, its alpha is glossiness."""
    builder = GltfBuilder()
    diffuse = np.array([[[200, 100, 50, 255], [0, 0, 0, 128]]], np.uint8)
    shine = np.zeros((2, 4, 4), np.uint8)
    shine[:, :2] = (56, 56, 56, 255)  # sRGB 56 is 0.0395
    shine[:, 2:] = (230, 180, 90, 51)
    transform = {"KHR_texture_transform": {"scale": [2, 3]}}
    extension = {
        "diffuseTexture": {"index": builder.texture(diffuse, {"wrapS": 33071}), "extensions": transform},
        "specularGlossinessTexture": {"index": builder.texture(shine), "extensions": transform},
        "glossinessFactor": 0.5,
    }
    material, _ = material_of(builder, tmp_path, extension)
    base, rough = material.base_color_texture, material.metallic_roughness_texture
    assert material.base_color == (1, 1, 1, 1) and material.metallic == material.roughness == 1.0
    assert base.image.pixels.shape == rough.image.pixels.shape == (2, 4, 4)
    assert base.wrap_u == rough.wrap_u == "clamp" and base.scale == rough.scale == (2, 3)
    np.testing.assert_allclose(base.image.pixels[0, 0], (200, 100, 50, 255), atol=1)
    np.testing.assert_allclose(base.image.pixels[1, 3], (230, 180, 90, 128), atol=1)
    np.testing.assert_array_equal(rough.image.pixels[0, :, 2], [0, 0, 255, 255])
    np.testing.assert_allclose(rough.image.pixels[0, :, 1], [127.5, 127.5, 229.5, 229.5], atol=0.5)


def test_one_texture_is_joined_with_the_factor_of_the_other(tmp_path):
    builder = GltfBuilder()
    diffuse = np.array([[[255, 255, 255, 255], [0, 0, 0, 255]]], np.uint8)
    extension = {
        "diffuseTexture": {"index": builder.texture(diffuse)},
        "diffuseFactor": [0.5, 0.5, 0.5, 1],
        "specularFactor": [0.3, 0.3, 0.3],
    }
    material, _ = material_of(builder, tmp_path, extension)
    left, right = linear_from_srgb(material.base_color_texture.image.pixels[0, :, 0] / 255)
    color, metallic = metallic_from_specular(np.array([[0.5] * 3, [0.0] * 3]), np.full((2, 3), 0.3))
    np.testing.assert_allclose((left, right), color[:, 0], atol=0.005)
    rough = material.metallic_roughness_texture.image.pixels
    assert (rough[..., 1] == 0).all() and np.abs(rough[0, :, 2] - 255 * metallic).max() <= 0.5


def test_dielectrics_keep_their_colours_and_textures(tmp_path):
    """Reflectance at normal incidence is the specular colour; glossiness becomes roughness, with its own place."""
    builder = GltfBuilder()
    diffuse = np.array([[[200, 100, 50, 255], [0, 0, 0, 128]]], np.uint8)
    shine = np.full((2, 4, 4), (120, 100, 60, 51), np.uint8)
    extension = {
        "diffuseTexture": {"index": builder.texture(diffuse)},
        "specularGlossinessTexture": {"index": builder.texture(shine), "texCoord": 1},
        "diffuseFactor": [0.5, 0.6, 0.7, 0.8],
        "specularFactor": [0.9, 0.8, 0.7],
        "glossinessFactor": 0.5,
    }
    material, _ = material_of(builder, tmp_path, extension)
    assert material.base_color == (0.5, 0.6, 0.7, 0.8) and (material.metallic, material.roughness) == (0.0, 1.0)
    assert (material.ior, material.specular, material.specular_color) == (0.0, 1.0, (0.9, 0.8, 0.7))
    np.testing.assert_array_equal(material.base_color_texture.image.pixels, diffuse)
    np.testing.assert_array_equal(material.specular_color_texture.image.pixels, shine)
    rough = material.metallic_roughness_texture
    assert (rough.image.pixels[..., 1] == round(255 - 51 / 2)).all()
    assert material.specular_color_texture.texcoord == rough.texcoord == 1
    alone, _ = material_of(GltfBuilder(), tmp_path, {"specularFactor": [0.1, 0.2, 0.05], "glossinessFactor": 0.75})
    assert (alone.roughness, alone.ior, alone.specular_color) == (0.25, 0.0, (0.1, 0.2, 0.05))


def test_materials_with_equal_textures_share_the_new_ones(tmp_path):
    builder = GltfBuilder()
    extension = {"diffuseTexture": {"index": builder.texture(np.full((4, 4, 3), 90, np.uint8))}}
    indices = [builder.material(extensions={NAME: extension}) for _ in range(3)]
    builder.node(mesh=builder.mesh(*(builder.primitive(material=index) for index in indices)))
    materials = load_gltf(builder.glb(tmp_path)).materials
    assert len(materials) == 3 and len({id(m.base_color_texture.image) for m in materials}) == 1


def test_the_new_textures_count_as_memory(tmp_path):
    builder = GltfBuilder()
    pixels = np.zeros((256, 256, 3), np.uint8)
    extension = {"diffuseTexture": {"index": builder.texture(pixels)}}
    index = builder.material(extensions={NAME: extension})
    builder.node(mesh=builder.mesh(builder.primitive(material=index)))
    path = builder.glb(tmp_path)
    assert load_gltf(path, MemoryBudget(2 << 20)).materials[0].metallic == 1.0
    with pytest.raises(GiError, match="unpacks to"):
        load_gltf(path, MemoryBudget(1 << 19))


@pytest.mark.parametrize("reflectance", [0.1, 0.9])
def test_extensions_that_exclude_it_are_left_out(tmp_path, reflectance):
    """It has a reflectance of its own, whether a dielectric's or a metal's; a clear coat stays."""
    layers = {"KHR_materials_ior": {"ior": 1.4}, "KHR_materials_specular": {"specularFactor": 0.5}}
    layers |= {"KHR_materials_clearcoat": {"clearcoatFactor": 0.25}}
    own = {"specularFactor": [reflectance] * 3}
    alone, _ = material_of(GltfBuilder(), tmp_path, own)
    extensions = {NAME: own, **layers}
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(TRIANGLE, material=builder.material(extensions=extensions))))
    scene = load_gltf(builder.glb(tmp_path))
    (material,) = scene.materials
    for name in ("ior", "specular", "specular_color", "base_color", "metallic"):
        assert getattr(material, name) == getattr(alone, name)
    assert material.clearcoat == 0.25
    assert sum("it was left out" in note for note in scene.notes) == 2
