"""Skinned and morphed meshes on the device: poses against numpy, and pictures against those of meshes at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import wgpu
from helpers.figures import bent, figure, tube
from helpers.surfaces import read_surfaces

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.gpu.device import open_device
from wgpu_gi.options import CameraSettings, Settings
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.built_in.shapes import quad, sphere
from wgpu_gi.scene.deformation import posed_mesh
from wgpu_gi.scene.scene import Environment, Instance, Material, MorphTarget, PointLight, Scene
from wgpu_gi.upload.mesh_data import octahedral_encode
from wgpu_gi.upload.scene_upload import SceneUpload

SIZE = (64, 36)
CAMERA = Camera.look_at((0.5, 2, 5), (0, 1, 0), yfov_deg=50)
EMPTY = 1 << 31


def room(*figures, lights=True):
    floor = quad((-3, 0, -3), (0, 0, 6), (6, 0, 0), Material("floor", (0.6, 0.6, 0.6, 1.0)))
    wall = quad((-3, 0, -2), (6, 0, 0), (0, 4, 0), Material("wall", (0.3, 0.6, 0.3, 1.0)))
    lamps = [PointLight((1.5, 3, 2), 30.0)] if lights else []
    return Scene([Instance(floor), Instance(wall), *figures], lamps, Environment((0.2, 0.2, 0.25)))


def at_rest(scene):
    """Return the scene with each pose as a mesh of its own."""

    def single(mesh):
        names = ("positions", "normals", "tangents")
        arrays = {n: getattr(mesh, n) for n in names}
        return replace(mesh, **{n: None if a is None else a.astype(np.float32) for n, a in arrays.items()})

    instances = [Instance(single(posed_mesh(i)), i.world_from_local, i.name) for i in scene.instances]
    return Scene(instances, scene.lights, scene.environment)


def picture(scene, gi="path", show=("radiance",), **fields):
    more = {"spp": 4} if gi == "path" else {}
    renderer = Renderer(scene, size=SIZE, camera=CAMERA, settings=Settings(gi=gi, **more, **fields))
    renderer.run(show=show)
    return renderer


def random_pose(instance, seed, scale=1.0, shift=0.0):
    """Give an instance joints that turn, stretch and shift at random."""
    rng = np.random.default_rng(seed)
    matrices = np.tile(np.eye(4), (5, 1, 1))
    matrices[:, :3, :3] = scale * (np.eye(3) + 0.5 * rng.normal(size=(5, 3, 3)))
    matrices[:, :3, 3] = scale * rng.normal(size=(5, 3)) + shift
    instance.joint_matrices = matrices
    instance.morph_weights = tuple(rng.normal(size=len(instance.mesh.morph_targets)))


def deformed(scene):
    """Return the upload of a scene whose figures are posed."""
    upload = SceneUpload(open_device(large_buffers=True))
    upload.update(scene)
    upload.deformation.run()
    return upload


def contents(upload, name, dtype, place):
    """Return the records of a figure on the device."""
    first = upload._hierarchy.first_figures[("nodes", "triangles", "vertices").index(name)]
    part = getattr(place, name)
    buffer = upload.deformation._tables[name]
    data = upload.resources.gpu.queue.read_buffer(buffer, (part.start - first) * dtype.itemsize)
    return np.frombuffer(data, np.uint8)[: (part.stop - part.start) * dtype.itemsize].view(dtype)


CASES = {
    "plain": {},
    "morphs": {"targets": 3},
    "tiny": {"scale": 1e-4},
    "huge": {"scale": 1e4},
    "far bind pose": {"bind": 1e4},
    "collapsed": {"scale": 0.0},
}


@pytest.fixture
def make():
    def make(targets=0, scale=1.0, bind=0.0):
        moving = figure(targets=targets)
        if bind:
            moving.mesh.positions = moving.mesh.positions + np.float32(bind)
        random_pose(moving, 3, scale)
        if bind:
            moving.joint_matrices[:, :3, 3] -= moving.joint_matrices[:, :3, :3] @ np.full(3, bind)
        return moving

    return make


@pytest.mark.parametrize("case", CASES)
def test_the_device_poses_as_numpy_does(case, make):
    """Positions to 1e-5 of the extent, normals and tangents to a step of their codes."""
    moving = make(**CASES[case])
    upload = deformed(room(moving))
    hierarchy, exact = upload._hierarchy, posed_mesh(moving)
    place = next(p for p in hierarchy.placements() if p.figure is not None)
    triangles = contents(upload, "triangles", hierarchy.triangles.dtype, place)
    corners = exact.positions[place.data.indices.astype(np.int64)]
    extent = max(np.ptp(exact.positions, axis=0).max(), 1e-30)
    assert np.isfinite(triangles["edge1"]).all() and np.isfinite(triangles["anchor"]).all()
    codes = triangles["flags"] >> 4
    weights = np.stack([codes & 0x3FFF, codes >> 14], 1) / 2.0**14
    edges = np.stack([triangles["edge1"], triangles["edge2"]], 1).astype(np.float64)
    anchor = corners[:, 0] + np.einsum("nk,nkc->nc", weights, corners[:, 1:] - corners[:, :1])
    assert np.abs(triangles["anchor"] - anchor).max() <= 1e-5 * extent
    assert np.abs(edges - (corners[:, 1:] - corners[:, :1])).max() <= 2e-5 * extent
    if case == "collapsed":
        return
    vertices = contents(upload, "vertices", hierarchy.vertices.dtype, place)
    for name, wanted in (("normal", exact.normals), ("tangent", exact.tangents[:, :3])):
        code, found = octahedral_encode(wanted), vertices[name]
        steps = [np.abs((code >> s).astype(np.int16).astype(int) - (found >> s).astype(np.int16)) for s in (0, 16)]
        assert np.minimum(*steps).max() <= 2 and np.mean(np.maximum(*steps) <= 2) > 0.995, name


@pytest.mark.parametrize("case", CASES)
def test_refitted_nodes_contain_their_triangles(case, make):
    upload = deformed(room(make(**CASES[case])))
    hierarchy = upload._hierarchy
    place = next(p for p in hierarchy.placements() if p.figure is not None)
    nodes = contents(upload, "nodes", hierarchy.nodes.dtype, place)
    positions = place.figure.positions(np.arange(place.figure.rest.count))
    steps = (positions - place.grid.low) * place.grid.scale
    corners = steps[place.data.indices.astype(np.int64)]
    # Decode the boxes of children, in steps of the grid.
    frame = nodes["frame"]
    origin = np.stack([frame[:, 0] & 0xFFFF, frame[:, 0] >> 16, frame[:, 1] & 0xFFFF], 1).astype(np.int64)
    shift = np.stack([frame[:, 1] >> s & 15 for s in (16, 20, 24)], 1).astype(np.int64)
    codes = np.stack([nodes[axis] for axis in "xyz"], 2)[:, :, None] >> np.array([0, 8, 16, 24])[:, None] & 255
    low, high = (origin[:, None] + (codes[:, side].astype(np.int64) << shift[:, None]) for side in (0, 1))
    deepest = 0
    todo = [(0, np.full(3, -np.inf), np.full(3, np.inf), 1)]
    seen = np.zeros(len(corners), int)
    while todo:
        node, below, above, depth = todo.pop()
        deepest = max(deepest, depth)
        for k, reference in enumerate(nodes["children"][node].tolist()):
            if reference == EMPTY:
                assert (codes[node, 0, k] == 255).all() and not codes[node, 1, k].any()
                continue
            boxed = np.maximum(below, low[node, k]), np.minimum(above, high[node, k])
            if reference & EMPTY:
                first = (reference & 0x0FFFFFFF) - place.triangles.start
                mine = slice(first, first + (reference >> 28 & 7))
                seen[mine] += 1
                assert (corners[mine] >= boxed[0] + 0.05).all() and (corners[mine] <= boxed[1] - 0.05).all()
            else:
                todo.append((reference - place.nodes.start, *boxed, depth + 1))
    assert (seen == 1).all() and deepest == place.data.bvh.depth


@pytest.mark.parametrize("seed", range(3))
def test_boxes_surround_every_pose(seed):
    moving = figure(targets=2)
    upload = SceneUpload(open_device(large_buffers=True))
    for step in range(6):
        random_pose(moving, 10 * seed + step, scale=10.0 ** (step - 3))
        upload.update(room(moving))
        (box,) = (f.box for f in upload._figures.known)
        exact = posed_mesh(moving).positions
        assert (exact >= box[0]).all() and (exact <= box[1]).all()
        # It is not much larger.
        assert (np.ptp(box, axis=0) <= 4 * np.ptp(exact, axis=0)).all()


def test_path_traced_poses_equal_meshes_at_rest():
    """Two instances of a mesh have their own poses, also far from the origin; differences are rounding only."""
    first, second = figure(0.1, (-0.8, 0, 0), targets=2), figure(0.0, (0.8, 0, 0))
    second.mesh, second.morph_weights = first.mesh, (0.0, 0.0)
    scene = room(first, second)
    renderer = picture(scene)
    first.joint_matrices, second.joint_matrices = bent(0.3), bent(-0.2)
    first.morph_weights = (1.0, 0.0)
    renderer.run(show=("radiance",))
    assert "deform" in renderer.plan() and "new pose" in renderer.plan()
    found, wanted = renderer.read_back(), picture(at_rest(scene)).read_back()
    # A hit moves by rounding, and may leave an edge.
    off = np.abs(found - wanted) > 1e-4 * (wanted + wanted.mean())
    assert off.mean() < 2e-3
    assert found.mean() == pytest.approx(wanted.mean(), rel=1e-4)
    renderer.close()


SLOW = [pytest.param(gi, marks=pytest.mark.slow) for gi in ("many-light", "ssdo", "ssil")]


@pytest.mark.parametrize("gi", ["none", *SLOW])
def test_each_technique_shows_the_pose_of_the_same_frame(gi):
    """A moved figure casts its shadow and bounces its colour at once."""
    moving = figure(0.0, (0.0, 0.0, -1.0))
    scene = room(moving)
    renderer = Renderer(scene, size=SIZE, camera=CAMERA, settings=Settings(gi=gi))
    renderer.settings.camera.frames = 2
    renderer.run(show=("radiance",))
    straight = renderer.read_back().copy()
    moving.joint_matrices = bent(0.35)
    renderer.run(show=("radiance",))
    found = renderer.read_back()
    fresh = Renderer(at_rest(scene), size=SIZE, camera=CAMERA, settings=renderer.settings)
    fresh.run(show=("radiance",))
    wanted = fresh.read_back()
    changed = np.abs(straight - wanted).mean()
    # Many-light draws other points on the surfaces, which leaves noise: 0.12 was measured, for others 1e-4.
    assert np.abs(found - wanted).mean() < (0.2 if gi == "many-light" else 0.005) * changed
    assert found.mean() == pytest.approx(wanted.mean(), rel=2e-3)
    for used in (renderer, fresh):
        used.close()


def test_motion_vectors_follow_the_vertices():
    """Of a pose, and of a mesh with new positions: the point of the triangle in the frame before."""
    moving, ball = figure(0.1, (-0.7, 0, 0)), Instance(sphere((0.9, 1.0, 0), 0.6, subdivisions=2))
    settings = Settings(gi="none", camera=CameraSettings(jitter=False))
    renderer = Renderer(room(moving, ball), size=(96, 54), camera=CAMERA, settings=settings)
    renderer.step(show=("motion", "position"))
    before = {3: figure_points(moving), 4: ball.mesh.positions.astype(np.float64)}
    moving.joint_matrices = bent(0.2)
    ball.mesh.positions = (ball.mesh.positions * np.array([1, 1.2, 1], np.float32)).astype(np.float32)
    renderer.step(show=("motion", "position", "instance"))
    motion, position = renderer.read_back("motion"), renderer.read_back("position").astype(np.float64)
    instance = renderer.read_back("instance")
    now = {3: figure_points(moving), 4: ball.mesh.positions.astype(np.float64)}
    seen = read_surfaces(renderer.graph).seen
    for number, mesh in ((3, moving.mesh), (4, ball.mesh)):
        mine = (instance == number) & seen
        points = position[mine]
        old = carried(points, now[number][mesh.triangles], before[number][mesh.triangles])
        shift = projected(points) - projected(old)
        assert np.abs(shift).max() > 0.5
        # Rasterisation may show another surface at edges.
        assert np.mean(np.abs(motion[mine][:, :2] - shift).max(1) < 2e-3) > 0.97
    # Afterwards all is still, also in a frame that has other changes.
    renderer.scene.lights[0].intensity *= 2
    for _ in range(2):
        renderer.step(show=("motion",))
        assert np.abs(renderer.read_back("motion")[..., :2]).max() < 1e-3


def figure_points(moving):
    return posed_mesh(moving).positions + moving.world_from_local[:3, 3]


def carried(points, corners, earlier):
    """Return points (n, 3) on triangles `corners` (t, 3, 3) on the same places of `earlier`."""
    a, b, c = (corners[:, k][None] for k in range(3))
    normal = np.cross(b - a, c - a)
    d, area = points[:, None] - a, np.maximum((normal**2).sum(-1), 1e-300)
    u, v = (np.cross(d, c - a) * normal).sum(-1) / area, (np.cross(b - a, d) * normal).sum(-1) / area
    off = np.abs((d * normal).sum(-1)) / np.sqrt(area) + 10 * np.maximum(0, -np.minimum(np.minimum(u, v), 1 - u - v))
    best = off.argmin(1)
    rows = np.arange(len(points))
    u, v = u[rows, best, None], v[rows, best, None]
    return (1 - u - v) * earlier[best, 0] + u * earlier[best, 1] + v * earlier[best, 2]


def projected(points):
    clip = CAMERA.clip_from_world((96, 54), np.zeros(3), 1e-3, 1e3, (0.5, 0.5))
    found = np.column_stack([points, np.ones(len(points))]) @ clip.T
    return (found[:, :2] / found[:, 3:] * (0.5, -0.5) + 0.5) * (96, 54)


def test_static_scenes_have_no_deformation():
    scene = room(Instance(tube()))  # a skin alone, in its bind pose
    renderer = picture(scene)
    assert "no mesh is skinned or morphed" in renderer.plan()
    assert np.array_equal(renderer.read_back(), picture(at_rest(scene)).read_back())
    renderer.close()


def test_arrays_of_skins_and_targets_may_be_replaced():
    moving = figure(0.3, targets=1)
    renderer = picture(room(moving), "none")
    renderer.run()
    before = renderer.read_back()
    mesh = moving.mesh
    for change in ("weights", "displacements", "target"):
        if change == "weights":
            mesh.skin.weights = mesh.skin.weights[:, ::-1].copy()
        elif change == "displacements":
            mesh.morph_targets[0].positions = mesh.morph_targets[0].positions * np.float32(4)
        else:
            mesh.morph_targets.append(replace(mesh.morph_targets[0]))
            moving.morph_weights = (0.5, 1.0)
        renderer.run()
        found, expected = renderer.read_back(), picture(at_rest(room(moving)), "none")
        assert np.abs(found - before).max() > 0.05
        before = found
        assert np.mean(np.abs(found - expected.read_back()).max(-1) > 0.01) < 0.01
        expected.close()
    mesh.morph_targets.append(MorphTarget(np.zeros((3, 3), np.float32)))
    with pytest.raises(GiError, match="morph_targets"):
        renderer.run()
    renderer.close()


def test_the_last_figure_takes_its_buffers_along():
    """When it comes back, it is posed as before."""
    moving = figure(0.3)
    renderer = Renderer(room(moving), size=(32, 18), camera=CAMERA, settings=Settings(gi="none"))
    renderer.run()
    before = renderer.read_back()
    buffers = wgpu.diagnostics.object_counts.get_dict()["Buffer"]["count"]
    kept = renderer.scene.instances.pop()
    renderer.run()
    assert wgpu.diagnostics.object_counts.get_dict()["Buffer"]["count"] <= buffers - 10
    renderer.scene.instances.append(kept)
    renderer.run()
    assert np.array_equal(renderer.read_back(), before)
    renderer.close()


def test_a_costly_pose_gets_a_hierarchy_of_its_own():
    moving = figure(0.0)
    upload = SceneUpload(open_device(large_buffers=True))
    scene = room(moving)
    meshes = set()
    for step in range(40):
        # From folded, where vertices of distant joints share leaves, to straight.
        moving.joint_matrices = bent(max(3.0 - 0.1 * step, 0.0))
        upload.update(scene)
        upload.deformation.run()
        meshes |= {f.stand_in.mesh for f in upload._figures.known}
    assert 2 <= len(meshes) <= 4
    upload.release()


def test_a_scene_at_another_time_keeps_its_figures():
    """New instances of the same meshes, in the same order, are the old ones after a move."""
    moving = figure(0.0)
    upload = SceneUpload(open_device(large_buffers=True))
    upload.update(room(moving))
    first = upload._figures.known
    floor, wall = (i.mesh for i in room().instances)
    again = Scene([Instance(floor), Instance(wall), moving])
    upload.update(again)
    assert upload._figures.known == first
    for step in range(4):
        copies = [replace(i) for i in again.instances]
        copies[-1].joint_matrices = bent(0.1 * step)
        copies[0].world_from_local = np.diag([1.0 + step, 1, 1, 1])
        upload.update(Scene(copies))
        upload.update_motion(Scene(copies))
        upload.deformation.run()
        assert upload._figures.known == first
    # Instances have moved since the scene before.
    found = upload._motion.update(upload._shown(Scene(copies)).instances, upload._hierarchy, upload.deformation)
    assert found["transform"][0, 0, 0] == 1.0
    copies = [replace(i) for i in copies]
    copies[0].world_from_local = np.diag([8.0, 1, 1, 1])
    upload.update(Scene(copies))
    found = upload._motion.update(upload._shown(Scene(copies)).instances, upload._hierarchy, upload.deformation)
    assert found["transform"][0, 0, 0] == 0.5
    upload.release()


def test_a_mesh_without_area_at_first_gets_points_later():
    """Surface points are sampled again when a deformed mesh has grown."""
    moving = figure(0.0)
    moving.joint_matrices = bent(0.0, scale=0.0)
    upload = SceneUpload(open_device(large_buffers=True))
    scene = room(moving)
    for step in range(20):
        moving.joint_matrices = bent(0.0, scale=min(step / 4, 1.0))
        upload.update(scene)
        upload.deformation.run()
    (shown,) = upload._figures.known
    assert np.ptp(shown.stand_in.mesh.positions[:, 1]) > 1.0
    upload.release()
