"""Frustum culling on the CPU is conservative: it keeps everything that the shaders' arithmetic brings into view."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from helpers.medley import at, medley

from wgpu_gi.camera import Camera
from wgpu_gi.gpu.draw_calls import DrawEncoder
from wgpu_gi.scene.scene import Instance
from wgpu_gi.techniques.shared import culling
from wgpu_gi.techniques.shared.culling import CameraDraws, ViewCulling, visible
from wgpu_gi.upload.draw_list import Clusters, DrawList, build_draw_list
from wgpu_gi.upload.mesh_data import NONE
from wgpu_gi.upload.two_level_bvh import TwoLevelBvh

VIEW = np.dtype([("clip_from_world", "<f4", (4, 4)), *((name, "<u4", 2) for name in ("size", "whole", "corner"))])


def view_of(camera, size=(64, 36), offset=(0.5, 0.5), origin=(0, 0, 0), near=1e-6, far=1e3):
    view = np.zeros(1, VIEW)
    view["size"] = view["whole"] = size
    view["clip_from_world"] = camera.clip_from_world(size, np.asarray(origin, float), near, far, offset).T
    return view


def cameras(scale=1.0, count=12):
    """Cameras inside and around a box of 20 m, every third orthographic."""
    rng = np.random.default_rng(1)
    for k in range(count):
        camera = Camera.look_at(
            rng.uniform(-15, 15, 3) * scale, rng.uniform(-8, 8, 3) * scale, yfov_deg=rng.uniform(5, 150)
        )
        if k % 3 == 0:
            camera.orthographic_height = rng.uniform(1, 20) * scale
        yield camera


def inside(view, points):
    """Tell which of the points (n, 3) lie in a view, in float32 arithmetic."""
    m = view["clip_from_world"][0]
    p = points.astype(np.float32)
    clip = ((p[:, :1] * m[0] + p[:, 1:2] * m[1]) + p[:, 2:] * m[2]) + m[3]
    x, y, z, w = clip.T
    return (np.abs(x) <= w) & (np.abs(y) <= w) & (z >= 0) & (z <= w)


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("offset", [(0.5, 0.5), (0.03, 0.97)])
def test_every_box_with_a_point_in_view_is_shown(scale, offset):
    rng = np.random.default_rng(0)
    middle, half = rng.uniform(-10, 10, (2000, 3)) * scale, 10.0 ** rng.uniform(-4, 1, (2000, 1)) * scale
    boxes = np.stack([middle - half, middle + half], 1).astype(np.float32)
    weights = rng.random((60, 1, 3))
    weights[:8, 0] = [[i >> a & 1 for a in range(3)] for i in range(8)]  # the corners, too
    points = boxes[:, 0] + weights * (boxes[:, 1].astype(np.float64) - boxes[:, 0])
    shares = []
    for camera in cameras(scale):
        view = view_of(camera, offset=offset, near=1e-7 * scale, far=1e3 * scale)
        (shown,) = visible(view, boxes)
        seen = inside(view, points.reshape(-1, 3)).reshape(60, -1).any(0)
        assert shown[seen].all()
        shares.append((shown.mean(), (shown & ~seen).mean()))
    # Few boxes outside the view are kept.
    assert 0.05 < np.mean(shares, 0)[0] < 0.6 and np.mean(shares, 0)[1] < 0.1


@pytest.mark.parametrize("distance", [1.0, 1e3, 1e5])
def test_points_at_the_edges_of_a_view_far_from_the_origin(distance):
    """No point is lost where rounding decides whether it is in view."""
    rng = np.random.default_rng(0)
    for direction in ((1, 0, 0), (0.6, 0.0, 0.8), (0.5, 0.7, -0.5)):
        eye = distance * np.array(direction)
        camera = Camera.look_at(eye, eye + np.array((1, 0, 1)), yfov_deg=90)
        edge = rng.uniform(-1, 1, (3000, 3))
        edge[:, 2] = -1
        edge[:, 0] = np.sign(edge[:, 0]) * (64 / 36)
        points = (camera.position + edge @ camera.world_from_view[:3, :3].T * rng.uniform(0.1, 5, (3000, 1))).astype(
            np.float32
        )
        view = view_of(camera)
        seen = inside(view, points)
        assert 0.05 < seen.mean() < 0.95
        assert visible(view, np.stack([points, points], 1))[0][seen].all()


@pytest.mark.slow
def test_every_triangle_in_view_is_drawn(dtypes):
    """By the arithmetic of the vertex shader, with instances, one of them far from its mesh's origin."""
    scene = medley()
    shifted = scene.instances[1].mesh
    shifted.positions = shifted.positions + np.float32(3000.0)
    turned = at(0, 0, 0, (0.3, 0.4, 0.3), 0.7)
    for i, place in ((1, (-2, 1, 0)), (2, (2, 0.5, 1))):
        scene.instances[i].world_from_local = turned.copy()
        scene.instances[i].world_from_local[:3, 3] = place - turned[:3, :3] @ np.full(3, 3000.0)
    scene.instances += [Instance(scene.instances[3].mesh, at(k, 0.2, -k)) for k in range(-20, 20)]
    materials = {id(m): k for k, m in enumerate({id(m): m for i in scene.instances for m in i.mesh.materials}.values())}
    hierarchy = TwoLevelBvh(dtypes)
    hierarchy.update(scene.instances, materials)
    draws = build_draw_list(scene.instances, hierarchy, {})
    matrices = hierarchy.instances["world_from_local"][:, :, :3]
    left_out = 0
    for camera in cameras(0.3):
        view = view_of(camera, origin=hierarchy.origin)
        culled = ViewCulling()
        assert culled.update(view, draws)
        for masked, everything in ((False, draws.opaque), (True, draws.masked)):
            drawn = set(_pairs(culled.runs(masked)[0]))
            for place, slot in set(_pairs(everything)) - drawn:
                p = draws.vertices[draws.indices[place], :3].copy().view(np.float32)
                if draws.slots[slot] != NONE:
                    m = matrices[draws.slots[slot]]
                    p = ((p[:, :1] * m[0] + p[:, 1:2] * m[1]) + p[:, 2:] * m[2]) + m[3]
                weights = np.random.default_rng(place).dirichlet((0.5,) * 3, 20).astype(np.float32)
                assert not inside(view, np.concatenate([p, weights @ p])).any()
                left_out += 1
    assert left_out > 1000


def _pairs(runs):
    """Return the triangles and instance slots that draw calls draw."""
    return [
        (k, slot + j)
        for first, count, slot, instances in runs
        for j in range(instances)
        for k in range(first // 3, (first + count) // 3)
    ]


# ------------------------------------------------------------------------------------------------ What is kept


def row_of_boxes(count=10):
    """Return a draw list of boxes in a row along x, too large to fill gaps with."""
    low = np.arange(count)[:, None] * (2.0, 0, 0)
    boxes = np.stack([low, low + 1], 1).astype(np.float32)
    runs = np.array([(3000 * k, 3000, 0, 1) for k in range(count)])
    clusters = Clusters(boxes, runs, np.full(count, -1), count - 2, boxes)
    nothing = np.zeros(0, np.uint32)
    everything = ((0, 3000 * (count - 2), 0, 1),), ((3000 * (count - 2), 6000, 0, 1),)
    return DrawList(nothing, nothing, nothing, nothing, *everything, clusters)


class Recorder:
    def __init__(self):
        self.calls = []

    def draw_indexed(self, count, instances, first, base, slot):
        assert base == 0
        self.calls.append((first, count, slot, instances))


def test_a_view_at_rest_is_culled_once(monkeypatch):
    calls = []
    monkeypatch.setattr(culling, "visible", lambda *a: calls.append(1) or visible(*a))
    draws, view = row_of_boxes(), view_of(Camera.look_at((4.5, 0.5, 3), (4.5, 0.5, 0), yfov_deg=40))
    uniform = SimpleNamespace(data=view[0].tobytes(), dtype=VIEW)
    upload, shared = SimpleNamespace(draws=draws), ViewCulling()
    solid, masked = (CameraDraws(uniform, upload, part, shared) for part in (False, True))

    def drawn():
        found = []
        for part in (solid, masked):
            encoder = Recorder()
            part(DrawEncoder(encoder, None, False))
            found.append(encoder.calls)
        return found

    first = drawn()
    assert first == [[(3000, 9000, 0, 1)], []]
    # Placing the boxes where they were changes nothing.
    draws.clusters.place(np.zeros((0, 4, 3), np.float32))
    assert drawn() == first and len(calls) == 1
    # The camera, the placement and the scene on the GPU count.
    uniform.data = view_of(Camera.look_at((20, 0.5, 3), (19, 0.5, 0), yfov_deg=40))[0].tobytes()
    assert drawn() == [[], [(3000 * 8, 6000, 0, 1)]] and len(calls) == 2
    draws.clusters.boxes = draws.clusters.boxes + np.float32((4, 0, 0))
    assert drawn() == [[(3000 * 6, 6000, 0, 1)], [(3000 * 8, 3000, 0, 1)]] and len(calls) == 3
    upload.draws = row_of_boxes(4)
    assert drawn() == [[], []] and len(calls) == 4


def test_draws_of_the_same_camera_and_scene_compare_equal():
    view, upload = SimpleNamespace(), SimpleNamespace()
    same = [CameraDraws(view, upload, False, ViewCulling()) for _ in range(2)]
    assert same[0] == same[1]
    assert same[0] != CameraDraws(view, upload, True, same[0].culling)
