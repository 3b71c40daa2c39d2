"""The panel of the desktop viewer: controls made from the settings, truth, pixel probe, lights, passes."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from typing import Any

from imgui_bundle import imgui

from ..options import TECHNIQUES, Settings, uses
from ..settings import QUALITIES, Row, describe
from .comparison import MODES, Comparison
from .lights import LightPanel
from .playback import SPEEDS
from .probe import PROBED, Probe
from .session import Session
from .thumbnails import SIZE

WIDTH, MARGIN = 380.0, 8.0  # points
CAPTION = 23  # characters below a picture
WIDE_RANGE = 100.0  # a slider is logarithmic from this ratio of its ends on: two decades
LARGEST_SLIDER = 2**31 - 1  # a slider's whole numbers have 32 bits

HELP = """\
left drag            orbit about the pivot
double click         set the pivot to the surface there
middle drag          pan; also shift + left drag
wheel                zoom to the pivot
right drag           look around; with W A S D Q E held: fly, with shift faster
Space                play and pause the animation
F                    frame all
Home                 return to the camera of the start
1 ... 9              the scene's cameras
S                    save the picture as .png and .exr
C                    copy the command line that renders this view
Tab                  panel on and off
Ctrl+Q               quit
?                    this help"""


class Panel:
    """Draws itself with imgui. `actions` maps the labels of buttons to what they do."""

    def __init__(self, session: Session, comparison: Comparison, actions: dict[str, Callable[[], None]]) -> None:
        self.visible = True
        self.help = False
        self.message = ""  # result of the last action
        self.status = ""  # progress of the picture
        self._session, self._comparison, self._actions = session, comparison, actions
        self.pointer = (-1.0, -1.0)  # shares of the window's width and height; outside [0, 1) over the panel
        self.probe, self._lights = Probe(session), LightPanel(session)
        self.shows_thumbnails = False
        self.thumbnails: list[tuple[str, str]] = []  # pass and resource of each
        self.sheet: Any = None  # texture with all of them, one below the other
        # Left, top, right, bottom, shares of the window: the screen's shader draws the panel's background.
        self.place = (0.0, 0.0, 0.0, 0.0)
        self._listed: Settings | None = None
        self._sectioned: dict[str, list[Row]] = {}  # the rows of `_listed` by section
        self._edited: dict[str, Any] = {}  # values being dragged or typed, which apply on release

    def draw(self) -> None:
        """Draw the whole panel with imgui."""
        self.place = (0.0, 0.0, 0.0, 0.0)
        if self.visible:
            self._main()
        else:
            self._session.measure = self.probe.on = self.shows_thumbnails = False
        if self.help:
            self._help()
        if self._session.error:
            self._error()

    def _main(self) -> None:
        imgui.set_next_window_pos(imgui.ImVec2(MARGIN, MARGIN), imgui.Cond_.always)
        height = max(imgui.get_io().display_size.y - 2 * MARGIN, 100.0)
        imgui.set_next_window_size(imgui.ImVec2(WIDTH, height), imgui.Cond_.always)
        imgui.set_next_window_bg_alpha(0.0)
        imgui.begin("wgpu_gi", None, imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_resize)
        corner, extent, whole = imgui.get_window_pos(), imgui.get_window_size(), imgui.get_io().display_size
        right, bottom = (corner.x + extent.x) / whole.x, (corner.y + extent.y) / whole.y
        self.place = (corner.x / whole.x, corner.y / whole.y, right, bottom)
        imgui.text_wrapped(self.status)
        for i, (label, action) in enumerate(self._actions.items()):
            if i:
                imgui.same_line()
            if imgui.button(label):
                action()
        if self.message:
            imgui.text_wrapped(self.message)
        if self._session.certificate is not None:
            imgui.text_wrapped(self._session.certificate.sentence())
        imgui.separator()
        self._animation()
        self._rendering()
        self._truth()
        self._probe()
        self._lights.draw()
        self._plan()
        self._thumbnails()
        self._sections()
        imgui.end()

    def _animation(self) -> None:
        """Draw the time line of the scene's animations."""
        playback = self._session.playback
        if not playback.names:
            return
        name = _combo("animation", playback.name, playback.names)
        if name:
            playback.choose(name)
        if imgui.button("pause (Space)" if playback.playing else "play (Space)"):
            playback.toggle()
        imgui.same_line()
        _, playback.loop = imgui.checkbox("loop", playback.loop)
        imgui.same_line()
        imgui.set_next_item_width(WIDTH * 0.3)
        flags = imgui.SliderFlags_.always_clamp | imgui.SliderFlags_.logarithmic
        _, playback.speed = imgui.slider_float("speed", playback.speed, *SPEEDS, format="%.2f", flags=flags)
        sought, seconds = imgui.slider_float("time (s)", playback.time, 0.0, playback.duration, "%.3f")
        if sought:
            playback.seek(seconds)
        imgui.separator()

    def _rendering(self) -> None:
        """Draw technique, quality, exposure, and the buffer shown."""
        session = self._session
        technique = _combo("technique", session.settings.gi, tuple(TECHNIQUES))
        imgui.set_item_tooltip(TECHNIQUES[session.settings.gi].sentence)
        if technique:
            session.change("gi", technique)
        quality = _combo("quality", session.quality, QUALITIES)
        imgui.set_item_tooltip("Sets all settings that have presets.")
        if quality:
            session.set_quality(quality)
        imgui.set_next_item_width(WIDTH * 0.4)
        changed, exposure = imgui.slider_float("exposure (EV)", session.exposure, -10.0, 10.0, "%.2f")
        if changed:
            session.change("exposure", exposure)
        imgui.same_line()
        switched, automatic = imgui.checkbox("automatic", session.settings.exposure is None)
        imgui.set_item_tooltip("Log-average luminance to 0.18; follows the view when it rests.")
        if switched:
            session.expose(automatic)
        shown = _combo("buffer", session.shown, session.buffers)
        if shown:
            session.show(shown)
        values = session.shown_range
        if values is not None:
            imgui.text(f"from {values[0]:.5g} to {values[1]:.5g}")

    def _truth(self) -> None:
        comparison = self._comparison
        mode = _combo("path tracer", comparison.mode, MODES)
        imgui.set_item_tooltip("Compare the view with the path tracer, which converges while the view rests.")
        if mode:
            comparison.mode = mode
        if comparison.on and comparison.mode == "split":
            _, comparison.split = imgui.slider_float("split", comparison.split, 0.0, 1.0, "%.2f")
        if comparison.on and comparison.errors is not None:
            errors = comparison.errors
            error = f"{errors.relmse:.3g}" if errors.relmse > 0 else "below the noise"
            imgui.text(f"relMSE {error}, bias {errors.bias:+.2%}")
            if errors.floor is not None:
                imgui.text(f"noise of the path tracer (subtracted): {errors.floor:.3g}")

    def _probe(self) -> None:
        """Draw the values of the pixel under the mouse."""
        self.probe.on = bool(imgui.collapsing_header("pixel"))
        nothing = [""] * (1 + len(PROBED))  # keeps the controls below in place
        for line in (self.probe.lines(*self.pointer) or nothing) if self.probe.on else ():
            imgui.text(line)

    def _sections(self) -> None:
        """Draw the settings that the technique uses, by section."""
        settings = self._session.settings
        if settings != self._listed:
            self._listed, self._sectioned = deepcopy(settings), {}
            for row in describe(settings):
                if row.name not in ("gi", "exposure") and uses(settings.gi, row.name):
                    self._sectioned.setdefault(row.name.rpartition(".")[0] or "frame", []).append(row)
        for name, rows in self._sectioned.items():
            if imgui.collapsing_header(name):
                imgui.push_id(name)
                for row in rows:
                    self._setting(row)
                imgui.pop_id()

    def _setting(self, row: Row) -> None:
        """Draw one setting; its value applies when the mouse or the text field is released."""
        label = row.name.rpartition(".")[2] + (f" ({row.unit})" if row.unit else "")
        imgui.set_next_item_width(WIDTH * 0.4)
        value = self._edited.get(row.name, row.value)
        if row.choices:
            chosen = _combo(label, row.value, row.choices)
            if chosen:
                self._session.change(row.name, chosen)
        elif row.kind is bool and not row.optional:
            changed, value = imgui.checkbox(label, value)
            if changed:
                self._session.change(row.name, value)
        else:
            changed, value = _field(label, row, value)
            if changed:
                self._edited[row.name] = value
            if imgui.is_item_deactivated_after_edit() and row.name in self._edited:
                self._session.change(row.name, self._edited[row.name])
            if not imgui.is_item_active():
                self._edited.pop(row.name, None)
        imgui.set_item_tooltip(_tooltip(row))

    def _plan(self) -> None:
        """Draw state and time of each pass in the last step."""
        opened = bool(imgui.collapsing_header("passes"))
        self._session.measure = opened
        if not opened:
            return
        rows = self._session.renderer.graph.plan()
        counts = ", ".join(f"{sum(r.state == s for r in rows)} {s}" for s in ("ran", "kept", "culled"))
        imgui.text(f"{counts}; {sum(r.ms or 0.0 for r in rows):.1f} ms")
        if not imgui.begin_table("plan", 3, imgui.TableFlags_.row_bg):
            return
        for row in rows:
            imgui.table_next_row()
            for text in (row.name, row.state, "" if row.ms is None else f"{row.ms:.2f} ms"):
                imgui.table_next_column()
                imgui.text(text)
                imgui.set_item_tooltip(row.reason)
        imgui.end_table()

    def _thumbnails(self) -> None:
        """Draw thumbnails of what each pass wrote, two per row."""
        self.shows_thumbnails = bool(imgui.collapsing_header("pass outputs"))
        if not self.shows_thumbnails or self.sheet is None:
            return
        size, count = imgui.ImVec2(*SIZE), len(self.thumbnails)
        for i, (name, resource) in enumerate(self.thumbnails):
            if i % 2:
                imgui.same_line()
            imgui.begin_group()
            imgui.image(self.sheet, size, imgui.ImVec2(0, i / count), imgui.ImVec2(1, (i + 1) / count))
            imgui.text(resource[-CAPTION:])
            imgui.end_group()
            imgui.set_item_tooltip(f"{resource}, written by {name}")

    def _help(self) -> None:
        centre = imgui.get_main_viewport().get_center()
        imgui.set_next_window_pos(centre, imgui.Cond_.appearing, imgui.ImVec2(0.5, 0.5))
        _, opened = imgui.begin("help", self.help, imgui.WindowFlags_.always_auto_resize)
        self.help = bool(opened)
        imgui.text(HELP)
        imgui.end()

    def _error(self) -> None:
        size = imgui.get_io().display_size
        imgui.set_next_window_pos(imgui.ImVec2(size.x / 2, size.y - 16), imgui.Cond_.always, imgui.ImVec2(0.5, 1.0))
        imgui.set_next_window_size(imgui.ImVec2(size.x * 0.7, 0), imgui.Cond_.always)
        imgui.begin("error", None, imgui.WindowFlags_.no_collapse)
        imgui.text_wrapped(self._session.error)
        imgui.end()


def _combo(label: str, value: str, choices: tuple[str, ...]) -> str | None:
    """Return the new choice of the user, None if there is none."""
    changed, index = imgui.combo(label, choices.index(value) if value in choices else -1, list(choices))
    return choices[index] if changed else None


def _field(label: str, row: Row, value: Any) -> tuple[bool, Any]:
    """Return whether a number or a text is being edited, and its value."""
    limits = row.range
    if row.optional or limits is None or row.kind not in (int, float) or max(map(abs, limits)) > LARGEST_SLIDER:
        return imgui.input_text(label, "none" if value is None else str(value))
    wide = limits[0] > 0 and limits[1] / limits[0] >= WIDE_RANGE
    flags = imgui.SliderFlags_.always_clamp | (imgui.SliderFlags_.logarithmic if wide else 0)
    if row.kind is int:
        return imgui.slider_int(label, value, int(limits[0]), int(limits[1]), flags=flags)
    return imgui.slider_float(label, value, *limits, format="%.4g", flags=flags)


def _tooltip(row: Row) -> str:
    limits = f" {row.range[0]:g} to {row.range[1]:g}" if row.range else ""
    presets = ", ".join(f"{quality} {value}" for quality, value in row.presets.items())
    notes = [f"{row.name}{limits} {row.unit}".rstrip(), f"default {row.default}", presets]
    return row.sentence + "\n" + "; ".join(note for note in notes if note)
