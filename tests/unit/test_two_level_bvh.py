"""The two-level BVH, decoded like in the shader: each triangle once, inside its boxes; and updates change little."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from helpers.anchors import corners_of
from helpers.medley import at

from wgpu_gi.scene.built_in.shapes import box, quad, sphere
from wgpu_gi.scene.scene import Instance, Material, Mesh
from wgpu_gi.upload import top_level
from wgpu_gi.upload.mesh_data import COLORED, HAS_TANGENTS, MASKED, NONE, SMOOTH, octahedral_encode, prepare_meshes
from wgpu_gi.upload.node_quantization import QuantizationGrid
from wgpu_gi.upload.two_level_bvh import INSTANCE_FLAG, TwoLevelBvh
from wgpu_gi.upload.wide_bvh import EMPTY

LEAF = 1 << 31
STACK_SIZE = 24  # of wgsl/scene/trace.wgsl, whose last entry is never read
ALL = {"nodes", "triangles", "vertices", "instances"}


def material_index(instances):
    materials = {id(m): m for i in instances for m in i.mesh.materials}
    return {key: number for number, key in enumerate(materials)}


def update(hierarchy, instances):
    hierarchy.update(instances, material_index(instances))
    check(hierarchy, instances)
    return hierarchy.changed


def check(hierarchy, instances):
    """Decode the arrays like wgsl/scene/geometry.wgsl and compare them with `instances`, in float64."""
    matrices = [np.array(i.world_from_local, np.float64) for i in instances]
    for matrix in matrices:
        matrix[:3, 3] -= hierarchy.origin
    found = Counter()
    deepest = 0

    def leaf(slots, number, entered):
        """Check some triangles of an instance; return their true corners, in the space that they are tested in."""
        mesh = instances[number].mesh
        place = hierarchy.placement(mesh)
        indices = mesh.triangles[place.data.bvh.order[slots - place.triangles.start]]
        found.update((number, *corner_ids) for corner_ids in indices.tolist())
        matrix = np.eye(4) if entered else matrices[number]
        local = mesh.positions.astype(np.float64)
        world = local @ matrix[:3, :3].T + matrix[:3, 3]
        # Stored corners equal the positions of the stored indices.
        record = hierarchy.triangles[slots]
        ids = record["corners"] - place.vertices.start
        assert np.array_equal(np.sort(ids, 1), np.sort(indices, 1))
        assert (record["instance"] == (NONE if entered else number)).all()
        size = np.abs(world).max()
        edge1, edge2 = record["edge1"].astype(np.float64), record["edge2"].astype(np.float64)
        assert np.allclose(corners_of(record), world[ids], rtol=0, atol=3e-7 * size)
        # Mirroring keeps the counter-clockwise side: the normal is the transformed local normal.
        a, b, c = local[indices].transpose(1, 0, 2)
        normal = np.cross(b - a, c - a) @ np.linalg.inv(matrix[:3, :3])
        side = np.cross(edge1, edge2)
        solid = np.linalg.norm(side, axis=1) > 1e-5 * size**2
        assert ((side * normal).sum(1)[solid] > 0).all()
        return world[indices].reshape(-1, 3)

    def walk(reference, low, scale, entered, above):
        """Return all corners below a reference."""
        nonlocal deepest
        deepest = max(deepest, above)
        if reference & LEAF:
            slots = (reference & 0x0FFFFFFF) + np.arange(reference >> 28 & 7)
            number = int(hierarchy.triangles[slots[0]]["instance"]) if entered is None else entered
            return leaf(slots, number, entered is not None)
        if reference & INSTANCE_FLAG:
            assert entered is None
            number = reference & ~INSTANCE_FLAG
            record, matrix = hierarchy.instances[number], matrices[number]
            grid = record["frame_low"].astype(np.float64), record["frame_scale"].astype(np.float64)
            return walk(int(record["root"]), *grid, number, above) @ matrix[:3, :3].T + matrix[:3, 3]
        node, below = hierarchy.nodes[reference], []
        x_y, z_shift = (int(word) for word in node["frame"])
        origin = np.array([x_y & 0xFFFF, x_y >> 16, z_shift & 0xFFFF])
        shift = np.array([z_shift >> 16 & 15, z_shift >> 20 & 15, z_shift >> 24 & 15])
        for k in np.flatnonzero(node["children"] != EMPTY):
            points = walk(int(node["children"][k]), low, scale, entered, above + 1)
            codes = np.array([node[axis] for axis in "xyz"]).astype(np.int64).T >> 8 * k & 255
            box_low, box_high = low + (origin + (codes << shift)) / scale
            assert (points >= box_low).all() and (points <= box_high).all()
            below.append(points)
        return np.concatenate(below)

    for number, matrix in enumerate(matrices):
        record = hierarchy.instances[number]
        assert np.allclose(record["world_from_local"][:, :3].T, matrix[:3], rtol=1e-6)
        assert np.allclose(record["local_from_world"][:, :3].T, np.linalg.inv(matrix)[:3], rtol=1e-6)
    if not instances:
        assert hierarchy.root == EMPTY
        return
    # The world's grid in float32, as in the SceneInfo uniform.
    low, scale = (v.astype(np.float32).astype(np.float64) for v in (hierarchy.world.low, hierarchy.world.scale))
    points = walk(hierarchy.root, low, scale, None, 0)
    assert found == Counter((number, *ids) for number, i in enumerate(instances) for ids in i.mesh.triangles.tolist())
    assert deepest < STACK_SIZE
    assert np.isclose(hierarchy.radius, np.linalg.norm(np.ptp(points, 0)) / 2, rtol=0.3)


def some_meshes():
    """A floor, a ball and two boxes: a single leaf and trees of several levels."""
    return (
        quad((-5, 0, -5), (0, 0, 10), (10, 0, 0)),
        sphere(subdivisions=1),
        box((0, 0, 0), (1, 2, 3)),
        box((0, 0, 0), (1, 1, 1)),
    )


def some_instances():
    """Two baked meshes, and one with three instances, one of them mirrored."""
    floor, ball, block, _ = some_meshes()
    return [
        Instance(floor, at(0, -1)),
        Instance(block, at(1, 0, 2, turn=0.7)),
        Instance(ball, at(-2, 1, 0)),
        Instance(ball, at(2, 1, 0, (0.5, 1, 2), 0.3)),
        Instance(ball, at(0, 2, 1, (-1, 1, 1), 1.0)),
    ]


def test_baked_and_instanced_meshes(dtypes):
    hierarchy, instances = TwoLevelBvh(dtypes), some_instances()
    assert update(hierarchy, instances) == ALL
    baked = [hierarchy.placement(i.mesh).baked for i in instances]
    assert baked == [0, 1, None, None, None] and hierarchy.has_instances
    assert update(hierarchy, instances) == set()
    assert update(hierarchy, list(instances)) == set()


@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (1, -2, 1), (-1, -1, -1), (-1e3, 1e-3, 1)])
def test_one_instance_and_two(dtypes, scale):
    """A mesh with one instance, then with two, mirrored or not; a single leaf and a tree."""
    for mesh in some_meshes()[:2]:
        hierarchy = TwoLevelBvh(dtypes)
        instance = Instance(mesh, at(3, 4, 5, scale, 0.4))
        update(hierarchy, [instance])
        assert hierarchy.placement(mesh).baked == 0 and not hierarchy.has_instances
        update(hierarchy, [instance, Instance(mesh, at(-3, 0, 0, scale))])
        assert hierarchy.placement(mesh).baked is None and hierarchy.has_instances


def test_the_same_instance_twice(dtypes):
    hierarchy, instance = TwoLevelBvh(dtypes), some_instances()[1]
    update(hierarchy, [instance, instance])
    assert hierarchy.placement(instance.mesh).baked is None


def test_moving_an_instance_changes_few_arrays(dtypes):
    hierarchy, instances = TwoLevelBvh(dtypes), some_instances()
    update(hierarchy, instances)
    origin = hierarchy.origin.copy()
    instances[1].world_from_local = at(0, 0, 2)
    assert update(hierarchy, instances) == ALL - {"vertices"}  # taken out of the world's tree
    assert hierarchy.placement(instances[1].mesh).baked is None
    instances[1].world_from_local = at(0, 0.5, 2)
    assert update(hierarchy, instances) == {"nodes", "instances"}
    instances[1].world_from_local[1, 3] = 0.7  # in place
    assert update(hierarchy, instances) == {"nodes", "instances"}
    instances[3].world_from_local = at(1, 1, 0)
    assert update(hierarchy, instances) == {"nodes", "instances"}
    assert np.array_equal(hierarchy.origin, origin) and hierarchy.placement(instances[0].mesh).baked == 0


def test_moved_meshes_are_not_baked(dtypes):
    hierarchy, instances = TwoLevelBvh(dtypes), some_instances()
    update(hierarchy, instances)
    instances[1].world_from_local = at(0, 0, 2)
    update(hierarchy, instances)
    instances.append(Instance(some_meshes()[3], at(-3, 0, 0)))
    update(hierarchy, instances)
    assert [hierarchy.placement(instances[k].mesh).baked for k in (0, 1, 5)] == [0, None, 5]


def test_instances_come_and_go(dtypes):
    hierarchy, instances = TwoLevelBvh(dtypes), some_instances()
    update(hierarchy, instances)
    data = hierarchy.placement(instances[2].mesh).data
    for removed in (3, 0, 2):
        del instances[removed]
        assert update(hierarchy, instances) == ALL
    assert hierarchy.placement(instances[1].mesh).data is data  # its own tree is not built again
    instances += some_instances()
    update(hierarchy, instances)
    instances[1].mesh = instances[2].mesh
    update(hierarchy, instances)
    update(hierarchy, instances[::-1])
    assert update(hierarchy, []) >= {"nodes", "triangles"} and not hierarchy.has_instances
    assert update(hierarchy, []) == set()
    update(hierarchy, instances)


def test_leaving_the_grid_and_returning(dtypes):
    hierarchy, instances = TwoLevelBvh(dtypes), some_instances()
    update(hierarchy, instances)
    here = instances[1].world_from_local = at(0, 0, 2)
    update(hierarchy, instances)
    nodes, records, root = hierarchy.nodes.copy(), hierarchy.instances.copy(), hierarchy.root
    home = hierarchy.world
    for distance in (10, 11, 12, 1e3, 30.0):
        instances[1].world_from_local = at(distance, 0, 2)
        assert update(hierarchy, instances) >= {"nodes", "instances"}
    instances[1].world_from_local = here
    update(hierarchy, instances)
    assert hierarchy.world is home and hierarchy.root == root
    used = slice(hierarchy.placement(instances[0].mesh).nodes.start, None)
    assert hierarchy.nodes[used].tobytes() == nodes[used].tobytes() and hierarchy.nodes[0] == nodes[0]
    assert hierarchy.instances.tobytes() == records.tobytes()


def test_slow_motion_outwards_rarely_spans_a_new_grid(dtypes):
    hierarchy, instances = TwoLevelBvh(dtypes), some_instances()
    grids = []
    for step in range(40):
        instances[1].world_from_local = at(4 + step / 4, 0, 2)
        hierarchy.update(instances, material_index(instances))
        grids.append(hierarchy.world)
    assert len({id(g) for g in grids}) <= 5


def test_expected_motion_makes_arrays_independent_of_the_poses_between(dtypes):
    """Whatever tree and grid a pose in between needed; without, the last pose of the detour is stored otherwise."""

    def stored(expected, path):
        instances = some_instances()
        moving = instances[1:3]
        hierarchy = TwoLevelBvh(dtypes)
        if expected:
            hierarchy.expect_motion(moving)
        update(hierarchy, instances)
        first = [np.array(i.world_from_local) for i in moving]
        for offset in path:
            for sign, instance, matrix in zip((1, -1), moving, first, strict=True):
                instance.world_from_local = at(sign * offset) @ matrix
            update(hierarchy, instances)
        return hierarchy

    def are_equal(one, other):
        # Behind the first node, the top level leaves what larger trees stored.
        used = [0, *range(min(place.nodes.start for place in one.placements()), len(one.nodes))]
        same = [np.array_equal(getattr(one, name), getattr(other, name)) for name in ALL - {"nodes"}]
        return all(same) and one.root == other.root and np.array_equal(one.nodes[used], other.nodes[used])

    detour = [0.3, 4.0, 60.0, 9.0]
    for expected in (True, False):
        pairs = [[stored(expected, [*path, last]) for path in ([], detour)] for last in (0.5, 9.5)]
        assert all(are_equal(*pair) for pair in pairs) is expected


@pytest.mark.parametrize("far", [1e7, -3e8])
def test_a_scene_far_from_the_origin(dtypes, far):
    """Positions relative to the origin equal those of the same scene at zero."""
    near, moved = some_instances(), some_instances()
    for instance in moved:
        instance.world_from_local = at(far, 2 * far, -far) @ instance.world_from_local
    here, there = TwoLevelBvh(dtypes), TwoLevelBvh(dtypes)
    update(here, near)
    update(there, moved)
    assert np.allclose(there.origin - here.origin, (far, 2 * far, -far), rtol=1e-12)
    for field in ("anchor", "edge1", "edge2"):
        assert np.allclose(there.triangles[field], here.triangles[field], rtol=0, atol=1e-6 + 1e-15 * abs(far))
    moved[2].world_from_local = at(far + 1, 2 * far, -far)
    assert update(there, moved) == {"nodes", "instances"}


def test_a_scene_that_drifts_away_gets_a_new_origin(dtypes):
    hierarchy, instances = TwoLevelBvh(dtypes), some_instances()
    update(hierarchy, instances)
    first = hierarchy.triangles.copy()
    for offset in (1.0, 1e6, 0.0):
        moved = [Instance(i.mesh, at(offset) @ i.world_from_local) for i in some_instances()]
        for instance, target in zip(instances, moved, strict=True):
            instance.world_from_local = target.world_from_local
        update(hierarchy, instances)
        assert np.abs(hierarchy.origin - (offset, 0, 0)).max() < 50
    assert len(hierarchy.triangles) == len(first)


def test_more_meshes_than_the_top_level_opens(dtypes, monkeypatch):
    monkeypatch.setattr(top_level, "OPEN_UP_TO", 8)
    for count in (2, 5, 20):
        instances = [Instance(sphere((3 * k, 0, 0), 1 + k % 3, 1)) for k in range(count)]
        hierarchy = TwoLevelBvh(dtypes)
        update(hierarchy, instances)
        assert hierarchy._subtrees is not None and max(6, count) <= len(hierarchy._subtrees[2]) <= max(8, count)


def test_a_large_mesh_is_opened_where_others_overlap_it(dtypes):
    ball = sphere(radius=10.0, subdivisions=3)
    hierarchy, instances = TwoLevelBvh(dtypes), [Instance(ball), Instance(box((0, 0, 0), (1, 1, 1)))]
    update(hierarchy, instances)
    assert hierarchy._subtrees is not None and len(hierarchy._subtrees[2]) > 100


@pytest.mark.parametrize(("extent", "baked"), [(1e2, True), (1e5, False)])
def test_a_mesh_too_fine_for_the_world_keeps_its_own_grid(dtypes, extent, baked):
    """If a step of the world's grid were as large as its triangles, their boxes would overlap."""
    hierarchy, ball = TwoLevelBvh(dtypes), sphere(radius=1.0, subdivisions=4)
    floor = quad((-extent, 0, -extent), (0, 0, 2 * extent), (2 * extent, 0, 0))
    update(hierarchy, [Instance(floor), Instance(ball)])
    assert hierarchy.placement(floor).baked == 0
    assert (hierarchy.placement(ball).baked == 1) == baked


@pytest.mark.parametrize("shift", [0.0, 1e3])
def test_worst_depth_of_both_levels_fits_the_stack(dtypes, shift):
    """Triangles that halve in size from one to the next, in instances that also halve in size."""
    size = 2.0 ** -np.arange(60.0)
    corners = np.array([[1, 0, 0], [1, 1, 0], [1, 0, 1]]) * size[:, None, None] + [shift, 0, 0]
    mesh = Mesh(corners.reshape(-1, 3).astype(np.float32), np.arange(180, dtype=np.uint32).reshape(-1, 3))
    if shift:
        mesh.positions[:3] += 1  # not all of one size after rounding
    instances = [Instance(mesh, at(s, 0, 0, (s, s, s))) for s in 2.0 ** -np.arange(12.0)]
    update(TwoLevelBvh(dtypes), instances)


def test_flat_and_tiny_and_huge(dtypes):
    for scale in (1e-20, 1e-6, 1e15):
        instances = some_instances()
        for instance in instances:
            instance.world_from_local = at(0, 0, 0, (scale, scale, scale)) @ instance.world_from_local
        update(TwoLevelBvh(dtypes), instances)
    floor = some_meshes()[0]
    update(TwoLevelBvh(dtypes), [Instance(floor, at(0, 7))])
    update(TwoLevelBvh(dtypes), [Instance(floor, at(0, 7)), Instance(floor, at(0, 7))])


def test_unused_vertices_do_not_enlarge_boxes(dtypes):
    mesh = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    mesh.positions = np.concatenate([mesh.positions, [[1e9, 0, 0]]]).astype(np.float32)
    hierarchy = TwoLevelBvh(dtypes)
    update(hierarchy, [Instance(mesh)])
    assert np.allclose(hierarchy.origin, (0.5, 0.5, 0))


def test_materials_are_renumbered_in_place(dtypes):
    red, green, leaf = Material("red"), Material("green"), Material("leaf", alpha_mode="mask")
    mesh = box((0, 0, 0), (1, 1, 1))
    mesh.materials, mesh.material_of_triangle = [red, leaf], np.arange(12, dtype=np.uint32) % 2
    other = quad((0, 0, 0), (0, 0, 1), (1, 0, 0), green)
    instances, hierarchy = [Instance(other), Instance(mesh)], TwoLevelBvh(dtypes)
    update(hierarchy, instances)

    def fields(name):
        place = hierarchy.placement(mesh)
        in_order = np.empty(12, np.uint32)
        in_order[place.data.bvh.order] = hierarchy.triangles[name][place.triangles]
        return in_order.tolist()

    assert fields("material") == [1, 2] * 6 and fields("flags") == [0, MASKED] * 6
    red.alpha_mode = "mask"
    assert update(hierarchy, instances) == {"triangles"} and fields("flags") == [MASKED] * 12
    red.alpha_mode = leaf.alpha_mode = "opaque"
    assert update(hierarchy, instances) == {"triangles"} and fields("flags") == [0] * 12
    mesh.materials = [green, leaf]
    assert update(hierarchy, instances) == {"triangles"} and fields("material") == [0, 1] * 6
    assert update(hierarchy, instances) == set()


def test_vertex_attributes_and_flags(dtypes):
    """A vertex without normal or tangent makes its triangles flat; encoded directions are decoded correctly."""
    rng = np.random.default_rng(0)
    mesh = sphere(subdivisions=1)
    count = len(mesh.positions)
    mesh.normals = (mesh.positions * rng.uniform(0.5, 2, (count, 1))).astype(np.float32)
    mesh.normals[mesh.triangles[0, 0]] = 0
    mesh.tangents = np.concatenate([rng.normal(size=(count, 3)), rng.choice([-1, 1], (count, 1))], 1).astype(np.float32)
    mesh.tangents[mesh.triangles[5, 2]] = 0
    mesh.colors = rng.random((count, 4)).astype(np.float32)
    mesh.texcoords0, mesh.texcoords1 = rng.normal(size=(2, count, 2)).astype(np.float32)
    (data,) = prepare_meshes([mesh], dtypes["vertices"])
    triangles = mesh.triangles[data.bvh.order]
    flat = (triangles == mesh.triangles[0, 0]).any(1)
    bare = (triangles == mesh.triangles[5, 2]).any(1)
    assert np.array_equal(data.flags, SMOOTH * ~flat | HAS_TANGENTS * ~bare | COLORED)

    def decoded(codes):
        snorm = np.stack([codes & 0xFFFF, codes >> 16], 1).astype(np.uint16).view(np.int16) / 32767
        z = 1 - np.abs(snorm).sum(1)
        xy = np.where(z[:, None] < 0, (1 - np.abs(snorm[:, ::-1])) * np.where(snorm >= 0, 1, -1), snorm)
        v = np.concatenate([xy, z[:, None]], 1)
        return v / np.linalg.norm(v, axis=1, keepdims=True)

    def angles(codes, directions):
        directions = directions / np.linalg.norm(directions.astype(np.float64), axis=1, keepdims=True)
        return np.linalg.norm(decoded(codes) - directions, axis=1)

    given = mesh.normals.any(1)
    assert angles(data.vertices["normal"][given], mesh.normals[given]).max() < 6e-5
    given = mesh.tangents[:, :3].any(1)
    assert angles(data.vertices["tangent"][given], mesh.tangents[given, :3]).max() < 1.5e-4
    assert np.array_equal(data.vertices["tangent"] & 1, mesh.tangents[:, 3] < 0)
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    assert np.allclose(decoded(octahedral_encode(axes)), axes, atol=1e-15)
    assert octahedral_encode(np.zeros((1, 3)))[0] == 0
    unorm = np.stack([data.vertices["color"] & 0xFFFF, data.vertices["color"] >> 16], -1).reshape(count, 4) / 65535
    assert np.abs(unorm - mesh.colors).max() < 1e-5
    assert np.array_equal(data.vertices["texcoord0"], mesh.texcoords0)
    assert np.array_equal(data.vertices["texcoord1"], mesh.texcoords1)
    (plain,) = prepare_meshes([box((0, 0, 0), (1, 1, 1))], dtypes["vertices"])
    assert not plain.flags.any() and (plain.vertices["color"] == 0xFFFFFFFF).all()


def test_the_grid_spans_any_bounds():
    rng = np.random.default_rng(0)
    for exponent in range(-20, 16):
        for offset in (0, 1, 1e3, 1e6):
            low = (rng.normal(size=3) + rng.normal(size=3) * offset) * 10.0**exponent
            bounds = np.stack([low, low + rng.choice([0, 1, 1e-3], 3) * 10.0**exponent])
            grid = QuantizationGrid.around(bounds)
            assert grid.spans(bounds)
            assert np.array_equal(grid.low, grid.low.astype(np.float32))
            extent = np.maximum(np.ptp(bounds, 0), 1e-6 * np.ptp(bounds))
            assert not grid.spans(bounds + extent) and not grid.spans(bounds - extent)
