"""Skins and morph targets of meshes that move: merged from primitives, or given to the shapes of points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..files.points import MAX_POINTS
from ..scene import Instance, Mesh, MorphTarget, Skin
from .morphs import DISPLACED, displacement_key
from .vertices import Vertices


def merged_skin(parts: list[Vertices]) -> Skin | None:
    """Return the skin of the vertices of all parts one after another; None without influences."""
    if not parts or "JOINTS" not in parts[0]:
        return None
    widest = max(part["JOINTS"].shape[1] for part in parts)

    def padded(values: NDArray[Any]) -> NDArray[Any]:
        return np.pad(values, ((0, 0), (0, widest - values.shape[1])))

    return Skin(*(np.concatenate([padded(part[name]) for part in parts]) for name in ("JOINTS", "WEIGHTS")))


def merged_targets(parts: list[Vertices], count: int, names: list[str]) -> list[MorphTarget]:
    """Return `count` morph targets of the vertices of all parts one after another; those without a target stay."""
    targets = []
    for number in range(count):
        target = MorphTarget(name=names[number] if number < len(names) else "")
        for name, field in DISPLACED.items():
            key = displacement_key(number, name)
            if any(key in part for part in parts):
                rows = [part.get(key, np.zeros((len(part["POSITION"]), 3), np.float32)) for part in parts]
                setattr(target, field, np.concatenate(rows))
        targets.append(target)
    return targets


def shown_points(vertices: Vertices) -> Vertices:
    """Return those of the vertices that `points_scene` shows: finite ones, thinned if they are too many."""
    kept = np.flatnonzero(np.isfinite(vertices["POSITION"]).all(axis=1))
    if len(kept) > MAX_POINTS:
        kept = kept[np.arange(MAX_POINTS) * len(kept) // MAX_POINTS]
    return {name: values[kept] for name, values in vertices.items()}


def deformed_points(shapes: Instance, vertices: Vertices, count: int) -> Mesh:
    """Return the mesh of the shapes of points in the space of the points; each shape moves as its point does.

    `count`: of morph targets.
    """
    mesh = shapes.mesh
    corners = len(mesh.positions) // len(vertices["POSITION"])
    mesh.positions = (mesh.positions + shapes.world_from_local[:3, 3]).astype(np.float32)
    if corners * len(vertices["POSITION"]) != len(mesh.positions):
        return mesh  # shapes too small for float32 lost corners; they stay where they are
    repeated = {name: np.repeat(values, corners, axis=0) for name, values in vertices.items()}
    mesh.skin = merged_skin([repeated])
    moves = {name: values for name, values in repeated.items() if name == "POSITION" or name.endswith("/POSITION")}
    mesh.morph_targets = merged_targets([moves], count, [])
    return mesh
