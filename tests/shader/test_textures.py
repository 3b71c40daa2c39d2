"""scene/materials.wgsl: wrap modes, filters and transforms of textures, against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.measure.wgsl_evaluator import Evaluator
from wgpu_gi.pictures.color import linear_from_srgb
from wgpu_gi.scene.built_in.shapes import grid
from wgpu_gi.scene.scene import Image, Instance, Material, Scene, Texture

MATERIALS = "scene/materials.wgsl"
BASE_COLOR, METALLIC_ROUGHNESS = "BASE_COLOR_SLOT", "METALLIC_ROUGHNESS_SLOT"  # sRGB-coded and linear


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


def picture(height=5, width=7, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (height, width, 4)).astype(np.uint8)


def wrapped(index, size, mode):
    if mode == "clamp":
        return np.clip(index, 0, size - 1)
    if mode == "repeat":
        return index % size
    index = index % (2 * size)
    return np.where(index < size, index, 2 * size - 1 - index)


def sampled(values, uv, wrap_u, wrap_v, nearest=False):
    """Bilinear or nearest look-up in float values (h, w, 4)."""
    height, width = values.shape[:2]
    texel = uv.astype(np.float64) * [width, height] - (0.0 if nearest else 0.5)
    base = np.floor(texel).astype(np.int64)
    f = np.zeros_like(texel) if nearest else texel - base
    columns = [wrapped(base[:, 0] + k, width, wrap_u) for k in (0, 1)]
    rows = [wrapped(base[:, 1] + k, height, wrap_v) for k in (0, 1)]
    fx, fy = f[:, :1], f[:, 1:]
    top, low = (values[r, columns[0]] * (1 - fx) + values[r, columns[1]] * fx for r in rows)
    return top * (1 - fy) + low * fy


def coordinates(count=3000):
    """In and around the unit square, far away on both sides, and on texel edges and centres."""
    rng = np.random.default_rng(1)
    near, far = rng.uniform(-3, 3, (count, 2)), rng.uniform(-300, 300, (count, 2))
    lattice = np.stack(np.meshgrid(np.arange(-14, 15) / 7 + 1e-4, np.arange(-10, 11) / 5 + 1e-4), -1).reshape(-1, 2)
    return np.concatenate([near, far, lattice]).astype(np.float32)


def scene_with(texture, second=None):
    """A material with a texture; other pictures lie beside it in the atlas and must not bleed in."""
    others = [Texture(Image(np.full((9, 3, 4), 255, np.uint8))), Texture(Image(np.full((4, 4, 4), 255, np.uint8)))]
    materials = [
        Material(base_color_texture=others[0], metallic_roughness_texture=others[1]),
        Material(base_color_texture=texture, metallic_roughness_texture=second or texture),
    ]
    meshes = [grid(material=m) for m in materials]
    return Scene([Instance(m) for m in meshes])


@pytest.mark.parametrize("wrap_v", ["repeat", "clamp", "mirror"])
@pytest.mark.parametrize("wrap_u", ["repeat", "clamp", "mirror"])
@pytest.mark.parametrize("nearest", [False, True])
def test_wrap_modes_and_filters_agree_with_numpy(evaluate, wrap_u, wrap_v, nearest):
    pixels = picture()
    texture = Texture(Image(pixels), wrap_u, wrap_v, "nearest" if nearest else "linear")
    uv = coordinates()
    call = f"sample_texture(1u, {METALLIC_ROUGHNESS}, uv(i), vec2f(0.0))"
    got = evaluate(MATERIALS, call, "vec4f", scene=scene_with(texture), uv=uv)
    expected = sampled(pixels / 255, uv, wrap_u, wrap_v, nearest)
    off = np.abs(got - expected).max(1)
    if nearest:  # Rounding decides at the edges of texels.
        edge = np.abs(uv * [7, 5] - np.round(uv * [7, 5])).min(1)
        off = off[edge > 1e-3]
    # Coordinates of 300 have 3e-5 * 7 texels of rounding.
    assert off.max() < 1e-3 and len(off) > 4000


def test_colours_are_decoded_before_they_are_filtered(evaluate):
    pixels = picture()
    uv = coordinates()
    call = f"sample_texture(1u, {BASE_COLOR}, uv(i), vec2f(0.0))"
    got = evaluate(MATERIALS, call, "vec4f", scene=scene_with(Texture(Image(pixels))), uv=uv)
    linear = np.concatenate([linear_from_srgb(pixels[..., :3] / 255), pixels[..., 3:] / 255], -1)
    assert np.abs(got - sampled(linear, uv, "repeat", "repeat")).max() < 3e-3  # sRGB decoding is good to 0.5/255


def test_each_texture_uses_its_own_set_of_coordinates(evaluate):
    pixels = picture()
    scene = scene_with(Texture(Image(pixels)), Texture(Image(picture(seed=5)), texcoord=1))
    uv = coordinates(100)
    for slot, values, column in ((METALLIC_ROUGHNESS, picture(seed=5), 1), (BASE_COLOR, None, 0)):
        pair = ("vec2f(9.3)", "uv(i)") if column else ("uv(i)", "vec2f(9.3)")
        a = evaluate(MATERIALS, f"sample_texture(1u, {slot}, {pair[0]}, {pair[1]})", "vec4f", scene=scene, uv=uv)
        b = evaluate(MATERIALS, f"sample_texture(1u, {slot}, uv(i), uv(i))", "vec4f", scene=scene, uv=uv)
        assert np.array_equal(a, b)
        if values is not None:
            assert np.abs(a - sampled(values / 255, uv, "repeat", "repeat")).max() < 1e-3


def test_texture_transform_follows_its_specification(evaluate):
    """KHR_texture_transform: scale, then rotate counter-clockwise as seen with v down, then offset."""
    pixels, offset, scale, angle = picture(), (0.3, -1.2), (2.0, -0.5), 0.6
    texture = Texture(Image(pixels), offset=offset, scale=scale, rotation=angle)
    uv = coordinates(500)
    uv = uv[np.abs(uv).max(1) < 4]
    call = f"sample_texture(1u, {METALLIC_ROUGHNESS}, uv(i), vec2f(0.0))"
    got = evaluate(MATERIALS, call, "vec4f", scene=scene_with(texture), uv=uv)
    u, v = (uv.astype(np.float64) * scale).T
    c, s = np.cos(angle), np.sin(angle)
    moved = np.stack([c * u + s * v, -s * u + c * v], 1) + offset
    assert np.abs(got - sampled(pixels / 255, moved, "repeat", "repeat")).max() < 1e-3


def test_huge_and_undefined_coordinates_stay_in_the_picture(evaluate):
    """Whatever the coordinates: some texel of the picture, never its neighbour in the atlas."""
    pixels = np.zeros((5, 7, 4), np.uint8)
    pixels[..., 1] = 100
    values = [0.0, 1e9, -1e9, 3e38, -3e38, np.inf, -np.inf, np.nan]
    uv = np.array([(a, b) for a in values for b in values], np.float32)
    for wrap in ("repeat", "clamp", "mirror"):
        scene = scene_with(Texture(Image(pixels), wrap, wrap, "nearest"))
        call = f"sample_texture(1u, {METALLIC_ROUGHNESS}, uv(i), vec2f(0.0))"
        got = evaluate(MATERIALS, call, "vec4f", scene=scene, uv=uv)
        assert np.allclose(got, (0, 100 / 255, 0, 0), atol=1e-6)


def test_normal_maps_keep_16_bits(evaluate):
    """A slow ramp in 16 bits is smooth to 1 / 65535 between texels; other slots use the high bytes."""
    ramp = np.round(np.linspace(32000, 33400, 64)).astype(np.uint16)
    pixels = np.broadcast_to(ramp[None, :, None], (3, 64, 4)).copy()
    mesh = grid(material=Material(normal_texture=Texture(Image(pixels), "clamp", "clamp")))
    mesh.materials[0].base_color_texture = Texture(Image(pixels), "clamp", "clamp")
    u = np.linspace(0.0, 1.0, 2000)
    uv = np.stack([u, np.full(2000, 0.4)], 1).astype(np.float32)
    call = "sample_texture(0u, NORMAL_SLOT, uv(i), vec2f(0.0))"
    got = evaluate(MATERIALS, call, "vec4f", scene=Scene([Instance(mesh)]), uv=uv)
    expected = np.interp(np.clip(u * 64 - 0.5, 0, 63), np.arange(64), ramp.astype(float)) / 65535
    assert np.abs(got[:, 0] - expected).max() < 1.5 / 65535
    assert len(np.unique(got[:, 0])) > 1000


def test_one_pixel_picture_is_constant(evaluate):
    pixels = np.array([[[10, 20, 30, 40]]], np.uint8)
    for wrap in ("repeat", "clamp", "mirror"):
        call = f"sample_texture(1u, {METALLIC_ROUGHNESS}, uv(i), vec2f(0.0))"
        scene = scene_with(Texture(Image(pixels), wrap, wrap))
        got = evaluate(MATERIALS, call, "vec4f", scene=scene, uv=coordinates(50))
        assert np.allclose(got, pixels[0] / 255, atol=1e-6)
