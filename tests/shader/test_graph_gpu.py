"""The render graph on a real adapter: results, read-back, timings and error messages."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import wgpu

from wgpu_gi.errors import GiError
from wgpu_gi.gpu.capabilities import CPU, GPU
from wgpu_gi.gpu.device import open_device
from wgpu_gi.gpu.formats import FORMATS
from wgpu_gi.gpu.graph import Graph
from wgpu_gi.gpu.wgsl.load import load


@pytest.fixture
def graph(tmp_path):
    """Return a graph whose `write(name, text)` adds a shader."""
    graph = Graph(open_device(), shader_root=tmp_path)
    graph.write = lambda name, text: (tmp_path / name).write_text(text)
    return graph


PROGRESSIVE = """
struct Params { settle_index: u32, first_workgroup: u32, step: f32 }
@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var<storage, read_write> total: array<f32>;
override WIDTH: u32 = 64;
@compute @workgroup_size(WIDTH)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
  let i = (params.first_workgroup + group.x) * WIDTH + local;
  if i >= arrayLength(&total) { return; }
  let before = select(total[i], 0.0, params.settle_index == 0);
  total[i] = before + f32(i) * params.step;
}
"""


@pytest.mark.parametrize("split", [False, True])
def test_progressive_pass_does_not_depend_on_splitting(graph, split):
    graph.write("sum.wgsl", PROGRESSIVE)

    def declare(step, settle, width=64):
        graph.begin()
        total = graph.buffer("total", count=40_000)
        writes, constants = {"total": total}, {"WIDTH": width}
        how = {"params": {"step": step}, "constants": constants, "settle": settle, "split": split}
        graph.compute("sum", "sum.wgsl", over=total, writes=writes, **how)
        graph.compile([total])
        while graph.run():
            pass
        return graph.read_back(total)

    numbers = np.arange(40_000, dtype=np.float32)
    assert np.array_equal(declare(1.0, 3), numbers * 3)
    assert np.array_equal(declare(1.0, 5), numbers * 5)
    assert np.array_equal(declare(2.0, 2, width=128), numbers * 4)


def test_struct_layout_agrees_with_the_gpu(graph):
    graph.write(
        "layout.wgsl",
        """
struct Inner { a: vec3f, b: u32, c: vec2f }
struct Outer { x: f32, m: mat3x3f, y: vec3f, inner: array<Inner, 2>, rows: array<vec3f, 2>, z: f32, @align(32) w: u32 }
@group(0) @binding(3) var<uniform> given: Outer;
@group(1) @binding(5) var<storage, read_write> out: array<Outer>;
@compute @workgroup_size(1) fn main() {
  out[1] = given;
  out[1].inner[1].c.y += 1;
  out[1].m[2][1] += given.rows[1].z;
  out[1].w = u32(given.y.z);
}
""",
    )
    dtype = load("layout.wgsl", graph.shader_root).struct_dtype("Outer")
    value = np.zeros((), dtype)
    value["m"][2][1], value["y"], value["rows"][1][2], value["inner"]["b"], value["z"] = 5, (1, 2, 3), 7, (8, 9), 10
    graph.uniform("given", value)
    graph.begin()
    out = graph.buffer("out", dtype=dtype, count=3)
    graph.compute("layout", "layout.wgsl", over=1, writes={"out": out})
    graph.compile([out])
    graph.run()
    got = graph.read_back(out)
    assert got.shape == (3,) and not got[0]["y"].any() and not got[2]["y"].any()
    assert got[1]["m"][2][1] == 12 and got[1]["inner"]["c"].tolist() == [[0, 0], [0, 1]] and got[1]["w"] == 3
    assert got[1]["inner"]["b"].tolist() == [8, 9] and got[1]["z"] == 10 and got[1]["rows"][1][2] == 7


@pytest.mark.parametrize("format", [f.name for f in FORMATS.values() if f.storage])
def test_storage_formats_are_read_back_exactly(graph, format):
    kind = FORMATS[format]
    scalar = {"u": "u32", "i": "i32", "f": "f32"}["f" if kind.normalized else kind.dtype.kind]
    graph.write(
        "store.wgsl",
        f"""
@group(1) @binding(0) var out: texture_storage_2d<{format}, write>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {{
  textureStore(out, id.xy, vec4<{scalar}>(vec4u(id.x, id.y, 1, 0)));
}}
""",
    )
    graph.begin((37, 5))  # rows that are no multiple of 256 bytes
    out = graph.texture("out", format)
    graph.compute("store", "store.wgsl", over=out, writes={"out": out})
    graph.compile([out])
    graph.run()
    got = graph.read_back("out")
    assert got.shape == (5, 37, kind.channels) and got.dtype == kind.dtype
    y, x = np.mgrid[:5, :37]
    expected = np.stack([x, y, np.ones_like(x), np.zeros_like(x)], -1)[..., : kind.channels]
    if kind.normalized:
        expected = np.clip(expected, 0, 1) * np.iinfo(kind.dtype).max
    assert np.array_equal(got, expected.astype(kind.dtype))


RASTER = """
struct Params { depth: f32, settle_index: u32 }
@group(1) @binding(0) var<uniform> params: Params;
struct Out { @location(1) place: vec2f, @location(0) color: vec4f }
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
  let corner = vec2f(f32(i & 1u), f32(i >> 1u)) * 4 - 1;
  return vec4f(corner, params.depth, 1);
}
@fragment fn fs(@builtin(position) at: vec4f) -> Out { return Out(at.xy, vec4f(1, 0.5, 0, 1)); }
"""


def test_depth_test_keeps_the_nearer_surface(graph):
    graph.write("triangle.wgsl", RASTER)
    graph.begin((9, 6))
    color, place, depth = (
        graph.texture(*t) for t in [("c", "rgba8unorm-srgb"), ("p", "rg16float"), ("d", "depth32float")]
    )
    for i, (near, keep) in enumerate([(0.5, False), (0.25, True)]):
        targets = {"color": color, "place": place}
        graph.raster(
            f"draw {i}", "triangle.wgsl", draw=3, color=targets, depth=depth, load=keep, params={"depth": near}
        )
    graph.compile([depth, color])
    graph.run(timings=True)
    assert np.all(graph.read_back(depth) == 0.5) and graph.read_back(depth).shape == (6, 9, 1)
    # sRGB of 0.5 is 187.5 of 255, and drivers round it either way.
    assert np.abs(graph.read_back(color) - [255, 187.5, 0, 255]).max() <= 0.5
    y, x = np.mgrid[:6, :9]
    assert np.array_equal(graph.read_back(place), np.stack([x, y], -1) + np.float16(0.5))
    rows, frame = graph.plan(), graph.timing.frame_ms()
    assert all(row.ms is not None and 0 <= row.ms <= row.p95 for row in rows)
    assert frame is not None and frame[0] == pytest.approx(sum(row.ms for row in rows))


CORNERS = """
struct View { offset: vec4f }
@group(0) @binding(0) var<uniform> view: View;
@group(1) @binding(0) var<storage> corners: array<vec2f>;
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
  return vec4f(corners[i] + view.offset.xy, 0.5, 1);
}
"""


@dataclass(frozen=True)
class DrawApart:
    """Draws the two triangles of six indices one by one."""

    def __call__(self, encoder):
        encoder.draw_indexed(3, 1, 0)
        encoder.draw_indexed(3, 1, 3)


@pytest.mark.parametrize("draw", [6, DrawApart()])
def test_indexed_draws_use_the_uniform_of_their_camera(graph, draw):
    graph.write("corners.wgsl", CORNERS)
    value = np.zeros((), load("corners.wgsl", graph.shader_root).struct_dtype("View"))
    graph.uniform("view", value)
    value["offset"][0] = 1
    graph.uniform("view_second", value)
    # The left half of the screen, its corners in an order that only the indices set right.
    make, usage = graph.device.gpu.create_buffer_with_data, wgpu.BufferUsage
    corners = make(data=np.array([(-1, -1), (0, 1), (-1, 1), (0, -1)], np.float32), usage=usage.STORAGE)
    order = make(data=np.array([0, 3, 2, 1, 2, 3], np.uint32), usage=usage.INDEX)
    graph.begin((4, 4))
    reads, index = {"corners": graph.share("corners", corners)}, graph.share("order", order)
    depths = [graph.texture(name, "depth32float") for name in ("left", "right")]
    for depth, view in zip(depths, ("view", "view_second"), strict=True):
        graph.raster(
            depth.name, "corners.wgsl", draw=draw, index=index, depth=depth, reads=reads, uniforms={"view": view}
        )
    graph.compile(depths)
    graph.run()
    left, right = (graph.read_back(depth)[..., 0] for depth in depths)
    assert np.array_equal(left, np.tile([0.5, 0.5, 0, 0], (4, 1)).astype(np.float32))
    assert np.array_equal(right, left[:, ::-1])


def test_mips_layers_and_volumes_are_written_and_read_back(graph):
    graph.write(
        "half.wgsl",
        """
@group(1) @binding(0) var source: texture_2d<f32>;
@group(1) @binding(1) var out: texture_storage_2d<r32float, write>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {
  textureStore(out, id.xy, textureLoad(source, id.xy * 2, 0) + 1);
}
""",
    )
    graph.write(
        "layers.wgsl",
        """
@group(1) @binding(0) var out: texture_storage_2d_array<r32uint, write>;
@group(1) @binding(1) var volume: texture_storage_3d<r32uint, write>;
@compute @workgroup_size(4, 4) fn main(@builtin(global_invocation_id) id: vec3u) {
  textureStore(out, id.xy, id.z, vec4u(id.z + 1));
  textureStore(volume, id, vec4u(id.z + 2));
}
""",
    )
    graph.begin((8, 8))
    pyramid = graph.texture("pyramid", "r32float", mips=3)
    source = graph.neutral("texture_2d", 5.0)
    for level in range(3):
        out = pyramid.mip(level)
        graph.compute(f"half {level}", "half.wgsl", over=out, reads={"source": source}, writes={"out": out})
        source = out
    layers = graph.texture("layers", "r32uint", layers=3)
    volume = graph.texture("volume", "r32uint", layers=3, dimension="3d")
    graph.compute("layers", "layers.wgsl", over=layers, writes={"out": layers, "volume": volume})
    graph.compile([pyramid, layers, volume])
    graph.run()
    # Outside of the 1x1 source, loads are of texel 0 or of zeros; the first texel is always inside.
    assert [graph.read_back(pyramid, mip)[0, 0, 0] for mip in range(3)] == [6, 7, 8]
    assert [graph.read_back(pyramid, mip).shape for mip in range(3)] == [(8, 8, 1), (4, 4, 1), (2, 2, 1)]
    for texture, first in ((layers, 1), (volume, 2)):
        got = graph.read_back(texture)
        assert got.shape == (3, 8, 8, 1) and [np.unique(layer).tolist() for layer in got] == [
            [first + i] for i in range(3)
        ]
    assert np.unique(graph.read_back(layers.layer(2))).tolist() == [3]


def test_history_is_the_previous_value(graph):
    graph.write(
        "step.wgsl",
        """
@group(1) @binding(0) var<storage> before: array<u32>;
@group(1) @binding(1) var<storage, read_write> now: array<u32>;
@compute @workgroup_size(8) fn main(@builtin(global_invocation_id) id: vec3u) { now[id.x] = before[id.x] + 1; }
""",
    )
    graph.begin()
    now = graph.buffer("now", dtype=np.uint32, count=8, history=True)
    graph.compute("step", "step.wgsl", over=now, reads={"before": now.previous}, writes={"now": now}, settle=3)
    graph.compile([now])
    for step in (1, 2, 3, 3):
        graph.run()
        assert np.all(graph.read_back(now) == step)
    assert np.all(graph.read_back(now.previous) == 2)


def test_check_names_the_first_bad_value(graph):
    graph.write(
        "bad.wgsl",
        """
struct Item { id: u32, weight: vec2f }
struct Params { value: f32 }
@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var<storage, read_write> items: array<Item>;
@group(1) @binding(2) var image: texture_storage_2d<rgba16float, write>;
@compute @workgroup_size(1) fn main() {
  items[3].weight.y = params.value / (params.value * params.value - 1);
  textureStore(image, vec2u(2, 1), vec4f(0, 0, min(params.value, 0), 0));
}
""",
    )
    dtype = load("bad.wgsl", graph.shader_root).struct_dtype("Item")

    def check(value, nonnegative=False):
        graph.begin((4, 4))
        items = graph.buffer("items", dtype=dtype, count=4)
        image = graph.texture("image", "rgba16float", nonnegative=nonnegative)
        graph.compute("bad", "bad.wgsl", over=1, writes={"items": items, "image": image}, params={"value": value})
        graph.compile([image])
        graph.run(check=True)

    check(2.0, nonnegative=True)
    message = r"pass 'bad' \(bad\.wgsl\): wrote inf to 'items' at index 3, component 1 field weight \(1 of 8 values"
    with pytest.raises(GiError, match=message):
        check(1.0)
    check(-2.0)
    message = r"wrote -2\.0 to 'image' at pixel \(2, 1\), channel 2 \(1 of 64"
    with pytest.raises(GiError, match=message):
        check(-2.0, nonnegative=True)
        graph.run(force=True, check=True)


@pytest.mark.parametrize("capabilities", [CPU, GPU])
def test_compiler_errors_name_pass_file_and_line(graph, capabilities, monkeypatch):
    monkeypatch.setattr(graph.device, "capabilities", capabilities)  # one thread, or several
    good = "@group(1) @binding(0) var<storage, read_write> out: array<f32>;\n@compute @workgroup_size(8) fn main() {"
    for number in range(3):
        graph.write(f"good_{number}.wgsl", f"{good} out[0] = {number}.0; }}\n")
    graph.write("library.wgsl", "fn twice(x: f32) -> f32 {\n  return 2u * x;\n}\n")
    graph.write(
        "user.wgsl",
        '#import "library.wgsl"\n@group(1) @binding(0) var<storage, read_write> out: array<f32>;\n'
        "@compute @workgroup_size(8) fn main() { out[0] = twice(1.0); }\n",
    )
    graph.begin()
    out = graph.buffer("out", count=8)
    for number in range(3):
        graph.compute(f"good {number}", f"good_{number}.wgsl", over=out, writes={"out": out})
    graph.compute("user", "user.wgsl", over=out, writes={"out": out})
    with pytest.raises(GiError, match=r"^pass 'user' \(user\.wgsl\): library\.wgsl:2: ") as caught:
        graph.compile([out])
    assert any(line.startswith("2 │") and "return 2u * x;" in line for line in str(caught.value).splitlines())


def test_unfilterable_textures_take_linear_samplers(graph):
    graph.write(
        "sample.wgsl",
        """
@group(1) @binding(0) var source: texture_2d<f32>;
@group(1) @binding(1) var smooth_sampler: sampler;
@group(1) @binding(2) var<storage, read_write> out: array<f32>;
@compute @workgroup_size(1) fn main() { out[0] = textureSampleLevel(source, smooth_sampler, vec2f(0.5), 0).x; }
""",
    )
    graph.begin()
    out = graph.buffer("out", count=1)
    for wrap in ("clamp", "repeat", "mirror"):
        reads = {"source": graph.neutral("texture_2d", 3.0), "smooth_sampler": graph.sampler("linear", wrap)}
        graph.compute(wrap, "sample.wgsl", over=1, reads=reads, writes={"out": out})
    graph.compile([out])
    graph.run()
    assert graph.read_back(out)[0] == 3
