"""The controls beside a canvas in a notebook, made from the settings."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

import ipywidgets as widgets

from ..options import TECHNIQUES
from ..settings import QUALITIES, Row, describe
from .playback import SPEEDS
from .session import Session

WIDTH = "260px"
MAIN = ("gi", "exposure")  # settings with a control of their own


class Controls:
    """Widgets that change a session: `box` shows them, `done` is called after each change."""

    def __init__(self, session: Session, done: Callable[[], None]) -> None:
        self._session, self._done = session, done
        self._following = False  # `follow` is moving a slider
        self.technique = self._dropdown("technique", (*TECHNIQUES,), session.settings.gi)
        self.quality = self._dropdown("quality", QUALITIES, session.quality)
        automatic = session.settings.exposure is None
        self.automatic = widgets.Checkbox(automatic, description="automatic exposure", layout={"width": WIDTH})
        self.exposure = widgets.FloatSlider(
            session.exposure,
            min=-10.0,
            max=10.0,
            step=0.05,
            description="exposure",
            layout={"width": WIDTH},
        )
        self.buffer = self._dropdown("buffer", session.buffers, session.shown)
        self._rows = {row.name: row for row in describe(session.settings) if row.name not in MAIN}
        self.setting = self._dropdown("setting", (*self._rows,), "bounces")
        self.value = widgets.VBox()
        self._add_playback()
        rows = [self.technique, self.quality, self.exposure, self.automatic, self.buffer, self.setting, self.value]
        self.box = widgets.VBox([*self.playback, *rows], layout={"width": "280px"})
        self.technique.observe(self._on_technique, "value")
        self.quality.observe(self._on_quality, "value")
        self.exposure.observe(self._on_exposure, "value")
        self.automatic.observe(self._on_automatic, "value")
        self.buffer.observe(self._on_buffer, "value")
        self.setting.observe(lambda change: self._show_setting(), "value")
        self._show_setting()

    def _on_technique(self, change: dict[str, Any]) -> None:
        self._session.change("gi", change["new"])
        with self.buffer.hold_trait_notifications():
            self.buffer.options, self.buffer.value = self._session.buffers, self._session.shown
        self._done()

    def _on_quality(self, change: dict[str, Any]) -> None:
        self._session.set_quality(change["new"])
        self._show_setting()
        self._done()

    def follow(self) -> None:
        """Move the exposure slider to the automatic exposure, and the time line to the time that is shown."""
        playback, self._following = self._session.playback, True
        if self.automatic.value and self.exposure.value != self._session.exposure:
            self.exposure.value = self._session.exposure
        if self.playback:
            self.time.max, self.time.value = playback.duration, playback.time
            self.play.value = playback.playing
        self._following = False

    def _add_playback(self) -> None:
        """Make the controls of the scene's animations, if it has any."""
        playback = self._session.playback
        self.playback: tuple[Any, ...] = ()
        if not playback.names:
            return
        self.animation = self._dropdown("animation", playback.names, playback.name)
        self.play = widgets.ToggleButton(playback.playing, description="play", layout={"width": WIDTH})
        self.time = widgets.FloatSlider(
            playback.time, min=0.0, max=playback.duration, step=0.001, description="time (s)", layout={"width": WIDTH}
        )
        low, high = SPEEDS
        self.speed = widgets.FloatSlider(
            playback.speed, min=low, max=high, step=0.1, description="speed", layout={"width": WIDTH}
        )
        self.loop = widgets.Checkbox(playback.loop, description="loop", layout={"width": WIDTH})
        self.playback = self.animation, self.play, self.time, self.speed, self.loop
        self.animation.observe(lambda change: self._play(playback.choose, change["new"]), "value")
        self.play.observe(lambda change: self._play(playback.toggle), "value")
        self.time.observe(lambda change: self._play(playback.seek, change["new"]), "value")
        self.speed.observe(lambda change: setattr(playback, "speed", change["new"]), "value")
        self.loop.observe(lambda change: setattr(playback, "loop", change["new"]), "value")

    def _play(self, action: Callable[..., None], *values: Any) -> None:
        """Carry out an action of the user, not one of `follow`."""
        if not self._following:
            action(*values)
            self._done()

    def _on_exposure(self, change: dict[str, Any]) -> None:
        if not self._following:
            self._session.change("exposure", change["new"])
            self.automatic.value = False
            self._done()

    def _on_automatic(self, change: dict[str, Any]) -> None:
        if change["new"] != (self._session.settings.exposure is None):
            self._session.expose(change["new"])
            self._done()

    def _on_buffer(self, change: dict[str, Any]) -> None:
        if change["new"] not in (None, self._session.shown):
            self._session.show(change["new"])
            self._done()

    def _change(self, name: str, value: object) -> None:
        self._session.change(name, value)
        self._done()

    def _show_setting(self) -> None:
        """Show the control of the selected setting."""
        name = self.setting.value
        row = next(row for row in describe(self._session.settings) if row.name == name)
        control = _control(row)
        control.observe(lambda change: self._change(name, change["new"]), "value")
        limits = f" {row.range[0]:g} to {row.range[1]:g}" if row.range else ""
        told = widgets.HTML(f"<small>{escape(row.sentence)}{escape(f'{limits} {row.unit}'.rstrip())}</small>")
        before, self.value.children = self.value.children, (control, told)
        for widget in before:
            close(widget)

    @staticmethod
    def _dropdown(label: str, choices: tuple[str, ...], value: str) -> Any:
        return widgets.Dropdown(options=choices, value=value, description=label, layout={"width": WIDTH})


def close(widget: Any) -> None:
    """Close a widget with its children, layout and style, which ipywidgets would keep alive."""
    for child in getattr(widget, "children", ()):
        close(child)
    parts = [getattr(widget, name, None) for name in ("layout", "style")]
    widget.close()
    for part in parts:
        if part is not None:
            part.close()


def _control(row: Row) -> Any:
    """Return a control for a setting; a typed value applies on Enter."""
    options = {"description": "value", "layout": {"width": WIDTH}}
    if row.choices:
        return widgets.Dropdown(options=row.choices, value=row.value, **options)
    if row.kind is bool and not row.optional:
        return widgets.Checkbox(row.value, **options)
    text = "none" if row.value is None else str(row.value)
    return widgets.Text(text, continuous_update=False, **options)
