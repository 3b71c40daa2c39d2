"""Imports and line map, struct layouts, and what is reflected of a shader."""

from __future__ import annotations

import os

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.gpu.messages import compiler_message
from wgpu_gi.gpu.wgsl.load import load, refresh
from wgpu_gi.gpu.wgsl.tokens import evaluate, tokenize


@pytest.fixture
def shader(tmp_path):
    """Return a function that writes files and loads the first."""

    def write(text="", **files):
        for name, content in {"main": text, **files}.items():
            (tmp_path / f"{name}.wgsl").write_text(content)
        return load("main.wgsl", root=tmp_path)

    return write


def struct(shader, body, before=""):
    return shader(f"{before}\nstruct S {{ {body} }}").struct_dtype("S")


# Imports.


def test_each_file_is_pasted_once_depth_first(shader):
    source = shader(
        '#import "a.wgsl"\n#import "b.wgsl"\nconst M = 1;',
        a='const A = 1;\n#import "b.wgsl"\nconst A2 = 2;',
        b="const B = 1;",
    )
    assert source.text.split("\n") == ["const A = 1;", "const B = 1;", "const A2 = 2;", "const M = 1;", ""]
    assert [source.where(i) for i in range(1, 5)] == ["a.wgsl:1", "b.wgsl:1", "a.wgsl:3", "main.wgsl:3"]


def test_missing_import_names_the_line(shader):
    with pytest.raises(GiError, match=r"^main\.wgsl:2: there is no shader 'nowhere\.wgsl'"):
        shader('\n#import "nowhere.wgsl"')


def test_missing_shader(tmp_path):
    with pytest.raises(GiError, match=r"there is no shader 'none\.wgsl' in "):
        load("none.wgsl", root=tmp_path)


def test_cycle(shader):
    with pytest.raises(GiError, match=r"b\.wgsl:1: import cycle a\.wgsl -> b\.wgsl -> a\.wgsl"):
        shader('#import "a.wgsl"', a='#import "b.wgsl"', b='#import "a.wgsl"')


def test_import_must_be_quoted(shader):
    with pytest.raises(GiError, match=r"main\.wgsl:1: write #import"):
        shader("#import a.wgsl")


def test_read_again_when_asked_after_a_file_changed(shader, tmp_path):
    first = shader('#import "a.wgsl"', a="const A = 1;")
    assert load("main.wgsl", root=tmp_path) is first
    (tmp_path / "a.wgsl").write_text("const A = 2;")
    os.utime(tmp_path / "a.wgsl", ns=(1, 1))
    assert load("main.wgsl", root=tmp_path) is first
    # A shader read after the change does not hide it from those read before.
    assert load("a.wgsl", root=tmp_path).constants["A"] == 2
    changes = refresh()
    assert load("main.wgsl", root=tmp_path).constants["A"] == 2
    assert refresh() == changes
    (tmp_path / "a.wgsl").write_text("const A = ;")
    os.utime(tmp_path / "a.wgsl", ns=(2, 2))
    assert refresh() == changes + 1


def test_a_file_written_with_the_same_text_gives_the_same_source(shader, tmp_path):
    first = shader('#import "a.wgsl"', a="const A = 1;")
    os.utime(tmp_path / "a.wgsl", ns=(1, 1))
    changes = refresh()
    assert load("main.wgsl", root=tmp_path) is first and refresh() == changes


def test_a_file_that_was_missing_is_found_once_it_is_there(tmp_path):
    (tmp_path / "main.wgsl").write_text('#import "late.wgsl"')
    with pytest.raises(GiError, match=r"there is no shader 'late\.wgsl'"):
        load("main.wgsl", root=tmp_path)
    changes = refresh()
    (tmp_path / "late.wgsl").write_text("const A = 1;")
    assert refresh() == changes + 1 and load("main.wgsl", root=tmp_path).constants["A"] == 1


# Layout: the examples of the WGSL specification, section 14.4, and what padding does.


def offsets(dtype):
    return [dtype.fields[name][1] for name in dtype.names]


def test_layout_of_specification_example(shader):
    # WGSL section 14.4.4, "Layout of structures using implicit member sizes and alignments".
    inner = "struct A { u: f32, v: f32, w: vec2<f32>, x: f32 }"
    dtype = struct(shader, "a: vec2f, b: vec3f, c: f32, d: f32, e: A, f: vec3f, g: array<A, 3>, h: i32", inner)
    assert offsets(dtype) == [0, 16, 28, 32, 40, 64, 80, 152]
    assert dtype.itemsize == 160
    assert dtype["e"].itemsize == 24 and dtype["g"].shape == (3,)


def test_layout_with_explicit_size_and_alignment(shader):
    # The same section, with explicit attributes.
    inner = "struct A { u: f32, v: f32, w: vec2<f32>, @size(16) x: f32 }"
    dtype = struct(shader, "a: vec2f, @align(16) b: vec3f, c: f32, d: f32, @align(16) e: A", inner)
    assert offsets(dtype) == [0, 16, 28, 32, 48]
    assert dtype["e"].itemsize == 32 and dtype.itemsize == 80


@pytest.mark.parametrize(
    ("kind", "shape", "itemsize", "base"),
    [
        ("f32", (), 4, "f4"),
        ("atomic<u32>", (), 4, "u4"),
        ("vec2<i32>", (2,), 8, "i4"),
        ("vec3u", (3,), 16, "u4"),
        ("vec4h", (4,), 8, "f2"),
        ("mat4x4f", (4, 4), 64, "f4"),
        ("mat3x3<f32>", (3, 4), 48, "f4"),  # a column of three takes four
        ("mat2x3f", (2, 4), 32, "f4"),
        ("mat3x2f", (3, 2), 24, "f4"),
        ("array<vec3f, 4>", (4, 4), 64, "f4"),
        ("array<f32, N>", (6,), 24, "f4"),
        ("array<array<vec2f, 2>, N * 2>", (12, 2, 2), 192, "f4"),
        ("Row", (3,), 16, "f4"),
    ],
)
def test_layout_of_types(shader, kind, shape, itemsize, base):
    dtype = struct(shader, f"x: {kind}", "const N: u32 = 2u * 3u; alias Row = vec3f;")
    values = np.zeros((), dtype)["x"]
    assert values.shape == shape and values.dtype == np.dtype(base)
    assert dtype.itemsize == itemsize


def test_runtime_array_at_the_end(shader):
    source = shader("struct S { count: u32, items: array<vec3f> } @group(1) @binding(0) var<storage> s: S;")
    layout = source.layout(source.bindings["s"].type)
    assert source.struct_dtype("S").names == ("count",)
    assert (layout.size, layout.runtime, layout.element.stride) == (16, True, 16)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("x: bool", "type bool cannot be shared"),
        ("x: array<f32>, y: f32", "only the last member may be a runtime-sized array, not 'x'"),
        ("x: Nothing", "type Nothing cannot be shared"),
    ],
)
def test_types_without_layout(shader, body, message):
    with pytest.raises(GiError, match=rf"main\.wgsl: .*{message}"):
        struct(shader, body)


def test_unknown_struct(shader):
    with pytest.raises(GiError, match=r"main\.wgsl declares no struct 'T'; available: S"):
        shader("struct S { a: f32 }").struct_dtype("T")


# Reflection.

SHADER = """
enable f16; /* a comment /* in a comment */ struct No { } */
diagnostic(off, derivative_uniformity);
const PI: f32 = 3; // const NOT = 1;
const N = (1u << 3u) - 2;
const COMPUTED = sin(1.0);
override WIDTH: u32 = 64;
override SCALE: f32 = 1;
override DEPTH: u32;
override HALF: u32 = WIDTH / 2;
override ON: bool = true;
struct View { clip_from_world: mat4x4f, eye: vec3f, time: f32, }
@group(0) @binding(2) var<uniform> view: View;
@group(1) @binding(0) var<storage, read_write> nodes: array<View>;
@group(1) @binding(1) var<storage> lights: array<vec4f>;
@group(1) @binding(2) var albedo: texture_2d_array<f32>;
@group(1) @binding(3) var out: texture_storage_2d<rgba16float, write>;
@group(1) @binding(4) var linear: sampler;
@group(1) @binding(5) var shadow: texture_depth_2d;
@group(1) @binding(N) var<storage> unused: array<u32>;
var<private> seed: u32 = 1;
var<workgroup> tile: array<array<f32, 4>, N>;
const_assert N == 6;
fn fetch(at: vec2f) -> vec4f { return textureSampleLevel(albedo, linear, at, 0, 0.0); }
fn twice(at: vec2f) -> vec4f { return fetch(at) * 2 + view.unused; }
@compute @workgroup_size(WIDTH, N / 3) fn main(@builtin(global_invocation_id) id: vec3u) {
  if id.x < DEPTH { textureStore(out, id.xy, twice(vec2f(id.xy)) + lights[0]); }
}
struct Targets { @location(1) normal: vec4f, @location(0) flux: vec4f, @builtin(frag_depth) d: f32 }
@vertex fn vs() -> @builtin(position) vec4f { return view.clip_from_world[0]; }
@fragment fn fs() -> Targets { var t: Targets; return t; }
@fragment fn one() -> @location(0) vec4f { return vec4f(PI); }
"""


def test_constants_and_overrides(shader):
    source = shader(SHADER)
    assert source.constants == {"PI": 3.0, "N": 6} and isinstance(source.constants["PI"], float)
    assert source.overrides == {"WIDTH": 64, "SCALE": 1.0, "DEPTH": None, "HALF": None, "ON": True}
    assert source.module.required_overrides == {"DEPTH"}


def test_bindings(shader):
    found = {b.name: (b.group, b.number, b.space, b.access, str(b.type)) for b in shader(SHADER).bindings.values()}
    assert found == {
        "view": (0, 2, "uniform", "read", "View"),
        "nodes": (1, 0, "storage", "read_write", "array<View>"),
        "lights": (1, 1, "storage", "read", "array<vec4f>"),
        "albedo": (1, 2, "texture", "read", "texture_2d_array<f32>"),
        "out": (1, 3, "storage_texture", "write", "texture_storage_2d<rgba16float, write>"),
        "linear": (1, 4, "sampler", "read", "sampler"),
        "shadow": (1, 5, "texture", "read", "texture_depth_2d"),
        "unused": (1, 6, "storage", "read", "array<u32>"),
    }


def test_entry_points_know_what_they_reach(shader):
    source = shader(SHADER)
    main, vs = source.entry_points["main"], source.entry_points["vs"]
    assert (main.stage, main.workgroup_size) == ("compute", ("WIDTH", 2))
    assert set(source.bindings) & main.uses == {"view", "albedo", "linear", "out", "lights"}
    assert set(source.bindings) & vs.uses == {"view"}
    assert source.entry_points["fs"].outputs == {"normal": 1, "flux": 0}
    assert source.entry_points["one"].outputs == {"": 0}


def test_texture_and_sampler_used_together(shader):
    assert shader(SHADER).module.sampled == {("albedo", "linear")}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0x1Fu", 31),
        ("1e3f", 1000.0),
        (".5", 0.5),
        ("-7 / 2", -3),
        ("-7 % 2", -1),
        ("2 + 3 * 4 - 1", 13),
        ("1u << 4u >> 1u", 8),
        ("(1 + 2) * u32(4.7)", 12),
        ("A * 2", 6),
        ("1 / 0", None),
        ("B", None),
        ("f(1)", None),
        ("1 2", None),
        ("", None),
    ],
)
def test_constant_expressions(text, value):
    assert evaluate(tokenize(text), {"A": 3}) == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("\nstruct S { a f32 }", r"main\.wgsl:2: expected ':', found 'f32'"),
        ("const A = 1;\nfoo", r"main\.wgsl:2: expected a declaration, found 'foo'"),
        ("/* open", "this block comment is not closed"),
        ("fn f() {", "found 'end of file'"),
        ("@group(0) @binding(X) var<uniform> a: f32;", "'X' is not an integer"),
    ],
)
def test_unreadable_shaders(shader, text, message):
    with pytest.raises(GiError, match=message):
        shader(text)


def test_compiler_messages_lead_to_the_file(shader):
    source = shader('#import "a.wgsl"\nfn f() { g(); }\n', a="const A = 1;\nfn g() -> f32 {\n  return 1u;\n}\n")
    text = (
        "Validation Error\n\nCaused by:\n  In wgpuDeviceCreateShaderModule\n\n"
        "Shader 'x' parsing error: no definition\n  ┌─ wgsl:5:10\n  │\n5 │ fn f() { g(); }\n  │          ^ here\n\n"
    )
    message = compiler_message(RuntimeError(text), source)
    assert message.splitlines()[0] == "main.wgsl:2: parsing error: no definition"
    assert "┌─ main.wgsl:2:10" in message and "2 │ fn f() { g(); }" in message and "5 │" not in message
    assert compiler_message(RuntimeError("Validation Error\n\nCaused by:\n  In f\n    a\n      b"), source) == "a: b"
