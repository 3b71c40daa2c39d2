"""The desktop viewer: a window on a session. It draws after events and while a picture converges, else it sleeps."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import glfw
import wgpu

from ..errors import GiError
from ..pictures.display import display_layer
from . import navigation
from .camera_controller import CameraController
from .certification import certify_view
from .comparison import Comparison
from .panel import Panel
from .saving import command_of, save
from .screen import Screen
from .session import DISPLAY, Session
from .thumbnails import sheet, thumbnails
from .window import SETTLE_FRAMES, Window

FLIGHT = 0.25  # flight speed, scene sizes per second: across a scene in four seconds
DOUBLE_CLICK_SECONDS, DOUBLE_CLICK_REACH = 0.4, 0.01  # between the clicks; the reach is a share of the window's height
IDLE_SECONDS = 0.5  # longest wait for an event, as shader files are checked in between
MOVE_SECONDS = 0.02  # longest wait while the view moves, to see when it comes to rest
TICK_SECONDS = 0.1  # between redraws during a long frame: a longer pause looks stuck
MEASURE_SECONDS = 0.5  # between measurements of the error: two numbers per second are readable

_FLIGHT_KEYS = {
    glfw.KEY_D: (1, 0, 0),
    glfw.KEY_A: (-1, 0, 0),
    glfw.KEY_E: (0, 1, 0),
    glfw.KEY_Q: (0, -1, 0),
    glfw.KEY_W: (0, 0, 1),
    glfw.KEY_S: (0, 0, -1),
}


class App:
    """Turns events into changes of a session, and draws the session."""

    def __init__(self, session: Session, title: str) -> None:
        """Open the window. Raises GiError if there is no display."""
        self.session = session
        session.on_compile = self._compiled
        self.controller = CameraController(session)
        self.comparison = Comparison(session)
        actions = {
            "save (S)": lambda: self._todo.append(self._save),
            "copy command (C)": lambda: self._todo.append(self._copy),
            "certify": lambda: self._todo.append(self._certify),
            "help (?)": self._toggle_help,
        }
        self.panel = Panel(session, self.comparison, actions)
        device = session.renderer.graph.device
        self.window = Window(title, session.size, device, self)
        self.screen = Screen(device, self.window.format)
        self._thumbnailed = False  # the thumbnails show the current view
        self._held: int | None = None  # the mouse button that drags
        self._modifiers = 0
        self._place = (0.0, 0.0)
        self._click = (-1.0, (0.0, 0.0))  # time and place of the last click
        self._flown = self._drawn = self._measured = time.monotonic()
        self._todo: list[Callable[[], None]] = []  # actions to carry out between steps

    def run(self) -> None:
        """Show the session until the window is closed."""
        busy = True
        while not self.window.closing:
            busy = self.turn(busy)

    def turn(self, busy: bool) -> bool:
        """Handle events, render and draw; wait for an event first unless `busy`. Return whether there is more to do."""
        # Handle events.
        session, window = self.session, self.window
        at_once = busy or window.wanted > 0 or self._flying
        window.events(0.0 if at_once else MOVE_SECONDS if session.moving else IDLE_SECONDS)
        if 0 in window.size:
            window.events(IDLE_SECONDS)
            return False
        self._prepare()

        # While the panel is in use, draw first: a slow picture must not delay the panel.
        if window.wanted and session.resolution.level and not session.urgent:
            self._draw()
            return True

        # Render the view, else refine the truth beside it.
        ran = session.step(self._tick)
        refined = False
        if ran:
            self._take()
            self.comparison.ready = False
        elif not session.moving and not session.error:
            refined = self._compare()
        self._update_thumbnails()

        # Draw if anything changed.
        told, self.panel.status = self.panel.status, session.status()
        if ran or refined or window.wanted or told != self.panel.status:
            self._draw()
        return ran or refined

    def close(self) -> None:
        """Close the window."""
        self.comparison.close()
        self.window.close()

    # ------------------------------------------------------------------------------------------------ Pictures

    def _prepare(self) -> None:
        """Apply resizing, flight, saved shaders and the actions requested since the last turn."""
        session, window = self.session, self.window
        self._follow_size()
        self._fly()
        if session.watch_shaders():
            window.wanted = SETTLE_FRAMES
        todo, self._todo = self._todo, []
        for action in todo:
            action()

    def _follow_size(self) -> None:
        """Give the picture the size of the window."""
        size = self.window.size
        if size != self.session.size and 0 not in size:
            self.session.resize(*size)

    def _take(self) -> None:
        """Copy the rendered buffer to the screen's texture."""
        session = self.session
        self.panel.probe.take()
        self._thumbnailed = False
        if session.shown == DISPLAY:
            session.shown_range = None
            self.screen.copy(0, session.renderer.display_texture())
            return
        values = session.values()
        session.shown_range = float(values.min()), float(values.max())
        self.screen.write(0, display_layer(session.shown, values, session.exposure))

    def _compare(self) -> bool:
        """Refine the truth, copy it to the screen's texture, measure the error; return False without anything to do."""
        comparison, now = self.comparison, time.monotonic()
        was_ready = comparison.ready
        refined = comparison.step(self._tick)
        if not comparison.ready or (was_ready and not refined):
            return refined
        if comparison.mode == "difference":
            self.screen.write(1, comparison.difference())
        else:
            self.screen.copy(1, comparison.display())
        if not refined or now - self._measured > MEASURE_SECONDS:
            comparison.measure()
            self._measured = time.monotonic()
        self.window.wanted = max(self.window.wanted, 1)
        return refined

    def _update_thumbnails(self) -> None:
        """Make the thumbnails of the passes once the view rests, if the panel shows them."""
        if not self.panel.shows_thumbnails or self._thumbnailed or not self.session.at_rest:
            return
        found = list(thumbnails(self.session.renderer.graph))
        self.panel.thumbnails = [(name, resource) for name, resource, _ in found]
        self.panel.sheet = self.window.sheet(sheet([picture for *_, picture in found]))
        self._thumbnailed, self.window.wanted = True, SETTLE_FRAMES

    def _draw(self) -> None:
        comparison = self.comparison
        shows_truth = comparison.ready and not self.session.moving
        split = (comparison.split if comparison.mode == "split" else 0.0) if shows_truth else 2.0

        def picture(render_pass: Any, width: int) -> None:
            self.screen.draw(render_pass, split, width, self.panel.place)

        self.window.draw(picture, self.panel.draw)
        self._drawn = time.monotonic()

    def _compiled(self, done: int, count: int) -> None:
        """Keep the last picture and say what is being compiled."""
        self._wait_on(f"compiling {done} of {count}")

    def _tick(self, fraction: float) -> None:
        """Say how much of a long frame is done."""
        self._wait_on(f"{fraction:.0%}")

    def _wait_on(self, progress: str) -> None:
        """Handle events during a long frame, and redraw the last picture with the progress of this one."""
        self.window.events(0.0)
        self._follow_size()
        if self._flying:
            self._fly()
        if time.monotonic() - self._drawn > TICK_SECONDS or self.window.wanted:
            self.panel.status = f"{self.session.status()} ... {progress}"
            self._draw()

    # ------------------------------------------------------------------------------------------------ Actions

    def _save(self) -> None:
        try:
            self.panel.message = "saved " + " and ".join(file.name for file in save(self.session))
        except GiError as error:
            self.panel.message = str(error)
        self.window.wanted = SETTLE_FRAMES

    def _certify(self) -> None:
        try:
            certify_view(self.session, self._tick)
            self._take()
        except GiError as error:
            self.panel.message = str(error)
        self.window.wanted = SETTLE_FRAMES

    def _copy(self) -> None:
        command = command_of(self.session)
        self.window.clipboard(command)
        print(command, flush=True)
        self.panel.message = "copied: " + command

    def _toggle_help(self) -> None:
        self.panel.help = not self.panel.help

    def _set_pivot(self, place: tuple[float, float]) -> None:
        self.panel.message = self.controller.set_pivot(*place)
        self.window.wanted = SETTLE_FRAMES

    # ------------------------------------------------------------------------------------------------ Events

    def button(self, button: int, down: bool, modifiers: int, place: tuple[float, float]) -> None:
        """Begin or end a drag; a double click sets the pivot."""
        self._held, self._modifiers = (button if down else None), modifiers
        self._flown = time.monotonic()
        if not down or button != glfw.MOUSE_BUTTON_LEFT:
            return
        (before, there), now = self._click, time.monotonic()
        near = max(abs(place[0] - there[0]), abs(place[1] - there[1])) < DOUBLE_CLICK_REACH
        if now - before < DOUBLE_CLICK_SECONDS and near:
            self._todo.append(lambda: self._set_pivot(place))
            self.session.changed()
            now = 0.0
        self._click = now, place

    def move(self, place: tuple[float, float], delta: tuple[float, float]) -> None:
        """Drag: orbit, pan or look around."""
        self.panel.pointer = place
        if self._held is None or delta == (0.0, 0.0):
            return
        shifted = self._held == glfw.MOUSE_BUTTON_MIDDLE or self._modifiers & glfw.MOD_SHIFT
        self.controller.drag("look" if self._held == glfw.MOUSE_BUTTON_RIGHT else "pan" if shifted else "orbit", *delta)

    def scroll(self, amount: float) -> None:
        """Zoom."""
        self.controller.zoom(amount)

    def key(self, key: int, down: bool, modifiers: int) -> None:
        """Run the command of a key, unless the key is flying the camera."""
        session, cameras = self.session, self.session.renderer.scene.cameras
        if down and key == glfw.KEY_Q and modifiers & glfw.MOD_CONTROL:
            self.window.quit()
        if not down or self._held == glfw.MOUSE_BUTTON_RIGHT or modifiers & (glfw.MOD_CONTROL | glfw.MOD_ALT):
            return
        if key == glfw.KEY_S:
            self._todo.append(self._save)
        elif key == glfw.KEY_C:
            self._todo.append(self._copy)
        elif key == glfw.KEY_SPACE:
            session.playback.toggle()
        elif key == glfw.KEY_F:
            self.controller.frame_all()
        elif key == glfw.KEY_HOME:
            self.controller.take(session.start_camera)
        elif key == glfw.KEY_TAB:
            self.panel.visible = not self.panel.visible
        elif key == glfw.KEY_ESCAPE:
            self.panel.help = False
        elif 0 <= key - glfw.KEY_1 < min(len(cameras), 9):
            self.controller.take(cameras[key - glfw.KEY_1])

    def character(self, character: str) -> None:
        """Toggle the help by "?", on any keyboard layout."""
        if character == "?":
            self._toggle_help()

    @property
    def _flying(self) -> bool:
        held = self._held == glfw.MOUSE_BUTTON_RIGHT
        return held and any(map(self.window.is_down, _FLIGHT_KEYS))

    def _fly(self) -> None:
        """Move the camera by the flight keys held and the time since the last call."""
        now, session = time.monotonic(), self.session
        seconds, self._flown = now - self._flown, now
        if not self._flying:
            return
        fast = 4.0 if self.window.is_down(glfw.KEY_LEFT_SHIFT) else 1.0
        length = FLIGHT * fast * seconds * navigation.size_of(session.renderer.scene)
        held = [steps for key, steps in _FLIGHT_KEYS.items() if self.window.is_down(key)]
        session.camera = navigation.fly(session.camera, [length * sum(axis) for axis in zip(*held, strict=True)])


def view(session: Session, title: str) -> None:
    """Show a session in a window until it is closed. Raises GiError without a display, or if the GPU is lost."""
    app = App(session, title)
    try:
        app.run()
    except (wgpu.GPUError, RuntimeError) as error:
        raise GiError(f"the GPU failed ({error}); to render this view: {command_of(session)}") from error
    finally:
        app.close()
