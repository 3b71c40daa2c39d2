"""The viewer in a notebook: a live canvas with controls, and a still picture that is saved with the notebook."""

from __future__ import annotations

import asyncio
import base64
import time
import weakref
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError, warn_of
from ..extras import install_hint
from ..options import Settings
from ..pictures.display import display_layer, png_bytes
from ..pictures.tables import html_table
from ..renderer import Renderer
from ..rendering import settings_of
from ..scene.load import lit_at
from ..scene.scene import Environment
from .camera_controller import CameraController
from .session import DISPLAY, REST_SECONDS, Session

try:
    import ipywidgets as widgets
    from IPython import get_ipython
    from IPython.display import HTML, display
    from rendercanvas.anywidget import RenderCanvas

    from .controls import Controls, close
except ImportError as error:
    raise GiError(f"gi.show needs packages ({error.name} is missing): {install_hint('jupyter')}") from None

FIRST_SECONDS = 1.0  # render this long before a cell returns, so that its still picture is more than noise
TELL_SECONDS = 0.25  # between updates of the status line
FRAMES_PER_SECOND = 60  # upper limit
LEFT, MIDDLE, RIGHT = 1, 3, 2  # mouse buttons of the canvas
EVENTS = ("pointer_down", "pointer_move", "pointer_up", "double_click", "wheel", "key_down", "resize")

_views: dict[str, list[weakref.ref[View]]] = {}  # keys: the cells that show the views


def show(
    scene: Any = "cornell",
    *,
    size: tuple[int, int] = (640, 360),
    camera: Camera | str | int | dict[str, Any] | None = None,
    environment: Environment | str | Path | None = None,
    at: float | None = None,
    time: float | None = None,
    animation: str | int | None = None,
    gi: str | None = None,
    quality: str | None = None,
    settings: Settings | None = None,
    adapter: str | None = None,
) -> View:
    """Return a live view of a scene; the last line of a cell shows it, as `display` does.

    Drag to orbit, shift + drag to pan, right drag to look around, wheel to zoom, double-click to set the pivot; F
    frames the scene, Home returns to the start camera, the space bar plays and pauses the animation. Running the cell
    again closes its earlier view. Arguments are those of `render`; the view changes a copy of `settings`. A number as
    `time` is `at`: a view has no budget. Raises GiError for bad values.
    """
    if at is not None and time is not None:
        raise GiError(f"at={at!r} and time={time!r} are both the time in the animation; leave out time")
    chosen = settings_of(settings, {"gi": gi}, quality)
    if settings is None:
        chosen.path.samples_per_run = 1  # shows the first sample at once
    lighted, seconds, notes = lit_at(scene, environment, time if at is None else at, animation)
    warn_of(notes, stacklevel=2)
    renderer = Renderer(lighted, size=size, camera=camera, settings=chosen, adapter=adapter)
    renderer.time, renderer.animation = seconds, animation
    return View(Session(renderer, quality or "medium", (lighted.name or "SCENE",)))


class _Canvas(RenderCanvas):  # type: ignore[misc]
    """A canvas that can be closed: `_rc_close` of rendercanvas 2.7.2 recurses without end."""

    _is_closed: bool

    def _rc_close(self) -> None:
        if not self._is_closed:
            self._is_closed = True
            widgets.Widget.close(self)


class View:
    """A session on a canvas. `close` frees its memory, also on the GPU."""

    def __init__(self, session: Session) -> None:
        self.session, self._controller = session, CameraController(session)
        self.canvas = _Canvas(size=session.size, update_mode="ondemand", max_fps=FRAMES_PER_SECOND)
        self._bitmap = self.canvas.get_bitmap_context()
        self.controls = Controls(session, self._changed)
        self._status, self._live = widgets.HTML(), widgets.HTML()
        self._passes = widgets.Accordion([widgets.HTML()], titles=("passes",))
        column = widgets.VBox([self.canvas, self._status])
        self.box = widgets.VBox([widgets.HBox([column, self.controls.box]), self._passes, self._live])
        self._still: Any = None  # the display of the still picture
        self._told = 0.0  # time of the last status line
        self._seconds = 0.0  # time of the last frame
        self._note = ""  # result of the last action
        self._run = ""  # the run of the cell that shows it
        self._dragged: tuple[str, float, float] | None = None  # kind of drag, and its last place
        self._closed = False
        self.canvas.request_draw(self._draw)
        self.canvas.add_event_handler(self._on_event, *EVENTS)
        self.canvas.observe(self._on_visible, "_has_visible_views")
        self._passes.observe(self._on_passes, "selected_index")

    def close(self) -> None:
        """Remove the widgets and free the memory."""
        if self._closed:
            return
        self._closed = True
        self.canvas.close()
        close(self.box)
        self.session.renderer.release()

    def _ipython_display_(self) -> None:
        _close_earlier(self)
        deadline = time.monotonic() + FIRST_SECONDS
        while self.session.step() and time.monotonic() < deadline:
            pass
        self._show_pixels()
        self._tell()
        display(self.box)
        self._still = display(HTML(self._still_html()), display_id=True)

    def _display_(self) -> Any:
        """Return what marimo shows: the canvas alone, since marimo takes no other Jupyter widgets."""
        return self.canvas

    # ------------------------------------------------------------------------------------------------ Drawing

    def _draw(self) -> None:
        """Render a frame when the page is ready, and request the next while there is more to do."""
        session, start = self.session, time.perf_counter()
        ran = session.step()
        if ran:
            self._seconds = time.perf_counter() - start
            self._show_pixels()
            self.canvas.request_draw()
        elif not session.at_rest:
            asyncio.get_running_loop().call_later(REST_SECONDS, self._wake)
        elif self._still is not None:
            self._still.update(HTML(self._still_html()))
        if not ran or time.monotonic() - self._told > TELL_SECONDS:
            self._tell()

    def _wake(self) -> None:
        if not self._closed:
            self.canvas.request_draw()

    def _changed(self) -> None:
        """Draw after a control changed, or show the error."""
        self._tell()
        self._wake()

    def _show_pixels(self) -> None:
        pixels = _pixels(self.session)
        self._bitmap.set_bitmap(np.dstack([pixels, np.full(pixels.shape[:2], 255, np.uint8)]))

    def _tell(self) -> None:
        """Update the text below the canvas."""
        self._told = time.monotonic()
        session = self.session
        told = f"{session.status()}, {self._seconds * 1e3:.0f} ms a frame" + (self._note and f", {self._note}")
        if session.shown_range is not None:
            told += ", from {:.5g} to {:.5g}".format(*session.shown_range)
        self.controls.follow()
        self._status.value = f"<b>{escape(session.error)}</b>" if session.error else escape(told)
        if self._passes.selected_index is not None:
            rows = session.renderer.graph.plan()
            cells = [(r.name, r.state, "" if r.ms is None else f"{r.ms:.2f}", r.reason) for r in rows]
            self._passes.children[0].value = html_table(("pass", "state", "ms", "why"), cells)

    def _still_html(self) -> str:
        """Return the still picture as HTML."""
        data = base64.b64encode(png_bytes(DISPLAY, _pixels(self.session))).decode()
        return f"<div class='{self._mark}'><img src='data:image/png;base64,{data}'/></div>"

    @property
    def _mark(self) -> str:
        return f"wgpu-gi-{self.canvas.model_id}"

    # ------------------------------------------------------------------------------------------------ Events

    def _on_visible(self, _change: object) -> None:
        """Hide the still picture on pages that show the live canvas."""
        self._live.value = f"<style>.{self._mark} {{ display: none }}</style>"

    def _on_passes(self, change: dict[str, Any]) -> None:
        self.session.measure = change["new"] is not None
        self._changed()

    def _on_event(self, event: dict[str, Any]) -> None:
        kind = event["event_type"]
        if kind == "resize":
            width, height = self.canvas.get_physical_size()
            if (width, height) != self.session.size:
                self.session.resize(width, height)
        elif kind == "wheel":
            self._controller.zoom(-event["dy"] / 100.0)
        elif kind == "key_down":
            self._on_key(event["key"])
        elif kind == "double_click":
            width, height = self.canvas.get_logical_size()
            self._note = self._controller.set_pivot(event["x"] / width, event["y"] / height)
            self.session.changed()
        else:
            self._on_pointer(kind, event)
        self._wake()

    def _on_key(self, key: str) -> None:
        if key in ("f", "F"):
            self._controller.frame_all()
        elif key == " ":
            self.session.playback.toggle()
        elif key == "Home":
            self._controller.take(self.session.start_camera)

    def _on_pointer(self, kind: str, event: dict[str, Any]) -> None:
        """Begin, continue or end a drag."""
        x, y = event["x"], event["y"]
        if kind == "pointer_down":
            shifted = event["button"] == MIDDLE or "Shift" in event["modifiers"]
            self._dragged = ("look" if event["button"] == RIGHT else "pan" if shifted else "orbit"), x, y
        elif kind == "pointer_up":
            self._dragged = None
        elif self._dragged is not None:
            height = max(self.canvas.get_logical_size()[1], 1)
            what, before_x, before_y = self._dragged
            self._controller.drag(what, (x - before_x) / height, (y - before_y) / height)
            self._dragged = what, x, y


def _pixels(session: Session) -> NDArray[np.uint8]:
    """Return the buffer shown as sRGB bytes (height, width, 3); black after an error."""
    if session.error:
        return np.zeros((session.size[1], session.size[0], 3), np.uint8)
    if session.shown == DISPLAY:
        session.shown_range = None
        return np.asarray(session.renderer.read_back(DISPLAY))
    values = session.values()
    session.shown_range = float(values.min()), float(values.max())
    return np.round(display_layer(session.shown, values, session.exposure) * 255.0).astype(np.uint8)


def _close_earlier(view: View) -> None:
    """Close the views of earlier runs of the same cell; record this one."""
    kernel = getattr(get_ipython(), "kernel", None)
    if kernel is None:
        return
    parent = kernel.get_parent("shell")
    cell = parent.get("metadata", {}).get("cellId") or parent.get("content", {}).get("code", "")
    run = parent.get("header", {}).get("msg_id", "")
    for earlier in _views.pop(cell, []):
        known = earlier()
        if known is not None and known._run != run:
            known.close()
        elif known is not None:
            _views.setdefault(cell, []).append(earlier)
    view._run = run
    _views.setdefault(cell, []).append(weakref.ref(view))
