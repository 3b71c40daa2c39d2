"""scene/textures.wgsl: mip levels, trilinear and anisotropic filters, against numpy; footprints against differences."""

from __future__ import annotations

import numpy as np
import pytest
from shader.test_textures import METALLIC_ROUGHNESS, picture, sampled, scene_with

from wgpu_gi.measure.wgsl_evaluator import Evaluator
from wgpu_gi.pictures.color import linear_from_srgb
from wgpu_gi.scene.built_in.shapes import grid
from wgpu_gi.scene.scene import Image, Instance, Material, Scene, Texture
from wgpu_gi.upload.mip_levels import mip_levels

BASE_COLOR, NORMAL = "BASE_COLOR_SLOT", "NORMAL_SLOT"
SURFACE = "scene/surface.wgsl"


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


def read(evaluate, scene, slot, uv, x, y, most=1.0, material=1):
    """Return the filtered texture at `uv` over parallelograms of sides `x` and `y`."""
    footprint = f"UvFootprint(vec4f(x(i), 0.0, 0.0), vec4f(y(i), 0.0, 0.0), {most:f})"
    call = f"read_texture({material}u, {slot}, uv(i), vec2f(0.0), {footprint}, false)"
    return evaluate(SURFACE, call, "vec4f", scene=scene, uv=uv, x=np.float32(x), y=np.float32(y))


def trilinear(levels, uv, level, wraps=("repeat", "repeat"), nearest=False):
    """Return the value of levels (h, w, 4) in 0..1 at fractional numbers of levels."""
    level = np.clip(level, 0, len(levels) - 1)
    found = np.zeros((len(uv), 4))
    for number, values in enumerate(levels):
        weight = np.maximum(1 - np.abs(level - number), 0)[:, None]
        found += weight * sampled(values, uv, *wraps, nearest)
    return found


def footprints(count=1500, seed=0, octaves=7):
    """Points, and square footprints from a hundredth of a picture of 64 texels to more than all of it."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform(-2, 2, (count, 2)).astype(np.float32)
    width = 2.0 ** rng.uniform(-8, octaves - 6, count)
    turn = rng.uniform(0, 2 * np.pi, count)
    x = np.stack([np.cos(turn), np.sin(turn)], 1) * width[:, None]
    return uv, x, np.stack([-x[:, 1], x[:, 0]], 1)


@pytest.mark.parametrize(
    ("size", "wraps"),
    [
        ((64, 64), ("repeat", "repeat")),
        ((7, 5), ("repeat", "clamp")),
        ((1, 1), ("mirror", "repeat")),
        ((40, 3), ("clamp", "mirror")),
        ((33, 64), ("mirror", "clamp")),
    ],
)
def test_levels_are_blended_by_the_area_of_the_footprint(evaluate, size, wraps):
    pixels = picture(size[1], size[0])
    uv, x, y = footprints()
    got = read(evaluate, scene_with(Texture(Image(pixels), *wraps)), METALLIC_ROUGHNESS, uv, x, y)
    a, b = (side.astype(np.float32) * np.array(size, np.float64) for side in (x, y))
    longer = np.maximum((a**2).sum(1), (b**2).sum(1))
    area = np.maximum(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), longer / 64)
    levels = [level / 255 for level in mip_levels(pixels, "data")]
    assert np.abs(got - trilinear(levels, uv, 0.5 * np.log2(area), wraps)).max() < 2e-3


def test_colours_are_filtered_as_light(evaluate):
    pixels = picture(32, 32)
    uv, x, y = footprints()
    got = read(evaluate, scene_with(Texture(Image(pixels))), BASE_COLOR, uv, x, y)
    levels = [
        np.concatenate([linear_from_srgb(level[..., :3] / 255), level[..., 3:] / 255], -1)
        for level in mip_levels(pixels, "color")
    ]
    level = np.log2(np.linalg.norm(x, axis=1) * 32)
    assert np.abs(got - trilinear(levels, uv, level)).max() < 5e-3


def test_filters_of_the_sampler_are_obeyed(evaluate):
    """NEAREST reads one texel of one level, without mip filter the finest one."""
    pixels = picture(64, 64)
    levels = [level / 255 for level in mip_levels(pixels, "data")]
    uv, x, y = footprints()
    level = np.log2(np.linalg.norm(x, axis=1) * 64)
    cases = {
        ("nearest", None, "none"): trilinear(levels, uv, 0 * level, nearest=True),
        ("nearest", "nearest", "nearest"): trilinear(levels, uv, np.round(level), nearest=True),
        ("linear", "nearest", "linear"): np.where(
            level[:, None] > 0, trilinear(levels, uv, level, nearest=True), sampled(levels[0], uv, "repeat", "repeat")
        ),
        ("linear", None, "nearest"): trilinear(levels, uv, np.round(level)),
        ("linear", None, "none"): sampled(levels[0], uv, "repeat", "repeat"),
        ("nearest", "linear", "none"): np.where(
            level[:, None] > 0,
            sampled(levels[0], uv, "repeat", "repeat"),
            sampled(levels[0], uv, "repeat", "repeat", True),
        ),
    }
    for (magnify, minify, mip), expected in cases.items():
        texture = Texture(Image(pixels), filter=magnify, min_filter=minify, mip_filter=mip)
        got = read(evaluate, scene_with(texture), METALLIC_ROUGHNESS, uv, x, y, most=8.0)
        off = np.abs(got - expected).max(1) > 2e-3
        assert off.mean() < 0.01, (magnify, minify, mip)  # rounding decides at the edges of texels and levels


def test_samples_along_a_long_footprint_keep_what_lies_across(evaluate):
    """Stripes along u, seen over 16 x 1 texels: 8 samples see each stripe, one sample sees their mean."""
    pixels = np.zeros((64, 64, 4), np.uint8)
    pixels[::4] = pixels[1::4] = 255
    scene = scene_with(Texture(Image(pixels)))
    uv = np.stack([np.full(64, 0.5), (np.arange(64) + 0.5) / 64], 1).astype(np.float32)
    x, y = np.tile([16.0 / 64, 0], (64, 1)), np.tile([0, 1.0 / 64], (64, 1))
    one, eight = (read(evaluate, scene, METALLIC_ROUGHNESS, uv, x, y, most)[:, 0] for most in (1.0, 8.0))
    assert np.allclose(one, 0.5, atol=0.01) and np.ptp(eight) > 0.4
    swapped = read(evaluate, scene, METALLIC_ROUGHNESS, uv, y, x, 8.0)[:, 0]
    assert np.allclose(swapped, eight, atol=1e-5)
    # Along the other axis the same samples see all stripes.
    across = read(evaluate, scene, METALLIC_ROUGHNESS, uv, x[:, ::-1], y[:, ::-1], 8.0)[:, 0]
    assert np.allclose(across, 0.5, atol=0.03)


def test_undefined_footprints_give_a_value_of_the_texture(evaluate):
    pixels = np.full((16, 16, 4), 100, np.uint8)
    values = [0.0, 1e-30, 1e9, 3e38, np.inf, -np.inf, np.nan]
    sides = np.array([(a, b) for a in values for b in values], np.float32)
    uv = np.full_like(sides, 0.3)
    scene = scene_with(Texture(Image(pixels)))
    for y in (sides, sides[:, ::-1], 0 * np.nan_to_num(sides)):
        got = read(evaluate, scene, METALLIC_ROUGHNESS, uv, sides, y, 8.0)
        assert np.isfinite(got).all()
        usual = np.isfinite(sides).all(1) & (np.abs(sides).max(1) < 1e10)
        assert np.allclose(got[usual], 100 / 255, atol=1e-3)


def test_16_bit_normals_have_levels(evaluate):
    """A slow ramp stays smooth on coarse levels."""
    ramp = np.round(np.linspace(32000, 33400, 64)).astype(np.uint16)
    pixels = np.broadcast_to(ramp[None, :, None], (16, 64, 4)).copy()
    pixels[..., 2] = 65535
    mesh = grid(material=Material(normal_texture=Texture(Image(pixels), "clamp", "clamp")))
    u = np.linspace(0.1, 0.9, 500)
    uv = np.stack([u, np.full(500, 0.4)], 1).astype(np.float32)
    x, y = np.tile([4 / 64, 0], (500, 1)), np.tile([0, 4 / 16], (500, 1))
    got = read(evaluate, Scene([Instance(mesh)]), NORMAL, uv, x, y, material=0)
    level = mip_levels(pixels, "normal")[2] / 65535
    expected = sampled(level, uv, "clamp", "clamp")
    assert np.abs(got - expected).max() < 1e-4 and len(np.unique(got[:, 0])) > 300


def test_footprints_are_the_differences_of_hits(evaluate):
    """Of a turned and of a moved ray, against hits of the neighbours."""
    rng = np.random.default_rng(3)
    count = 400
    arrays = {k: rng.normal(size=(count, 3)).astype(np.float32) for k in ("anchor", "e1", "e2", "origin", "step")}
    weights = rng.uniform(0.1, 0.5, (count, 2)).astype(np.float32)
    target = arrays["anchor"] + weights[:, :1] * arrays["e1"] + weights[:, 1:] * arrays["e2"]
    arrays["aim"] = (target - arrays["origin"]).astype(np.float32)
    functions = """
fn triangle_of(i: u32) -> Triangle {
    return Triangle(anchor(i), 0u, e1(i), 0u, e2(i), 0u, vec3u(0u));
}
fn by(i: u32, moves: f32) -> vec2f {
    let d = step(i);
    let t = triangle_of(i);
    let at = hit_plane(origin(i), aim(i), t).from_anchor;
    return weight_change(t, at, origin(i), aim(i), d * moves, d * (1.0 - moves));
}
fn difference(i: u32, moves: f32) -> vec2f {
    let d = step(i) * 0.003;
    let t = triangle_of(i);
    let after = hit_plane(origin(i) + d * moves, aim(i) + d * (1.0 - moves), t).from_anchor;
    let before = hit_plane(origin(i) - d * moves, aim(i) - d * (1.0 - moves), t).from_anchor;
    return (after - before) / 0.006;
}
"""
    functions = functions.replace("step(", "shift(")
    arrays["shift"] = arrays.pop("step")
    library = "shared/gbuffer/visible_surface.wgsl"
    for moves in ("1.0", "0.0"):
        got = evaluate(library, f"by(i, {moves})", "vec2f", functions=functions, **arrays)
        expected = evaluate(library, f"difference(i, {moves})", "vec2f", functions=functions, **arrays)
        size = np.linalg.norm(expected, axis=1)
        tame = size < 50  # the others are nearly edge-on
        assert tame.mean() > 0.85
        assert np.median(np.linalg.norm(got - expected, axis=1)[tame] / size[tame]) < 2e-3
