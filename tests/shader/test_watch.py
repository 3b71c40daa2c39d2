"""The NaN watch on a real adapter: it names pass, resource and pixel of the first bad value."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.gpu.device import open_device
from wgpu_gi.gpu.formats import unpack_rg11b10ufloat
from wgpu_gi.gpu.graph import Graph

# Values are passed as bits, because a compiler may fold 0 / 0 to any value.
SHADER = """
struct Params {{ bits: u32 }}
@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var image: {kind}<{format}, write>;
@compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3u) {{
  {store}
}}
"""
NAN, MINUS_INFINITY, ONE, MINUS_ONE = 0x7FC00000, 0xFF800000, 0x3F800000, 0xBF800000
HUNDRED_THOUSAND, HALF_MAX, BELOW_HALF_MAX = 0x47C35000, 0x477FE000, 0x477FC000  # 1e5, 65504, 65472
BELOW_GREEN_MAX = 0x477C0000  # 64512: the green of rg11b10ufloat has steps of 512 there, and ends at 65024


@pytest.fixture
def check(tmp_path):
    """Return a function that writes a value somewhere and runs the watch."""

    def run(bits, store, kind="texture_storage_2d", texture_format="rgba32float", mip=None, **texture):
        (tmp_path / "bad.wgsl").write_text(SHADER.format(kind=kind, format=texture_format, store=store))
        graph = Graph(open_device(), shader_root=tmp_path)
        graph.begin((8, 4))
        image = graph.texture("image", texture_format, **texture)
        out = image if mip is None else image.mip(mip)
        graph.compute("bad", "bad.wgsl", over=1, writes={"image": out}, params={"bits": bits})
        graph.compile([out])
        return graph.run(check=True)

    return run


BAD = "bitcast<f32>(params.bits)"


@pytest.mark.parametrize(
    ("how", "place"),
    [
        ({"store": f"textureStore(image, vec2u(5, 2), vec4f(0, {BAD}, 1, 2));"}, "pixel (5, 2), channel 1 (1 of 128"),
        ({"store": f"textureStore(image, vec2u(7, 3), vec4f({BAD}));"}, "pixel (7, 3), channel 0 (4 of 128"),
        (
            {"store": f"textureStore(image, vec2u(6, 1), vec4f({BAD}));", "texture_format": "r32float"},
            "pixel (6, 1), channel 0 (1 of 32",
        ),
        (
            {
                "store": f"textureStore(image, vec2u(5, 2), 2, vec4f(0, 0, 0, {BAD}));",
                "kind": "texture_storage_2d_array",
                "layers": 3,
            },
            "pixel (5, 2), channel 3, layer 2 (1 of 384",
        ),
        (
            {
                "store": f"textureStore(image, vec3u(1, 0, 1), vec4f(0, 0, {BAD}, 0));",
                "kind": "texture_storage_3d",
                "layers": 2,
                "dimension": "3d",
            },
            "pixel (1, 0), channel 2, layer 1 (1 of 256",
        ),
        (
            {"store": f"textureStore(image, vec2u(3, 1), vec4f({BAD}, 0, 0, 0));", "mips": 3, "mip": 1},
            "pixel (3, 1), channel 0, mip level 1 (1 of 32",
        ),
    ],
    ids=["one channel", "all channels", "scalar", "layer", "volume", "mip"],
)
def test_a_bad_value_is_located(check, how, place):
    assert check(ONE, **how) and check(MINUS_ONE, **how)
    for bits, value in ((NAN, "nan"), (MINUS_INFINITY, "-inf")):
        with pytest.raises(GiError) as caught:
            check(bits, **how)
        assert str(caught.value).startswith(f"pass 'bad' (bad.wgsl): wrote {value} to 'image' at {place}")


def test_negative_values_are_bad_only_where_declared_nonnegative(check):
    store = f"textureStore(image, vec2u(0, 3), vec4f(0, 0, {BAD}, 0));"
    assert check(MINUS_ONE, store) and check(ONE, store, nonnegative=True)
    with pytest.raises(GiError, match=r"wrote -1\.0 to 'image' at pixel \(0, 3\), channel 2 \(1 of 128"):
        check(MINUS_ONE, store, nonnegative=True)


@pytest.mark.parametrize("texture_format", ["rgba16float", "r32float"])
def test_the_end_of_a_narrow_range_is_bad(check, texture_format):
    how = {"store": f"textureStore(image, vec2u(3, 2), vec4f({BAD}, 0, 0, 0));", "texture_format": texture_format}
    assert check(BELOW_HALF_MAX, **how)
    for bits in (HALF_MAX, HUNDRED_THOUSAND):
        if texture_format == "r32float":
            assert check(bits, **how)
            continue
        # Drivers turn what is too large into infinity, or into the largest value.
        with pytest.raises(
            GiError, match=r"wrote (inf|65504\.0 \(where .* rgba16float ends\)) to 'image' at pixel \(3, 2\)"
        ):
            check(bits, **how)


def test_integers_may_be_anything(check):
    whatever = "textureStore(image, vec2u(3, 2), vec4u(params.bits));"
    assert check(NAN, store=whatever, texture_format="rgba32uint", nonnegative=True)


DRAWN = """
struct Params { bits: u32 }
@group(1) @binding(0) var<uniform> params: Params;
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
  return vec4f(vec2f(f32(i & 1u), f32(i >> 1u)) * 4 - 1, 0.5, 1);
}
@fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {
  return vec4f(1, select(1, bitcast<f32>(params.bits), all(vec2u(at.xy) == vec2u(6, 2))), 1, 1);
}
"""


def test_render_targets_are_watched(tmp_path):
    device = open_device()
    if "rg11b10ufloat-renderable" not in device.features:
        pytest.skip("this adapter does not draw to rg11b10ufloat")
    (tmp_path / "drawn.wgsl").write_text(DRAWN)
    graph = Graph(device, shader_root=tmp_path)

    def check(bits):
        graph.begin((8, 4))
        color, depth = graph.texture("color", "rg11b10ufloat"), graph.texture("depth", "depth32float")
        graph.raster("draw", "drawn.wgsl", draw=3, color={"color": color}, depth=depth, params={"bits": bits})
        graph.compile([color])
        return graph.run(check=True)

    assert check(BELOW_GREEN_MAX)
    for bits, value in ((NAN, "nan"), (HUNDRED_THOUSAND, r"(inf|65024\.0 \(where the range of rg11b10ufloat ends\))")):
        message = (
            rf"^pass 'draw' \(drawn\.wgsl\): wrote {value} to 'color' at pixel \(6, 2\), channel 1 \(1 of 96 values"
        )
        with pytest.raises(GiError, match=message):
            check(bits)


def test_packed_floats_are_unpacked():
    words = np.array([0, 0x3C0 | 0x400 << 11 | 0x1C0 << 22, 0x7BF | 0x7C0 << 11 | 0x3DF << 22], np.uint32)
    expected = [[0, 0, 0], [1, 2, 0.5], [65024, np.inf, 64512]]
    assert np.array_equal(unpack_rg11b10ufloat(words), np.array(expected, np.float32))
    assert np.isnan(unpack_rg11b10ufloat(np.uint32(0x7C1))[0])


LAYER = """
struct Params { bits: u32 }
@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var<storage, read_write> layer: array<vec4f>;
@compute @workgroup_size(1) fn main() { layer[19].z = bitcast<f32>(params.bits); }
"""


@pytest.mark.parametrize(("width", "place"), [(8, r"pixel \(3, 2\)"), (0, "index 19")])
def test_buffers_of_pixels_name_the_pixel(tmp_path, width, place):
    (tmp_path / "layer.wgsl").write_text(LAYER)
    graph = Graph(open_device(), shader_root=tmp_path)

    def check(bits):
        graph.begin((8, 4))
        kind = np.dtype((np.float32, (4,)))
        layer = graph.buffer("layer", dtype=kind, count=32, nonnegative=True, width=width)
        graph.compute("bad", "layer.wgsl", over=1, writes={"layer": layer}, params={"bits": bits})
        graph.compile([layer])
        return graph.run(check=True)

    assert check(ONE)
    for bits, value in ((NAN, "nan"), (MINUS_INFINITY, "-inf"), (MINUS_ONE, r"-1\.0")):
        with pytest.raises(GiError, match=rf"wrote {value} to 'layer' at {place}, component 2 \(1 of 128 values"):
            check(bits)


def test_a_pass_runs_again_after_a_bad_value(tmp_path):
    (tmp_path / "bad.wgsl").write_text(
        SHADER.format(
            kind="texture_storage_2d", format="r32float", store=f"textureStore(image, vec2u(1, 1), vec4f({BAD}));"
        )
    )
    graph = Graph(open_device(), shader_root=tmp_path)
    for bits in (NAN, NAN, ONE):
        graph.begin((4, 4))
        image = graph.texture("image", "r32float")
        graph.compute("bad", "bad.wgsl", over=1, writes={"image": image}, params={"bits": bits})
        graph.compile([image])
        if bits == NAN:
            with pytest.raises(GiError, match=r"nan to 'image' at pixel \(1, 1\)"):
                graph.run(check=True)
        else:
            assert graph.run(check=True)
    assert graph.read_back("image")[1, 1, 0] == 1 and np.isfinite(graph.read_back("image")).all()
