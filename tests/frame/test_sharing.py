"""Processes and threads that share a GPU: forks, renderers in several threads, and the loss of a device."""

from __future__ import annotations

import subprocess
import sys
import threading

import numpy as np
import pytest
import wgpu

import wgpu_gi as gi
from wgpu_gi.__main__ import main
from wgpu_gi.gpu.device import open_device

SIZE = (32, 18)
SHOW = ("radiance",)

FORK = """
import gc, multiprocessing, sys
import wgpu_gi as gi

def renderer():
    return gi.Renderer(gi.load("cornell-point"), size=(16, 9), settings=gi.Settings(gi="none"))

def use(parents):
    global made
    try:
        (parents or renderer()).step(show=("radiance",))
        print("rendered")
    except gi.GiError as error:
        print(error)
    made = parents = None
    gc.collect()

made = None
if sys.argv[1] != "before":
    made = renderer()
    made.step(show=("radiance",))
child = multiprocessing.get_context("fork").Process(target=use, args=(made if sys.argv[1] == "same" else None,))
child.start()
child.join()
print(child.exitcode)
if made is not None:
    made.step(show=("radiance",))
    print(made.read_back().shape)
"""


def make(technique, **fields):
    settings = gi.Settings(gi=technique, exposure=0.0, **fields)
    return gi.Renderer(gi.load("cornell"), size=SIZE, settings=settings)


def moving_frames(renderer, count=6):
    """Return the pictures of a camera that moves sideways."""
    pictures = []
    for number in range(count):
        renderer.camera = gi.Camera.look_at((2.78 + 0.1 * number, 2.73, -2.6), (2.78, 2.73, 0), yfov_deg=61)
        renderer.step(show=SHOW)
        pictures.append(renderer.read_back())
    return pictures


@pytest.mark.skipif(not hasattr(__import__("os"), "fork"), reason="the system has no fork")
@pytest.mark.parametrize("when", ["before", "after", "same"])
def test_fork_works_before_the_first_use_and_is_refused_after_it(when):
    """The child makes a renderer, or uses that of its parent; it must never wait for ever."""
    command = [sys.executable, "-c", FORK, when]
    child, exit_code, *parent = subprocess.run(
        command, capture_output=True, text=True, timeout=120, check=True
    ).stdout.splitlines()
    if when == "before":
        assert child == "rendered" and not parent
    else:
        assert "forked" in child and "spawn" in child and parent == ["(9, 16, 3)"]
    assert exit_code == "0"


def test_renderers_in_two_threads_render_what_each_renders_alone():
    techniques = ("none", "ssao")
    alone = {name: moving_frames(make(name)) for name in techniques}
    found = {}
    renderers = {name: make(name) for name in techniques}
    threads = [
        threading.Thread(target=lambda name=name: found.update({name: moving_frames(renderers[name])}))
        for name in techniques
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for name in techniques:
        assert all(map(np.array_equal, found[name], alone[name])), name


def test_second_thread_is_refused_while_the_first_renders():
    """Whether it steps, reads or frees; afterwards any thread may use the renderer."""
    renderer, errors = make("path", spp=32), []

    def intrude():
        for action in (lambda: renderer.step(show=SHOW), renderer.read_back, renderer.release):
            with pytest.raises(gi.GiError, match="another thread is using this Renderer") as raised:
                action()
            errors.append(raised.value)

    def on_progress(_):
        if not errors:
            thread = threading.Thread(target=intrude)
            thread.start()
            thread.join()

    renderer.run(on_progress, show=SHOW)
    assert len(errors) == 3
    after = []
    thread = threading.Thread(target=lambda: after.append(renderer.read_back()))
    thread.start()
    thread.join()
    assert np.array_equal(after[0], renderer.read_back())


def test_dropped_renderer_is_freed_at_the_end_of_the_current_frame():
    """Here, a callback drops it while another one renders."""
    others, counts = [make("none")], []
    others[0].step(show=SHOW)

    def textures():
        return wgpu.diagnostics.object_counts.get_dict()["Texture"]["resource_mem"]

    def on_progress(_):
        before = textures()
        others.clear()
        counts.append(before - textures())

    renderer = make("path", spp=1)
    renderer.step(show=SHOW)
    before = textures()
    renderer.settings.spp = 2
    renderer.run(on_progress, show=SHOW)
    assert counts and counts[0] == 0
    assert textures() < before


# ------------------------------------------------------------------------------------------------ Loss of the device


@pytest.fixture
def lost():
    """Lose the device that all renderers share; the next test opens another."""
    yield lambda: open_device(large_buffers=True).gpu.destroy()
    open_device.__globals__["_open"].cache_clear()


def test_lost_device_is_one_sentence_and_a_new_renderer_works(lost):
    renderer = make("none")
    renderer.step(show=SHOW)
    before = renderer.read_back()
    lost()
    for action in (renderer.read_back, lambda: renderer.step(show=SHOW, force=True)):
        with pytest.raises(gi.GiError, match=r"the driver of '.*' has lost the device.* new Renderer") as raised:
            action()
        assert "\n" not in str(raised.value)
    renderer.release()
    renewed = make("none")
    renewed.step(show=SHOW)
    assert np.array_equal(renewed.read_back(), before)


@pytest.mark.parametrize("after", [0, 1, 5])
def test_lost_device_ends_a_sequence_cleanly(lost, after, tmp_path, monkeypatch, capsys):
    """The frames written before are whole, and nothing else is left."""
    monkeypatch.chdir(tmp_path)
    save, written = gi.save_image.__globals__["save_image"], []

    def save_some(path, *arguments, **named):
        save(path, *arguments, **named)
        written.append(path.name)
        if len(written) == after:
            lost()

    monkeypatch.setattr("wgpu_gi.sequence.files.save_image", save_some)
    if not after:
        lost()
    command = ["render", "cornell", "-o", "f_{frame}.npy", "--frames", "0:9", "--turntable", "--gi", "none"]
    assert main([*command, "--size", "16x16", "--exposure", "0", "--set", "camera.frames=2"]) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if not line.startswith(("note:", "warning:"))]
    assert len(errors) == 1 and "has lost the device" in errors[0]
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(["f_job.json", *written])
    assert all(np.load(file).shape == (16, 16, 3) for file in tmp_path.glob("*.npy")) and len(written) == after


# ------------------------------------------------------------------------------------------------ Out of memory

MEMORY = """
import resource, sys
import wgpu_gi as gi

def frame(*size):
    renderer.size = size
    renderer.step(show=("radiance",))
    return renderer.read_back()

renderer = gi.Renderer(gi.load("cornell-point"), size=(32, 18), settings=gi.Settings(gi="none"))
before = frame(32, 18)
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
limits = resource.getrlimit(resource.RLIMIT_AS)
resource.setrlimit(resource.RLIMIT_AS, (used + int(sys.argv[1]) * 2**20, limits[1]))
try:
    frame(2560, 1440)
except gi.GiError as error:
    print(error)
print((frame(32, 18) == before).all())
resource.setrlimit(resource.RLIMIT_AS, limits)
print(frame(640, 360).shape)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs Linux's limits of memory")
@pytest.mark.parametrize("mebibytes", [30, pytest.param(150, marks=pytest.mark.slow)])
def test_renderer_works_again_after_it_ran_out_of_memory(mebibytes):
    command = [sys.executable, "-c", MEMORY, str(mebibytes)]
    printed = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout.splitlines()
    assert len(printed) == 3 and "Not enough memory" in printed[0] and "smaller" in printed[0]
    assert printed[1:] == ["True", "(360, 640, 3)"]
