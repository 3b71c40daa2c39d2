"""The command line end to end, on whatever adapter there is: files, messages, exit codes."""

from __future__ import annotations

import json
import os
import re
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.terminal import interrupted
from PIL import Image

from wgpu_gi.__main__ import main
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.pictures.image import load_image

TINY = ["--size", "32x18", "--spp", "2", "--gi", "path"]
BUFFERS = ["radiance", "direct", "indirect", "emission", "albedo", "normal", "depth", "position", "instance"]
BUFFERS += ["standard_error"]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def start(*arguments: str, **options) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-m", "wgpu_gi", *arguments], text=True, **options)


def picture(*arguments: str, name: str = "p.npy") -> np.ndarray:
    """Render in this process to linear floats."""
    assert main(["render", "-o", name, *TINY, *arguments]) == 0
    return load_image(name)


def test_command_makes_a_picture(folder):
    process = start("render", "cornell", "--size", "32x18", stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    out, err = process.communicate()
    assert process.returncode == 0, err
    assert re.fullmatch(r"out\.png: 32x18, 24 frames, exposure \+[\d.]+ EV \(automatic\), [\d.]+ s on .+\n", out)
    assert "\r" not in err  # no progress bar off a terminal
    assert load_image("out.png").shape == (18, 32, 3)
    assert os.listdir(folder) == ["out.png"]


def test_npy_is_linear_radiance():
    values = picture("--exposure", "5")
    assert (values.shape, values.dtype) == ((18, 32, 3), np.float32)
    assert np.isfinite(values).all()
    assert values.min() >= 0.0
    assert values.max() > 1.0  # the lamp, neither exposed nor tone-mapped
    assert np.array_equal(values, picture())


@pytest.mark.parametrize("suffix", ["exr", "npz"])
def test_every_buffer_in_one_file(suffix):
    shows = [argument for name in BUFFERS for argument in ("--show", name)]
    assert main(["render", "-o", f"p.{suffix}", *TINY, *shows]) == 0
    layers = {name: load_image(f"p.{suffix}", name) for name in BUFFERS}
    for name, layer in layers.items():
        assert layer.shape[:2] == (18, 32), name
        assert np.isfinite(layer).all(), name
    assert np.array_equal(load_image(f"p.{suffix}"), layers["radiance"])
    total = layers["direct"] + layers["indirect"] + layers["emission"]
    assert np.allclose(total, layers["radiance"], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("name", ["normal", "depth", "albedo"])
def test_png_shows_other_buffers(name):
    assert main(["render", *TINY, "--show", name]) == 0
    shown = load_image("out.png")
    assert shown.max() > shown.min()


def test_seed_determines_the_picture():
    assert np.array_equal(picture("--seed", "7"), picture("--seed", "7"))
    assert not np.array_equal(picture("--seed", "7"), picture("--seed", "8"))


def test_path_tracer_without_bounces_equals_direct_light():
    """Both have only direct light; the path tracer has no noise with one point light."""
    arguments = ("cornell-point", "--diffuse", "--set", "camera.jitter=false")
    traced, deferred = picture("--bounces", "0", *arguments), picture("--gi", "none", *arguments)
    assert np.allclose(deferred.mean((0, 1)), traced.mean((0, 1)), rtol=0.005)
    assert traced.sum() < picture(*arguments).sum()


@pytest.mark.parametrize("gi", TECHNIQUES)
def test_exposure_is_the_same_by_flag_and_by_setting(gi):
    def shown(*arguments):
        assert main(["render", "-o", "p.png", "--gi", gi, *TINY, *arguments]) == 0
        return load_image("p.png")

    plain, brighter = shown("--exposure", "0"), shown("--exposure", "1.5")
    assert brighter.mean() > 1.5 * plain.mean()
    assert np.array_equal(shown("--set", "exposure=1.5"), brighter)
    assert np.array_equal(shown("--exposure", "-3", "--set", "exposure=1.5"), brighter)
    automatic = shown()
    with Image.open("p.png") as picture:
        stops, _, word = picture.text["exposure"].partition(" EV ")
    assert word == "(automatic)"
    assert np.array_equal(shown("--exposure", stops), automatic)


def test_camera_light_and_environment_options_change_the_picture(folder):
    Path("cam.json").write_text(json.dumps({"position": [0.1, 1.0, 3.0], "target": [0, 1, 0], "yfov_deg": 50}))
    plain = picture()
    assert not np.array_equal(picture("--camera", "cam.json"), plain)
    assert np.array_equal(picture("--camera", "0"), plain)
    assert picture("--light", "point 0,1,0 3,3,3").sum() > plain.sum()
    assert picture("--env", "1,1,1").sum() > plain.sum()
    assert not np.array_equal(picture("--set", "camera.jitter=false"), plain)


def test_plan_and_timings_are_printed(capsys):
    assert main(["render", *TINY, "--plan", "--timings", "--check", "--diffuse"]) == 0
    printed = capsys.readouterr().out
    assert "ran" in printed
    assert "ms" in printed
    assert printed.splitlines()[-1].startswith("out.png: 32x18")


def test_info_names_the_adapter_in_use(capsys):
    assert main(["info"]) == 0
    printed = capsys.readouterr().out
    for words in ("will be used", "wgpu 0.32", "features: ", "limits: ", "missing"):
        assert words in printed


def test_info_is_quick():
    start_time = time.perf_counter()
    assert start("info", stdout=subprocess.DEVNULL).wait() == 0
    # The aim is 2 s; twice that allows for a loaded machine.
    assert time.perf_counter() - start_time < 4.0


def hostile_glb(announced: int) -> bytes:
    """Return a GLB whose buffer claims to have `announced` bytes."""
    text = json.dumps(
        {
            "asset": {"version": "2.0"},
            "buffers": [{"byteLength": announced}],
            "bufferViews": [{"buffer": 0, "byteLength": announced}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": announced // 12, "type": "VEC3"}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "nodes": [{"mesh": 0}],
            "scenes": [{"nodes": [0]}],
            "scene": 0,
        }
    ).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sII", b"glTF", 2, 20 + len(text)) + struct.pack("<I4s", len(text), b"JSON") + text


BAD_FILES = {
    "empty.glb": b"",
    "truncated.glb": hostile_glb(1200)[:60],
    "magic.glb": b"NotAGlTF" * 4,
    "json.gltf": b'{"hello": "world"}',
    "broken.gltf": b'{"asset": ',
    "huge.glb": hostile_glb(10**10),
    "nothing.obj": b"# nothing\n",
    "picture.xyz": b"1 2 3",
    "sky.hdr": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100000 +X 100000\n",
    "cam.json": b'{"position": [0, 0, 0], "target": [0, 0, 0]}',
}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("missing.glb", "missing.glb"),
        ("picture.xyz", r"\.xyz"),
        ("empty.glb", "empty"),
        ("truncated.glb", "truncated.glb"),
        ("magic.glb", "magic.glb"),
        ("json.gltf", "json.gltf"),
        ("broken.gltf", "broken.gltf"),
        ("huge.glb", "huge.glb"),
        ("nothing.obj", "nothing.obj"),
        ("nonsense", "no built-in scene"),
        ("--env sky.hdr", "100000x100000"),
        ("--env missing.hdr", "missing.hdr"),
        ("--env 1,nan,1", "finite"),
        ("--camera missing.json", "missing.json"),
        ("--camera cam.json", "same point"),
        ("--camera 99", "no camera"),
        ("--light sun", "sun"),
        ("--size 0x0", "0x0"),
        ("--size 100000x100000", "100000x100000"),
        ("--spp 0", "spp"),
        ("--seed -1", "seed"),
        ("--show beauty", "beauty"),
        ("--set path.nonsense=1", "path.nonsense"),
        ("--adapter nonesuch", "nonesuch"),
        ("-o out.tiff", r"\.tiff"),
        ("-o missing/out.png", "no folder"),
    ],
)
def test_bad_input_is_one_sentence_and_nothing_is_written(arguments, words, capsys, folder):
    for name in BAD_FILES.keys() & set(arguments.split()):
        Path(name).write_bytes(BAD_FILES[name])
    before = sorted(os.listdir(folder))
    assert main(["render", *TINY, *arguments.split()]) == 2
    printed = capsys.readouterr()
    error = [line for line in printed.err.splitlines() if not line.startswith(("note: ", "warning: "))]
    assert len(error) == 1, printed.err
    assert error[0].startswith("wgpu-gi: error: ")
    assert re.search(words, error[0])
    assert printed.out == ""
    assert sorted(os.listdir(folder)) == before


def test_strict_refuses_a_damaged_file(folder, capsys):
    """Without --strict the bad face is left out, with a note."""
    Path("bad.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 9\n", encoding="ascii")
    assert main(["render", "bad.obj", "-o", "p.npy", *TINY]) == 0
    assert "bad.obj" in capsys.readouterr().err
    os.remove("p.npy")
    assert main(["render", "bad.obj", "-o", "p.npy", *TINY, "--strict"]) == 2
    error = capsys.readouterr().err
    assert "bad.obj" in error and "Traceback" not in error and not os.path.exists("p.npy")


def test_light_with_nan_is_refused():
    import wgpu_gi as gi

    scene = gi.load("cornell-point")
    scene.lights[0].intensity = float("nan")
    with pytest.raises(gi.GiError, match="light"):
        gi.render(scene, size=(8, 8), gi="path", spp=1)


def test_no_adapter_is_one_sentence(folder):
    environment = {**os.environ, "VK_DRIVER_FILES": "/nonexistent.json", "VK_ICD_FILENAMES": "/nonexistent.json"}
    process = start("render", *TINY, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    _, err = process.communicate()
    if sys.platform != "linux":
        pytest.skip("only the Vulkan loader can be told to find no driver")
    assert process.returncode == 2
    assert "install" in err
    assert "Traceback" not in err
    assert not os.listdir(folder)


PATH = ("render", "-o", "out.exr", "--gi", "path")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to a single process")
def test_interrupt_before_the_first_picture_leaves_no_file(folder):
    """The first run of the path tracer would take minutes."""
    code, seen = interrupted(
        b"rendering", *PATH, "--size", "1280x720", "--spp", "100000", "--set", "path.samples_per_run=64"
    )
    assert code == 130
    assert b"interrupted; no file was left half-written" in seen
    assert b"Traceback" not in seen
    assert not os.listdir(folder)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to a single process")
def test_interrupt_saves_the_picture_so_far(folder):
    code, seen = interrupted(rb"[1-9]%", *PATH, "--size", "32x18", "--spp", "20000", "--set", "path.samples_per_run=1")
    assert code == 130
    assert b"Traceback" not in seen
    done = int(re.search(rb"holds the picture so far, (\d+) of 20000 spp", seen)[1])
    assert b"relMSE" in seen and os.listdir(folder) == ["out.exr"]
    expected = picture("--spp", str(done))
    assert load_image("out.exr") == pytest.approx(expected, rel=1e-4, abs=1e-6)
