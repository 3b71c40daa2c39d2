"""Shapes and built-in scenes: areas, outward normals, sealed rooms, and the Cornell box in `scenes/`."""

import math

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.resources import resource_dir
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.scenes import BUILTIN_SCENES, builtin_scene, plates_form_factor
from wgpu_gi.scene.built_in.shapes import box, grid, quad, sphere


def corners(mesh):
    return mesh.positions[mesh.triangles].astype(np.float64).transpose(1, 0, 2)


def area_vectors(mesh):
    a, b, c = corners(mesh)
    return 0.5 * np.cross(b - a, c - a)


def area(mesh):
    return np.linalg.norm(area_vectors(mesh), axis=1).sum()


def volume(mesh):
    """Signed volume by the divergence theorem: positive if all faces of a closed mesh point outwards."""
    a, _, _ = corners(mesh)
    return (a * area_vectors(mesh)).sum() / 3


def is_watertight(mesh):
    """Tell whether every edge is used once in each direction."""
    edges = np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]]).tolist()
    return sorted(map(tuple, edges)) == sorted((b, a) for a, b in edges)


def nearest_hit(origin, directions, triangles):
    """Distance to the first triangle (m, 3, 3) along each ray, inf for none (Möller and Trumbore 1997)."""
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(directions[:, None], v)
    det = (u * p).sum(-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = origin - a
        q = np.cross(s, u)
        bu, bv, t = (s * p).sum(-1) / det, (directions[:, None] * q).sum(-1) / det, (v * q).sum(-1) / det
        hit = (bu >= -1e-9) & (bv >= -1e-9) & (bu + bv <= 1 + 1e-9) & (t > 1e-9)
    return np.where(hit, t, np.inf).min(1)


def directions(count):
    v = np.random.default_rng(7).normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def scene_triangles(scene):
    return np.concatenate([i.mesh.positions[i.mesh.triangles].astype(np.float64) for i in scene.instances])


def test_quad():
    mesh = quad((1, 2, 3), (2, 0, 0), (0, 0, -3))
    np.testing.assert_allclose(area_vectors(mesh).sum(0), [0, 6, 0])
    assert len(mesh.triangles) == 2 and mesh.normals is None and mesh.positions.dtype == np.float32


def test_box():
    mesh = box((-1, 0, 2), (1, 3, 6))
    assert is_watertight(mesh) and len(mesh.triangles) == 12
    assert volume(mesh) == pytest.approx(24) and area(mesh) == pytest.approx(2 * (6 + 8 + 12))
    assert volume(box((-1, 0, 2), (1, 3, 6), inward=True)) == pytest.approx(-24)
    outward = area_vectors(mesh) * (np.mean(corners(mesh), axis=0) - (0, 1.5, 4))
    assert (outward.sum(1) > 0).all()


@pytest.mark.parametrize("subdivisions", [0, 1, 3])
def test_sphere(subdivisions):
    mesh = sphere((1, 2, 3), 2.0, subdivisions)
    assert is_watertight(mesh) and len(mesh.triangles) == 20 * 4**subdivisions
    assert area(mesh) == pytest.approx(16 * math.pi, rel=1e-6)
    assert ((np.mean(corners(mesh), axis=0) - (1, 2, 3)) * area_vectors(mesh)).sum(1).min() > 0
    radii = np.linalg.norm(mesh.positions - np.array([1, 2, 3]), axis=1)
    assert np.ptp(radii) < 1e-5
    assert volume(sphere(subdivisions=subdivisions, inward=True)) < 0


def test_grid():
    mesh = grid(4.0, 3, centre=(0, 1, 0))
    assert len(mesh.triangles) == 18 and len(mesh.positions) == 16
    assert (area_vectors(mesh)[:, 1] > 0).all() and area(mesh) == pytest.approx(16)
    np.testing.assert_allclose(mesh.positions.min(0), [-2, 1, -2])


def test_sphere_light_is_within_half_a_percent_of_the_closed_form():
    mesh = builtin.sphere_light(radius=2.0, intensity=10.0).meshes[0]
    a, b, c = corners(mesh)
    weights = np.random.default_rng(1).dirichlet((1, 1, 1), 8)
    vectors = area_vectors(mesh)
    normals = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    total = 0.0
    for x, y, z in weights:
        points = x * a + y * b + z * c
        distance = np.linalg.norm(points, axis=1)
        irradiance = -10.0 * (points * normals).sum(1) / distance**3
        np.testing.assert_allclose(irradiance, 2.5, rtol=0.005)
        total += irradiance.mean() / len(weights)
    assert total == pytest.approx(2.5, rel=5e-4)


def test_plates_form_factor():
    """Compare with 0.199825 (Howell C-11), with Monte Carlo, and with the inverse-square law at a distance."""
    assert plates_form_factor() == pytest.approx(0.199825, abs=1e-6)
    rng = np.random.default_rng(3)
    p, q = rng.random((2, 200_000, 2))
    squared = ((p - q) ** 2).sum(1) + 0.25
    estimate = 0.25 / (math.pi * squared**2)
    assert plates_form_factor(0.5) == pytest.approx(estimate.mean(), abs=4 * estimate.std() / 200_000**0.5)
    assert plates_form_factor(100.0) == pytest.approx(1e-4 / math.pi, rel=1e-3)


def test_plates_face_each_other():
    receiver, lamp = builtin.plates(2.0).meshes
    np.testing.assert_allclose(area_vectors(receiver).sum(0), [0, 1, 0])
    np.testing.assert_allclose(area_vectors(lamp).sum(0), [0, -1, 0])
    np.testing.assert_allclose(lamp.positions[:, 1], 2.0)
    assert lamp.materials[0].emission == (1, 1, 1) and not lamp.materials[0].double_sided


def test_builtin_scenes_are_valid():
    for name in BUILTIN_SCENES:
        scene = builtin_scene(name)
        assert scene.name == name and scene.cameras and not scene.notes
        for mesh in scene.meshes:
            assert mesh.triangles.max() < len(mesh.positions) and np.isfinite(mesh.positions).all()
            assert (np.linalg.norm(area_vectors(mesh), axis=1) > 0).all()
        for camera in scene.cameras:
            assert np.linalg.det(camera.world_from_view) == pytest.approx(1.0)


def test_builtin_scenes_are_independent_copies():
    first = builtin_scene("cornell")
    first.materials[0].base_color = (0, 0, 0, 1)
    assert builtin_scene("cornell").materials[0].base_color != (0, 0, 0, 1)


def test_unknown_builtin_scene():
    with pytest.raises(GiError, match="did you mean furnace"):
        builtin_scene("furnase")
    with pytest.raises(GiError, match="cornell-point"):
        builtin_scene("zzz")


@pytest.mark.parametrize("name", ["closed-box", "sphere-light"])
def test_rooms_are_closed_and_seen_from_inside(name):
    scene = builtin_scene(name)
    mesh = scene.meshes[0]
    assert is_watertight(mesh) and volume(mesh) < 0
    low, high = scene.bounds()
    assert (scene.cameras[0].position > low).all() and (scene.cameras[0].position < high).all()


@pytest.mark.parametrize("name", ["cornell", "cornell-point", "cornell-spot"])
def test_frame_of_the_cornell_box_shows_only_the_box(name):
    scene = builtin_scene(name)
    camera = scene.cameras[0]
    height = math.tan(camera.yfov / 2)
    corners = [(right * height * 16 / 9, up * height, -1.0) for right in (-1, 0, 1) for up in (-1, 0, 1)]
    rays = np.array(corners) @ camera.world_from_view[:3, :3].T
    assert np.isfinite(nearest_hit(camera.position, rays, scene_triangles(scene))).all()


def test_corridor_chamber_is_sealed_and_its_rooms_have_doors():
    scene = builtin_scene("corridor")
    triangles = scene_triangles(scene)
    rays = directions(3000)
    warm, cool, sealed = (np.asarray(light.position) for light in scene.lights)
    ends = sealed + rays * nearest_hit(sealed, rays, triangles)[:, None]
    assert (ends > (-0.001, -0.001, 1.099)).all() and (ends < (2.901, 2.601, 3.401)).all()
    low, high = scene.bounds()
    for lamp, side in ((warm, -1), (cool, 1)):
        ends = lamp + rays * nearest_hit(lamp, rays, triangles)[:, None]
        assert (ends > low - 1e-6).all() and (ends < high + 1e-6).all()
        # Some light enters the corridor through the door, and none bypasses it.
        assert (ends[:, 2] * side > -1.001).any() and (ends[:, 2] * side < 1.001).all()
    for camera in scene.cameras:
        assert np.isfinite(nearest_hit(camera.position, rays, triangles)).all()


def rotated(triangles):
    """Return triangles as a sorted list, each beginning at its least corner, to compare sets of triangles."""
    rounded = np.round(triangles, 5) + 0.0
    return sorted(min((t[k:] + t[:k]) for k in range(3)) for t in rounded.tolist())


@pytest.mark.parametrize("kind", ["area", "point", "spot"])
def test_cornell_equals_the_file_in_scenes(kind):
    from wgpu_gi.scene.gltf.load import load_gltf

    ours = builtin_scene("cornell" if kind == "area" else f"cornell-{kind}")
    file = load_gltf(resource_dir("scenes") / "cornell" / f"cornell_{kind}.glb")
    np.testing.assert_allclose(ours.bounds(), file.bounds(), atol=1e-6)
    by_name = {instance.name: instance for instance in file.instances}
    assert [instance.name for instance in ours.instances] == [instance.name for instance in file.instances]
    for instance in ours.instances:
        other = by_name[instance.name]
        world = other.mesh.positions[other.mesh.triangles] @ other.world_from_local[:3, :3].T
        world = world + other.world_from_local[:3, 3]
        assert rotated(instance.mesh.positions[instance.mesh.triangles].astype(float)) == rotated(world)
        material, expected = instance.mesh.materials[0], other.mesh.materials[0]
        assert material.name == expected.name and material.double_sided == expected.double_sided
        np.testing.assert_allclose(material.base_color, expected.base_color)
        np.testing.assert_allclose(material.emission, expected.emission)
        assert (material.metallic, material.roughness) == (expected.metallic, expected.roughness)
    assert len(ours.lights) == len(file.lights)
    for light, expected in zip(ours.lights, file.lights, strict=True):
        assert type(light) is type(expected) and light.intensity == expected.intensity
        np.testing.assert_allclose(light.color, expected.color)
        np.testing.assert_allclose(light.position, expected.position)
        if kind == "spot":
            unit = np.asarray(light.direction) / np.linalg.norm(light.direction)
            np.testing.assert_allclose(unit, expected.direction, atol=1e-6)
            assert light.inner_cone_angle == pytest.approx(expected.inner_cone_angle)
            assert light.outer_cone_angle == pytest.approx(expected.outer_cone_angle)
    np.testing.assert_allclose(ours.cameras[0].world_from_view, file.cameras[0].world_from_view, atol=1e-9)
    assert ours.cameras[0].yfov == pytest.approx(file.cameras[0].yfov) and ours.cameras[0].name == file.cameras[0].name


def test_every_folder_of_scenes_and_references_has_a_licence():
    files = [file for kind in ("*.glb", "*.npz") for file in resource_dir("scenes").rglob(kind)]
    assert len(files) > 8
    for file in files:
        assert file.name in (file.parent / "LICENSE").read_text()
