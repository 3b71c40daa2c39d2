"""Thumbnails of the outputs of a frame's passes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..gpu.graph import Graph
from ..gpu.handles import Buffer, Resource, Texture

SIZE = (168, 96)  # pixels of one, at most
BRIGHT = 99.0  # percentile shown white, so that 1 % of fireflies does not darken the rest


def thumbnails(graph: Graph) -> Iterator[tuple[str, str, NDArray[np.uint8]]]:
    """Yield pass, resource and (height, width, 3) picture for every image that the last run wrote."""
    seen: set[str] = set()
    for p in graph.order:
        for use in p.uses:
            resource = use.view.resource
            if use.writes and resource.name not in seen:
                seen.add(resource.name)
                values = _values(graph, resource)
                if values is not None:
                    yield p.name, resource.name, _small(values)


def sheet(pictures: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Return the pictures one below the other, each in the top left of a cell of SIZE, with alpha."""
    width, height = SIZE
    pixels = np.zeros((height * max(len(pictures), 1), width, 4), np.uint8)
    for i, picture in enumerate(pictures):
        h, w, _ = picture.shape
        pixels[i * height : i * height + h, :w, :3] = picture
        pixels[i * height : i * height + h, :w, 3] = 255
    return pixels


def _values(graph: Graph, resource: Resource) -> NDArray | None:
    """Return the first layer as (height, width, channels), None if the resource is no image."""
    if isinstance(resource, Texture):
        texels: Any = graph.read_back(resource.name)
        return texels if texels.ndim == 3 else texels[0]
    if isinstance(resource, Buffer) and resource.width and resource.dtype.names is None:
        items = graph.read_back(resource.name)
        if len(items) % resource.width:
            return None
        return items.reshape(-1, resource.width, int(np.prod(items.shape[1:], dtype=int)))
    return None


def _small(values: NDArray) -> NDArray[np.uint8]:
    """Return every nth pixel as bytes with gamma 2: black is 0 or the least value, white the percentile BRIGHT."""
    height, width, channels = values.shape
    step = max(-(-height // SIZE[1]), -(-width // SIZE[0]), 1)
    chosen = values[::step, ::step, : 3 if channels >= 3 else 1].astype(np.float64)
    chosen = np.repeat(chosen, 3, axis=-1) if chosen.shape[-1] == 1 else chosen
    finite = chosen[np.isfinite(chosen)]
    low = min(float(finite.min()), 0.0) if finite.size else 0.0
    high = float(np.percentile(finite, BRIGHT)) if finite.size else 1.0
    scaled = np.clip((np.nan_to_num(chosen) - low) / max(high - low, 1e-30), 0.0, 1.0)
    return np.round(np.sqrt(scaled) * 255.0).astype(np.uint8)
