"""The stored truths: references by Mitsuba 3 in `scenes/references`, and their scenes.

`tools/make_references.py --size 128x72` makes them and explains their layers: linear radiance at pixel centres by
number of scattering events, all materials Lambert, with standard errors. `courtyard_sun` is the built-in courtyard
with `--env 0`, `leak_corridor_a` the corridor with `--camera a`, `curtain` a built-in scene.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..resources import resource_dir
from ..scene.load import load
from ..scene.scene import Environment, Scene

SIZE = (128, 72)
# The scene, and the environment that replaces its own.
SCENES: dict[str, tuple[str, Environment | None]] = {
    "cornell_area": ("cornell/cornell_area.glb", None),
    "cornell_point": ("cornell/cornell_point.glb", None),
    "cornell_spot": ("cornell/cornell_spot.glb", None),
    "leak_corridor_a": ("leak_corridor/leak_corridor.glb", None),
    "curtain": ("curtain", None),
    "courtyard_sun": ("courtyard", Environment((0.0, 0.0, 0.0))),
    "courtyard_sky": ("courtyard", None),
}


def path_of(name: str) -> Path:
    """Return the file of a reference."""
    return resource_dir("scenes") / "references" / f"{name}_{SIZE[0]}x{SIZE[1]}.npz"


def source_of(name: str) -> str:
    """Return the source of a reference's scene, as `load` and the tool take it."""
    scene = SCENES[name][0]
    return str(resource_dir("scenes") / scene) if "." in scene else scene


def meta_of(name: str) -> dict[str, Any]:
    """Return the metadata of a reference: how it was made."""
    with np.load(path_of(name)) as file:
        found: dict[str, Any] = json.loads(str(file["meta"]))
    return found


def layers_of(name: str) -> dict[str, NDArray[np.float32]]:
    """Return the layers of a reference."""
    with np.load(path_of(name)) as file:
        return {key: file[key].astype(np.float32) for key in file.files if key != "meta"}


def scene_of(name: str) -> Scene:
    """Return the scene of a reference, with the camera of the reference only."""
    scene = load(source_of(name), environment=SCENES[name][1])
    camera = meta_of(name)["camera"]
    scene.cameras = [Camera(np.array(camera["world_from_view"]), camera["yfov"])]
    return scene
