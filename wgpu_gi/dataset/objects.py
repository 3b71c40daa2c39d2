"""The objects of a frame: ids of instances and categories, visible pixels and boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError
from ..scene.rules import is_whole, shown
from ..scene.scene import Scene
from .boxes import projected_box
from .frame_data import ObjectData

MOST_ID = 2**31 - 1


def check_categories(category_of: Sequence[int] | None, names: dict[int, str], scene: Scene) -> NDArray[np.int32]:
    """Return the category of each instance, (n,); 0: none. Raises GiError for ids that do not fit."""
    for key in names:
        if not is_whole(key) or not 1 <= key <= MOST_ID:
            raise GiError(f"ids of categories are whole numbers from 1 on, not {shown(key)}")
    if category_of is None:
        return np.zeros(len(scene.instances), np.int32)
    if len(category_of) != len(scene.instances):
        raise GiError(
            f"category_of has {len(category_of)} ids for {len(scene.instances)} instances; give one for each instance"
        )
    for key in category_of:
        if key not in names and not (is_whole(key) and key == 0):
            raise GiError(f"category_of has the id {shown(key)}, which categories lacks; give it a name")
    return np.array(category_of, np.int32)


def categories_of(ids: NDArray[np.int32], kinds: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the category that each pixel shows, given its instance, from 1, and the category of each instance."""
    found: NDArray[np.int32] = np.concatenate([np.zeros(1, np.int32), kinds])[ids]
    return found


def pixel_boxes(ids: NDArray[Any], count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the number of pixels of each id from 0 to `count`, and their box: x, y, width, height, (count + 1, 4)."""
    pixels = np.bincount(ids.ravel(), minlength=count + 1)
    height, width = ids.shape
    low, high = np.full((count + 1, 2), max(width, height)), np.full((count + 1, 2), -1)
    y, x = np.divmod(np.arange(ids.size), width)
    for axis, place in enumerate((x, y)):
        np.minimum.at(low[:, axis], ids.ravel(), place)
        np.maximum.at(high[:, axis], ids.ravel(), place)
    return pixels, np.concatenate([low, high - low + 1], 1)


def visible_objects(scene: Scene, ids: NDArray[np.int32], kinds: NDArray[np.int32]) -> list[ObjectData]:
    """Return the objects that a picture of instance ids shows."""
    pixels, boxes = pixel_boxes(ids, len(scene.instances))
    seen = [number for number in np.flatnonzero(pixels).tolist() if number]
    return [ObjectData(n, name_of(scene, n), int(kinds[n - 1]), int(pixels[n]), box=box_of(boxes[n])) for n in seen]


def amodal_objects(
    scene: Scene, ids: NDArray[np.int32], kinds: NDArray[np.int32], amodal: NDArray[np.int64], camera: Camera
) -> list[ObjectData]:
    """Return the objects that a picture would show if each were alone; `amodal`: `Renderer.amodal`."""
    height, width = ids.shape
    seen = {found.id: found for found in visible_objects(scene, ids, kinds)}
    objects = []
    for n in (np.flatnonzero(amodal[:, 0]) + 1).tolist():
        found = seen.get(n) or ObjectData(n, name_of(scene, n), int(kinds[n - 1]), 0)
        pixels = int(amodal[n - 1, 0])
        objects.append(
            replace(
                found,
                amodal_pixels=pixels,
                visible_fraction=found.visible_pixels / pixels,
                amodal_box=projected_box(scene.instances[n - 1], camera, (width, height)),
                amodal_box_clipped=box_of(amodal[n - 1, 1:]),
            )
        )
    return objects


def name_of(scene: Scene, number: int) -> str:
    """Return the name of an instance, by its id."""
    instance = scene.instances[number - 1]
    return instance.name or instance.mesh.name


def box_of(row: NDArray[np.int64]) -> tuple[float, float, float, float]:
    """Return a box as FrameData has it."""
    x, y, width, height = (float(value) for value in row)
    return x, y, width, height
