"""Converts meshes, point clouds and scenes of the library trimesh to a `Scene`.

Colours are converted as trimesh writes and reads glTF and OBJ: 8-bit vertex and face colours are sRGB, the factors of
`PBRMaterial` linear, and a `SimpleMaterial` is matte with the linear reflectance `diffuse`. Texture coordinates have v
pointing up. Shading is smooth where a mesh holds vertex normals, given or computed, which is the rule of trimesh's own
exporters. Lights have the units of glTF. Axes are not turned: Y is up.

Departures: specular colour and glossiness are ignored; blended materials become alpha masks; paths are left out.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError
from ..float_limits import LARGEST_LIGHT, LARGEST_YFOV, SMALLEST_YFOV
from .arrays import linear_rgba
from .check import is_singular
from .files.memory import MemoryBudget
from .files.notes import Notes
from .files.points import points_scene
from .files.raw_mesh import RawMesh, RawPoints, clay, scene_from_raw
from .rules import shown
from .scene import DirectionalLight, Image, Instance, Light, Material, PointLight, Scene, SpotLight, Texture

_TEXTURES = {
    "base_color_texture": "baseColorTexture",
    "metallic_roughness_texture": "metallicRoughnessTexture",
    "normal_texture": "normalTexture",
    "occlusion_texture": "occlusionTexture",
    "emission_texture": "emissiveTexture",
}
_DEFAULT_DIFFUSE = (102, 102, 102, 255)  # of a SimpleMaterial that was given none; trimesh.visual.color.DEFAULT_COLOR


def scene_of_trimesh(source: Any, notes: Notes, budget: MemoryBudget, point_size: float | None = None) -> Scene:
    """Return the scene of a trimesh.Trimesh, PointCloud or Scene.

    Geometry that the graph of a scene places several times becomes one Mesh with several instances. Parts that cannot
    be shown are left out, with a note. `points_scene` shows points. Raises GiError for other objects, and if nothing is
    left.
    """
    import trimesh

    convert = _Converter(notes, budget, point_size)
    if isinstance(source, trimesh.Scene):
        return _scene(source, convert, notes)
    if not isinstance(source, (trimesh.Trimesh, trimesh.PointCloud)):
        raise GiError(f"a trimesh mesh, point cloud or scene can be shown, not {shown(source)}")
    return convert.geometry(source, str(source.metadata.get("name", "")))


def _scene(source: Any, convert: _Converter, notes: Notes) -> Scene:
    """Convert a trimesh.Scene."""
    scene = Scene()
    # Convert each geometry once.
    parts: dict[str, list[Instance]] = {}
    for name, geometry in source.geometry.items():
        try:
            parts[name] = convert.geometry(geometry, name).instances
        except GiError as error:
            notes.damage(f"{error}; it was left out")
    # Place it where the graph does.
    for node in source.graph.nodes_geometry:
        matrix, name = source.graph.get(node)
        for part in parts.get(name, ()):
            placed = np.asarray(matrix, np.float64) @ part.world_from_local
            if is_singular(placed):
                notes.add(f"{node!r} was left out: its transform scales it to zero")
            else:
                scene.instances.append(replace(part, world_from_local=placed, name=str(node)))
    if not scene.instances:
        raise GiError(f"the trimesh scene has nothing to show. {' '.join(notes.sentences)}".rstrip())
    # Lights and camera, if they were given: trimesh would otherwise make them up.
    if getattr(source, "_lights", None):
        scene.lights = [light for light in (_light(source, light, notes) for light in source.lights) if light]
    if source.has_camera:
        camera = _camera(source, notes)
        scene.cameras = [camera] if camera else []
    scene.notes = notes.sentences
    return scene


class _Converter:
    """Converts meshes and point clouds, with their materials."""

    def __init__(self, notes: Notes, budget: MemoryBudget, point_size: float | None) -> None:
        self._notes, self._budget, self._point_size = notes, budget, point_size
        self._materials = _Materials(notes)

    def geometry(self, geometry: Any, name: str) -> Scene:
        """Return a scene of one instance. Raises GiError if the geometry cannot be shown."""
        import trimesh

        where = f"trimesh geometry {name!r}" if name else "the trimesh mesh"
        if isinstance(geometry, trimesh.PointCloud):
            colors = np.asarray(geometry.colors)
            tints = linear_rgba(colors) if len(colors) == len(geometry.vertices) else None
            points = RawPoints(np.asarray(geometry.vertices, np.float64), tints)
            return points_scene(points, self._point_size, name, where, self._notes, self._budget)
        if not isinstance(geometry, trimesh.Trimesh):
            raise GiError(f"{where} is a {type(geometry).__name__}, and only meshes and points can be shown")
        raw = RawMesh(np.asarray(geometry.vertices, np.float64), np.asarray(geometry.faces, np.int64))
        # trimesh computes normals that a mesh was not given, which would round every edge of a box.
        if "vertex_normals" in geometry._cache:
            raw.normals = np.asarray(geometry.vertex_normals, np.float64)
        raw = self._dressed(raw, geometry.visual, where)
        if raw.colors is not None and (raw.colors[:, 3] < 1.0).any():
            self._notes.add(f"{where}: the transparency of its colours is ignored; it is shown opaque")
        return scene_from_raw(raw, name, where, self._notes)

    def _dressed(self, raw: RawMesh, visual: Any, where: str) -> RawMesh:
        """Return a mesh with the colours, or the materials and texture coordinates, of trimesh's `visual`."""
        if visual.kind == "face":
            return _with_face_colors(raw, linear_rgba(np.asarray(visual.face_colors)))
        if visual.kind == "vertex":
            raw.colors = linear_rgba(np.asarray(visual.vertex_colors))
        if visual.kind != "texture":
            return raw
        if visual.uv is not None and len(visual.uv) == len(raw.positions):
            raw.texcoords = np.asarray(visual.uv, np.float64)[:, :2] * (1.0, -1.0) + (0.0, 1.0)
        listed = getattr(visual.material, "materials", None)
        raw.materials = [self._materials.get(material) for material in listed or [visual.material]]
        of_faces = visual.face_materials
        if listed and of_faces is not None and len(of_faces) == len(raw.triangles):
            raw.material_of_triangle = np.asarray(of_faces, np.uint32)
            if int(raw.material_of_triangle.max(initial=0)) >= len(listed):
                raise GiError(f"{where}: face_materials has an index that is not in the list of materials")
        return raw


def _with_face_colors(raw: RawMesh, colors: NDArray[np.float64]) -> RawMesh:
    """Return a mesh with a colour (m, 4) for each triangle: triangles then share no vertices."""
    corners = raw.triangles.reshape(-1)
    normals, texcoords = (None if rows is None else rows[corners] for rows in (raw.normals, raw.texcoords))
    return replace(
        raw,
        positions=raw.positions[corners],
        triangles=np.arange(len(corners)).reshape(-1, 3),
        normals=normals,
        texcoords=texcoords,
        colors=np.repeat(colors, 3, axis=0),
    )


class _Materials:
    """Converts materials and images, each once."""

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._materials: dict[int, tuple[Any, Material]] = {}  # with the source, so that its id is not reused
        self._images: dict[int, tuple[Any, Image | None]] = {}

    def get(self, source: Any) -> Material:
        """Return a material."""
        if id(source) not in self._materials:
            is_pbr = hasattr(source, "baseColorFactor")
            self._materials[id(source)] = source, self._pbr(source) if is_pbr else self._simple(source)
        return self._materials[id(source)][1]

    def _pbr(self, source: Any) -> Material:
        """Convert a PBRMaterial; factors that it lacks have the defaults of glTF."""
        material = Material(str(source.name or ""), base_color=_unit_rgba(source.baseColorFactor))
        metallic, roughness = source.metallicFactor, source.roughnessFactor
        material.metallic = 1.0 if metallic is None else _fraction(metallic)
        material.roughness = 1.0 if roughness is None else _fraction(roughness)
        for slot, name in _TEXTURES.items():
            setattr(material, slot, self._texture(getattr(source, name)))
        if source.emissiveFactor is not None:
            red, green, blue = (min(max(float(c), 0.0), LARGEST_LIGHT) for c in source.emissiveFactor)
            material.emission = red, green, blue
        material.double_sided = bool(source.doubleSided)
        if source.alphaMode == "MASK":
            material.alpha_mode = "mask"
            material.alpha_cutoff = 0.5 if source.alphaCutoff is None else float(source.alphaCutoff)
        elif source.alphaMode == "BLEND":
            material.alpha_mode = "blend"
        return material

    def _simple(self, source: Any) -> Material:
        """Convert a SimpleMaterial; anything else becomes clay."""
        material = clay()
        material.name = str(getattr(source, "name", "") or "")
        diffuse = getattr(source, "diffuse", None)
        material.base_color_texture = self._texture(getattr(source, "image", None))
        if material.base_color_texture and (diffuse is None or tuple(diffuse) == _DEFAULT_DIFFUSE):
            material.base_color = (1.0, 1.0, 1.0, 1.0)
        elif diffuse is not None:
            material.base_color = _unit_rgba(diffuse)
            if material.base_color[3] < 1.0:
                material.alpha_mode = "blend"
        return material

    def _texture(self, source: Any) -> Texture | None:
        """Return the texture of a Pillow image; None, with a note, if it cannot be decoded."""
        if source is None:
            return None
        if id(source) not in self._images:
            from .files.image_files import decode_image, from_pillow  # imports Pillow

            is_image = hasattr(source, "convert")
            opened = from_pillow(source) if is_image else f"it is {shown(source)}, not an image"
            if not isinstance(opened, str) and opened.note:
                self._notes.add(f"a texture of the trimesh material: {opened.note}")
            pixels = decode_image(opened)
            if isinstance(pixels, str):
                self._notes.damage(f"a texture was left out: {pixels}")
                self._images[id(source)] = source, None
            else:
                self._images[id(source)] = source, Image(pixels)
        image = self._images[id(source)][1]
        return None if image is None else Texture(image)


def _unit_rgba(color: Any) -> tuple[float, float, float, float]:
    """Return linear factors from 0 to 1 of a colour with 3 or 4 channels in 8 bits or floats; None means white."""
    if color is None:
        return 1.0, 1.0, 1.0, 1.0
    values = np.asarray(color)
    unit = values / 255.0 if values.dtype.kind in "ui" else values.astype(np.float64)
    red, green, blue, alpha = np.clip(np.append(unit, 1.0)[:4], 0.0, 1.0).tolist()
    return red, green, blue, alpha


def _fraction(value: Any) -> float:
    return min(max(float(value), 0.0), 1.0)


def _light(source: Any, light: Any, notes: Notes) -> Light | None:
    """Return a light of a trimesh.Scene at its node; it shines along the node's -Z."""
    import trimesh.scene.lighting as kinds

    pose = np.asarray(source.graph[light.name][0], np.float64) if light.name in source.graph else np.eye(4)
    red, green, blue, _ = _unit_rgba(light.color)
    color, intensity = (red, green, blue), float(light.intensity)
    if not 0 <= intensity <= LARGEST_LIGHT:
        notes.damage(f"the light {light.name!r} was left out: its intensity is {intensity:g}")
        return None
    x, y, z = pose[:3, 3].tolist()
    direction = tuple((-pose[:3, 2]).tolist())
    reach = None if light.radius is None else float(light.radius)
    if isinstance(light, kinds.PointLight):
        return PointLight((x, y, z), intensity, color, reach, str(light.name))
    if not any(direction):
        notes.damage(f"the light {light.name!r} was left out: its direction is scaled to zero")
        return None
    if isinstance(light, kinds.SpotLight):
        inner, outer = float(light.innerConeAngle), float(light.outerConeAngle)
        return SpotLight((x, y, z), direction, min(inner, outer), outer, intensity, color, reach, str(light.name))
    return DirectionalLight(direction, intensity, color, str(light.name))


def _camera(source: Any, notes: Notes) -> Camera | None:
    """Return the camera of a trimesh.Scene without the scale of its node; None, with a note, if it sees nothing."""
    pose, yfov = np.array(source.camera_transform, np.float64), math.radians(float(source.camera.fov[1]))
    lengths = np.linalg.norm(pose[:3, :3], axis=0)
    if not lengths.all() or not SMALLEST_YFOV <= yfov <= LARGEST_YFOV:
        notes.damage("the camera was left out: its axes or its angle are zero or out of range")
        return None
    pose[:3, :3] = _nearest_rotation(pose[:3, :3] / lengths)
    return Camera(pose, yfov, name=str(source.camera.name or "camera"))


def _nearest_rotation(axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return axes that are orthogonal and right-handed (singular value decomposition)."""
    left, _, right = np.linalg.svd(axes)
    left[:, 2] *= np.sign(np.linalg.det(left @ right))
    rotation: NDArray[np.float64] = left @ right
    return rotation
