"""The NaN watch on a real adapter: the pass, the resource and the very pixel of the first bad value."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.gpu.device import open_device
from wgpu_gi.gpu.graph import Graph

# Bits, for a compiler may take 0 / 0 for whatever it likes.
SHADER = """
struct Params {{ bits: u32 }}
@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var image: {kind}<{format}, write>;
@compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3u) {{
  {store}
}}
"""
NAN, MINUS_INFINITY, ONE, MINUS_ONE = 0x7FC00000, 0xFF800000, 0x3F800000, 0xBF800000


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
def test_a_nan_is_found_where_it_is(check, how, place):
    assert check(ONE, **how) and check(MINUS_ONE, **how)
    for bits, value in ((NAN, "nan"), (MINUS_INFINITY, "-inf")):
        with pytest.raises(GiError) as caught:
            check(bits, **how)
        assert str(caught.value).startswith(f"pass 'bad' (bad.wgsl): wrote {value} to 'image' at {place}")


def test_negative_only_where_it_may_not_be(check):
    store = f"textureStore(image, vec2u(0, 3), vec4f(0, 0, {BAD}, 0));"
    assert check(MINUS_ONE, store) and check(ONE, store, nonnegative=True)
    with pytest.raises(GiError, match=r"wrote -1\.0 to 'image' at pixel \(0, 3\), channel 2 \(1 of 128"):
        check(MINUS_ONE, store, nonnegative=True)


def test_after_a_bad_value_the_pass_runs_again(tmp_path):
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
