"""Which clusters and texels shadow maps draw for a camera: all that a shadow in its picture needs, and when again."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.gpu.draw_calls import DrawEncoder
from wgpu_gi.gpu.wgsl.load import load
from wgpu_gi.techniques.deferred.shadow_casters import FILTER, Receivers, casters, needed_texels
from wgpu_gi.techniques.deferred.shadow_draws import ShadowDraws
from wgpu_gi.techniques.deferred.shadow_views import ShadowSettings, build_shadow_views
from wgpu_gi.upload.direct_lights import DIRECT_POINT, DIRECT_SUN
from wgpu_gi.upload.draw_list import Clusters, DrawList

DIRECT_LIGHT = load("deferred/shadow/views.wgsl").struct_dtype("DirectLight")
VIEW = load("scene/lights.wgsl").struct_dtype("View")
BOX = np.array([[-10.0, -2.0, -6.0], [10.0, 2.0, 6.0]])


def view_of(camera, scale, size=(64, 36)):
    view = np.zeros((), VIEW)
    matrix = camera.world_from_view
    height = np.tan(camera.yfov / 2) if camera.orthographic_height is None else camera.orthographic_height / 2
    view["position"], view["forward"] = matrix[:3, 3], -matrix[:3, 2]
    view["size"] = view["whole"] = size
    view["right"], view["up"] = matrix[:3, 0] * height * size[0] / size[1], matrix[:3, 1] * height
    view["orthographic"] = camera.orthographic_height is not None
    view["clip_from_world"] = camera.clip_from_world(size, np.zeros(3), 1e-6 * scale, 1e3 * scale, (0.5, 0.5)).T
    return view


def shadow_views(lights, view, scale):
    radius = float(np.linalg.norm(BOX[1] - BOX[0])) / 2 * scale
    samples = np.random.default_rng(0).uniform(*BOX, (500, 3)) * scale
    arguments = {"centre": np.zeros(3), "radius": radius, "surface_samples": samples, "box": BOX * scale}
    return build_shadow_views(lights, ShadowSettings(sun=256, point=64), view=view, **arguments)


def sun_and_lamp(scale, direction=(0.3, -1.0, 0.2), position=(1.0, 1.5, -2.0)):
    lights = np.zeros(2, DIRECT_LIGHT)
    lights["kind"], lights["color"] = (DIRECT_SUN, DIRECT_POINT), 1.0
    lights["direction"] = direction / np.linalg.norm(direction)
    lights["position"] = np.array(position) * scale
    return lights


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("wide", [False, True])
def test_all_that_may_cast_a_shadow_into_the_picture_is_drawn(scale, wide):
    rng = np.random.default_rng(1)
    shares, areas = [], []
    for number in range(12):
        camera = Camera.look_at(
            rng.uniform(-9, 9, 3) * scale, rng.uniform(-2, 2, 3) * scale, yfov_deg=rng.uniform(10, 90)
        )
        if number % 4 == 0:
            camera.orthographic_height = rng.uniform(1, 8) * scale
        view = view_of(camera, scale)
        direction, position = rng.normal(size=3), rng.uniform(*BOX)
        found = shadow_views(sun_and_lamp(scale, direction, position), view, scale)
        receivers = Receivers(view, BOX * scale)
        # Find points in view, and points between each of them and the lights.
        points = rng.uniform(*BOX, (20000, 3)) * scale
        clip = np.c_[points, np.ones(len(points))] @ view["clip_from_world"].astype(np.float64)
        inside = (np.abs(clip[:, :2]) <= clip[:, 3:]).all(1) & (clip[:, 2] >= 0) & (clip[:, 2] <= clip[:, 3])
        seen = points[inside][:300]
        share = rng.random((len(seen), 1))
        to_sun = -found.lights["direction"][0].astype(np.float64)
        between = seen + to_sun * share * 20 * scale, seen + (found.lights["position"][1] - seen) * share
        middles = rng.uniform(2 * BOX[0], 2 * BOX[1], (500, 3)) * scale
        for light, places in zip(found.lights, between, strict=True):
            which = slice(light["first_view"], light["first_view"] + light["view_count"])
            records = found.records[which]
            boxes = np.stack([places - 1e-5 * scale, places + 1e-5 * scale], 1).astype(np.float32)
            assert casters(records, receivers, boxes, wide).all()
            others = np.stack([middles - 0.1 * scale, middles + 0.1 * scale], 1).astype(np.float32)
            shares.append(casters(records, receivers, others, wide).mean())
            # Each receiver's texels lie in the rectangle.
            drawn = needed_texels(records, receivers, wide).astype(np.float64)
            areas.append((drawn[:, 2:].prod(1) / records["size"].prod(1)).mean())
            if light["kind"] == DIRECT_SUN:
                for record, (x, y, width, height) in zip(records, drawn, strict=True):
                    ndc = (np.c_[seen, np.ones(len(seen))] @ record["clip_from_world"].astype(np.float64))[:, :2]
                    ndc = ndc[(np.abs(ndc) < 1 - 2 * FILTER / record["size"]).all(1)]
                    texel = record["corner"] + record["size"] * (ndc * (0.5, -0.5) + 0.5)
                    assert (texel >= (x + 2, y + 2)).all() and (texel <= (x + width - 2, y + height - 2)).all()
            else:
                assert np.array_equal(drawn[:, 2:], records["size"])
    # Much of the scene is left out.
    assert np.mean(shares) < 0.7 and np.mean(areas[::2]) < 0.7


def row_of_boxes(count=40):
    """Return a draw list of boxes in a row along x, too large to fill gaps with."""
    low = np.stack([np.linspace(-10, 9.5, count), np.full(count, -0.25), np.full(count, -0.25)], 1)
    boxes = np.stack([low, low + 0.5], 1).astype(np.float32)
    runs = np.array([(3000 * k, 3000, 0, 1) for k in range(count)])
    clusters = Clusters(boxes, runs, np.full(count, -1), count, boxes)
    nothing = np.zeros(0, np.uint32)
    return DrawList(nothing, nothing, nothing, np.zeros(1, np.uint32), ((0, 3000 * count, 0, 1),), (), clusters)


class Recorder:
    def __init__(self):
        self.indices = 0

    def draw_indexed(self, count, *others):
        self.indices += count

    def set_viewport(self, *values):
        pass

    def set_scissor_rect(self, *values):
        self.rectangle = values


def test_maps_are_drawn_again_once_the_camera_leaves_them():
    draws, shadows = row_of_boxes(), ShadowDraws()
    lights = sun_and_lamp(1.0)[:1]
    camera = Camera.look_at((-4, 1, 5), (-4, 0, 0), yfov_deg=30)
    views = shadow_views(lights, view_of(camera, 1.0), 1.0).records[-1:]

    def drawn(camera):
        receivers = None if camera is None else Receivers(view_of(camera, 1.0), BOX)
        shadows.update(views, draws, receivers)
        recorder = Recorder()
        shadows.record(DrawEncoder(recorder, None, False), False)
        return recorder.indices, shadows.version, recorder.rectangle[2:]

    few, version, rectangle = drawn(camera)
    assert 0 < few < 0.6 * 3 * 1000 * 40 and version == 0 and rectangle[0] < 200
    # A small move needs no more.
    assert drawn(Camera.look_at((-4.05, 1, 5), (-4.05, 0, 0), yfov_deg=30)) == (few, 0, rectangle)
    # A large one draws everything, once.
    everything = (120000, 1, tuple(views["size"][0].astype(int)))
    assert drawn(Camera.look_at((4, 1, 5), (4, 0, 0), yfov_deg=30)) == everything
    assert drawn(camera) == everything
    # New geometry starts over.
    draws.clusters.boxes = draws.clusters.boxes + np.float32((0, 0.01, 0))
    assert drawn(camera)[:2] == (few, 1)
    # Points out of view may need all of the map.
    assert drawn(None)[:2] == (120000, 2)


def test_no_views_and_no_clusters():
    receivers = Receivers(view_of(Camera.look_at((0, 0, 5), (0, 0, 0)), 1.0), BOX)
    views = shadow_views(sun_and_lamp(1.0), receivers.camera, 1.0).records
    boxes = np.zeros((3, 2, 3), np.float32)
    assert casters(views[:0], receivers, boxes, True).shape == (0, 3)
    assert casters(views, receivers, boxes[:0], True).shape == (len(views), 0)
    assert needed_texels(views[:0], receivers, True).shape == (0, 4)
    shadows = ShadowDraws()
    nothing = SimpleNamespace(slots=range(1), clusters=SimpleNamespace(boxes=boxes[:0]))
    shadows.update(views[:0], nothing, receivers)
    shadows.update(views[:0], nothing, None)
