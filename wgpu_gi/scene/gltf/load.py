"""Reads glTF 2.0 and GLB files as a `Scene`, with json and numpy alone (Khronos glTF 2.0 specification).

Departures: alpha blending becomes an alpha mask, animations and morph targets are shown in their rest pose, points and
lines are left out. The scene's notes say what was changed or left out. Files are untrusted: every index, count, type
and path is checked, nothing is allocated by an announced size, and invalid data raises GiError with its place.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ...camera import Camera
from ...errors import GiError
from ...float_limits import LARGEST_HEIGHT, LARGEST_LIGHT, LARGEST_YFOV, MAX_COORDINATE, SMALLEST_HEIGHT, SMALLEST_YFOV
from ..files.memory import MemoryBudget
from ..files.notes import Notes
from ..scene import DirectionalLight, Instance, Light, PointLight, Scene, SpotLight
from .accessors import Accessors
from .document import Document
from .json_object import JsonObject
from .materials import Materials, some
from .meshes import Meshes
from .nodes import Matrix, Nodes
from .skins import joint_matrices

_FLAT = 1e-7  # ratio of a matrix's singular values below which float32 cannot invert it
_RIGID = 1e-14  # error of the products of a rotation's axes: some roundings of float64
_NOTHING = 1e-18  # scale at which anything is invisible


def load_gltf(path: Path, budget: MemoryBudget | None = None, notes: Notes | None = None) -> Scene:
    """Return the default scene of a .gltf or .glb file, which may unpack to the bytes of `budget`.

    Each glTF mesh becomes one Mesh, shared by the instances of all nodes that refer to it. Lights and cameras have the
    name of their node, or else their own. Raises GiError if the file is damaged, needs an extension that is not
    supported or a decoder that is not installed, refers to files outside its folder, or has no triangles.
    """
    document = Document(path, budget or MemoryBudget(), notes or Notes())
    nodes = Nodes(document)
    shown = nodes.shown()
    scene = Scene(name=nodes.scene_name() or path.stem)
    scene.instances = _instances(document, nodes, shown)
    scene.lights = _lights(document, nodes, shown)
    scene.cameras = _cameras(document, nodes, shown)
    _note_rest_pose(document)
    scene.notes = document.notes.sentences
    return scene


def _instances(document: Document, nodes: Nodes, shown: list[int]) -> list[Instance]:
    """Return an instance for every shown node that has a mesh with triangles."""
    # Read the materials of all meshes that are shown.
    descriptions = document.array("nodes")
    accessors = Accessors(document)
    materials = Materials(document, accessors)
    meshes = Meshes(document, accessors, materials)
    skin_count = len(document.array("skins"))
    mesh_of_node = {n: descriptions[n].index("mesh", len(meshes), "meshes") for n in shown if "mesh" in descriptions[n]}
    if not mesh_of_node:
        raise GiError(f"{document.path.name}: its scene has no meshes; there is nothing to show")
    materials.load(meshes.materials_of(mesh_of_node.values()))
    # Read the meshes, in the pose of their skins, and place them.
    instances: list[Instance] = []
    flat: list[str] = []
    posed: dict[int, tuple[Matrix, Matrix]] = {}  # the joint matrices and the frame of each skin
    for node, mesh_index in mesh_of_node.items():
        description, matrix, joints, skin = descriptions[node], nodes.world[node], None, None
        if "skin" in description:
            # A skinned mesh ignores the transform of its own node (glTF 2.0, 3.7.3.2).
            skin = description.index("skin", skin_count, "skins")
            if skin not in posed:
                posed[skin] = joint_matrices(document, accessors, skin, nodes.world)
            joints, matrix = posed[skin]
        mesh = meshes.get(mesh_index, skin, joints)
        name = description.text("name") or meshes.name(mesh_index)
        placed = _invertible(matrix)
        if placed is None:
            flat.append(name)
        elif mesh is not None:
            instances.append(Instance(mesh, placed, name))
    # Note what was left out.
    meshes.note_left_out()
    if flat:
        document.notes.add(f"Objects scaled to zero were left out: {some(flat)}.")
    if not instances:
        reasons = " ".join(document.notes.sentences)
        raise GiError(f"{document.path.name}: there are no triangles to show. {reasons}".rstrip())
    return instances


def _invertible(matrix: Matrix) -> Matrix | None:
    """Return `matrix`, or one that is invertible and looks the same; None if it projects everything to a line.

    Exporters write flat objects with a scale of zero along one axis. Those get a thickness below float32's resolution.
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
                document.notes.add(f"{description.where}: its light was left out; its direction is scaled to zero.")
            else:
                lights.append(light)
    return lights


def _light(source: JsonObject, matrix: Matrix, name: str) -> Light | None:
    """Return the light of a node, which shines along the node's -Z; None if that axis has no length."""
    kind = source.choice("type", {kind: kind for kind in ("point", "spot", "directional")})
    red, green, blue = source.vector("color", (1.0, 1.0, 1.0), low=0.0, high=LARGEST_LIGHT)
    color, intensity = (red, green, blue), source.number("intensity", 1.0, low=0.0, high=LARGEST_LIGHT)
    if max(color) * intensity > LARGEST_LIGHT:
        raise source.error(f"intensity times color must be at most {LARGEST_LIGHT:g}; repair the file")
    # Some exporters write a range of 0, or a huge one, for "no limit"; the extension omits the range instead.
    limit = source.number("range", 0.0, low=0.0)
    reach = limit if 0 < limit <= MAX_COORDINATE else None
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
    """Return the cameras of the shown nodes, with the scale of their nodes removed."""
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
            document.notes.add(f"{description.where}: its camera was left out, because its axes are scaled to zero.")
        elif source.choice("type", {"perspective": False, "orthographic": True}):
            height = 2.0 * source.child("orthographic").number("ymag", low=SMALLEST_HEIGHT / 2, high=LARGEST_HEIGHT / 2)
            cameras.append(Camera(pose, orthographic_height=height, name=name))
        else:
            yfov = source.child("perspective").number("yfov", low=SMALLEST_YFOV, high=LARGEST_YFOV)
            cameras.append(Camera(pose, yfov, None, name))
    return cameras


def _rigid(matrix: Matrix) -> Matrix | None:
    """Return `matrix` with orthonormal axes of the same view direction and up; None if those have no length.

    A rotation stays as it is, to the last bit, so that a saved camera gives the same picture.
    """
    axes = matrix[:3, :3]
    if np.abs(axes.T @ axes - np.eye(3)).max() < _RIGID and np.linalg.det(axes) > 0:
        return matrix
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
    """Note animations, skins and morph targets, which are shown in their rest pose."""
    primitives = (p for mesh in document.array("meshes") for p in mesh.values("primitives") if isinstance(p, dict))
    moving = {
        "animations": bool(document.array("animations")),
        "skins": bool(document.array("skins")),
        "morph targets": any("targets" in primitive for primitive in primitives),
    }
    kinds = [kind for kind, present in moving.items() if present]
    if kinds:
        listed = " and ".join([", ".join(kinds[:-1])] * (len(kinds) > 1) + kinds[-1:])
        document.notes.add(f"{listed.capitalize()} are shown in their rest pose.")
