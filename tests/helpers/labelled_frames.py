"""Frames of a data set without rendering: discs before a floor, drawn by number, with everything a frame can hold."""

from __future__ import annotations

import numpy as np

from wgpu_gi import Camera
from wgpu_gi.dataset.frame_data import FrameData, ObjectData
from wgpu_gi.dataset.matrices import matrices

SIZE = (24, 17)
CATEGORIES = {1: "disc", 3: "blob"}
DATA = {
    *("picture", "direct", "indirect", "standard_error", "depth_ray", "depth_z", "normal", "albedo"),
    *("instance", "category", "amodal", "flow", "occlusion"),
}


def frame(number: int, size: tuple[int, int] = SIZE) -> FrameData:
    """Return a frame that its number determines."""
    random = np.random.default_rng(number)
    width, height = size
    y, x = np.mgrid[:height, :width] + 0.5
    instance = np.zeros((height, width), np.int32)
    category_of = [0, 1, 3, 1, 0]
    categories = np.array(category_of, np.int32)
    # Later discs hide earlier ones; the second one spans whole columns in every fourth frame.
    alone = []
    for i in range(1, 5):
        center, radius = random.uniform((0, 0), size), random.uniform(1.0, height / 2)
        disc = np.hypot(x - center[0], y - center[1]) < radius
        if i == 2 and number % 4 == 0:
            disc = (x > center[0] - 3) & (x < center[0] + 3)
        alone.append(disc)
        instance[disc] = i
    objects = [_object(i, category_of[i], instance == i, alone[i - 1]) for i in range(1, 5)]
    light = random.uniform(0, 2, (height, width, 3)).astype(np.float32)
    depth = random.uniform(1, 5, (height, width)).astype(np.float32)
    return FrameData(
        size,
        picture=light,
        direct=light * 0.75,
        indirect=light * 0.25,
        standard_error=light * 0.01,
        depth_ray=depth * 1.1,
        depth_z=np.where(instance > 0, depth, 0.0).astype(np.float32),
        normal=np.broadcast_to(np.float32([0, 1, 0]), (height, width, 3)).copy(),
        albedo=light / 2,
        instance=instance,
        category=categories[instance],
        flow=random.normal(size=(height, width, 2)).astype(np.float32),
        occlusion=random.random((height, width)) < 0.1,
        objects=objects,
        categories=CATEGORIES,
        cameras=matrices(Camera.look_at(random.uniform(2, 3, 3), random.uniform(-1, 1, 3)), size),
    )


def record(number: int) -> dict[str, object]:
    """Return what was drawn for a frame."""
    return {"seed": [7, number], "light": {"intensity": np.float64(number) / 3}, "name": 'a "name" of ünicode'}


def _object(number: int, category: int, seen: np.ndarray, alone: np.ndarray) -> ObjectData:
    visible, amodal = int(seen.sum()), int(alone.sum())
    fraction = visible / amodal if amodal else None
    boxes = _box(seen), _box(alone), _box(alone)
    return ObjectData(number, f"thing {number}", category, visible, amodal, fraction, *boxes)


def _box(mask: np.ndarray) -> tuple[float, float, float, float] | None:
    if not mask.any():
        return None
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    left, top = int(columns[0]), int(rows[0])
    return (left, top, int(columns[-1]) + 1 - left, int(rows[-1]) + 1 - top)
