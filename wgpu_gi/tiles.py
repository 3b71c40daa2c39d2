"""Renders a picture in tiles: larger pictures than an adapter's buffers hold, and one picture on several machines.

A tile is rendered in a window of the picture (`camera.Window`), which adds a margin of the pixels that filters read.
Every pixel of a window has the camera ray, the footprint and the random numbers that it has in the whole picture, so
tiles equal the whole picture bit for bit.

Memory: one window on the device; a rasterising technique adds triangle numbers and depths of the whole picture, 8 to 12
bytes per pixel of it. On the host, the finished buffers, 4 bytes per value.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .camera import Window
from .errors import GiError
from .options import Settings, check_whole, technique_of
from .pictures.picture import Picture
from .renderer import Renderer
from .scene.rules import is_whole, shown
from .scene.scene import Scene
from .techniques.deferred.transmission import finds_light_in_picture
from .techniques.shared.technique import Reach

MOST_TILES = 65536
SIDE = 2048  # pixels, longest side of a tile by default: the path tracer then takes about 1 GiB on the device


class Tile(NamedTuple):
    """A part of a picture: its first pixel (x, y) and its size in pixels; and those of the window that contains it."""

    corner: tuple[int, int]
    size: tuple[int, int]
    window_corner: tuple[int, int]
    window_size: tuple[int, int]

    def put(self, part: NDArray, picture: NDArray) -> None:
        """Copy the tile's pixels into the whole picture."""
        (x, y), (width, height) = self.corner, self.size
        picture[y : y + height, x : x + width] = part

    def cut(self, picture: NDArray) -> NDArray:
        """Return the tile's pixels of a picture of its window."""
        x, y = (a - b for a, b in zip(self.corner, self.window_corner, strict=True))
        return picture[y : y + self.size[1], x : x + self.size[0]]


class TilePlan(NamedTuple):
    """The size of a picture, and its tiles, rows from the top."""

    size: tuple[int, int]
    tiles: list[Tile]


class Tiled(NamedTuple):
    """The finished buffers of a picture by name, and the exposure of the settings, EV; None: automatic."""

    pictures: dict[str, NDArray]
    exposure: float | None

    def read_back(self, name: str) -> Picture:
        """Return a buffer as `Renderer.read_back` does."""
        return Picture(self.pictures[name], name, self.exposure)


def tile_plan(size: tuple[int, int], settings: Settings, tiles: bool | int | tuple[int, int] = True) -> TilePlan:
    """Return the tiles of a picture: so many, or of a size (width, height) at most; True: SIDE x SIDE at most.

    Raises GiError for a technique that needs the whole picture, and for bad values.
    """
    check_whole(size)
    reach = _reach_of(settings)
    columns, rows = _grid(size, tiles)
    found = [_tile(x, y, size, reach) for y in _parts(size[1], rows) for x in _parts(size[0], columns)]
    return TilePlan((size[0], size[1]), found)


def _grid(size: tuple[int, int], tiles: bool | int | tuple[int, int]) -> tuple[int, int]:
    """Return the numbers of columns and rows of tiles."""
    if tiles is True:
        tiles = SIDE, SIDE
    if isinstance(tiles, (tuple, list)) and len(tiles) == 2 and all(map(is_whole, tiles)) and min(tiles) >= 1:
        return -(-size[0] // tiles[0]), -(-size[1] // tiles[1])
    if isinstance(tiles, int) and is_whole(tiles) and 1 <= tiles <= MOST_TILES:
        # Of all grids of that many tiles that fit, take the one whose tiles are closest to squares.
        grids = [(n, tiles // n) for n in range(1, tiles + 1) if tiles % n == 0]
        fitting = [(x, y) for x, y in grids if x <= size[0] and y <= size[1]]
        if fitting:
            return min(fitting, key=lambda grid: abs(math.log(size[0] * grid[1] / (size[1] * grid[0]))))
    message = f"tiles must be their number, or their size (width, height) in pixels, not {shown(tiles)}"
    raise GiError(f"{message}, for a picture of {size[0]}x{size[1]}")


def _parts(length: int, count: int) -> list[tuple[int, int]]:
    """Return start and end of `count` parts of about the same length."""
    ends = [length * k // count for k in range(count + 1)]
    return list(pairwise(ends))


def _tile(x: tuple[int, int], y: tuple[int, int], size: tuple[int, int], reach: Reach) -> Tile:
    """Return the tile from x[0], y[0] to x[1], y[1], with the window around it."""
    first = [max(start - reach.margin, 0) // reach.step * reach.step for start in (x[0], y[0])]
    end = [min(stop + reach.margin, length) for stop, length in zip((x[1], y[1]), size, strict=True)]
    window = end[0] - first[0], end[1] - first[1]
    return Tile((x[0], y[0]), (x[1] - x[0], y[1] - y[0]), (first[0], first[1]), window)


def _reach_of(settings: Settings) -> Reach:
    """Return what the window of a tile must hold. Raises GiError if that is the whole picture."""
    technique, gi = technique_of(settings.gi), settings.gi
    if technique.reach is None:
        reason = "its light and occlusion come from all over the picture"
        raise GiError(f"{gi} cannot be rendered in tiles: {reason}; use path, many-light or none")
    if gi == "path" and settings.path.adaptive:
        raise GiError("tiles: path.adaptive divides its paths over the whole picture; leave it off")
    if gi != "path" and settings.direct.contacts and not settings.direct.edges:
        raise GiError("tiles: direct.contacts searches the whole picture for shadows; leave it 0")
    if gi == "many-light" and (settings.gather.adaptive or settings.ssdo.near_field):
        name = (
            "gather.adaptive chooses rays by squares"
            if settings.gather.adaptive
            else "ssdo.near_field finds light all over"
        )
        raise GiError(f"tiles: {name} of the whole picture; leave it off")
    return technique.reach(settings)


def check_tiles(settings: Settings, scene: Scene, names: Sequence[str]) -> None:
    """Raise GiError if tiles of the buffers `names` of a scene would differ from the whole picture."""
    technique = technique_of(settings.gi)
    for name in names:
        if name in technique.views and not technique.averages_samples:
            raise GiError(f"tiles: {name} shows no pixels of the picture; render it without tiles")
    if not technique.averages_samples and finds_light_in_picture(scene, diffuse=settings.diffuse):
        raise GiError("tiles: the scene has rough or solid glass, whose light comes from all of the picture; use path")


def render_tile(
    renderer: Renderer,
    tile: Tile,
    size: tuple[int, int],
    names: Sequence[str],
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> dict[str, NDArray]:
    """Return buffers of a tile of a picture of `size`, (height, width, ...) float32; `options`: of `Renderer.run`.

    The renderer keeps the window of the tile. Raises GiError as `Renderer.run` does.
    """
    renderer.forget()  # a tile is a picture of its own, of the first frames' random numbers
    renderer.size, renderer.window = tile.window_size, Window(tile.window_corner, size)
    renderer.run(progress, show=tuple(names), **options)
    return {name: np.ascontiguousarray(tile.cut(renderer.read_back(name))) for name in names}


def render_tiles(
    renderer: Renderer,
    plan: TilePlan,
    names: Sequence[str],
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Tiled:
    """Render a picture tile by tile; arguments as of `render_tile`."""
    check_tiles(renderer.settings, renderer.scene, names)
    size, pictures = plan.size, {}
    for number, tile in enumerate(plan.tiles):

        def report(fraction: float, number: int = number) -> None:
            if progress is not None:
                progress((number + fraction) / len(plan.tiles))

        for name, part in render_tile(renderer, tile, size, names, report, **options).items():
            if name not in pictures:
                pictures[name] = np.empty((size[1], size[0], *part.shape[2:]), part.dtype)
            tile.put(part, pictures[name])
    return Tiled(pictures, renderer.settings.exposure)
