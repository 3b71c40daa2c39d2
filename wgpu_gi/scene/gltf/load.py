"""Reads glTF 2.0 and GLB files as a `Scene`, with json and numpy alone (Khronos glTF 2.0 specification).

Departures: alpha blending becomes an alpha mask, lines are left out. The scene stands in its rest pose, and `Scene.at`
moves it. The scene's notes say what was changed or left out. Files are untrusted: every index, count, type and path is
checked, and nothing is allocated by an announced size. Damage costs the smallest part that holds it (a value, a
triangle, a primitive, a texture, a skin, a light, a channel), with a note; `Notes(strict=True)` refuses it.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ...camera import Camera
from ...float_limits import LARGEST_HEIGHT, LARGEST_LIGHT, LARGEST_YFOV, MAX_COORDINATE, SMALLEST_HEIGHT, SMALLEST_YFOV
from ..files.memory import MemoryBudget
from ..files.notes import Notes
from ..scene import DirectionalLight, Light, PointLight, Scene, SpotLight
from ..transforms import rigid
from .accessors import Accessors
from .animations import Motion
from .document import Document
from .instances import read_instances
from .json_object import JsonObject
from .nodes import Matrix, Nodes

_WIDEST_CONE = math.pi / 2 + 1e-3  # radians; what exceeds a right angle by less is rounding


def load_gltf(
    path: Path, budget: MemoryBudget | None = None, notes: Notes | None = None, point_size: float | None = None
) -> Scene:
    """Return the default scene of a .gltf or .glb file, which may unpack to the bytes of `budget`.

    Each glTF mesh becomes one Mesh, shared by the instances of all nodes that refer to it. Lights and cameras have the
    name of their node, or else their own. Raises GiError if the file is not glTF 2.0, is truncated or read beyond its
    data, needs a decoder that is not installed, or has no triangles and points to show. Points become discs or spheres
    of the diameter `point_size`; see `points_scene`.
    """
    document = Document(path, budget or MemoryBudget(), notes or Notes())
    nodes = Nodes(document)
    shown = nodes.shown()
    accessors = Accessors(document)
    motion = Motion(document, accessors, nodes)
    scene = Scene(name=nodes.scene_name() or path.stem)
    scene.instances = read_instances(document, accessors, nodes, shown, motion, point_size)
    scene.lights = _lights(document, nodes, shown, motion)
    scene.cameras = _cameras(document, nodes, shown, motion)
    scene.animations = motion.animations()
    scene.notes = document.notes.sentences
    return scene


def _lights(document: Document, nodes: Nodes, shown: list[int], motion: Motion) -> list[Light]:
    """Return the KHR_lights_punctual lights of the shown nodes, in world space."""
    extension = document.root.extension("KHR_lights_punctual")
    descriptions = document.named_objects(extension.values("lights"), "lights") if extension else []
    lights: list[Light] = []
    for node in shown:
        description = document.array("nodes")[node]
        reference = description.extension("KHR_lights_punctual")
        if reference is not None:
            with document.leaving_out("the light"):
                index = reference.index("light", len(descriptions), "lights")
                name = description.text("name") or descriptions[index].text("name")
                light = _light(descriptions[index], nodes.placed(node), name)
                lights.append(light)
                motion.place(node, light)
                motion.found("light", index, light)
    return lights


def _light(source: JsonObject, matrix: Matrix, name: str) -> Light:
    """Return the light of a node, which shines along the node's -Z. Raises Damage."""
    # Read what all kinds have. Some exporters write a range of 0, or a huge one, for "no limit".
    kind = source.choice("type", {kind: kind for kind in ("point", "spot", "directional")})
    red, green, blue = source.vector("color", (1.0, 1.0, 1.0), high=LARGEST_LIGHT)
    color, intensity = (red, green, blue), source.number("intensity", 1.0)
    if min(color) < 0.0 or not 0.0 <= max(color) * intensity <= LARGEST_LIGHT:
        raise source.error(f"intensity times color must be from 0 to {LARGEST_LIGHT:g}")
    limit = source.number("range", 0.0, low=0.0)
    reach = limit if 0 < limit <= MAX_COORDINATE else None
    x, y, z = matrix[:3, 3].tolist()
    if kind == "point":
        return PointLight((x, y, z), intensity, color, reach, name)
    # Read what has a direction.
    length = float(np.linalg.norm(matrix[:3, 2]))
    if length == 0.0:
        raise source.error("its direction is scaled to zero")
    direction = tuple((-matrix[:3, 2] / length).tolist())
    if kind == "directional":
        return DirectionalLight(direction, intensity, color, name)
    # Exporters round a right angle to 1.5708.
    spot = source.child("spot")
    outer = min(spot.number("outerConeAngle", math.pi / 4, low=0.0, high=_WIDEST_CONE), math.pi / 2)
    inner = spot.number("innerConeAngle", 0.0, low=0.0, high=_WIDEST_CONE)
    if outer == 0.0:
        raise spot.error("outerConeAngle must be above 0")
    return SpotLight((x, y, z), direction, min(inner, outer), outer, intensity, color, reach, name)


def _cameras(document: Document, nodes: Nodes, shown: list[int], motion: Motion) -> list[Camera]:
    """Return the cameras of the shown nodes, with the scale of their nodes removed."""
    descriptions = document.array("cameras")
    cameras: list[Camera] = []
    for node in shown:
        description = document.array("nodes")[node]
        index = description.optional_index("camera", len(descriptions), "cameras")
        if index is not None:
            with document.leaving_out("the camera"):
                name = description.text("name") or descriptions[index].text("name")
                camera = _camera(descriptions[index], nodes.placed(node), name)
                cameras.append(camera)
                motion.place(node, camera)
                motion.found("camera", index, camera)
    return cameras


def _camera(source: JsonObject, matrix: Matrix, name: str) -> Camera:
    """Return the camera of a node. Raises Damage."""
    pose = rigid(matrix)
    if pose is None:
        raise source.error("its axes are scaled to zero")
    if source.choice("type", {"perspective": False, "orthographic": True}):
        height = 2.0 * source.child("orthographic").number("ymag", low=SMALLEST_HEIGHT / 2, high=LARGEST_HEIGHT / 2)
        return Camera(pose, orthographic_height=height, name=name)
    yfov = source.child("perspective").number("yfov", low=SMALLEST_YFOV, high=LARGEST_YFOV)
    return Camera(pose, yfov, None, name)
