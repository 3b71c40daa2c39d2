"""Scenes survive `save_glb` and loading: arrays, materials, lights and environment exactly, directions rounded."""

from __future__ import annotations

import json
import struct
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from helpers.medley import medley
from helpers.scene_strategies import FIXED, scenes
from hypothesis import given, settings

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError, GiWarning
from wgpu_gi.measure.scenes import KINDS, make_scene
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.deformation import posed_mesh
from wgpu_gi.scene.files.environment_files import load_environment
from wgpu_gi.scene.gltf.write import power_of_two_above, save_glb
from wgpu_gi.scene.load import load
from wgpu_gi.scene.mesh_cleaning import has_area, unit_rows
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, Material, Mesh, PointLight, Scene, SpotLight

VERTEX_ARRAYS = ("positions", "normals", "tangents", "texcoords0", "texcoords1", "colors")
ROUNDED = ("direction",)  # fields that loaders normalise


def differences(a: object, b: object, place: str = "scene") -> list[str]:
    """Return the places where two scenes, or parts of them, differ."""
    if is_dataclass(a) and type(a) is type(b):
        return [d for f in fields(a) for d in differences(getattr(a, f.name), getattr(b, f.name), f"{place}.{f.name}")]
    if any(place.endswith(name) for name in ROUNDED):
        return [] if np.allclose(a, b, rtol=4e-16, atol=4e-16) else [place]
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return [] if a.dtype == b.dtype and np.array_equal(a, b) else [place]
    if isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            return [f"{place}: {len(a)} and {len(b)} elements"]
        return [d for k, (x, y) in enumerate(zip(a, b, strict=True)) for d in differences(x, y, f"{place}[{k}]")]
    return [] if type(a) is type(b) and a == b else [f"{place}: {a!r} and {b!r}"]


def loadable(scene: Scene) -> Scene:
    """Return the scene without what files do not hold: degenerate triangles, unused vertices, poses, animations."""
    instances = [Instance(rounded(posed_mesh(i)), i.world_from_local, i.name) for i in scene.instances]
    scene = Scene(instances, scene.lights, scene.environment, scene.cameras, scene.name)
    clean: dict[int, Mesh] = {}
    for mesh in scene.meshes:
        kept = mesh.triangles[has_area(mesh.positions, mesh.triangles)]
        used = np.isin(np.arange(len(mesh.positions)), kept)
        arrays = {name: getattr(mesh, name) for name in VERTEX_ARRAYS}
        arrays = {name: None if values is None else values[used] for name, values in arrays.items()}
        triangles = (np.cumsum(used) - 1)[kept].astype(np.uint32)
        clean[id(mesh)] = Mesh(**arrays, triangles=triangles, materials=mesh.materials, name=mesh.name)
        clean[id(mesh)].material_of_triangle = mesh.material_of_triangle
    instances = [Instance(clean[id(i.mesh)], i.world_from_local, i.name) for i in scene.instances]
    instances = [instance for instance in instances if len(instance.mesh.triangles)]
    return Scene(instances, scene.lights, unrotated(scene.environment), scene.cameras, scene.name)


def rounded(mesh: Mesh) -> Mesh:
    """Return a mesh with arrays of float32, itself if it has no others; loaders make directions unit vectors again."""
    if mesh.positions.dtype == np.float32:
        return mesh
    arrays = {name: getattr(mesh, name) for name in ("positions", "normals", "tangents")}
    arrays = {name: None if v is None else v.astype(np.float32) for name, v in arrays.items()}
    for name in ("normals", "tangents"):
        if arrays[name] is not None:
            arrays[name][:, :3] = unit_rows(arrays[name][:, :3])
    return replace(mesh, **arrays)


def unrotated(environment: Environment | None) -> Environment | None:
    """Return the environment as a file can hold it: turned by whole columns, in white."""
    if environment is None or environment.image is None:
        return environment
    columns = round(environment.rotation / (2 * np.pi) * environment.image.shape[1])
    return Environment(image=np.roll(environment.image, -columns, axis=1))


def round_trip(folder, scene: Scene) -> Scene:
    env = save_glb(folder / "scene.glb", scene)
    loaded = load(folder / "scene.glb", environment=None if env is None else load_environment(env))
    for environment in (loaded.environment, scene.environment):
        if environment is not None:
            environment.name = ""
    loaded.notes = []
    return loaded


@pytest.mark.parametrize("kind", KINDS)
def test_generated_scenes_survive(tmp_path, kind):
    for seed in range(6):
        scene = make_scene(kind, seed)
        assert not differences(round_trip(tmp_path, scene), loadable(scene))


@given(scene=scenes())
@settings(FIXED, max_examples=15)
def test_any_generated_scene_survives(tmp_path_factory, scene):
    assert not differences(round_trip(tmp_path_factory.mktemp("scene"), scene), loadable(scene))


def test_a_scene_with_animations_is_written_as_it_stands(tmp_path):
    scene = make_scene("moving", 0)
    with pytest.warns(GiWarning, match=r"scene.glb holds the scene as it stands"):
        save_glb(tmp_path / "scene.glb", scene)
    np.testing.assert_allclose(load(tmp_path / "scene.glb").bounds(), scene.bounds(), rtol=1e-6)


def test_meshes_and_materials_stay_shared(tmp_path):
    scene = make_scene("many", 0)
    loaded = round_trip(tmp_path, scene)
    assert len(loaded.meshes) == len(scene.meshes) < len(scene.instances)
    assert len(loaded.materials) == len(scene.materials)


def test_every_kind_of_surface_survives(tmp_path):
    scene = medley()
    scene.name = "medley"
    for number, instance in enumerate(scene.instances):
        instance.name = instance.name or f"object {number}"
    loaded = round_trip(tmp_path, scene)
    found = differences(loaded, loadable(scene))
    # Normals and tangents are normalised when loaded.
    assert all(place.endswith((".normals", ".tangents")) for place in found)


def test_a_mesh_of_several_materials_keeps_them(tmp_path):
    materials = [Material("a"), Material("b", emission=(3.0, 0.5, 0.1)), Material("c", unlit=True)]
    square = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    mesh = Mesh(square.positions, np.concatenate([square.triangles] * 2), materials, name="mixed")
    mesh.material_of_triangle = np.array([0, 1, 0, 2], np.uint32)
    scene = Scene([Instance(mesh, name="mixed")], cameras=[Camera()], name="mixed")
    assert not differences(round_trip(tmp_path, scene), scene)


def test_lights_keep_their_numbers(tmp_path):
    lights = [
        PointLight((1.0, -2.0, 1e7), 1e12, (1.0, 0.1, 0.0), 0.1, "point"),
        SpotLight((0.0, 1.0, 2.0), (0.0, -1.0, 0.0), 0.3, np.pi / 2, 1e-12, name="spot"),
        DirectionalLight((0.6, 0.0, -0.8), 3.3, name="sun"),
    ]
    scene = Scene([Instance(quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), name="floor")], lights, None, [Camera()], "lights")
    assert not differences(round_trip(tmp_path, scene).lights, lights)


def test_a_colour_above_1_moves_to_the_intensity(tmp_path):
    light = PointLight((0.0, 0.0, 0.0), 2.0, (3.0, 0.3, 1.0), name="bright")
    scene = Scene([Instance(quad((0, 0, 0), (1, 0, 0), (0, 1, 0)))], [light], cameras=[Camera()])
    (loaded,) = round_trip(tmp_path, scene).lights
    assert loaded.intensity == 8.0 and loaded.color == (0.75, 0.075, 0.25)


def test_strengths_are_powers_of_two():
    assert [power_of_two_above((0.0, v)) for v in (0.0, 0.3, 1.0, 1.0000001, 2.0, 3.0, 1e12)] == [
        *(1.0, 1.0, 1.0, 2.0, 2.0, 4.0, 2.0**40)
    ]


def test_the_environment_becomes_the_value_of_the_option(tmp_path):
    scene = Scene([Instance(quad((0, 0, 0), (1, 0, 0), (0, 1, 0)))], cameras=[Camera()])
    path = tmp_path / "scene.glb"
    assert save_glb(path, scene) == "0,0,0", "or loading would add a sky"
    scene.environment = Environment((0.1, 1e-12, 3e9))
    assert load_environment(save_glb(path, scene)).color == scene.environment.color
    # A half turn, and one of a quarter column.
    image = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    scene.environment = Environment((2.0, 1.0, 1.0), image, np.pi)
    env = save_glb(path, scene)
    assert env == str(tmp_path / "scene.exr")
    assert np.array_equal(load_environment(env).image, np.roll(image, 2, axis=1) * np.float32([2, 1, 1]))
    scene.environment = Environment(image=image, rotation=np.pi / 8)
    blended = 0.75 * image + 0.25 * np.roll(image, -1, axis=1)
    assert np.allclose(load_environment(save_glb(path, scene)).image, blended)
    scene.environment, scene.lights = None, [PointLight((0, 0, 0))]
    assert save_glb(path, scene) is None


def test_the_file_is_a_glb_of_aligned_chunks(tmp_path):
    path = tmp_path / "scene.glb"
    save_glb(path, make_scene("textured", 0))
    data = path.read_bytes()
    magic, version, length, size, kind = struct.unpack_from("<4sIIII", data)
    assert (magic, version, length, size % 4, kind) == (b"glTF", 2, len(data), 0, 0x4E4F534A)
    root = json.loads(data[20 : 20 + size])
    assert struct.unpack_from("<II", data, 20 + size) == (len(data) - size - 28, 0x004E4942)
    assert all(view["byteOffset"] % 4 == 0 for view in root["bufferViews"])
    assert all(max(m["emissiveFactor"]) <= 1 for m in root["materials"])
    used = {name for name in root["extensionsUsed"] if name in data[20 : 20 + size].decode()}
    assert used == set(root["extensionsUsed"])


@pytest.mark.parametrize(
    "change, message",
    [
        (
            lambda s: s.lights.append(SpotLight((0, 0, 0), (0, 0, 1), 0, 2.0, name="a")),
            "light 'a': glTF has no spot",
        ),
        (
            lambda s: s.lights.append(PointLight((0, 0, 0), np.nan, name="a")),
            r"lights\[0\].intensity",
        ),
        (lambda s: s.instances[0].mesh.positions.fill(np.nan), "mesh.positions"),
        (lambda s: s.cameras.append(Camera(yfov=4.0, name="wide")), "camera.yfov"),
    ],
)
def test_what_gltf_cannot_hold_is_an_error_and_leaves_no_file(tmp_path, change, message):
    sky = Environment(image=np.ones((1, 2, 3), np.float32))
    scene = Scene([Instance(quad((0, 0, 0), (1, 0, 0), (0, 1, 0)))], [], sky)
    change(scene)
    with pytest.raises(GiError, match=message):
        save_glb(tmp_path / "scene.glb", scene)
    assert not list(tmp_path.iterdir())


def test_other_extensions_are_errors(tmp_path):
    with pytest.raises(GiError, match=r"written as \.glb"):
        save_glb(tmp_path / "scene.gltf", make_scene("room", 0))
