"""Converts a dome light of a stage to an environment.

A dome's picture has -Z of the light at its left edge, +X at a quarter and +Y on top, as this package's environments
have. A dome that is turned about another axis than the vertical is resampled.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...pictures.color import linear_from_srgb
from ..files.environment_files import ENVIRONMENT_EXTENSIONS, load_environment
from ..scene import Environment, Scene
from ..transforms import Matrix, rigid
from .stage import Stage
from .textures import Textures

_UPRIGHT = 1e-6  # error of a rotation about the vertical


def add_dome(
    prim: Any,
    stage: Stage,
    matrix: Matrix,
    radiance: tuple[float, float, float],
    textures: Textures,
    scene: Scene,
) -> None:
    """Give a scene the environment of a dome light at `matrix`; a second dome is left out with a note."""
    from pxr import UsdGeom

    if scene.environment is not None:
        stage.note(f"the dome light {prim.GetPath()} was left out: the scene has another")
        return
    image = _image(prim, stage, textures)
    scene.environment = Environment(radiance, image, name=prim.GetName())
    if image is None:
        return
    pose = rigid(matrix)
    rotation = np.eye(3) if pose is None else pose[:3, :3]
    # A dome of the second version may have the pole along Z.
    pole = prim.GetAttribute("poleAxis")
    axis = pole.Get() if pole else UsdGeom.Tokens.y
    if axis == UsdGeom.Tokens.z or (axis == "scene" and UsdGeom.GetStageUpAxis(stage.usd) == UsdGeom.Tokens.z):
        rotation = rotation @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    if abs(rotation[1, 1] - 1.0) < _UPRIGHT:
        scene.environment.rotation = math.atan2(rotation[0, 2], rotation[2, 2])
    else:
        stage.budget.take(3 * image.nbytes, f"{stage.source}: {prim.GetPath()}")
        scene.environment.image = turned(image, rotation)


def turned(image: NDArray[np.float32], rotation: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the map (h, w, 3) whose radiance along d is that of `image` along the inverse rotation of d."""
    height, width = image.shape[:2]
    azimuth = 2 * np.pi * (np.arange(width) + 0.5) / width
    result = np.empty_like(image)
    for row in range(height):
        polar = np.pi * (row + 0.5) / height
        sine = math.sin(polar)
        directions = np.stack([sine * np.sin(azimuth), np.full(width, math.cos(polar)), -sine * np.cos(azimuth)], 1)
        x, y, z = (directions @ rotation).T
        u = np.arctan2(x, -z) / (2 * np.pi) * width - 0.5
        v = np.arccos(y.clip(-1, 1)) / np.pi * height - 0.5
        # Interpolate bilinearly, around in u and clamped in v.
        column, line = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
        fu, fv = (u - column)[:, None].astype(np.float32), (v - line)[:, None].astype(np.float32)
        upper, lower = line.clip(0, height - 1), (line + 1).clip(0, height - 1)
        left, right = column % width, (column + 1) % width
        top = image[upper, left] * (1 - fu) + image[upper, right] * fu
        bottom = image[lower, left] * (1 - fu) + image[lower, right] * fu
        result[row] = top * (1 - fv) + bottom * fv
    return result


def _image(prim: Any, stage: Stage, textures: Textures) -> NDArray[np.float32] | None:
    """Return the linear picture of a dome; None without one, with a note if it cannot be used."""
    asset = prim.GetAttribute("inputs:texture:file").Get(stage.time)
    if asset is None or not asset.path:
        return None
    layout = str(prim.GetAttribute("inputs:texture:format").Get(stage.time) or "automatic")
    if layout not in ("automatic", "latlong"):
        stage.note(f"the dome light {prim.GetPath()}: the layout {layout} is not supported; its plain colour is used")
        return None
    extension = Path(asset.path).suffix.lower()
    if extension not in ENVIRONMENT_EXTENSIONS:
        picture = textures.image(asset)
        if picture is None:
            return None
        stage.budget.take(picture.pixels.size * 8, f"{stage.source}: {asset.path[:80]}")
        return linear_from_srgb(picture.pixels[..., :3] / 255.0).astype(np.float32)
    data = textures.bytes_of(asset)
    if data is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / Path(asset.path).name
        file.write_bytes(data)
        try:
            image = load_environment(file, stage.notes, max_memory=stage.budget.limit).image
        except GiError as error:
            if "unpacks to" in str(error) or stage.notes.strict:
                raise
            stage.damage(f"the dome light {prim.GetPath()}: {str(error).replace(folder, '')[:200]}")
            return None
    if image is not None:
        stage.budget.take(image.nbytes, f"{stage.source}: {asset.path[:80]}")
    return image
