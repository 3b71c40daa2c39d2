"""Compares the view with the path tracer, which converges while the view rests: split, difference, numbers."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy

import numpy as np
from numpy.typing import NDArray

from ..errors import GiError
from ..measure.metrics import Errors, measure
from ..pictures.color import srgb_from_linear
from ..renderer import Renderer
from .session import DISPLAY, Interrupted, Session

MODES = ("off", "split", "difference")
TRUTH = "path"
SPP = 4096  # samples per pixel of the truth: its noise is 1/64 of that of one sample


class Comparison:
    """`split` is the share of the window's width that shows the technique if `mode` is "split"."""

    def __init__(self, session: Session) -> None:
        self._mode = "off"
        self.ready = False  # the truth shows the current view
        self.split = 0.5
        self.errors: Errors | None = None
        self._session = session
        self._renderer: Renderer | None = None

    @property
    def mode(self) -> str:
        """One of MODES."""
        return self._mode

    @mode.setter
    def mode(self, mode: str) -> None:
        self._mode, self.ready = mode, False
        self._session.changed()

    @property
    def on(self) -> bool:
        """True if there is a truth to show."""
        return self.mode != "off" and self._session.shown == DISPLAY

    def step(self, tick: Callable[[float], None]) -> bool:
        """Refine the truth of a view at rest; return False if there was nothing to do, or after an interruption."""
        session = self._session
        if not self.on:
            self.close()
            return False
        settings = deepcopy(session.settings)
        settings.gi, settings.spp = TRUTH, SPP
        settings.path.samples_per_run = 1  # shows the first sample at once
        if self._renderer is None:
            adapter = session.renderer.adapter_name
            self._renderer = Renderer(session.renderer.scene, size=session.size, settings=settings, adapter=adapter)
        truth = self._renderer
        truth.settings, truth.camera, truth.size = settings, session.renderer.camera, session.size
        truth.time, truth.animation = session.renderer.time, session.renderer.animation
        truth.automatic_exposure, truth.on_compile = session.exposure, session.on_compile

        def progress(fraction: float) -> None:
            tick(fraction)
            if session.interrupted:
                raise Interrupted

        try:
            ran = truth.step(progress, show=(DISPLAY, "radiance", "standard_error"))
        except Interrupted:
            self.ready = False
            return False
        self.ready = True
        return ran

    def display(self) -> object:
        """Return the display texture of the truth."""
        assert self._renderer is not None
        return self._renderer.display_texture()

    def measure(self) -> None:
        """Update `errors`; None if the truth is black."""
        assert self._renderer is not None
        image, truth, noise = self._session.renderer.read_back(), self._renderer.read_back(), self._noise()
        try:
            self.errors = measure(image, truth, noise)
        except GiError:
            self.errors = None

    def difference(self) -> NDArray[np.float32]:
        """Return where the view is too bright (red) and too dark (blue), sRGB-coded, relative to the truth's mean."""
        assert self._renderer is not None
        truth = self._renderer.read_back()
        signed = (self._session.renderer.read_back() - truth).mean(-1) / max(float(truth.mean()), 1e-30)
        zero = np.zeros_like(signed)
        return srgb_from_linear(np.stack([np.maximum(signed, zero), zero, np.maximum(-signed, zero)], -1))

    def close(self) -> None:
        """Free the truth's memory."""
        if self._renderer is not None:
            self._renderer.release()
        self._renderer, self.errors, self.ready = None, None, False

    def _noise(self) -> NDArray[np.float32] | None:
        assert self._renderer is not None
        noise = self._renderer.read_back("standard_error")
        return noise if np.isfinite(noise).all() else None
