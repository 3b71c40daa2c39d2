"""Sends the environment map and its sampling table to the GPU."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Environment
from .environment_cdf import environment_cdf
from .light_values import environment_radiance
from .resources import GpuResources


class EnvironmentUpload:
    """The resources `environment` and `environment_cdf`, of one texel where there is no map or no light."""

    def __init__(self, resources: GpuResources) -> None:
        self._resources = resources
        self._sent: tuple[Any, Any] = (None, None)  # image and colour
        self.cdf: NDArray[np.float32] | None = None  # None: there is nothing to sample

    def send(self, environment: Environment | None) -> None:
        """Send what changed.

        The image is compared by identity: it is immutable once in use. The table also depends on the colour.
        """
        image = environment.image if environment else None
        color = tuple(environment.color) if environment else None
        new_image = "environment" not in self._resources or self._sent[0] is not image
        new_table = new_image or self._sent[1] != color
        if new_image:
            pixels = np.zeros((1, 1, 4), np.float32)
            if image is not None:
                pixels = np.ones((*image.shape[:2], 4), np.float32)
                pixels[..., :3] = image
            self._resources.texture("environment", "rgba32float", pixels)
        if new_table:
            self.cdf = environment_cdf(environment) if environment and environment_radiance(environment).any() else None
            table = self.cdf if self.cdf is not None else np.ones((1, 2), np.float32)
            self._resources.texture("environment_cdf", "r32float", table[..., None])
        self._sent = (image, color)
