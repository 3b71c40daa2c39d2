"""The render graph with a fake device: what is culled, kept, run, in which order; history, settle, split; messages."""

from __future__ import annotations

import os
import weakref
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
import wgpu
from unit.fake_device import FakePass, fake_device

from wgpu_gi.errors import GiError
from wgpu_gi.gpu.capabilities import CPU, GPU
from wgpu_gi.gpu.describe import table
from wgpu_gi.gpu.execute import next_chunk
from wgpu_gi.gpu.graph import Graph
from wgpu_gi.gpu.wgsl.load import refresh

HEAD = """
struct View { offset: vec4f }
struct Params { gain: f32, settle_index: u32, first_workgroup: u32, width: u32 }
"""


def loads(numbers):
    return " + ".join(f"textureLoad(t{i}, vec2u(0), 0)" for i in numbers)


SHADERS = {
    "fill": HEAD
    + """
@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var out: texture_storage_2d<rgba16float, write>;
@compute @workgroup_size(8, 8) fn main() { textureStore(out, vec2u(params.width), vec4f(params.gain)); }
""",
    "look": HEAD
    + """
@group(0) @binding(0) var<uniform> view: View;
@group(1) @binding(0) var source: texture_2d<f32>;
@group(1) @binding(1) var out: texture_storage_2d<rgba16float, write>;
@compute @workgroup_size(8, 8)
fn main() { textureStore(out, vec2u(0), textureLoad(source, vec2u(0), 0) + view.offset); }
""",
    "copy": """
@group(1) @binding(0) var source: texture_2d<f32>;
@group(1) @binding(1) var out: texture_storage_2d<rgba16float, write>;
override SIZE: u32 = 8;
override NEEDED: f32;
@compute @workgroup_size(SIZE, 8) fn main() { textureStore(out, vec2u(0), textureLoad(source, vec2u(0), 0)); }
@compute @workgroup_size(SIZE, 8) fn other() { let x = NEEDED; }
""",
    "blend": """
@group(1) @binding(0) var source: texture_2d<f32>;
@group(1) @binding(1) var before: texture_2d<f32>;
@group(1) @binding(2) var out: texture_storage_2d<rgba16float, write>;
@compute @workgroup_size(8, 8)
fn main() { textureStore(out, vec2u(0), textureLoad(source, vec2u(0), 0) + textureLoad(before, vec2u(0), 0)); }
""",
    "sum": HEAD
    + """
@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var<storage, read_write> total: array<vec4f>;
@compute @workgroup_size(64) fn main() { total[params.first_workgroup] = vec4f(params.gain, f32(params.width), 0, 0); }
""",
    "add": """
@group(1) @binding(0) var<storage> points: array<vec4f>;
@group(1) @binding(1) var<storage, read_write> total: array<vec4f>;
@compute @workgroup_size(64) fn main() { total[0] = points[0]; }
""",
    "sample": """
@group(1) @binding(0) var source: texture_2d<f32>;
@group(1) @binding(1) var smooth_sampler: sampler;
@group(1) @binding(2) var out: texture_storage_2d<rgba16float, write>;
@compute @workgroup_size(8, 8)
fn main() { textureStore(out, vec2u(0), textureSampleLevel(source, smooth_sampler, vec2f(0), 0)); }
""",
    "draw": """
struct Out { @location(0) color: vec4f, @location(1) normal: vec4f }
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return vec4f(f32(i)); }
@fragment fn fs() -> Out { return Out(); }
""",
    "drawn": HEAD
    + """
@group(0) @binding(0) var<uniform> view: View;
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return view.offset * f32(i); }
""",
    "many": "".join(f"@group(1) @binding({i}) var t{i}: texture_2d<f32>;\n" for i in range(17))
    + "".join(f"@group(1) @binding({20 + i}) var o{i}: texture_storage_2d<rgba16float, write>;\n" for i in range(5))
    + f"""
@vertex fn vs() -> @builtin(position) vec4f {{ return {loads(range(9))}; }}
@fragment fn fs() -> @location(0) vec4f {{ return {loads(range(9, 17))}; }}
@compute @workgroup_size(8) fn sampled() {{ textureStore(o0, vec2u(0), {loads(range(17))}); }}
@compute @workgroup_size(8) fn stored() {{ {" ".join(f"textureStore(o{i}, vec2u(0), vec4f(0));" for i in range(5))} }}
""",
    "wide": "".join(f"@group(1) @binding({i}) var<storage, read_write> b{i}: array<u32>;\n" for i in range(9))
    + f"@compute @workgroup_size(64) fn main() {{ {' '.join(f'b{i}[0] = 1;' for i in range(9))} }}",
    "odd": """
@group(2) @binding(0) var<storage, read_write> total: array<vec4f>;
@group(1) @binding(0) var<storage, read_write> one: array<u32>;
@group(1) @binding(0) var<storage, read_write> same: array<u32>;
@compute @workgroup_size(64) fn main() { total[0] = vec4f(0); }
@compute @workgroup_size(64) fn twins() { one[0] = same[0]; }
@compute @workgroup_size(64) fn index() { one[0] = 1; }
@compute @workgroup_size(32, 32) fn large() { one[0] = 1; }
@compute fn sizeless() { one[0] = 1; }
""",
}
VIEW = np.dtype([("offset", "f4", (4,))])
VEC4 = np.dtype((np.float32, (4,)))


@pytest.fixture
def graph(tmp_path):
    for name, text in SHADERS.items():
        (tmp_path / f"{name}.wgsl").write_text(text)
    graph = Graph(fake_device(), shader_root=tmp_path)
    graph.uniform("view", np.zeros((), VIEW))
    return graph


def fill(g, name="a", gain=1.0, **more):
    out = g.texture(name, "rgba16float")
    g.compute(f"fill {name}", "fill.wgsl", over=out, writes={"out": out}, params={"gain": gain, "width": 1}, **more)
    return out


def read(g, source, name, shader="look", **more):
    """Declare a pass called like the texture that it writes."""
    out = g.texture(name, "rgba16float")
    g.compute(name, f"{shader}.wgsl", over=out, reads={"source": source}, writes={"out": out}, **more)
    return out


def chain(g, gain=1.0, settle=0, size=(16, 16), outputs=("c",)):
    """Declare fill a -> look b (binds view) -> copy c, and copy d of a that nothing needs unless it is an output."""
    g.begin(size)
    a = fill(g, "a", gain)
    b = read(g, a, "b", settle=settle)
    read(g, b, "c", "copy")
    read(g, a, "d", "copy")
    g.compile(outputs)


def ran(g, **how):
    """Run a frame and return which passes were dispatched or drawn, in order."""
    log = g.device.gpu.log
    log.clear()
    g.run(**how)
    return [entry[1] for entry in log if entry[0] in ("dispatch", "draw", "draw indexed")]


def params_of(g, name):
    """Return the params as the GPU has them: gain, settle_index, first_workgroup, width."""
    return np.frombuffer(g.passes[name].state.params_buffer.data, np.dtype("f4,u4,u4,u4"))[0].item()


def state_of(g, name):
    return next(row for row in g.plan() if row.name == name)


@dataclass(frozen=True)
class Draw:
    """A draw function that equals another of the same count."""

    count: int

    def __call__(self, encoder):
        encoder.draw(self.count, 1)


# Culling, staleness and order.


def test_runs_in_order_and_then_rests(graph):
    chain(graph)
    assert ran(graph) == ["fill a", "b", "c"]
    assert graph.at_rest
    assert ran(graph) == [] and graph.device.gpu.log == []  # nothing recorded, nothing submitted


def test_one_submit_per_frame(graph):
    chain(graph)
    graph.run()
    assert graph.device.gpu.log.count(("submit",)) == 1


def test_dispatches_share_a_pass_between_clears_and_draws(graph):
    graph.points = graph.device.gpu.create_buffer(label="points", size=160)
    graph.begin((8, 8))
    total, other = (graph.buffer(name, dtype=VEC4, count=10) for name in ("total", "other"))
    depth = graph.texture("depth", "depth32float")
    reads = {"points": graph.share("points", graph.points)}
    params = {"gain": 0.0, "width": 0}
    a = fill(graph)
    b = read(graph, a, "b")
    graph.raster("draw", "drawn.wgsl", draw=3, depth=depth)
    c = read(graph, b, "c", "copy")
    graph.compute("add", "add.wgsl", over=total, reads=reads, writes={"total": total}, clear=[total])
    graph.compute("sum", "sum.wgsl", over=other, writes={"total": other}, params=params)
    # `total` is cleared when the frame begins, and once more after the pass that wrote it.
    graph.compute("more", "add.wgsl", over=total, reads=reads, writes={"total": total}, clear=[total])
    graph.compile([c, depth, total, other])
    assert ran(graph) == ["fill a", "b", "draw", "c", "add", "sum", "more"]
    recorded = [
        entry[0] for entry in graph.device.gpu.log if entry[0] in ("compute pass", "targets", "clear", "submit")
    ]
    assert recorded == ["clear", "compute pass", "targets", "compute pass", "clear", "compute pass", "submit"]


def test_group_counts_are_rounded_up(graph):
    chain(graph, size=(17, 9))
    graph.run()
    assert ("dispatch", "b", (3, 2, 1)) in graph.device.gpu.log


def test_what_no_output_needs_is_culled(graph):
    chain(graph)
    graph.run()
    assert state_of(graph, "d").state == "culled" and "no output needs d" in state_of(graph, "d").reason
    with pytest.raises(GiError, match="'d' is not allocated"):
        graph.read_back("d")
    chain(graph, outputs=("d",))
    assert ran(graph) == ["d"]  # what it needs was kept
    assert state_of(graph, "c").state == "culled" and state_of(graph, "fill a").state == "kept"


def test_params_make_their_pass_and_its_readers_stale(graph):
    chain(graph)
    graph.run()
    chain(graph, gain=2.0)
    assert ran(graph) == ["fill a", "b", "c"]
    assert state_of(graph, "fill a").reason == "input changed: params"
    assert state_of(graph, "b").reason == "input changed: a"
    chain(graph, gain=2.0)
    assert ran(graph) == []
    assert state_of(graph, "b").reason == "inputs unchanged: view, a"


def test_shared_uniform_makes_only_those_stale_that_bind_it(graph):
    chain(graph)
    graph.run()
    value = np.zeros((), VIEW)
    graph.set_uniform("view", value)
    assert graph.at_rest  # the same bytes
    value["offset"] = 1
    graph.set_uniform("view", value)
    assert ran(graph) == ["b", "c"]
    assert state_of(graph, "b").reason == "input changed: view"


def test_force_runs_all_that_is_not_culled(graph):
    chain(graph)
    graph.run()
    assert ran(graph, force=True) == ["fill a", "b", "c"]
    assert graph.at_rest


def test_shared_resource_is_stale_by_version_or_object(graph):
    def declare(texture, version):
        graph.begin((8, 8))
        source = graph.share("image", texture, version)
        graph.compile([read(graph, source, "b")])
        return ran(graph)

    make = graph.device.gpu.create_texture
    one, two = (make(label="t", format="rgba8unorm", size=(8, 8, 1)) for _ in range(2))
    assert declare(one, 1) == ["b"]
    assert declare(one, 1) == []
    assert declare(one, 2) == ["b"]
    assert declare(two, 2) == ["b"]
    graph.share("image", two, 3)  # also without a new declaration
    assert ran(graph) == ["b"]
    graph.begin((8, 8))
    graph.compile([])
    assert not two.destroyed  # it is its owner's


def accumulate(g, version, outputs=("total",), settle=0):
    """Declare clear total -> add points (its input has a version) -> tail."""
    g.begin((8, 8))
    points = g.share("points", g.points, version)
    total = g.buffer("total", dtype=VEC4, count=100)
    g.compute("clear", "sum.wgsl", over=total, writes={"total": total}, params={"gain": 0.0, "width": 0})
    g.compute("add", "add.wgsl", over=total, reads={"points": points}, writes={"total": total}, settle=settle)
    g.compile(outputs)


def test_staleness_spreads_back_to_earlier_writers(graph):
    graph.points = graph.device.gpu.create_buffer(label="points", size=160)
    accumulate(graph, 1)
    assert ran(graph) == ["clear", "add"]
    accumulate(graph, 1)
    assert ran(graph) == []
    accumulate(graph, 2)
    assert ran(graph) == ["clear", "add"]
    assert state_of(graph, "clear").reason == "pass add needs its results"


def test_earlier_writer_repeated_for_a_settling_one_does_not_restart_it(graph):
    graph.points = graph.device.gpu.create_buffer(label="points", size=160)
    accumulate(graph, 1, settle=3)
    assert [ran(graph) for _ in range(4)] == [["clear", "add"]] * 3 + [[]]


def test_pass_between_two_writers_sees_the_first(graph):
    graph.points = graph.device.gpu.create_buffer(label="points", size=160)

    def declare(version, gain=1.0):
        graph.begin((8, 8))
        points = graph.share("points", graph.points, version)
        a, b = (graph.buffer(name, dtype=VEC4, count=10) for name in "ab")
        graph.compute("first", "sum.wgsl", over=a, writes={"total": a}, params={"gain": gain, "width": 0})
        graph.compute("between", "add.wgsl", over=b, reads={"points": a}, writes={"total": b})
        graph.compute("second", "add.wgsl", over=a, reads={"points": points}, writes={"total": a})
        graph.compile([a, b])
        return ran(graph)

    assert declare(1) == ["first", "between", "second"]
    assert declare(1) == []
    assert declare(2) == ["first", "second"]  # what is between would compute the same
    assert declare(2, 2.0) == ["first", "between", "second"]


def test_mip_levels_are_tracked_apart(graph):
    def declare(gain):
        graph.begin((8, 8))
        a = fill(graph, "a", gain)
        pyramid = graph.texture("pyramid", "rgba16float", mips=4)
        source = a
        for level in range(4):
            out = pyramid.mip(level)
            reads, writes = {"source": source}, {"out": out}
            graph.compute(f"mip {level}", "copy.wgsl", over=out, reads=reads, writes=writes)
            source = out
        graph.compile([pyramid])
        return ran(graph)

    assert declare(1.0) == ["fill a", "mip 0", "mip 1", "mip 2", "mip 3"]
    assert declare(1.0) == []
    assert declare(2.0) == ["fill a", "mip 0", "mip 1", "mip 2", "mip 3"]


# Redeclaration.


def test_same_declaration_keeps_contents_and_handles(graph):
    chain(graph)
    graph.run()
    kept = graph.resources["a"], graph.resources["a"].object()
    chain(graph, gain=5.0)
    assert (graph.resources["a"], graph.resources["a"].object()) == kept
    assert not kept[1].destroyed


def test_resize_destroys_and_rebuilds(graph):
    chain(graph)
    graph.run()
    old = [graph.resources[name].object() for name in "abc"]
    chain(graph, size=(32, 16))
    assert all(texture.destroyed for texture in old)
    assert graph.resources["a"].object().size == (32, 16, 1)
    assert ran(graph) == ["fill a", "b", "c"]


def test_pass_is_rebuilt_for_other_constants_and_pipelines_are_cached(graph):
    def declare(size):
        graph.begin((16, 16))
        graph.compile([read(graph, fill(graph), "c", "copy", constants={"SIZE": size})])
        names = ran(graph)
        return names, ("dispatch", "c", (16 // size, 2, 1)) in graph.device.gpu.log

    assert declare(8) == (["fill a", "c"], True)
    assert declare(16) == (["c"], True)
    graph.device.gpu.log.clear()
    declare(8)
    assert not [entry for entry in graph.device.gpu.log if "pipeline" in entry[0]]


def test_failed_declaration_does_not_forget_the_one_before(graph):
    chain(graph)
    graph.run()
    kept = graph.resources["a"].object()
    graph.begin((16, 16))
    graph.texture("a", "r32float")
    with pytest.raises(GiError):
        graph.texture("a", "r32float")
    with pytest.raises(GiError, match="not compiled"):
        graph.run()
    chain(graph)
    assert graph.resources["a"].object() is kept and ran(graph) == []


def test_changed_shader_file_is_run_again(graph, tmp_path):
    chain(graph)
    graph.run()
    (tmp_path / "look.wgsl").write_text(SHADERS["look"] + "// changed\n")
    os.utime(tmp_path / "look.wgsl", ns=(1, 1))
    chain(graph)
    assert ran(graph) == []  # files are looked at when asked
    refresh()
    chain(graph)
    assert ran(graph) == ["b", "c"]


# Redeclaration: what stays the same costs next to nothing, and what does not is checked.


def made(g, kind):
    """Return the labels of the objects of a kind that the device has made so far."""
    return [entry[1] for entry in g.device.gpu.log if entry[0] == kind]


def test_same_arguments_give_the_same_pass_with_new_params(graph):
    chain(graph)
    graph.run()
    passes = dict(graph.passes)
    chain(graph, gain=2.0, settle=3)
    assert all(graph.passes[name] is p for name, p in passes.items())
    graph.run()
    assert params_of(graph, "fill a")[0] == 2.0 and graph.passes["b"].settle == 3
    chain(graph, size=(17, 16))
    assert not any(graph.passes[name] is p for name, p in passes.items())


def test_no_file_is_touched_by_a_redeclaration(graph, monkeypatch):
    chain(graph)
    graph.run()

    def forbidden(path, *_, **__):
        raise AssertionError(f"{path} is looked at")

    for name in ("os.stat", "os.lstat", "os.open", "os.scandir", "builtins.open"):
        monkeypatch.setattr(name, forbidden)
    chain(graph, gain=2.0)
    graph.run()
    chain(graph, gain=2.0, size=(17, 16))
    graph.run()


def test_params_and_sizes_compile_no_pipeline(graph):
    chain(graph)
    graph.run()
    before = made(graph, "create_compute_pipeline")
    assert len(before) == 3
    for gain, side in ((2.0, 16), (2.0, 17), (3.0, 40)):
        chain(graph, gain=gain, size=(side, side))
        graph.run()
    assert made(graph, "create_compute_pipeline") == before


def copies(g, *sizes):
    """Declare a pass with a pipeline of its own for each size of a workgroup."""
    g.begin((8, 8))
    a = fill(g)
    out = [read(g, a, f"copy {size}", "copy", constants={"SIZE": size}) for size in sizes]
    g.compile(out)
    g.run()


def test_pipelines_that_nothing_declares_are_freed_but_for_the_last_ones(graph, monkeypatch):
    monkeypatch.setattr("wgpu_gi.gpu.pipelines.KEPT", 2)
    copies(graph, 1, 2, 3)
    alive = {size: weakref.ref(graph.passes[f"copy {size}"].pipeline) for size in (1, 2, 3)}
    copies(graph, 3)
    assert all(pipeline() is not None for pipeline in alive.values())
    compiled = len(made(graph, "create_compute_pipeline"))
    copies(graph, 1)  # one of the last two, and 3 takes its place
    assert len(made(graph, "create_compute_pipeline")) == compiled
    copies(graph, 4)
    assert alive[2]() is None and alive[1]() is not None and alive[3]() is not None
    copies(graph, 2)
    assert made(graph, "create_compute_pipeline")[-2:] == ["copy 4", "copy 2"]
    graph.release()
    assert len(graph.device.pipelines._pipelines) == 2


def test_a_pipeline_that_another_graph_uses_stays(graph, monkeypatch):
    monkeypatch.setattr("wgpu_gi.gpu.pipelines.KEPT", 0)
    other = Graph(graph.device, graph.shader_root)
    copies(other, 1)
    copies(graph, 1)
    pipeline = graph.passes["copy 1"].pipeline
    assert other.passes["copy 1"].pipeline is pipeline
    other.release()
    copies(graph, 1, 2)
    assert graph.passes["copy 1"].pipeline is pipeline
    assert made(graph, "create_compute_pipeline").count("copy 1") == 1


def test_a_shared_buffer_that_is_replaced_is_checked(graph):
    def declare(size):
        graph.begin((8, 8))
        buffer = SimpleNamespace(map_state="unmapped", size=size, label="points")
        total = graph.buffer("total", dtype=VEC4, count=10)
        reads = {"points": graph.share("points", buffer)}
        graph.compute("add", "add.wgsl", over=total, reads=reads, writes={"total": total})
        graph.compile([total])

    declare(160)
    declare(320)
    with pytest.raises(GiError, match="buffer 'points' has 8 bytes, but"):
        declare(8)


def test_a_uniform_of_another_type_is_checked(graph):
    chain(graph)
    graph.uniform("view", np.zeros((), [("offset", "f4", (8,))]))
    with pytest.raises(GiError, match="shared uniform 'view' has the fields"):
        chain(graph)


def test_params_that_change_in_place_are_seen(graph):
    gain = np.array(1.0)
    chain(graph, gain=gain)
    graph.run()
    gain[...] = 2.0
    chain(graph, gain=gain)
    assert ran(graph) == ["fill a", "b", "c"] and params_of(graph, "fill a")[0] == 2.0
    with pytest.raises(GiError, match="params gain is nan, which is not finite"):
        chain(graph, gain=np.nan)
    with pytest.raises(GiError, match="there is no field 'gian'"):
        graph.begin((16, 16))
        out = graph.texture("a", "rgba16float")
        graph.compute("fill a", "fill.wgsl", over=out, writes={"out": out}, params={"gian": 1.0, "width": 1})


def test_passes_with_the_same_uniforms_share_a_bind_group(graph):
    graph.begin((16, 16))
    a = fill(graph)
    b = read(graph, a, "b")
    c = read(graph, b, "c")
    graph.compile([c])
    graph.run()
    assert made(graph, "create_bind_group") == ["fill a", "uniforms", "b", "c"]


def test_uniforms_are_set_where_they_differ_from_the_dispatch_before(graph, monkeypatch):
    graph.uniform("view_second", np.zeros((), VIEW))
    graph.begin((16, 16))
    a = fill(graph)
    b = read(graph, a, "b")
    c = read(graph, b, "c", "copy")  # without uniforms
    d = read(graph, c, "d")
    e = read(graph, d, "e", uniforms={"view": "view_second"})
    graph.compile([e])
    set_groups, plain = [], FakePass.set_bind_group

    def noting(self, index, group):
        set_groups.append(group.label)
        plain(self, index, group)

    monkeypatch.setattr(FakePass, "set_bind_group", noting)
    graph.run()
    assert set_groups == ["fill a", "uniforms", "b", "c", "d", "uniforms", "e"]


def test_params_buffers_go_with_their_passes(graph):
    def declare(*names):
        graph.begin((8, 8))
        graph.compile([fill(graph, name) for name in names])
        graph.run()
        return {entry[1] for entry in graph.device.gpu.log if entry[0] == "destroy" and "params" in entry[1]}

    declare("a", "b")
    assert declare("a", "b") == set()
    assert declare("a") == {"fill b params"}
    assert params_of(graph, "fill a")[0] == 1.0


def test_pass_is_another_with_another_camera(graph):
    second = np.zeros((), VIEW)
    graph.uniform("view_second", second)

    def declare(**more):
        graph.begin((8, 8))
        graph.compile([read(graph, fill(graph), "b", **more)])
        return ran(graph)

    assert declare() == ["fill a", "b"]
    assert declare(uniforms={"view": "view"}) == []
    assert declare(uniforms={"view": "view_second"}) == ["b"]
    (groups,) = graph.passes["b"].state.bind_groups.values()
    assert groups[0].entries[0]["resource"]["buffer"].label == "uniform view_second"
    second["offset"] = 1
    graph.set_uniform("view", second)
    assert graph.at_rest
    graph.set_uniform("view_second", second)
    assert ran(graph) == ["b"] and state_of(graph, "b").reason == "input changed: view_second"


def test_later_reader_does_not_cost_the_contents(graph):
    graph.begin((8, 8))
    graph.compile([fill(graph)])
    graph.run()
    graph.begin((8, 8))
    graph.compile([read(graph, fill(graph), "c", "copy")])
    assert ran(graph) == ["c"]


def test_release_destroys_what_is_ours(graph):
    image = graph.device.gpu.create_texture(label="image", format="rgba8unorm", size=(8, 8, 1))
    graph.begin((8, 8))
    a = fill(graph)
    read(graph, graph.share("image", image), "b")
    read(graph, graph.neutral("texture_2d"), "c", "copy")
    graph.compile([a, "b", "c"])
    graph.run()
    graph.release()
    gone = {entry[1] for entry in graph.device.gpu.log if entry[0] == "destroy"}
    assert gone == {"a", "b", "c", "fill a params", "uniform view", "neutral texture_2d 0.0"}
    assert graph.at_rest and not graph.run()


# Compilation.


def two_pipelines(g):
    g.begin((8, 8))
    read(g, fill(g), "b", "copy")
    g.compile(["b"])


def test_a_driver_that_compiles_at_dispatch_reports_before_each_first_use(graph):
    heard = []
    graph.on_compile = lambda *counts: heard.append(counts)
    two_pipelines(graph)
    assert heard == [(0, 2), (0, 2)]
    heard.clear()
    graph.run()
    assert heard == [(0, 2), (1, 2)]
    graph.run(force=True)
    assert len(heard) == 2


def test_a_driver_that_compiles_at_creation_reports_each_pipeline(graph):
    heard = []
    graph.device.capabilities = GPU
    graph.on_compile = lambda *counts: heard.append(counts)
    two_pipelines(graph)
    assert heard == [(1, 2), (2, 2)]
    graph.run()
    assert len(heard) == 2 and sorted(made(graph, "create_compute_pipeline")) == ["b", "fill a"]


@pytest.mark.parametrize("capabilities", [CPU, GPU])
def test_interrupted_compilation_keeps_what_is_compiled(graph, capabilities):
    def stop(done, of):
        raise KeyboardInterrupt

    graph.device.capabilities = capabilities
    graph.on_compile = stop
    with pytest.raises(KeyboardInterrupt):
        two_pipelines(graph)
    graph.on_compile = None
    two_pipelines(graph)
    assert graph.run() and graph.at_rest
    assert made(graph, "create_compute_pipeline").count("fill a") == 1


# History, settle, split.


def temporal(g, gain=1.0, settle=0):
    g.begin((8, 8))
    a = fill(g, "a", gain)
    mean = g.texture("mean", "rgba16float", history=True)
    reads = {"source": a, "before": mean.previous}
    g.compute("blend", "blend.wgsl", over=mean, reads=reads, writes={"out": mean}, settle=settle)
    read(g, mean, "shown", "copy")
    g.compile(["shown"])


def test_history_swaps_only_when_written(graph):
    temporal(graph)
    first = graph.resources["mean"].object()
    graph.run()
    second = graph.resources["mean"].object()
    assert first is not second
    graph.run()
    assert graph.resources["mean"].object() is second
    temporal(graph, gain=2.0)
    graph.run()
    assert graph.resources["mean"].object() is first


def test_bind_groups_follow_the_swap(graph):
    temporal(graph, settle=2)
    state = graph.passes["blend"].state
    bound = []
    for _ in range(2):
        graph.run()
        _, group = list(state.bind_groups.values())[-1]
        bound.append([e["resource"].texture.label for e in group.entries])
    assert bound == [["a", "mean", "mean (history)"], ["a", "mean (history)", "mean"]]
    made = len(state.bind_groups)
    graph.run(force=True)
    assert len(state.bind_groups) == made


def test_history_does_not_keep_its_own_pass_stale(graph):
    temporal(graph)
    assert ran(graph) == ["fill a", "blend", "shown"]
    assert ran(graph) == []


def test_settle_runs_n_times_and_spreads_downstream(graph):
    temporal(graph, settle=3)
    assert ran(graph) == ["fill a", "blend", "shown"]
    assert graph.settle_progress() == pytest.approx(1 / 3) and not graph.at_rest
    assert ran(graph) == ["blend", "shown"]
    assert state_of(graph, "blend").reason == "settling: run 2 of 3"
    assert ran(graph) == ["blend", "shown"]
    assert graph.settle_progress() == 1.0 and graph.at_rest
    assert ran(graph) == []


def test_more_settle_goes_on_and_a_change_starts_again(graph):
    def progressive(settle, gain=1.0):
        graph.begin((8, 8))
        total = graph.buffer("total", dtype=VEC4, count=64)
        params = {"gain": gain, "width": 0}
        graph.compute("sum", "sum.wgsl", over=total, writes={"total": total}, params=params, settle=settle)
        graph.compile([total])
        indices = []
        while graph.run():
            indices.append(params_of(graph, "sum")[1])
        return indices

    assert progressive(2) == [0, 1]
    assert progressive(5) == [2, 3, 4]
    assert progressive(3) == []
    assert progressive(3, gain=2.0) == [0, 1, 2]
    assert progressive(0, gain=2.0) == []
    assert progressive(0, gain=3.0) == [0]


def test_progress_goes_on_with_a_value_that_would_have_changed_nothing(graph):
    def progressive(gain, width, goes_on):
        graph.begin((8, 8))
        total = graph.buffer("total", dtype=VEC4, count=64)
        params = {"gain": gain, "width": width}
        p = graph.compute("sum", "sum.wgsl", over=total, writes={"total": total}, params=params, settle=3)
        before = None if p.params_before is None else (float(p.params_before["gain"]), int(p.params_before["width"]))
        if goes_on:
            p.ignore_change_of("width")
        graph.compile([total])
        assert graph.stale() == ("sum",) and graph.run()
        gain, index, _, width = params_of(graph, "sum")
        return before, index, gain, width

    assert progressive(1.0, 5, False) == (None, 0, 1.0, 5)
    assert progressive(1.0, 6, True) == ((1.0, 5), 1, 1.0, 6)
    assert progressive(1.0, 7, True) == ((1.0, 6), 2, 1.0, 7)
    assert progressive(2.0, 8, True) == ((1.0, 7), 0, 2.0, 8)
    assert progressive(2.0, 9, False) == ((2.0, 8), 0, 2.0, 9)


def split(g, threads, chunk=64):
    g.begin((8, 8))
    total = g.buffer("total", dtype=VEC4, count=threads)
    params = {"gain": 1.0, "width": 0}
    g.compute("sum", "sum.wgsl", over=total, writes={"total": total}, params=params, split=True, clear=[total])
    g.compile([total])
    g.passes["sum"].state.chunk = chunk


def test_split_covers_all_workgroups_once_each_with_its_own_submit(graph, monkeypatch):
    monkeypatch.setattr("wgpu_gi.gpu.execute.next_chunk", lambda chunk, *_: chunk)
    split(graph, 64 * 150 + 1)
    done = []
    graph.run(on_chunk=done.append)
    log = graph.device.gpu.log
    firsts = [np.frombuffer(e[2], "u4")[2] for e in log if e[0] == "write" and e[1] == "sum params"]
    assert firsts == [0, 64, 128]
    assert [e[2] for e in log if e[0] == "dispatch"] == [(64, 1, 1), (64, 1, 1), (23, 1, 1)]
    assert log.count(("submit",)) == 3 and log.count(("clear", "total")) == 1
    assert done == pytest.approx([64 / 151, 128 / 151, 1.0])


def test_split_may_be_wider_than_a_dispatch(graph):
    split(graph, 64 * 100_000, chunk=10**6)
    graph.run()
    groups = [e[2][0] for e in graph.device.gpu.log if e[0] == "dispatch"]
    assert sum(groups) == 100_000 and max(groups) <= 65535


def test_chunks_of_a_gpu_are_awaited_while_the_next_is_queued(graph, monkeypatch):
    device, submissions, events = graph.device, iter(range(100)), []
    device.capabilities = GPU

    def submit(_commands):
        events.append(f"submit {(number := next(submissions))}")
        return number

    monkeypatch.setattr(device, "submit", submit)
    monkeypatch.setattr(device, "wait", lambda submission: events.append(f"wait {submission}"))
    monkeypatch.setattr("wgpu_gi.gpu.execute.next_chunk", lambda chunk, *_: chunk)
    split(graph, 64 * 64 * 3)
    graph.run()
    assert events == ["submit 0", "submit 1", "wait 0", "submit 2", "wait 1"]
    graph.run(force=True)
    assert events[5:] == ["submit 3", "wait 2", "submit 4", "wait 3", "submit 5", "wait 4"]


def test_interrupted_split_starts_again(graph):
    split(graph, 64 * 200)

    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        graph.run(on_chunk=stop)
    assert not graph.at_rest
    assert ran(graph)[0] == "sum" and graph.at_rest


@pytest.mark.parametrize(
    ("chunk", "count", "seconds", "expected"),
    [
        (64, 64, 0.0001, 512),  # at most eight times as many
        (64, 64, 0.05, 256),
        (64, 64, 0.2, 64),  # as it should be
        (64, 20, 0.01, 64),  # a rest says nothing of a full one
        (64, 64, 0.4, 32),
        (64, 64, 20.0, 16),  # compilation, most likely: no less than a quarter
        (1, 1, 20.0, 1),
        (65535, 65535, 0.001, 65535),
    ],
)
def test_chunks_adapt(chunk, count, seconds, expected):
    assert next_chunk(chunk, count, seconds, CPU.chunk_seconds) == expected


def test_clear_and_indirect(graph):
    graph.points = graph.device.gpu.create_buffer(label="points", size=160)
    graph.begin((8, 8))
    counts = graph.buffer("counts", dtype=VEC4, count=1)
    total = graph.buffer("total", dtype=VEC4, count=10)
    graph.compute("count", "sum.wgsl", over=1, writes={"total": counts}, params={"gain": 1.0, "width": 0})
    points = graph.share("points", graph.points)
    graph.compute("add", "add.wgsl", indirect=counts, reads={"points": points}, writes={"total": total}, clear=[total])
    graph.compile([total])
    assert ran(graph) == ["count", "add"]
    assert ("clear", "total") in graph.device.gpu.log and ("dispatch", "add", "counts") in graph.device.gpu.log


# Raster, samplers, neutral inputs, describing.


def test_raster_targets_by_name(graph):
    graph.begin((8, 8))
    color, normal = (graph.texture(name, "rgba8unorm") for name in ("color", "normal"))
    depth = graph.texture("depth", "depth32float")
    targets = {"normal": normal, "color": color}
    graph.raster("draw", "draw.wgsl", draw=3, color=targets, depth=depth)
    graph.compile([color])
    assert ran(graph) == ["draw"]
    (attachments,) = [e[2] for e in graph.device.gpu.log if e[0] == "targets"]
    assert [a["view"].texture.label for a in attachments["color_attachments"]] == ["color", "normal"]
    assert attachments["depth_stencil_attachment"]["depth_clear_value"] == 0.0
    assert ("draw", "draw", (3, 1)) in graph.device.gpu.log


def test_draw_function_gets_the_encoder(graph):
    graph.begin((8, 8))
    depth = graph.texture("depth", "depth32float")
    color = {n: graph.texture(n, "rgba8unorm") for n in ("color", "normal")}
    graph.raster("draw", "draw.wgsl", draw=lambda encoder: encoder.draw(7, 2), color=color, depth=depth)
    graph.compile([depth])
    graph.run()
    assert ("draw", "draw", (7, 2)) in graph.device.gpu.log


def draw_depth(g, draw, shader="drawn", **more):
    g.begin((8, 8))
    depth = g.texture("depth", "depth32float")
    p = g.raster("draw", f"{shader}.wgsl", draw=draw, depth=depth, **more)
    g.compile([depth])
    return p


def test_draw_functions_that_are_equal_keep_the_state(graph):
    draw_depth(graph, Draw(3))
    assert ran(graph) == ["draw"]
    draw_depth(graph, Draw(3))
    assert ran(graph) == []
    draw_depth(graph, Draw(4))
    assert ran(graph) == ["draw"]


@pytest.mark.parametrize(("draw", "counts"), [(6, (6, 1)), ((6, 2, 3), (6, 2, 3)), (Draw(5), (5, 1))])
def test_index_buffer_is_bound_before_the_draw(graph, draw, counts):
    indices = graph.device.gpu.create_buffer(label="indices", size=24)

    def declare(version):
        graph.begin((8, 8))
        index = graph.share("indices", indices, version)
        depth = graph.texture("depth", "depth32float")
        graph.raster("draw", "drawn.wgsl", draw=draw, index=index, depth=depth)
        graph.compile([depth])

    declare(0)
    assert ran(graph) == ["draw"]
    kind = "draw" if callable(draw) else "draw indexed"
    log = [e for e in graph.device.gpu.log if e[0] in ("index", "draw", "draw indexed")]
    assert log == [("index", "draw", "indices uint32"), (kind, "draw", counts)]
    declare(0)
    assert graph.at_rest
    declare(1)
    assert ran(graph) == ["draw"] and state_of(graph, "draw").reason == "input changed: indices"


def test_written_index_buffer_keeps_its_writer_alive(graph):
    graph.begin((8, 8))
    indices = graph.buffer("indices", dtype=np.uint32, count=8)
    graph.compute("sort", "odd.wgsl", over=1, writes={"one": indices}, entry="index")
    depth = graph.texture("depth", "depth32float")
    graph.raster("draw", "drawn.wgsl", draw=8, index=indices, depth=depth)
    graph.compile([depth])
    assert ran(graph) == ["sort", "draw"] and indices.usage & wgpu.BufferUsage.INDEX


def test_neutral_input_stands_in(graph):
    graph.begin((8, 8))
    graph.compile([read(graph, graph.neutral("texture_2d", 1.0), "b")])
    assert ran(graph) == ["b"]
    graph.begin((8, 8))
    graph.compile([read(graph, graph.neutral("texture_2d", 1.0), "b")])
    assert ran(graph) == []
    with pytest.raises(GiError, match="there is no neutral 'texture_9d'"):
        graph.neutral("texture_9d")


def test_plan_as_text(graph):
    chain(graph)
    graph.run(timings=True)
    text = table(graph.plan())
    assert text.splitlines()[0] == "ran 3, kept 0, culled 1: no output needs d"
    row = state_of(graph, "b")
    assert row.ms is not None and row.p95 >= row.ms and row.bytes == 16 * 16 * 8
    assert f"p95 {row.p95:.2f}" in text and "p95" not in text.splitlines()[-1]


def test_plan_says_what_the_scene_has_none_of(graph):
    graph.begin((8, 8))
    graph.skip("shadow/maps", "no light that casts shadows", "nothing")
    a = fill(graph)
    graph.skip("emitters", "no emissive material", lambda: "at most 3 %")
    graph.skip("masked", "no alpha-masked material", "nothing")
    b = read(graph, a, "b")
    graph.compile([b])
    assert ran(graph) == ["fill a", "b"]
    assert [r.name for r in graph.plan()] == ["shadow/maps", "fill a", "emitters", "masked", "b"]
    row = state_of(graph, "emitters")
    assert (row.state, row.reason, row.ms, row.bytes) == ("culled", "no emissive material", None, 0)
    # Bounds that take long are computed on request.
    assert (row.bound, state_of(graph, "shadow/maps").bound) == ("", "nothing")
    detailed = table(graph.plan(counts=True)).splitlines()
    assert detailed[3].endswith("no emissive material; would add at most 3 %")
    reasons = "no light that casts shadows, no emissive material, no alpha-masked material"
    assert table(graph.plan()).splitlines()[0] == f"ran 2, kept 0, culled 3: {reasons}"
    chain(graph)
    assert [r.name for r in graph.plan()] == ["fill a", "b", "c", "d"]


# Times.


def test_times_of_passes_and_runs(graph):
    clock = iter(float(i**2) for i in range(1000))  # each pass takes longer than the one before
    graph.timing.clock = lambda: next(clock)
    chain(graph)
    for _ in range(3):
        graph.run(force=True, timings=True)
    times = graph.timing
    assert [len(times.samples[n]) for n in ("fill a", "b", "c")] == [3, 3, 3]
    assert list(times.frames) == pytest.approx([sum(times.samples[n][i] for n in times.samples) for i in range(3)])
    assert times.median("b") == times.samples["b"][1] and times.median("d") is None
    assert times.median("b") < times.p95("b") < times.samples["b"][2]
    assert times.frame_ms() == (times.frames[1], pytest.approx(0.1 * times.frames[1] + 0.9 * times.frames[2]))
    assert not graph.run(timings=True) and len(times.frames) == 3  # nothing ran
    times.clear()
    assert times.frame_ms() is None and times.median("b") is None and not times.frames
    graph.run(force=True, timings=True)
    assert len(times.frames) == len(times.samples["b"]) == 1
    chain(graph, size=(32, 32))  # other textures: the times no longer hold
    assert times.frame_ms() is None and times.median("b") is None


def test_interrupted_run_leaves_no_times(graph):
    split(graph, 64 * 200)

    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        graph.run(on_chunk=stop, timings=True)
    assert not graph.timing.frames
    graph.run(timings=True)
    assert list(graph.timing.frames) == list(graph.timing.samples["sum"])


# Messages: each names the pass and the shader file.


def wrong(g, shader, message, name="p", **declaration):
    with pytest.raises(GiError, match=rf"pass '{name}' \({shader}\.wgsl\): .*{message}"):
        g.compute(name, f"{shader}.wgsl", **declaration)


@pytest.fixture
def begun(graph):
    graph.begin((8, 8))
    graph.out = graph.texture("out", "rgba16float")
    graph.source = fill(graph, "source")
    graph.total = graph.buffer("total", dtype=VEC4, count=10)
    graph.good = {"reads": {"source": graph.source}, "writes": {"out": graph.out}, "over": graph.out}
    graph.fill = {"writes": {"out": graph.out}, "over": graph.out}
    return graph


def test_binding_messages(begun):
    g, good = begun, begun.good
    reads, writes = good["reads"], good["writes"]
    wrong(g, "copy", "'sauce' is not a binding; available: source, out", **good | {"reads": {"sauce": g.source}})
    wrong(g, "look", r"'view' is not a binding \(group 0: set it", **good | {"reads": reads | {"view": g.source}})
    wrong(g, "copy", r"nothing is given for 'out' \(a storage texture\)", over=8, reads=reads)
    wrong(g, "copy", "'source' is read-only in the shader", **good | {"reads": {}, "writes": {"source": g.source}})
    wrong(g, "copy", "'out' is write in the shader, but is given in reads", over=8, reads=reads | writes)
    wrong(g, "copy", "out is in reads and in writes", **good | {"reads": reads | writes})
    wrong(g, "copy", "'source' is a texture, but 'total' is a buffer", **good | {"reads": {"source": g.total}})
    wrong(g, "add", "is a storage buffer, but 'source' is a texture", over=8, reads={"points": g.source})
    wrong(g, "copy", "3 is not a texture, buffer or shared resource", **good | {"reads": {"source": 3}})
    wrong(g, "copy", "'out' is read and written in one pass", **good | {"reads": {"source": g.out}})
    wrong(g, "add", "'total' is read and written in", over=8, reads={"points": g.total}, writes={"total": g.total})
    wrong(g, "odd", r"odd\.wgsl:2: 'total' is in group 2", over=8)
    wrong(g, "odd", r"odd\.wgsl:4: 'same' and 'one' have the same group", over=8, entry="twins")
    many = {f"b{i}": g.buffer(f"b{i}", dtype=np.uint32, count=4) for i in range(9)}
    wrong(g, "wide", "its compute stage binds 9 storage buffers; WebGPU guarantees 8", over=8, writes=many)
    sampled = {f"t{i}": g.source for i in range(17)}
    stored = {f"o{i}": g.texture(f"o{i}", "rgba16float") for i in range(5)}
    given = {"over": 8, "reads": sampled, "writes": {"o0": g.out}}
    wrong(g, "many", "binds 17 sampled textures; WebGPU guarantees 16", entry="sampled", **given)
    wrong(g, "many", "binds 5 storage textures; WebGPU guarantees 4", entry="stored", over=8, writes=stored)
    # The limits are per stage: 9 textures in one and 8 in the other are well.
    g.raster("p", "many.wgsl", draw=3, color={"out": g.out}, reads=sampled)


def test_format_messages(begun):
    g, good = begun, begun.good
    other = g.texture("other", "rgba32float")
    wrong(
        g, "copy", "texture_storage_2d<rgba16float, write>, but 'other' is rgba32", **good | {"writes": {"out": other}}
    )
    ids = g.texture("ids", "r32uint")
    wrong(g, "copy", "'source' is texture_2d<f32>, but 'ids' is r32uint", **good | {"reads": {"source": ids}})
    layers = g.texture("layers", "rgba16float", layers=2)
    wrong(g, "copy", "but 'layers' is a 2d texture of 2 layers", **good | {"reads": {"source": layers}})
    words = g.buffer("words", dtype=np.uint32, count=4)
    given = {"over": 8, "reads": {"points": words}, "writes": {"total": g.total}}
    wrong(g, "add", "'words' has elements of 4 bytes, but those of array<vec4f> take 16", **given)
    small = g.share("small", g.device.gpu.create_buffer(label="small", size=8))
    wrong(g, "add", "'small' has 8 bytes, but array<vec4f> needs 16", **given | {"reads": {"points": small}})


def test_sampler_messages(begun):
    g = begun
    texture = g.texture("precise", "rgba32float")
    given = {"over": g.out, "writes": {"out": g.out}}
    linear, nearest = g.sampler("linear"), g.sampler("nearest")
    reads = {"source": texture, "smooth_sampler": linear}
    wrong(
        g, "sample", "'source' has a format that cannot be filtered, but 'smooth_sampler' filters", reads=reads, **given
    )
    wrong(g, "sample", "'smooth_sampler' is a sampler, but", reads=reads | {"smooth_sampler": 1}, **given)
    shadow = reads | {"smooth_sampler": g.sampler(compare="greater")}
    wrong(g, "sample", "'smooth_sampler' is sampler, but the sampler given is comparison", reads=shadow, **given)
    g.compute("p", "sample.wgsl", reads=reads | {"smooth_sampler": nearest}, **given)
    with pytest.raises(GiError, match="there is no sampler 'cubic'"):
        g.sampler("cubic")


def test_params_messages(begun):
    g, given = begun, begun.fill
    wrong(g, "fill", "params lacks gain; Params has gain, width", params={"width": 1}, **given)
    wrong(g, "fill", "no field 'again' in params; available: gain, width", params={"again": 1}, **given)
    wrong(g, "fill", "no field 'settle_index' in params", params={"settle_index": 1}, **given)
    wrong(g, "fill", "params gain is nan, which is not finite", params={"gain": float("nan"), "width": 1}, **given)
    wrong(g, "fill", r"params gain cannot be \(1, 2\)", params={"gain": (1, 2), "width": 1}, **given)
    wrong(
        g,
        "fill",
        "params width cannot be -1: it must lie between 0 and 4294967295",
        params={"gain": 1, "width": -1},
        **given,
    )
    wrong(g, "copy", "params gain given, but its entry point uses no uniform `params`", params={"gain": 1}, **g.good)


def test_constants_and_entry_messages(begun):
    g, good = begun, begun.good
    wrong(g, "copy", "there is no override 'SICE'; available: SIZE, NEEDED", constants={"SICE": 1}, **good)
    wrong(g, "copy", "constant SIZE is inf, which is not finite", constants={"SIZE": float("inf")}, **good)
    wrong(g, "copy", "override NEEDED has no default", entry="other", over=8)
    wrong(g, "copy", "no compute entry point 'maine'; available: main, other", entry="maine", **good)
    one = g.buffer("one", dtype=np.uint32, count=4)
    wrong(g, "odd", "a workgroup of 32 x 32 x 1 threads", entry="large", over=8, writes={"one": one})
    wrong(g, "odd", "it has no @workgroup_size", entry="sizeless", over=8, writes={"one": one})


def test_over_messages(begun):
    g, good = begun, begun.good
    given = {"reads": good["reads"], "writes": good["writes"]}
    wrong(g, "copy", "give either over=", **given)
    wrong(g, "copy", r"65536 x 1 x 1 workgroups; a dispatch has at most 65535", over=65536 * 8, **given)
    wrong(g, "copy", "one to three numbers", over=(1, 2, 3, 4), **given)
    wrong(g, "copy", "one to three numbers", over=-1, **given)
    wrong(g, "copy", "split=True needs a field first_workgroup", split=True, **good)
    shared = g.share("shared", g.device.gpu.create_texture(label="s", format="rgba8unorm", size=(8, 8, 1)))
    wrong(g, "copy", "over cannot be the shared resource 'shared'", **good | {"over": shared})
    wrong(g, "copy", "clear takes buffers that the pass writes", clear=[g.total], **good)


def test_name_and_life_messages(begun):
    g = begun
    wrong(g, "copy", "two passes have this name", name="fill source", **g.good)
    with pytest.raises(GiError, match="pass 'fill source': two passes have this name"):
        g.skip("fill source", "no light", "nothing")
    g.skip("shadow", "no light", "nothing")
    wrong(g, "copy", "two passes have this name", name="shadow", **g.good)
    wrong(g, "copy", "it writes nothing", over=8, entry="other", constants={"NEEDED": 1})
    wrong(g, "nowhere", "there is no shader 'nowhere.wgsl'", over=8)
    for _ in range(2):
        message = "two resources are called 'total'"
        with pytest.raises(GiError, match=message):
            g.buffer("total", dtype=np.float32, count=1)
    old = dict(g.good)
    g.begin((8, 8))
    wrong(g, "copy", "'source' is of another declaration", **old)
    g.compile([])
    wrong(g, "sum", "declared outside of begin", over=1, writes={"total": g.total}, params={"gain": 1, "width": 1})
    with pytest.raises(GiError, match="pass 'shadow': skipped outside of begin"):
        g.skip("shadow", "no light", "nothing")


def test_shared_uniform_messages(begun):
    g = begun
    other = {"view": "view_second"}
    wrong(g, "look", "there is no shared uniform 'view_second'; available: view", uniforms=other, **g.good)
    wrong(g, "copy", "uniforms names view, but the shared uniforms it uses are none", uniforms=other, **g.good)
    g.uniform("view", np.dtype([("shift", "f4", (4,))]))
    wrong(g, "look", "has the fields shift@0, but View here has offset@0", **g.good)
    g.uniform("view", np.dtype("f4"))
    wrong(g, "look", "'view' has 4 bytes, but View here has 16", **g.good)
    del g.uniforms["view"]
    wrong(g, "look", "there is no shared uniform 'view'; available: none", **g.good)
    with pytest.raises(GiError, match="there is no shared uniform 'view'"):
        g.set_uniform("view", 0)


def test_compile_messages(begun):
    g = begun
    silent = g.texture("silent", "rgba16float")
    late = g.texture("late", "rgba16float")
    with pytest.raises(GiError, match=r"output 'silent' is written by no pass"):
        g.compile([silent])
    with pytest.raises(GiError, match=r"there is no resource 'nothing'"):
        g.compile(["nothing"])
    read(g, late, "early", "copy")
    with pytest.raises(GiError, match=r"pass 'early' \(copy\.wgsl\): 'source' reads 'late', which no pass writes"):
        g.compile(["early"])
    g.compute("late", "copy.wgsl", over=late, reads={"source": g.source}, writes={"out": late})
    with pytest.raises(GiError, match=r"pass 'early' .*reads 'late' before pass 'late' writes it"):
        g.compile(["early"])


def test_raster_messages(begun):
    g = begun
    g.texture("depth", "depth32float", size=(4, 4))
    color = {n: g.texture(n, "rgba8unorm") for n in ("color", "normal")}

    def wrong_raster(message, shader="draw", **declaration):
        with pytest.raises(GiError, match=rf"pass 'r' \({shader}\.wgsl\): .*{message}"):
            g.raster("r", f"{shader}.wgsl", draw=3, **declaration)

    depth = g.resources["depth"]
    wrong_raster("color targets colour given, but its outputs are color, normal", color={"colour": color["color"]})
    wrong_raster("its targets differ in size: color 8x8, normal 8x8, depth 4x4", color=color, depth=depth)
    wrong_raster("'color' is rgba8unorm; a depth format is needed", color=color, depth=color["color"])
    wrong_raster("'depth' is depth32float; a color format is needed", color=color | {"color": depth})
    wrong_raster("it has no vertex entry point", shader="copy", color=color)
    wrong_raster("index: 'total' has elements of .*; uint32 is needed", color=color, index=g.total)
    wrong_raster("index: 'color' is a texture; a buffer of uint32 is needed", color=color, index=color["color"])
    wrong_raster("index: 3 is not a texture, buffer or shared resource", color=color, index=3)
    wrong_raster("there is no vertex entry point 'vx'; available: vs", color=color, entry=("vx", "fs"))


def test_resource_messages(graph):
    graph.begin((8, 8))
    with pytest.raises(GiError, match="viewport of 0 x 5"):
        graph.begin((0, 5))
    for message, call in [
        ("texture 't': there is no texture format 'rgb8'", lambda: graph.texture("t", "rgb8")),
        ("texture 't': 9000 x 1 pixels", lambda: graph.texture("t", "r32float", size=(9000, 1))),
        ("1 layers and 5 mip levels do not fit 8 x 8", lambda: graph.texture("t", "r32float", mips=5)),
        ("dimension '1d'", lambda: graph.texture("t", "r32float", dimension="1d")),
        ("buffer 'b': 4 elements in rows of -2", lambda: graph.buffer("b", count=4, width=-2)),
        ("buffer 'b': -1 elements", lambda: graph.buffer("b", count=-1)),
        ("buffer 'b' needs 4096 MiB; this device binds 128 MiB", lambda: graph.buffer("b", count=2**30)),
        ("'n' has no previous contents", lambda: graph.buffer("n", count=1).previous),
        ("has 1 mip levels; there is no level 1", lambda: graph.texture("m", "r32float").mip(1)),
        ("has 1 layers; there is no layer 1", lambda: graph.texture("l", "r32float").layer(1)),
    ]:
        with pytest.raises(GiError, match=message):
            call()
