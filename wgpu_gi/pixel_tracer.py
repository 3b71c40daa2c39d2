"""Path traces a list of pixels: the truth of some pixels of a picture, with its standard error.

Each pixel is traced several times with independent random numbers (randomized quasi-Monte Carlo, L'Ecuyer and Lemieux
2002): the spread of these replicates gives an unbiased standard error although the samples of each are stratified.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import GiError
from .gpu.device import Device
from .gpu.graph import Graph
from .options import Settings
from .scene.rules import is_whole, shown
from .techniques.reference import MOST_LISTED, declare_pixel_list
from .techniques.shared.scene_inputs import declare_deformation, share_scene
from .upload.scene_upload import SceneUpload

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PixelTruth:
    """Radiance of some pixels, W/(m2 sr), by `spp` paths: `replicates` (n, R, 3) are independent means of `spp` / R."""

    replicates: Array
    spp: int

    @property
    def mean(self) -> Array:
        """The radiance of each pixel, (n, 3)."""
        return self.replicates.mean(axis=1)

    @property
    def squared_error(self) -> Array:
        """The squared standard error of `mean`, (n, 3), unbiased."""
        return self.replicates.var(axis=1, ddof=1) / self.replicates.shape[1]

    def joined(self, other: PixelTruth) -> PixelTruth:
        """Return the truth of the same pixels from the replicates of both, whose numbers of paths must be equal."""
        return PixelTruth(np.concatenate([self.replicates, other.replicates], axis=1), self.spp + other.spp)


class PixelTracer:
    """A render graph of its own, so that the picture of the frame's graph and its average stay."""

    def __init__(self, device: Device) -> None:
        self.graph = Graph(device)

    def trace(
        self,
        upload: SceneUpload,
        view: NDArray[np.void],
        settings: Settings,
        pixels: NDArray[np.uint32],
        *,
        spp: int,
        seed: int,
        replicates: int,
        progress: Callable[[float], None] | None = None,
    ) -> PixelTruth:
        """Trace `spp` paths for each of `pixels` (n, 2), in `replicates` independent parts.

        `upload` and `view` are those of the picture; of `settings`, bounces and samples per run count.
        """
        # List each pixel once for each replicate, with a seed of its own.
        count = len(pixels) * replicates
        entries = np.zeros((count, 4), np.uint32)
        entries[:, :2] = np.repeat(pixels, replicates, axis=0)
        entries[:, 2] = np.tile(_seeds(seed, replicates), len(pixels))
        # Trace as many entries at once as fit.
        parts = []
        for first in range(0, count, MOST_LISTED):

            def part_done(fraction: float, first: int = first) -> None:
                if progress is not None:
                    progress(min((first + MOST_LISTED * fraction) / count, 1.0))

            part = entries[first : first + MOST_LISTED]
            parts.append(self._trace(upload, view, settings, part, spp // replicates, part_done))
        means = np.concatenate(parts).reshape(len(pixels), replicates, 3)
        return PixelTruth(means, spp // replicates * replicates)

    def _trace(
        self,
        upload: SceneUpload,
        view: NDArray[np.void],
        settings: Settings,
        entries: NDArray[np.uint32],
        spp: int,
        progress: Callable[[float], None],
    ) -> Array:
        """Return the mean of `spp` paths of each entry, (entries, 3)."""
        graph, count = self.graph, len(entries)
        graph.uniform("view", view)
        scene = share_scene(graph, upload)
        graph.begin((int(view["size"][0]), int(view["size"][1])))
        declare_deformation(graph, scene)
        layers = declare_pixel_list(graph, settings, scene, entries, spp)
        graph.compile(layers)
        graph.run(on_chunk=progress, force=True)
        # Pixels with very long paths get fewer samples in a run.
        while (samples := float(self._layer(layers[0], count)[:, 3].min())) < spp:
            graph.run(on_chunk=progress)
            if float(self._layer(layers[0], count)[:, 3].min()) == samples:
                raise GiError("the path tracer makes no progress on a pixel; the scene or the camera is degenerate")
        return sum((self._layer(layer, count)[:, :3] for layer in layers), np.zeros((count, 3)))

    def _layer(self, buffer: Any, count: int) -> Array:
        return self.graph.read_back(buffer).reshape(-1, 4)[:count].astype(np.float64)


def _seeds(seed: int, count: int) -> NDArray[np.uint32]:
    """Return `count` seeds that differ from those of pictures, whose seeds are small numbers."""
    return np.random.default_rng((0x7069_7865, seed)).integers(1 << 31, 1 << 32, count, dtype=np.uint32)


def checked_pixels(pixels: ArrayLike, size: tuple[int, int]) -> NDArray[np.uint32]:
    """Return pixels (n, 2) as (x, y). Raises GiError for any that the picture does not have."""
    try:
        found = np.asarray(pixels)
    except ValueError:
        found = np.empty(0)  # rows of differing lengths
    if found.ndim != 2 or found.shape[1:] != (2,) or not len(found) or found.dtype.kind not in "iu":
        raise GiError(f"pixels must be an array (n, 2) of whole numbers x, y, not {shown(pixels)}")
    if (found < 0).any() or (found >= np.array(size)).any():
        raise GiError(f"pixels must lie in the picture of {size[0]}x{size[1]}")
    return found.astype(np.uint32)


def check_seed(seed: Any) -> None:
    """Raise GiError for a seed below 0."""
    if not is_whole(seed) or seed < 0:
        raise GiError(f"seed must be a whole number from 0 on, not {shown(seed)}")


def check_counts(spp: Any, replicates: Any, seed: Any) -> None:
    """Raise GiError unless `spp` paths can be divided into `replicates` parts, and for a seed below 0."""
    check_seed(seed)
    if not is_whole(replicates) or replicates < 2:
        raise GiError(f"replicates must be a whole number from 2 on, not {shown(replicates)}")
    if not is_whole(spp) or spp < replicates:
        raise GiError(f"spp must be a whole number of at least {replicates} (replicates), not {shown(spp)}")
