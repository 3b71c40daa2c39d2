"""Denoises pictures of the path tracer for a measurement, with the time that it takes."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from ..pictures.denoise import denoised
from ..renderer import Renderer
from ..techniques.reference import FEATURES


class Smoother:
    """Denoises pictures of the path tracer, and says how long that takes."""

    def __init__(self, renderer: Renderer) -> None:
        """Find what the denoiser reads; the renderer's settings must be those of the path tracer, for the same view."""
        renderer.run(show=FEATURES)  # compiles
        start = time.perf_counter()
        renderer.step(show=FEATURES, force=True)
        renderer.graph.device.wait()
        self._albedo, self._normal = (renderer.read_back(name) for name in FEATURES)
        self.features_ms = (time.perf_counter() - start) * 1e3
        ones = np.ones_like(self._albedo)
        denoised(ones, self._albedo, self._normal, ones)  # loads the library

    def __call__(self, picture: NDArray[np.float32], error: NDArray[np.float32]) -> tuple[NDArray[np.float32], float]:
        """Return the smooth picture, and the milliseconds of features and denoiser; `error`: its standard error."""
        start = time.perf_counter()
        smooth = denoised(picture, self._albedo, self._normal, error)
        return smooth, self.features_ms + (time.perf_counter() - start) * 1e3
