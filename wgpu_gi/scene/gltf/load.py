"""glTF 2.0 and GLB files to a `Scene`, read with json and numpy alone (Khronos glTF 2.0 specification).

Departures: alpha blending becomes a mask, animation and morph targets stay at rest, points and lines are left out;
what was changed or left out stands in the scene's notes. Files are data from strangers: every index, count, type and
path is checked, nothing is allocated by an announced size, and what cannot be right raises GiError with its place.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ...camera import Camera
from ...errors import GiError
from ..scene import DirectionalLight, Instance, Light, PointLight, Scene, SpotLight
from .accessors import Accessors
from .document import Document
from .json_object import JsonObject
from .materials import MAX_POWER, Materials, some
from .meshes import Meshes
from .nodes import Matrix, Nodes
from .skins import joint_matrices

# Ratio of a matrix's axes below which float32 cannot invert it, and a scale that makes anything invisible.
_FLAT, _NOTHING = 1e-7, 1e-18


def load_gltf(path: Path) -> Scene:
    """Return the default scene of a .gltf or .glb file.

    Each glTF mesh becomes one Mesh, shared by the instances of the nodes that show it. Lights and cameras carry the
    name of their node, or their own. Raises GiError if the file is damaged, needs an extension or a decoder that is
    not there, names files outside its folder, or has no triangles to show.
    """
    document = Document(path)
    nodes = Nodes(document)
    shown = nodes.shown()
    scene = Scene(name=nodes.scene_name() or path.stem)
    scene.instances = _instances(document, nodes, shown)
    scene.lights = _lights(document, nodes, shown)
    scene.cameras = _cameras(document, nodes, shown)
    _note_rest_pose(document)
    scene.notes = document.notes
    return scene


def _instances(document: Document, nodes: Nodes, shown: list[int]) -> list[Instance]:
    """Return an instance for every shown node that has a mesh with triangles."""
    descriptions = document.array("nodes")
    accessors = Accessors(document)
    materials = Materials(document, accessors)
    meshes = Meshes(document, accessors, materials)
    skin_count = len(document.array("skins"))
    mesh_of_node = {n: descriptions[n].index("mesh", len(meshes), "meshes") for n in shown if "mesh" in descriptions[n]}
    if not mesh_of_node:
        raise GiError(f"{document.path.name} has no meshes in its scene; there is nothing to show")
    materials.load(meshes.materials_of(mesh_of_node.values()))
    instances: list[Instance] = []
    flat: list[str] = []
    for node, mesh_index in mesh_of_node.items():
        description, matrix, joints, skin = descriptions[node], nodes.world[node], None, None
        if "skin" in description:
            # The transform of a skinned mesh's own node does not count (glTF 2.0, 3.7.3.2).
            skin = description.index("skin", skin_count, "skins")
            joints, matrix = joint_matrices(document, accessors, skin, nodes.world)
        mesh = meshes.get(mesh_index, skin, joints)
        name = description.text("name") or meshes.name(mesh_index)
        placed = _invertible(matrix)
        if placed is None:
            flat.append(name)
        elif mesh is not None:
            instances.append(Instance(mesh, placed, name))
    meshes.note_left_out()
    if flat:
        document.note(f"Left out, since scaled to nothing: {some(flat)}.")
    if not instances:
        raise GiError(f"{document.path.name} has no triangles to show. {' '.join(document.notes)}".rstrip())
    return instances


def _invertible(matrix: Matrix) -> Matrix | None:
    """Return `matrix`, or one that can be inverted and shows the same; None if it squeezes all into a line.

    Exporters write flat things with a scale of zero across. A thickness below float32's resolution changes no picture.
    """
    left, scales, right = np.linalg.svd(matrix[:3, :3])
    if scales[1] <= max(_FLAT * scales[0], _NOTHING):
        return None
    if scales[2] > _FLAT * scales[0]:
        return matrix
    thick = matrix.copy()
    thick[:3, :3] = left @ np.diag([scales[0], scales[1], 10 * _FLAT * scales[0]]) @ right
    return thick


def _lights(document: Document, nodes: Nodes, shown: list[int]) -> list[Light]:
    """Return the KHR_lights_punctual lights of the shown nodes, in world space."""
    extension = document.root.extension("KHR_lights_punctual")
    descriptions = document.named_objects(extension.values("lights"), "lights") if extension else []
    lights: list[Light] = []
    for node in shown:
        description = document.array("nodes")[node]
        reference = description.extension("KHR_lights_punctual")
        if reference is not None:
            source = descriptions[reference.index("light", len(descriptions), "lights")]
            light = _light(source, nodes.world[node], description.text("name") or source.text("name"))
            if light is None:
                document.note(f"{description.where}: its light is left out, since its direction is scaled to nothing.")
            else:
                lights.append(light)
    return lights


def _light(source: JsonObject, matrix: Matrix, name: str) -> Light | None:
    """Return a light at a node, shining along the node's -Z; None if that axis has no length."""
    kind = source.choice("type", {kind: kind for kind in ("point", "spot", "directional")})
    red, green, blue = source.vector("color", (1.0, 1.0, 1.0), low=0.0, high=MAX_POWER)
    color, intensity = (red, green, blue), source.number("intensity", 1.0, low=0.0, high=MAX_POWER)
    # Some exporters write a range of 0 for "no limit", which the extension expresses by its absence.
    reach = source.number("range", 0.0, low=0.0) or None
    x, y, z = matrix[:3, 3].tolist()
    if kind == "point":
        return PointLight((x, y, z), intensity, color, reach, name)
    length = float(np.linalg.norm(matrix[:3, 2]))
    if length == 0.0:
        return None
    direction = tuple((-matrix[:3, 2] / length).tolist())
    if kind == "directional":
        return DirectionalLight(direction, intensity, color, name)
    spot = source.child("spot")
    outer = spot.number("outerConeAngle", math.pi / 4, low=0.0, high=math.pi / 2 + 1e-6)
    inner = spot.number("innerConeAngle", 0.0, low=0.0, high=math.pi / 2 + 1e-6)
    if outer == 0.0:
        raise spot.error("outerConeAngle must be above 0; widen the light")
    return SpotLight((x, y, z), direction, min(inner, outer), outer, intensity, color, reach, name)


def _cameras(document: Document, nodes: Nodes, shown: list[int]) -> list[Camera]:
    """Return the cameras of the shown nodes with rigid poses: scale does not change what a camera sees."""
    descriptions = document.array("cameras")
    cameras: list[Camera] = []
    for node in shown:
        description = document.array("nodes")[node]
        if "camera" not in description:
            continue
        source = descriptions[description.index("camera", len(descriptions), "cameras")]
        name = description.text("name") or source.text("name")
        pose = _rigid(nodes.world[node])
        if pose is None:
            document.note(f"{description.where}: its camera is left out, since its axes are scaled to nothing.")
        elif source.choice("type", {"perspective": False, "orthographic": True}):
            height = 2.0 * source.child("orthographic").number("ymag", low=1e-30, high=1e30)
            cameras.append(Camera(pose, orthographic_height=height, name=name))
        else:
            # Full angles from a thousandth of a degree to just below 180; beyond, float32 projections degenerate.
            yfov = source.child("perspective").number("yfov", low=1e-5, high=math.pi - 1e-5)
            cameras.append(Camera(pose, yfov, None, name))
    return cameras


def _rigid(matrix: Matrix) -> Matrix | None:
    """Return `matrix` with orthonormal axes that keep its view direction and up; None if those have no length."""
    back = matrix[:3, 2]
    right = np.cross(matrix[:3, 1], back)
    if not np.linalg.norm(right) > _FLAT * np.linalg.norm(matrix[:3, 1]) * np.linalg.norm(back):
        return None
    pose = np.eye(4)
    pose[:3, 2] = back / np.linalg.norm(back)
    pose[:3, 0] = right / np.linalg.norm(right)
    pose[:3, 1] = np.cross(pose[:3, 2], pose[:3, 0])
    pose[:3, 3] = matrix[:3, 3]
    return pose


def _note_rest_pose(document: Document) -> None:
    """Note what could move in the file and does not."""
    primitives = (p for mesh in document.array("meshes") for p in mesh.values("primitives") if isinstance(p, dict))
    moving = {
        "animations": bool(document.array("animations")),
        "skins": bool(document.array("skins")),
        "morph targets": any("targets" in primitive for primitive in primitives),
    }
    if any(moving.values()):
        kinds = ", ".join(kind for kind, present in moving.items() if present)
        document.note(f"The file has {kinds}; the rest pose is shown.")
