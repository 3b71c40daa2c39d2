"""The notebook's view without a browser: interaction, saved pictures, freed memory; the example notebook."""

from __future__ import annotations

import base64
import io
import re
import time
from pathlib import Path

import nbformat
import numpy as np
import pytest
from helpers.animated import DIM, SLIDE, animated_scene
from nbclient import NotebookClient
from PIL import Image

import wgpu_gi as gi
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.settings import describe
from wgpu_gi.viewer import notebook

EXAMPLE = Path(__file__).parent / "example.ipynb"
SIZE = (64, 36)
WIDGET = "application/vnd.jupyter.widget-view+json"


def execute(*sources):
    """Run cells in one kernel; return the outputs of each."""
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in sources])
    NotebookClient(book, timeout=150, kernel_name="python3").execute()
    return [cell.outputs for cell in book.cells]


def pixels(data):
    """Return the picture of an output."""
    text = data.get("image/png") or re.search(r"base64,([^']+)'", data["text/html"])[1]
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(text))))


@pytest.fixture
def view():
    made = notebook.show("cornell-point", size=SIZE, gi="none")
    yield made
    made.close()


def settle(view):
    while view.session.step() or view.session.moving:
        pass


def event(view, kind, **fields):
    usual = {"x": 32.0, "y": 18.0, "button": 1, "modifiers": ()}
    view._on_event({"event_type": kind, **usual, **fields})


@pytest.mark.slow
def test_example_runs_and_keeps_its_pictures():
    book = nbformat.read(EXAMPLE, 4)
    NotebookClient(book, timeout=150, kernel_name="python3").execute()
    table, shown, picture, plan, normal = (cell.outputs for cell in book.cells if cell.cell_type == "code")
    assert "triangles" in table[0].data["text/html"]
    assert WIDGET in shown[0].data
    still = pixels(shown[1].data)
    assert still.shape == (270, 480, 3)
    assert 20 < still.mean() < 200
    assert pixels(picture[0].data).shape == (180, 320, 3)
    assert "<td style='text-align:left'>gbuffer" in plan[0].data["text/html"]
    assert np.abs(pixels(normal[0].data).astype(int) - 128).max() > 100


@pytest.mark.slow
def test_page_exported_from_the_notebook_has_its_pictures():
    exporter = pytest.importorskip("nbconvert").HTMLExporter()
    book = nbformat.read(EXAMPLE, 4)
    NotebookClient(book, timeout=150, kernel_name="python3").execute()
    page, _ = exporter.from_notebook_node(book)
    shown = re.search(r'<div class="(wgpu-gi-\w+)"><img[^>]* src="data:image/png;base64,([^"]+)"', page)
    still = np.asarray(Image.open(io.BytesIO(base64.b64decode(shown[2]))))
    assert still.shape == (270, 480, 3)
    assert 20 < still.mean() < 200
    assert not re.search(rf"\.{shown[1]} *{{ *display: none", page)
    assert len(re.findall(r'<img[^>]+src="data:image/png;base64,', page)) == 3  # with a frame and a buffer


@pytest.mark.slow
def test_memory_does_not_grow_when_a_cell_runs_twenty_times():
    show = f"import wgpu_gi as gi; gi.show('cornell-point', size={SIZE}, gi='none')"
    count = """
import gc, ipywidgets, wgpu
from wgpu_gi.gpu import device
from wgpu_gi.renderer import Renderer
gc.collect()
renderers = [r for r in gc.get_objects() if isinstance(r, Renderer) and r._gpu.upload is not None]
print(len(ipywidgets.widgets.widget._instances), len(renderers), device._open.cache_info().currsize)
"""
    outputs = execute(show, count, *[show] * 20, count)
    assert outputs[1][0].text == outputs[-1][0].text
    assert outputs[1][0].text.split()[1:] == ["1", "1"]


def test_drags_and_keys_move_the_view(view):
    settle(view)
    start = view.session.camera
    for button, modifiers in ((1, ()), (1, ("Shift",)), (2, ()), (3, ())):
        before = view.session.camera.world_from_view
        event(view, "pointer_down", button=button, modifiers=modifiers)
        event(view, "pointer_move", x=35.0, y=19.0)
        event(view, "pointer_up", x=35.0, y=19.0)
        after = view.session.camera.world_from_view
        assert not np.allclose(before, after)
        event(view, "pointer_move", x=50.0, y=19.0)
        assert np.array_equal(view.session.camera.world_from_view, after)
    event(view, "wheel", dy=-100.0)
    assert not np.allclose(view.session.camera.world_from_view, after)
    event(view, "key_down", key="Home")
    assert np.array_equal(view.session.camera.world_from_view, start.world_from_view)
    pivot = view.session.pivot
    width, height = view.canvas.get_logical_size()
    event(view, "double_click", x=0.2 * width, y=0.8 * height)
    assert not np.allclose(view.session.pivot, pivot)


def test_controls_change_the_picture(view):
    settle(view)
    before = notebook._pixels(view.session).mean()
    view.controls.exposure.value = 1.0
    settle(view)
    assert notebook._pixels(view.session).mean() > before + 5
    view.controls.buffer.value = "depth"
    settle(view)
    assert view.session.shown_range is None or view.session.shown == "depth"
    assert np.ptp(notebook._pixels(view.session), axis=-1).max() == 0


def test_controls_play_the_animation():
    view = notebook.show(animated_scene(), size=SIZE, at=0.25, gi="none")
    controls, session = view.controls, view.session
    assert (controls.animation.options, controls.time.value, controls.time.max) == (("slide", "dim"), 0.25, SLIDE)
    settle(view)
    before = notebook._pixels(session)
    event(view, "key_down", key=" ")
    time.sleep(0.1)
    session.step()
    view._tell()
    assert controls.play.value and session.moving and controls.time.value == session.renderer.time > 0.25
    controls.play.value = False
    controls.time.value = 0.875
    settle(view)
    assert session.renderer.time == 0.875
    assert np.abs(notebook._pixels(session).astype(int) - before).max() > 20
    controls.animation.value = "dim"
    assert (session.renderer.animation, session.renderer.time, controls.time.max) == ("dim", 0.0, DIM)
    view.close()


@pytest.mark.parametrize("gi", TECHNIQUES)
def test_buffers_follow_the_technique(view, gi):
    view.controls.technique.value = gi
    assert view.session.settings.gi == gi
    assert view.controls.buffer.options == view.session.buffers
    view.session.step()
    assert not view.session.error


def test_every_setting_has_a_control(view):
    for row in describe(view.session.settings):
        if row.name in view.controls.setting.options:
            view.controls.setting.value = row.name
            control = view.controls.value.children[0]
            if control.value in ("none", "True", "False") or isinstance(control.value, bool):
                continue
            control.value = str(control.value)
            assert not view.session.error, row.name


def test_bad_value_is_an_error_below_the_canvas(view):
    before = view.session.settings.camera.frames
    view.controls.setting.value = "camera.frames"
    view.controls.value.children[0].value = "0"
    assert "camera.frames" in view._status.value
    assert view.session.settings.camera.frames == before


def test_closing_frees_all_memory(view):
    import ipywidgets

    before = set(ipywidgets.widgets.widget._instances)
    other = notebook.show("cornell-point", size=SIZE, gi="none")
    settle(other)
    assert other.session.renderer._gpu.upload is not None
    other.close()
    other.close()
    assert set(ipywidgets.widgets.widget._instances) == before
    assert other.session.renderer._gpu.upload is None


def test_pictures_are_displayed_by_the_notebook():
    picture = gi.render(gi.load("cornell-point"), size=SIZE, gi="none")
    shown = np.asarray(Image.open(io.BytesIO(picture._repr_png_())))
    assert shown.shape == (*SIZE[::-1], 3)
    automatic = np.asarray(Image.open(io.BytesIO((picture * 4)._repr_png_())))
    assert np.array_equal(automatic, shown)
    picture.exposure = 0.0
    held, brighter = (np.asarray(Image.open(io.BytesIO(p._repr_png_()))) for p in (picture, picture * 4))
    assert brighter.mean() > held.mean() + 10
    assert picture[..., 0]._repr_png_() is None
    assert type(picture.mean()) is np.float32
    depth = gi.render(gi.load("cornell-point"), size=SIZE, gi="none", show="depth")
    assert np.asarray(Image.open(io.BytesIO(depth._repr_png_()))).shape == (*SIZE[::-1], 3)


def test_scene_that_does_not_load_is_one_sentence():
    with pytest.raises(gi.GiError, match="nowhere"):
        gi.show("nowhere.glb")


def test_time_in_the_animation_is_given_once():
    """As `at`, like that of `render`, or as `time`."""
    view = notebook.show(animated_scene(), size=SIZE, time=0.25, gi="none")
    assert view.controls.time.value == 0.25
    with pytest.raises(gi.GiError, match=r"at=0\.25 and time=0\.5 are both the time"):
        gi.show(animated_scene(), size=SIZE, at=0.25, time=0.5)
