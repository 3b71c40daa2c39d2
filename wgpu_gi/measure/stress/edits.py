"""Changes of a scene whose effect on the picture is known: brighter, moved, mirrored, cut, reordered.

Each function returns a new scene and leaves its argument as it is. Arrays and images that stay the same are shared.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...camera import Camera
from ...scene.built_in.shapes import quad
from ...scene.deformation import is_deformed, posed_mesh
from ...scene.scene import (
    DirectionalLight,
    Environment,
    Image,
    Instance,
    Light,
    Material,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
    Texture,
)

MOST_SUBDIVIDED = 20_000  # triangles of a mesh; a larger one stays as it is
Matrix = NDArray[np.float64]


def copied(
    scene: Scene,
    material: Callable[[Material], Material] = replace,
    mesh: Callable[[Mesh], Mesh] = replace,
    light: Callable[[Light], Light] = replace,
    environment: Callable[[Environment], Environment] = replace,
) -> Scene:
    """Return a scene whose materials, meshes, lights and environment are the results of the functions."""
    materials = {id(m): material(m) for m in scene.materials}
    meshes = {id(m): mesh(replace(m, materials=[materials[id(each)] for each in m.materials])) for m in scene.meshes}
    instances = [replace(i, mesh=meshes[id(i.mesh)]) for i in scene.instances]
    sky = None if scene.environment is None else environment(scene.environment)
    return Scene(instances, [light(x) for x in scene.lights], sky, [replace(c) for c in scene.cameras], scene.name)


def brightened(scene: Scene, factor: float) -> Scene:
    """Multiply every source of light by `factor`."""

    def times(rgb: Sequence[float]) -> Any:
        return tuple(factor * value for value in rgb)

    return copied(
        scene,
        material=lambda m: replace(m, emission=times(m.emission)),
        light=lambda x: replace(x, intensity=x.intensity * factor),
        environment=lambda e: replace(e, color=times(e.color)),
    )


def moved(scene: Scene, matrix: Matrix) -> Scene:
    """Apply a similarity (4, 4) to instances, lights, cameras and sky.

    Intensities grow with the square of its scale, so that the picture stays the same; a reflection mirrors the picture.
    The sky turns only about +Y and mirrors only along x.
    """
    scale, mirrors, turn = _parts(matrix)
    world = copied(scene, partial(_scaled_volume, scale), light=lambda x: _moved_light(x, matrix, scale))
    for instance in world.instances:
        instance.world_from_local = matrix @ instance.world_from_local
    world.cameras = [_moved_camera(camera, matrix, scale, mirrors) for camera in scene.cameras]
    sky = world.environment
    if sky is not None and sky.image is not None:
        image = sky.image[:, ::-1].copy() if mirrors else sky.image
        world.environment = replace(sky, image=image, rotation=(-sky.rotation if mirrors else sky.rotation) + turn)
    return world


def _parts(matrix: Matrix) -> tuple[float, bool, float]:
    """Return the scale, whether it mirrors, and the angle about +Y of a similarity, in radians."""
    determinant = float(np.linalg.det(matrix[:3, :3]))
    scale = abs(determinant) ** (1 / 3)
    # Snap powers of two, which a cube root may miss by an ulp.
    power = 2.0 ** round(np.log2(scale))
    scale = power if abs(scale / power - 1) < 1e-12 else scale
    linear = matrix[:3, :3] @ np.diag([-1.0, 1.0, 1.0]) if determinant < 0 else matrix[:3, :3]
    return scale, determinant < 0, float(np.arctan2(linear[0, 2], linear[0, 0]))


def _scaled_volume(scale: float, m: Material) -> Material:
    """Scale the distance in which a volume absorbs; its thickness is a length of the mesh."""
    return replace(m, attenuation_distance=None if m.attenuation_distance is None else m.attenuation_distance * scale)


def _moved_light(light: Light, matrix: Matrix, scale: float) -> Light:
    changes: dict[str, Any] = {}
    if isinstance(light, PointLight | SpotLight):
        changes["position"] = tuple(matrix[:3, :3] @ np.asarray(light.position, np.float64) + matrix[:3, 3])
        changes["intensity"] = light.intensity * scale**2
        changes["range"] = None if light.range is None else light.range * scale
    if isinstance(light, DirectionalLight | SpotLight):
        changes["direction"] = tuple(matrix[:3, :3] @ np.asarray(light.direction, np.float64) / scale)
    return replace(light, **changes)


def _moved_camera(camera: Camera, matrix: Matrix, scale: float, mirrors: bool) -> Camera:
    pose = matrix @ camera.world_from_view
    pose[:3, :3] /= scale
    if mirrors:
        pose[:3, 0] *= -1.0
    height = None if camera.orthographic_height is None else camera.orthographic_height * scale
    return Camera(pose, camera.yfov, height, camera.name)


def channels_rolled(scene: Scene) -> Scene:
    """Permute red, green, blue to green, blue, red in all colours."""
    images: dict[int, Image] = {}

    def rolled(rgb: Sequence[float]) -> Any:
        r, g, b, *rest = rgb
        return (g, b, r, *rest)

    def rolled_texture(texture: Texture | None) -> Texture | None:
        if texture is None:
            return None
        image = texture.image
        images.setdefault(id(image), Image(image.pixels[..., [1, 2, 0, 3]].copy(), image.name))
        return replace(texture, image=images[id(image)])

    return copied(
        scene,
        material=lambda m: replace(
            m,
            base_color=rolled(m.base_color),
            emission=rolled(m.emission),
            specular_color=rolled(m.specular_color),
            sheen_color=rolled(m.sheen_color),
            attenuation_color=rolled(m.attenuation_color),
            base_color_texture=rolled_texture(m.base_color_texture),
            emission_texture=rolled_texture(m.emission_texture),
            specular_color_texture=rolled_texture(m.specular_color_texture),
            sheen_color_texture=rolled_texture(m.sheen_color_texture),
        ),
        mesh=lambda m: m if m.colors is None else replace(m, colors=m.colors[:, [1, 2, 0, 3]].copy()),
        light=lambda x: replace(x, color=rolled(x.color)),
        environment=lambda e: replace(
            e, color=rolled(e.color), image=None if e.image is None else e.image[..., [1, 2, 0]].copy()
        ),
    )


def baked(scene: Scene) -> Scene | None:
    """Replace each deformed mesh by a static one of its pose, in float32; None if nothing deforms."""

    def rounded(values: NDArray[Any] | None) -> Any:
        return None if values is None else values.astype(np.float32)

    other = copied(scene)
    if not any(is_deformed(instance) for instance in other.instances):
        return None
    for instance in other.instances:
        if is_deformed(instance):
            mesh = posed_mesh(instance)
            mesh.positions, mesh.normals, mesh.tangents = map(rounded, (mesh.positions, mesh.normals, mesh.tangents))
            instance.mesh = mesh
            instance.joint_matrices, instance.morph_weights = None, ()
    return other


def with_triangles(mesh: Mesh, chosen: NDArray) -> Mesh:
    """Return the mesh with the triangles `chosen`, as indices or a mask."""
    kinds = mesh.material_of_triangle
    return replace(
        mesh, triangles=mesh.triangles[chosen], material_of_triangle=None if kinds is None else kinds[chosen]
    )


def reordered(scene: Scene, rng: np.random.Generator) -> Scene:
    """Shuffle instances, lights and the triangles of every mesh."""
    other = copied(scene, mesh=lambda m: with_triangles(m, rng.permutation(len(m.triangles))))
    other.instances = [other.instances[k] for k in rng.permutation(len(other.instances))]
    other.lights = [other.lights[k] for k in rng.permutation(len(other.lights))]
    return other


def cut(scene: Scene, rng: np.random.Generator) -> Scene | None:
    """Cut every mesh into two, each an instance of its own; None if no mesh has two triangles."""
    halves: dict[int, list[Mesh]] = {}
    other = copied(scene)
    for mesh in other.meshes:
        first = rng.random(len(mesh.triangles)) < 0.5
        whole = len(mesh.triangles) < 2 or first.all() or not first.any()
        halves[id(mesh)] = [mesh] if whole else [with_triangles(mesh, first), with_triangles(mesh, ~first)]
    if all(len(parts) == 1 for parts in halves.values()):
        return None
    other.instances = [replace(i, mesh=part) for i in other.instances for part in halves[id(i.mesh)]]
    return other


def subdivided(scene: Scene) -> Scene | None:
    """Divide every flat triangle into four at the midpoints of its edges; None if no mesh can be divided.

    Meshes with smooth normals or normal maps stay as they are: a midpoint changes the interpolation of unit vectors.
    So do meshes with a skin, whose midpoints would move off their edges, and with morph targets.
    """
    other = copied(scene, mesh=lambda m: _subdivided(m) if _is_flat(m) else m)
    return other if other.triangle_count > scene.triangle_count else None


def _is_flat(mesh: Mesh) -> bool:
    if not 0 < len(mesh.triangles) <= MOST_SUBDIVIDED or any(m.normal_texture for m in mesh.materials):
        return False
    if mesh.skin is not None or mesh.morph_targets:
        return False
    return all(
        values is None or bool((values[mesh.triangles] == values[mesh.triangles[:, :1]]).all())
        for values in (mesh.normals, mesh.tangents)
    )


def _subdivided(mesh: Mesh) -> Mesh:
    """Return the mesh with corners of its own for each triangle, and their midpoints: 6 vertices, 4 triangles."""

    def divided(values: NDArray[np.float32] | None) -> Any:
        if values is None:
            return None
        a, b, c = np.moveaxis(values[mesh.triangles].astype(np.float64), 1, 0)
        corners = np.stack([a, b, c, (a + b) / 2, (b + c) / 2, (c + a) / 2], axis=1)
        return corners.reshape(-1, values.shape[1]).astype(np.float32)

    pieces = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
    first = 6 * np.arange(len(mesh.triangles))[:, None, None]
    kinds = mesh.material_of_triangle
    return replace(
        mesh,
        positions=divided(mesh.positions),
        triangles=(first + pieces).reshape(-1, 3).astype(np.uint32),
        material_of_triangle=None if kinds is None else np.repeat(kinds, 4),
        normals=divided(mesh.normals),
        tangents=divided(mesh.tangents),
        texcoords0=divided(mesh.texcoords0),
        texcoords1=divided(mesh.texcoords1),
        colors=divided(mesh.colors),
    )


def source_count(scene: Scene) -> int:
    """Return the number of sources of light: lights, emitting materials, sky."""
    return len(scene.lights) + len(_emitting(scene)) + (scene.environment is not None)


def with_sources(scene: Scene, chosen: Sequence[bool]) -> Scene:
    """Return the scene with only the chosen sources: lights, emitting materials, sky, in this order."""
    emitting, lights = _emitting(scene), len(scene.lights)
    dark = {id(m) for m, keep in zip(emitting, chosen[lights:], strict=False) if not keep}
    other = copied(scene, material=lambda m: replace(m, emission=(0.0, 0.0, 0.0)) if id(m) in dark else replace(m))
    other.lights = [light for light, keep in zip(other.lights, chosen, strict=False) if keep]
    if scene.environment is not None and not chosen[-1]:
        other.environment = None
    return other


def _emitting(scene: Scene) -> list[Material]:
    return [m for m in scene.materials if max(m.emission) > 0]


def has_unlit(scene: Scene) -> bool:
    """Return whether a material shows its base colour whatever the light."""
    return any(m.unlit for m in scene.materials)


def with_nothing_added(scene: Scene) -> Scene:
    """Add a mesh without triangles."""
    other = copied(scene)
    other.instances.append(Instance(Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)), name="nothing"))
    return other


def with_hidden_added(scene: Scene) -> Scene:
    """Add a small black object outside the scene, behind a black wall: both see hardly any of it."""
    low, high = scene.bounds()
    diagonal = float(np.linalg.norm(high - low)) or 1.0
    black = Material("hidden", (0.0, 0.0, 0.0, 1.0))
    side, place = diagonal * 1e-3, (low + high) / 2 - np.array([0.0, diagonal, 0.0])
    corners = [tuple(place + side * np.array(offset)) for offset in ((-1, 0, -1), (-0.5, -1, -0.5))]
    wall = quad(corners[0], (0.0, 0.0, 2 * side), (2 * side, 0.0, 0.0), black)
    thing = quad(corners[1], (0.0, 0.0, side), (side, 0.0, 0.0), black)
    other = copied(scene)
    other.instances += [Instance(wall, name="hidden wall"), Instance(thing, name="hidden")]
    return other
