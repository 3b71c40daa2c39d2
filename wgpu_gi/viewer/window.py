"""A desktop window with a wgpu surface; its events go to imgui and to a handler.

It uses glfw directly, not rendercanvas. The viewer must handle events in the middle of a frame that takes seconds, and
sleep until the next event; rendercanvas draws and dispatches events from a loop of its own.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any, Protocol

import glfw
import numpy as np
import wgpu
from imgui_bundle import imgui
from numpy.typing import NDArray
from wgpu.utils.glfw_present_info import get_glfw_present_info
from wgpu.utils.imgui import ImguiWgpuBackend

from ..errors import GiError
from ..gpu.device import Device

LEAST_SCALE, LARGEST_SCALE = 1.0, 4.0  # pixels per unit in which windows and the mouse are measured
SETTLE_FRAMES = 3  # frames after an event until imgui has settled

# imgui's names of the keys that text fields use. Tab is left out: it would begin to edit the first field.
_KEYS: dict[int, tuple[imgui.Key, ...]] = {
    getattr(glfw, f"KEY_{name}"): (getattr(imgui.Key, name.lower()),)
    for name in ("BACKSPACE", "ENTER", "ESCAPE", "DELETE", "SPACE", "HOME", "END", *"ACVXYZ")
}
for _name in ("LEFT", "RIGHT", "UP", "DOWN"):
    _KEYS[getattr(glfw, f"KEY_{_name}")] = (getattr(imgui.Key, f"{_name.lower()}_arrow"),)
for _name, _short in (("CONTROL", "ctrl"), ("SHIFT", "shift"), ("ALT", "alt"), ("SUPER", "super")):
    for _side in ("LEFT", "RIGHT"):
        _key = getattr(imgui.Key, f"{_side.lower()}_{_short}")
        _KEYS[getattr(glfw, f"KEY_{_side}_{_name}")] = (_key, getattr(imgui.Key, f"mod_{_short}"))


class Handler(Protocol):
    """Receives the events outside the panel. Places are shares of the window's width and height, from the top left."""

    def button(self, button: int, down: bool, modifiers: int, place: tuple[float, float]) -> None:
        """Handle a mouse button that went down or up."""

    def move(self, place: tuple[float, float], delta: tuple[float, float]) -> None:
        """Handle a move of the mouse by `delta`, shares of the window's height."""

    def scroll(self, amount: float) -> None:
        """Handle the wheel: +1 for a notch up."""

    def key(self, key: int, down: bool, modifiers: int) -> None:
        """Handle a key that went down or up."""

    def character(self, character: str) -> None:
        """Handle a typed character."""


class Window:
    """A window with a wgpu surface and imgui in it."""

    def __init__(self, title: str, size: tuple[int, int], device: Device, handler: Handler) -> None:
        """Open the window. Raises GiError if that fails."""
        start()
        self._controller = handler
        self._pointer = (0.0, 0.0)
        self.wanted = SETTLE_FRAMES  # frames still to draw after the last event
        glfw.window_hint(glfw.CLIENT_API, glfw.NO_API)
        self._window: Any = glfw.create_window(*size, title, None, None)
        if not self._window:
            raise GiError(f"no window can be opened ({_glfw_error()})")
        self._surface: Any = wgpu.gpu.get_canvas_context(get_glfw_present_info(self._window, vsync=True))
        self._context = imgui.create_context()
        imgui.set_current_context(self._context)
        self.format = self._configure(device)
        self._backend = ImguiWgpuBackend(device.gpu, self.format)
        self._device = device.gpu
        self._sheet: Any = None
        self._listen()

    @property
    def size(self) -> tuple[int, int]:
        """Size of the drawing area in pixels; (0, 0) while minimised."""
        width, height = glfw.get_framebuffer_size(self._window)
        return int(width), int(height)

    @property
    def closing(self) -> bool:
        """True once the user has closed the window."""
        return bool(glfw.window_should_close(self._window))

    def quit(self) -> None:
        """Close the window, as its close button does."""
        glfw.set_window_should_close(self._window, True)

    def clipboard(self, text: str) -> None:
        """Copy a text to the clipboard."""
        glfw.set_clipboard_string(self._window, text)

    def is_down(self, key: int) -> bool:
        """Return whether a key is held."""
        return bool(glfw.get_key(self._window, key) == glfw.PRESS)

    def events(self, wait_seconds: float) -> None:
        """Handle all events; wait up to `wait_seconds` for the first."""
        if wait_seconds > 0:
            glfw.wait_events_timeout(wait_seconds)
        else:
            glfw.poll_events()

    def draw(self, picture: Callable[[Any, int], None], panel: Callable[[], None]) -> None:
        """Draw a frame: `picture`, given a render pass and the width in pixels, and over it the imgui of `panel`."""
        # Lay out the panel.
        width, height = self.size
        if width == 0 or height == 0:
            return
        logical = [max(length, 1) for length in glfw.get_window_size(self._window)]
        # The window may be resized between the two queries, so the ratio can be anything.
        scale = min(max(width / logical[0], LEAST_SCALE), LARGEST_SCALE)
        io = imgui.get_io()
        io.display_size = imgui.ImVec2(width / scale, height / scale)
        io.display_framebuffer_scale = imgui.ImVec2(scale, scale)
        imgui.new_frame()
        panel()
        imgui.render()

        # Draw picture and panel.
        self._surface.set_physical_size(width, height)
        try:
            target = self._surface.get_current_texture()
        except wgpu.DrawCancelled:
            return
        encoder = self._device.create_command_encoder(label="window")
        attachment = {"view": target.create_view(), "load_op": "clear", "store_op": "store"}
        render_pass = encoder.begin_render_pass(color_attachments=[attachment])
        picture(render_pass, width)
        self._backend.render(imgui.get_draw_data(), render_pass)
        render_pass.end()
        self._device.queue.submit([encoder.finish()])
        self._surface.present()
        self.wanted = max(self.wanted - 1, 0)

    def sheet(self, pixels: NDArray[np.uint8]) -> imgui.ImTextureRef:
        """Upload (height, width, 4) pixels in place of the last ones; return imgui's reference to the texture."""
        height, width, _ = pixels.shape
        usage = wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST
        texture = self._device.create_texture(label="sheet", size=(width, height, 1), format="rgba8unorm", usage=usage)
        layout = {"bytes_per_row": width * 4, "rows_per_image": height}
        self._device.queue.write_texture({"texture": texture}, pixels, layout, (width, height, 1))
        if self._sheet is not None:
            self._backend.unregister_texture(self._sheet)
        self._sheet = self._backend.register_texture(texture.create_view())
        return self._sheet

    def close(self) -> None:
        """Close the window."""
        self._surface.unconfigure()
        self._surface = None  # it must not outlive its window
        imgui.destroy_context(self._context)
        glfw.destroy_window(self._window)

    def _configure(self, device: Device) -> str:
        """Configure a format that stores sRGB codes unchanged."""
        preferred = self._surface.get_preferred_format(device.gpu.adapter)
        format = preferred.removesuffix("-srgb")
        self._surface.configure(device=device.gpu, format=format)
        return str(format)

    def _listen(self) -> None:
        window = self._window
        glfw.set_cursor_pos_callback(window, self._on_move)
        glfw.set_mouse_button_callback(window, self._on_button)
        glfw.set_scroll_callback(window, self._on_scroll)
        glfw.set_key_callback(window, self._on_key)
        glfw.set_char_callback(window, self._on_character)
        for listen in (glfw.set_framebuffer_size_callback, glfw.set_window_refresh_callback):
            listen(window, self._on_change)
        glfw.set_cursor_enter_callback(window, self._on_change)
        glfw.set_window_focus_callback(window, self._on_change)

    def _on_change(self, *_: object) -> None:
        self.wanted = SETTLE_FRAMES

    def _on_move(self, _window: object, x: float, y: float) -> None:
        self.wanted = SETTLE_FRAMES
        width, height = (max(length, 1) for length in glfw.get_window_size(self._window))
        before, self._pointer = self._pointer, (x, y)
        imgui.get_io().add_mouse_pos_event(x, y)
        delta = (x - before[0]) / height, (y - before[1]) / height
        self._controller.move((x / width, y / height), delta)

    def _on_button(self, _window: object, button: int, action: int, modifiers: int) -> None:
        self.wanted = SETTLE_FRAMES
        io, down = imgui.get_io(), action == glfw.PRESS
        io.add_mouse_button_event(button, down)
        width, height = (max(length, 1) for length in glfw.get_window_size(self._window))
        # A release always passes, so that a drag which began outside the panel can end over it.
        if not (down and io.want_capture_mouse):
            self._controller.button(button, down, modifiers, (self._pointer[0] / width, self._pointer[1] / height))

    def _on_scroll(self, _window: object, x: float, y: float) -> None:
        self.wanted = SETTLE_FRAMES
        io = imgui.get_io()
        io.add_mouse_wheel_event(x, y)
        if not io.want_capture_mouse:
            self._controller.scroll(y)

    def _on_key(self, _window: object, key: int, _code: int, action: int, modifiers: int) -> None:
        self.wanted = SETTLE_FRAMES
        io = imgui.get_io()
        for name in _KEYS.get(key, ()):
            io.add_key_event(name, action != glfw.RELEASE)
        if not io.want_capture_keyboard and action != glfw.REPEAT:
            self._controller.key(key, action == glfw.PRESS, modifiers)

    def _on_character(self, _window: object, code: int) -> None:
        self.wanted = SETTLE_FRAMES
        io = imgui.get_io()
        io.add_input_character(code)
        if not io.want_capture_keyboard:
            self._controller.character(chr(code))


def start() -> None:
    """Start glfw; may be called repeatedly. Raises GiError without a display; glfw would end the process."""
    if sys.platform.startswith("linux"):
        if not os.environ.get("DISPLAY"):
            wayland = " (on Wayland: XWayland)" if os.environ.get("WAYLAND_DISPLAY") else ""
            raise GiError(
                f"there is no display to open a window on: DISPLAY is not set{wayland}; log in to a desktop,"
                " use ssh -X, or make pictures with wgpu-gi render"
            )
        # The surface needs X11; Wayland desktops offer it through XWayland.
        glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_X11)
    glfw.ERROR_REPORTING = "ignore"
    if not glfw.init():
        raise GiError(f"no window can be opened ({_glfw_error()}); make pictures with wgpu-gi render")


def _glfw_error() -> str:
    _, text = glfw.get_error()
    return str(text, errors="replace").rstrip(".") if isinstance(text, bytes) else "glfw does not say why"
