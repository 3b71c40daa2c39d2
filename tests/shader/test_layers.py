"""scene/surface_layers.wgsl and shared/gbuffer/layers.wgsl: the layers of materials at hits, and their codes."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.medley import UNIT_SQUARE

from wgpu_gi.measure.wgsl_evaluator import Evaluator
from wgpu_gi.pictures.color import linear_from_srgb
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import Image, Instance, Material, Scene, Texture

SURFACE = "scene/surface.wgsl"
# Layers at the point of a square that a ray from above hits; `k` chooses four values.
AT = """
#import "scene/trace.wgsl"
fn layers_at(p: vec2f, k: u32) -> vec4f {
    let d = vec3f(0.0, 0.0, -1.0);
    let l = surface_at(trace(Ray(vec3f(p - 0.5, 1.0), d), FLOAT_MAX), d).layers;
    switch (k) {
        case 0u: { return vec4f(l.f0, l.f90); }
        case 1u: { return vec4f(l.clearcoat_normal, l.clearcoat); }
        case 2u: { return vec4f(l.sheen, l.sheen_roughness); }
        case 3u: { return vec4f(l.tangent, l.anisotropy); }
        case 4u: { return vec4f(l.ior, l.clearcoat_roughness, l.transmission, l.thickness); }
        default: { return vec4f(l.attenuation, 0.0); }
    }
}
"""
POINTS = np.array([[0.21, 0.33], [0.5, 0.5], [0.77, 0.62], [0.9, 0.11]], np.float32)
FULL = {
    "ior": 1.8,
    "specular": 0.7,
    "specular_color": (2.0, 0.5, 30.0),
    "clearcoat": 0.6,
    "clearcoat_roughness": 0.3,
    "sheen_color": (0.9, 0.6, 0.2),
    "sheen_roughness": 0.5,
    "transmission": 0.4,
    "thickness": 0.3,
    "attenuation_distance": 0.5,
    "attenuation_color": (0.2, 0.5, 1.0),
    "anisotropy": 0.8,
    "anisotropy_rotation": 0.4,
}
PACK = """
#import "shared/gbuffer/layers.wgsl"
fn layers_of(i: u32) -> Layers {
    return Layers(f0(i), shares(i).x, 1.0 / inverse_ior(i), shares(i).y, shares(i).z, coat(i), sheen(i), shares(i).w,
        more(i).x, tangent(i), more(i).y, more(i).z, vec3f(0.0));
}
fn read_back(i: u32) -> Layers {
    let n = normal(i);
    let read = octahedral_decode(unpack2x16snorm(pack2x16snorm(octahedral_encode(n))));
    return unpack_layers(read, pack_coats(layers_of(i)), pack_lobes(layers_of(i), n));
}
"""


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


def layers_at(evaluate, scene, points=POINTS):
    """Return the layers at points of the square, (n, 4) for each k of `AT`."""
    ks = np.zeros(len(points), np.uint32)
    rows = [
        evaluate(SURFACE, "layers_at(p(i), k(i))", "vec4f", functions=AT, scene=scene, p=points, k=ks + k)
        for k in range(6)
    ]
    return [row.astype(np.float64) for row in rows]


def square(material, matrix=None, tangents=None):
    """Return a scene of a unit square that faces +Z; v points down its texture."""
    mesh = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), material)
    mesh.normals = np.tile(np.float32((0, 0, 1)), (4, 1))
    mesh.texcoords0 = mesh.texcoords1 = UNIT_SQUARE * np.float32((1, -1)) + np.float32((0, 1))
    mesh.tangents = None if tangents is None else np.tile(np.float32(tangents), (4, 1))
    return Scene([Instance(mesh, np.eye(4) if matrix is None else matrix)])


def texture(*texel, **fields):
    return Texture(Image(np.full((4, 4, 4), texel, np.uint8)), **fields)


def f0_of(specular=0.7, tint=(2.0, 0.5, 30.0)):
    return np.minimum((0.8 / 2.8) ** 2 * np.array(tint), 1) * specular


def test_factors_are_those_of_khronos(evaluate):
    f0, coat, sheen, lobe, rest, absorbed = layers_at(evaluate, square(Material(roughness=0.5, **FULL)))
    assert np.allclose(f0, [*f0_of(), 0.7], atol=1e-6)
    assert np.allclose(coat, (0, 0, 1, 0.6), atol=1e-4)
    assert np.allclose(sheen, (0.9, 0.6, 0.2, 0.5), atol=1e-6)
    assert np.allclose(lobe, (np.cos(0.4), np.sin(0.4), 0, 0.8), atol=1e-4)
    assert np.allclose(rest, (1.8, 0.3, 0.4, 0.3), atol=1e-6)
    assert np.allclose(absorbed[:, :3], -np.log((0.2, 0.5, 1.0)) / 0.5, atol=1e-5)


def test_plain_and_unlit_materials_have_no_layers(evaluate):
    for material in (Material(roughness=0.5), Material(unlit=True, **FULL)):
        mixed = square(material)
        mixed.instances.append(square(Material(**FULL), np.diag((0.1, 0.1, 0.1, 1.0))).instances[0])
        mixed.instances[-1].world_from_local[:3, 3] = (0, 0, -5)
        found = layers_at(evaluate, mixed, np.float32([[-0.2, -0.2]]) + 0.9)
        assert np.allclose(found[0], (0.04, 0.04, 0.04, 1)) and np.allclose(found[4], (1.5, 0, 0, 0))
        assert found[1][0, 3] == found[3][0, 3] == 0 and (found[2] == 0).all() and (found[5] == 0).all()


def test_textures_scale_factors_by_their_channels(evaluate):
    """Colours are sRGB-coded, their alpha and all other textures are linear."""
    code = (200, 100, 50, 150)
    red, green, _, alpha = (c / 255 for c in code)
    color = linear_from_srgb(np.array(code[:3]) / 255)
    names = ("specular", "specular_color", "clearcoat", "clearcoat_roughness", "sheen_color", "sheen_roughness")
    material = Material(roughness=0.5, **{**FULL, "specular_color": (1.0, 1.0, 1.0)})
    for name in (*names, "transmission", "thickness"):
        setattr(material, f"{name}_texture", texture(*code))
    f0, coat, sheen, _, rest, _ = layers_at(evaluate, square(material))
    assert np.allclose(f0, [*f0_of(0.7 * alpha, color), 0.7 * alpha], atol=1e-3)
    assert np.allclose(coat[:, 3], 0.6 * red, atol=1e-5)
    assert np.allclose(sheen, [*(np.array((0.9, 0.6, 0.2)) * color), 0.5 * alpha], atol=2e-3)
    # A texture of thickness does not make parts of a solid's surface thin walls.
    assert np.allclose(rest, (1.8, 0.3 * green, 0.4 * red, 0.3), atol=1e-5)


def test_textures_have_own_transforms_and_coordinates(evaluate):
    """A gradient along u of the second set, shifted by a quarter: red = 255 (u + 1/4)."""
    image = Image(np.zeros((1, 256, 4), np.uint8))
    image.pixels[0, :, 0] = np.arange(256)
    where = Texture(image, texcoord=1, offset=(0.25, 0.0), wrap_u="clamp")
    scene = square(Material(clearcoat=1.0, clearcoat_texture=where))
    scene.instances[0].mesh.texcoords0 = np.zeros((4, 2), np.float32)
    found = layers_at(evaluate, scene)[1][:, 3]
    assert np.allclose(found, np.clip(256 * (POINTS[:, 0] + 0.25) - 0.5, 0, 255) / 255, atol=2e-3)


@pytest.mark.parametrize("tangents", [None, (1, 0, 0, 1)])
def test_the_clear_coat_has_its_own_normal_map(evaluate, tangents):
    """The base's map does not bend it, nor does its own bend the base; green is up in the picture."""
    base, own = texture(255, 128, 128, 255), texture(128, 192, 221, 255)
    material = Material(normal_texture=base, clearcoat=1.0, clearcoat_normal_texture=own, clearcoat_normal_scale=0.5)
    normal = np.array((1 / 255, 129 / 255, 0)) * 0.5 + (0, 0, 187 / 255)
    found = layers_at(evaluate, square(material, tangents=tangents))[1][:, :3]
    assert np.allclose(found, normal / np.linalg.norm(normal), atol=1e-4)
    material.clearcoat_normal_texture = None
    assert np.allclose(layers_at(evaluate, square(material, tangents=tangents))[1][:, :3], (0, 0, 1), atol=1e-4)


@pytest.mark.parametrize("tangents", [None, (1, 0, 0, 1)])
def test_anisotropy_textures_turn_and_scale(evaluate, tangents):
    """RG is the direction, turned counter-clockwise by the rotation, B the amount."""
    own = texture(128, 255, 102, 255)
    material = Material(anisotropy=0.5, anisotropy_rotation=0.3, anisotropy_texture=own)
    found = layers_at(evaluate, square(material, tangents=tangents))[3]
    angle = np.arctan2(1.0, 1 / 255) + 0.3
    assert np.allclose(found, (np.cos(angle), np.sin(angle), 0, 0.2), atol=1e-4)


def test_anisotropy_follows_the_coordinates_of_the_normal_map(evaluate):
    turned = texture(128, 128, 255, 255, rotation=0.5)
    found = layers_at(evaluate, square(Material(anisotropy=0.5, normal_texture=turned)))[3]
    # uv' = R uv, so the direction in which u' grows is turned by -0.5 in uv, where v points down.
    assert np.allclose(found[:, :3], (np.cos(0.5), -np.sin(0.5), 0), atol=1e-4)


def test_instances_scale_thickness_not_absorption(evaluate):
    material = Material(transmission=1.0, thickness=0.3, attenuation_distance=2.0, attenuation_color=(0.5, 0.5, 0.5))
    for copies, point in ((1, (0.8, 0.4)), (2, (-0.2, 2.4))):  # relative to the scenes' origins
        scene = square(material, np.diag((-2.0, 4.0, 1.0, 1.0)))
        scene.instances += [Instance(scene.instances[0].mesh, np.diag((1e-3, 1e-3, 1e-3, 1.0)))] * (copies - 1)
        found = layers_at(evaluate, scene, np.float32([point]))
        assert np.allclose(found[4][:, 3], 0.6, atol=1e-5)
        assert np.allclose(found[5][:, :3], np.log(2) / 2, atol=1e-6)


def test_codes_of_the_gbuffer_err_by_their_rounding(evaluate):
    """16 bits: half of 1/65535; colours: half of 1/1023 of the square root; normals and tangents: 1e-4 radians."""
    rng = np.random.default_rng(0)
    unit = rng.normal(size=(3, 4000, 3))
    normal, coat, other = unit / np.linalg.norm(unit, axis=2, keepdims=True)
    tangent = np.cross(normal, other)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    shares, more = rng.random((4000, 4)), rng.random((4000, 3)) * (1, 1, 100)
    colors, inverse_ior = rng.random((2, 4000, 3)), 1 / rng.uniform(1, 3, 4000)
    given = {"normal": normal, "coat": coat, "tangent": tangent, "shares": shares, "more": more, "f0": colors[0]}
    given = {name: np.float32(value) for name, value in given.items()}
    given |= {"sheen": np.float32(colors[1]), "inverse_ior": np.float32(inverse_ior)}

    def read(expression, returns):
        text = f"{expression}".replace("l.", "read_back(i).")
        return evaluate("common/math.wgsl", text, returns, functions=PACK, **given).astype(np.float64)

    half = 0.51 / 65535
    for k, name in enumerate(("f90", "clearcoat", "clearcoat_roughness", "sheen_roughness")):
        assert np.abs(read(f"l.{name}", "f32") - shares[:, k]).max() < half
    for k, name in enumerate(("anisotropy", "transmission")):
        assert np.abs(read(f"l.{name}", "f32") - more[:, k]).max() < half
    assert np.abs(1 / read("l.ior", "f32") - inverse_ior).max() < half
    assert (read("l.thickness", "f32") == np.float32(more[:, 2])).all()
    for name, color in (("f0", colors[0]), ("sheen", colors[1])):
        assert np.abs(np.sqrt(read(f"l.{name}", "vec3f")) - np.sqrt(color)).max() < 0.51 / 1023
    for name, direction in (("clearcoat_normal", coat), ("tangent", tangent)):
        assert np.linalg.norm(read(f"l.{name}", "vec3f") - direction, axis=1).max() < 1e-4
