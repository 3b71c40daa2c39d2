"""Shadow views on the CPU: matrices, cube faces, cascades, the atlas, and culling."""

from __future__ import annotations

import math
import time
from types import SimpleNamespace

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.gpu.wgsl.load import load
from wgpu_gi.settings import validate
from wgpu_gi.techniques.deferred.shadow_atlas import SMALLEST
from wgpu_gi.techniques.deferred.shadow_draws import ShadowDraws
from wgpu_gi.techniques.deferred.shadow_views import ShadowSettings, build_shadow_views, frames_from_normals
from wgpu_gi.techniques.shared.culling import frustum_planes, visible
from wgpu_gi.upload.direct_lights import DIRECT_AREA, DIRECT_POINT, DIRECT_SPOT, DIRECT_SUN
from wgpu_gi.webgpu_limits import MAX_TEXTURE_SIDE

DIRECT_LIGHT = load("deferred/shadow/views.wgsl").struct_dtype("DirectLight")
VIEW = load("scene/lights.wgsl").struct_dtype("View")
MARGIN = 1.5  # texels that a filter of 3 x 3 reaches beyond its middle
BOX = np.array([[-10.0, -2.0, -6.0], [10.0, 2.0, 6.0]])


def view_of(camera, size=(640, 360)):
    view = np.zeros((), VIEW)
    matrix = camera.world_from_view
    height = math.tan(camera.yfov / 2) if camera.orthographic_height is None else camera.orthographic_height / 2
    view["position"], view["forward"] = matrix[:3, 3], -matrix[:3, 2]
    view["right"], view["up"] = matrix[:3, 0] * height * size[0] / size[1], matrix[:3, 1] * height
    view["orthographic"], view["whole"] = camera.orthographic_height is not None, size
    return view


FROM_FRONT = Camera.look_at((0, 0, 25), (0, 0, 0))


def points_in(box, count=2000, seed=0):
    return np.random.default_rng(seed).uniform(box[0], box[1], (count, 3))


def lay_out(lights, camera=FROM_FRONT, box=BOX, samples=None, size=(640, 360), **settings):
    settings = ShadowSettings(**settings)
    validate(settings)
    result = build_shadow_views(
        lights,
        settings,
        centre=box.mean(0),
        radius=float(np.linalg.norm(box[1] - box[0]) / 2),
        view=view_of(camera, size),
        surface_samples=points_in(box) if samples is None else samples,
        box=box,
    )
    check(result)
    return result


def check(result):
    """Assert what holds for any lights."""
    records = result.records
    for name in records.dtype.names:
        assert np.isfinite(records[name]).all()
    lights = result.lights
    assert (lights["view_count"] > 0).all() and lights["view_count"].sum() == len(records)
    assert np.array_equal(lights["first_view"], np.cumsum(lights["view_count"]) - lights["view_count"])
    corner, size = records["corner"].astype(int), records["size"].astype(int)
    assert (size[:, 0] >= SMALLEST).all() and (size[:, 1] >= SMALLEST // 2).all()
    assert (corner >= 0).all() and (corner + size <= result.atlas_size).all()
    # All are multiples of 8 texels, so a coarser grid finds overlaps.
    assert (corner % 8 == 0).all() and (size % 8 == 0).all()
    used = np.zeros((result.atlas_size // 8,) * 2, np.int64)
    for (x, y), (width, height) in zip(corner // 8, size // 8, strict=True):
        used[y : y + height, x : x + width] += 1
    assert used.max(initial=0) <= 1
    assert result.atlas_size & (result.atlas_size - 1) == 0
    assert result.atlas_size <= SMALLEST or size.prod(1).sum() > (result.atlas_size // 2) ** 2


def light(kind, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0), color=(1.0, 1.0, 1.0), **fields):
    record = np.zeros(1, DIRECT_LIGHT)
    record["kind"], record["position"], record["color"] = kind, position, color
    record["direction"] = np.asarray(direction, float) / np.linalg.norm(direction)
    for name, value in fields.items():
        record[name] = value
    return record


def spot(half_angle, **fields):
    """A spot whose inner cone has no width."""
    return light(DIRECT_SPOT, cone_scale=1 / (1 - math.cos(half_angle)), cone_offset=1.0, **fields)


def join(*records):
    joined = np.zeros(len(records), DIRECT_LIGHT)
    for k, record in enumerate(records):
        joined[k : k + 1] = record
    return joined


def project(record, points):
    """Return texel coordinates from the rectangle's corner, (n, 2), depth, and w."""
    clip = np.c_[points, np.ones(len(points))] @ record["clip_from_world"].astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        ndc = clip[:, :3] / clip[:, 3:]
    return (ndc[:, :2] * (0.5, -0.5) + 0.5) * record["size"], ndc[:, 2], clip[:, 3]


def inside(record, points, margin=MARGIN):
    texel, depth, w = project(record, points)
    with np.errstate(invalid="ignore"):
        fits = (texel >= margin).all(1) & (texel <= record["size"] - margin).all(1)
    return fits & (w > 0) & (depth > 0) & (depth <= 1)


def random_directions(count=20_000, seed=0):
    v = np.random.default_rng(seed).normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def face_of(local, order):
    """Return the face that the major axis points to; `order` lists axis and sign of the faces."""
    axis = np.abs(local).argmax(1)
    sign = np.sign(local[np.arange(len(local)), axis])
    return np.array([order.index((int(a), int(s))) for a, s in zip(axis, sign, strict=True)])


WORLD_ORDER = [(0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1)]
OWN_ORDER = [(2, 1), (0, 1), (0, -1), (1, 1), (1, -1), (2, -1)]


# ------------------------------------------------------------------------------------------------ Perspective views


@pytest.mark.parametrize("side", [16, 64, 512])
def test_point_light_covers_all_directions(side):
    """The cube face of the major axis contains the point, with a margin for the filter."""
    position = np.array([1.0, -0.5, 2.0])
    result = lay_out(light(DIRECT_POINT, position), point=side)
    assert len(result.records) == 6 and (result.records["size"] == side).all()
    directions = random_directions()
    points = position + directions * np.random.default_rng(1).uniform(0.01, 1e4, (len(directions), 1))
    face = face_of(directions, WORLD_ORDER)
    for k, record in enumerate(result.records):
        assert inside(record, points[face == k]).all()
        outside = face != k
        assert inside(record, points[outside], 2.001).sum() <= 1e-3 * outside.sum()


@pytest.mark.parametrize("both", [0, 1])
@pytest.mark.parametrize("direction", [(0, 0, 1), (0, 0, -1), (0, -1, 0), (0.3, -0.8, 0.2), (-0.6, 0.1, -0.7)])
@pytest.mark.parametrize("side", [16, 128])
def test_emitter_sample_covers_its_hemisphere(direction, both, side):
    one = light(DIRECT_AREA, (0.5, 1, 0), direction, area=0.1, both_sides=both)
    result = lay_out(one, area=side)
    heights = [side] + [side if both else side // 2] * (5 if both else 4)
    assert result.records["size"].tolist() == [[side, height] for height in heights]
    frame = frames_from_normals(one["direction"].astype(np.float64))[0]
    directions = random_directions()
    local = directions @ frame.T
    if not both:
        directions, local = directions[local[:, 2] > 0], local[local[:, 2] > 0]
    face = face_of(local, OWN_ORDER)
    for k, record in enumerate(result.records):
        assert inside(record, one["position"] + 5 * directions[face == k]).all()
    # A half cube contains only a margin of the other side.
    behind = one["position"] + 5 * (random_directions()[:, :2] @ frame[:2] - 0.7 * frame[2])
    if not both:
        assert not any(inside(record, behind, 0).any() for record in result.records)


@pytest.mark.parametrize(
    ("degrees", "views"), [(0.1, 1), (10, 1), (45, 1), (59.99, 1), (61, 5), (89, 5), (90, 5), (91, 6), (180, 6)]
)
def test_spot_covers_its_cone(degrees, views):
    direction = np.array([0.6, -0.64, 0.48])
    one = spot(math.radians(degrees), position=(1, 1, 1), direction=direction)
    result = lay_out(one)
    assert len(result.records) == views
    frame = frames_from_normals(one["direction"].astype(np.float64))[0]
    rng = np.random.default_rng(0)
    cosine = 1 - rng.random(5000) * (1 - math.cos(math.radians(degrees)))
    cosine = np.maximum(cosine, 1e-3) if views == 5 else cosine
    angle = rng.random(5000) * 2 * math.pi
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    local = np.stack([sine * np.cos(angle), sine * np.sin(angle), cosine], 1)
    face = np.zeros(5000, int) if views == 1 else face_of(local, OWN_ORDER)
    points = one["position"].astype(np.float64) + 3 * local @ frame
    for k, record in enumerate(result.records):
        assert inside(record, points[face == k], 1.0 if degrees < 1 else MARGIN).all()


def test_frame_equals_the_shaders():
    """It is orthonormal and right-handed with the normal as third axis, and equals the formula at z = 0 and -1."""
    normals = np.concatenate([random_directions(500), [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, -1, 0), (0.6, 0.8, -0.0)]])
    frames = frames_from_normals(normals)
    assert np.allclose(frames @ frames.transpose(0, 2, 1), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(frames), 1) and np.allclose(frames[:, 2], normals)
    assert np.allclose(frames[500:502, 0], [(1, 0, 0), (1, 0, 0)])


@pytest.mark.parametrize("one", [light(DIRECT_POINT), light(DIRECT_AREA, area=1.0), spot(0.5), spot(1.4)])
def test_texel_size_is_that_at_1_m(one):
    for record in lay_out(one).records:
        rows = record["clip_from_world"].T.astype(np.float64)
        forward, right = rows[3, :3], np.cross(rows[3, :3], rows[1, :3])
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        base = one["position"] + 7 * forward
        steps = np.concatenate([base, base + 7 * record["texel"] * right, base + 7 * record["texel"] * up])
        texel, depth, w = project(record, steps)
        assert np.allclose(texel[1] - texel[0], (1, 0), atol=1e-3)
        assert np.allclose(texel[2] - texel[0], (0, -1), atol=1e-3)  # rows from the top
        assert np.allclose(w, 7, rtol=1e-5) and np.allclose(depth, rows[2, 3] / 7) and rows[2, 3] > 0
        assert np.linalg.det(rows[[0, 1, 3], :3]) < 0  # like a camera, so that front faces stay counter-clockwise


# ------------------------------------------------------------------------------------------------ Suns


SUNS = [(0, -1, 0), (0.3, -0.8, 0.5), (1, 0, 0), (-0.5, 0.1, -0.9)]


@pytest.mark.parametrize("direction", SUNS)
def test_sun_map_covers_the_scene(direction):
    sun = light(DIRECT_SUN, direction=direction)
    (record,) = lay_out(sun, cascades=1).records
    points = points_in(BOX, 5000)
    points[:8] = [[BOX[i >> a & 1][a] for a in range(3)] for i in range(8)]
    assert inside(record, points).all()
    along = points @ sun["direction"][0]
    depth = project(record, points)[1]
    assert (np.diff(depth[np.argsort(along)]) <= 1e-6).all()  # 1 nearest to the light
    step = np.cross(direction, (0.3, 0.5, -0.7))
    step *= record["texel"] / np.linalg.norm(step)
    texel = project(record, np.stack([points[0], points[0] + step]))[0]
    assert np.linalg.norm(texel[1] - texel[0]) == pytest.approx(1, abs=1e-3)


def test_sun_map_is_tight():
    """A long, flat scene seen from above fills most of a map of half the height."""
    sun = light(DIRECT_SUN, direction=(0, -1, 0))
    box = np.array([[-10.0, -2.0, -4.0], [10.0, 2.0, 4.0]])
    (record,) = lay_out(sun, box=box, sun=1024).records
    assert record["size"].tolist() == [1024, 512]
    assert 20 / 1024 < record["texel"] < 1.12 * 20 / 1024
    (record,) = lay_out(sun, sun=1024).records  # 20 m by 12 m
    assert record["size"].tolist() == [1024, 1024]


def street(length=2000.0):
    """Return points on a street along -Z, the nearest 1.5 m from the origin, and its box."""
    rng = np.random.default_rng(0)
    z = -1.5 * (length / 1.5) ** rng.random(4000)
    points = np.stack([rng.uniform(-0.4, 0.4, 4000) * np.abs(z), rng.uniform(-0.2, 0.2, 4000) * np.abs(z), z], 1)
    points[0] = (0, 0, -1.5)
    return points, np.stack([points.min(0), points.max(0)])


@pytest.mark.parametrize("direction", SUNS)
@pytest.mark.parametrize("length", [30.0, 200.0, 2000.0])
def test_cascades_match_the_resolution_of_pixels(direction, length):
    """The first map that contains a visible point has texels of few pixels, with as few maps as possible."""
    points, box = street(length)
    camera = Camera.look_at((0, 0, 0), (0, 0, -1))
    records = lay_out(light(DIRECT_SUN, direction=direction), camera, box, points).records
    assert (np.diff(records["texel"]) > 0).all()
    pixel = 2 * math.tan(camera.yfov / 2) / 360 * -points[:, 2]
    first = np.argmax([inside(record, points) for record in records], axis=0)
    assert all(inside(records[k], points[first == k]).all() for k in range(len(records)))
    wide = records["texel"][first] / pixel
    assert wide.max() < (4.3 if len(records) < 4 else 8.0)
    if len(records) > 1:
        assert (records["texel"][-1] / pixel).max() > 4


def test_number_of_cascades():
    points, box = street()
    camera = Camera.look_at((0, 0, 0), (0, 0, -1))
    sun = light(DIRECT_SUN, direction=(0.1, -0.9, 0.2))
    whole = lay_out(sun, camera, box, points, cascades=1).records
    for count in (1, 2, 3, 4):
        records = lay_out(sun, camera, box, points, cascades=count).records
        assert len(records) == count and records["texel"][-1] == whole["texel"][0]
    away = Camera.look_at((0, 0, 0), (0, 0, 1))
    assert len(lay_out(sun, away, box, points).records) == 1  # nothing in view
    assert len(lay_out(sun).records) == 1  # a small scene


def test_sun_maps_do_not_shimmer():
    """For every camera the same positions are texel centres; the map of the whole scene does not change."""
    points, box = street()
    sun = light(DIRECT_SUN, direction=(0.3, -0.8, 0.5))
    probes = points[::50]
    rng = np.random.default_rng(0)
    seen = {}
    for _ in range(12):
        eye = rng.uniform(-0.3, 0.3, 3)
        records = lay_out(sun, Camera.look_at(eye, eye + np.append(rng.uniform(-0.3, 0.3, 2), -1)), box, points).records
        for record in records:
            texel = project(record, probes)[0]
            before = seen.setdefault(float(record["texel"]), texel)
            moved = texel - before
            # At 2000 m float32 has an error that matters for texels of a centimetre.
            assert np.abs(moved - np.round(np.median(moved, axis=0))).max() < 2e-4 / record["texel"] + 1e-2
        assert np.array_equal(project(records[-1], probes)[0], seen[float(records[-1]["texel"])])
    assert len(seen) < 12


def test_sun_map_of_a_growing_scene_keeps_its_texels():
    sun = light(DIRECT_SUN, direction=(0.3, -0.8, 0.5))
    points = points_in(BOX, 50)
    before = lay_out(sun, box=BOX).records[0]
    grown = BOX + np.array([[0, 0, 0], [0.05, 0.01, 0.02]])
    after = lay_out(sun, box=grown).records[0]
    moved = project(after, points)[0] - project(before, points)[0]
    assert after["texel"] == before["texel"] and np.abs(moved - np.round(moved[0])).max() < 1e-2


def test_orthographic_camera_gets_a_finer_map_of_its_view():
    camera = Camera.look_at((0, 500, 0), (0, 0, 0))
    camera.orthographic_height = 4.0
    box = np.array([[-1000.0, -1, -1000], [1000, 1, 1000]])
    near = points_in(np.array([[-3, -1, -2], [3, 1, 2]]), 200)
    samples = np.concatenate([points_in(box), near])
    fine, whole = lay_out(light(DIRECT_SUN, direction=(0.3, -0.8, 0.5)), camera, box, samples).records
    assert inside(fine, near).all() and inside(whole, samples).all()
    assert fine["texel"] < 4 * 4 / 360 < whole["texel"]


def test_scene_without_extent():
    for box in (np.zeros((2, 3)), np.array([[0, 0, 0], [1.0, 0, 0]])):
        for direction in ((1, 0, 0), (0, -1, 0)):
            lay_out(light(DIRECT_SUN, direction=direction), box=box)
    result = build_shadow_views(
        light(DIRECT_SUN),
        ShadowSettings(),
        centre=np.zeros(3),
        radius=5.0,
        view=view_of(FROM_FRONT),
        surface_samples=np.zeros((0, 3)),
    )
    check(result)
    assert inside(result.records[0], 5 * random_directions(500)).all()


# ------------------------------------------------------------------------------------------------ Atlas


def many_points(count, seed=0):
    rng = np.random.default_rng(seed)
    lights = np.zeros(count, DIRECT_LIGHT)
    lights["position"], lights["color"] = rng.uniform(BOX[0], BOX[1], (count, 3)), rng.random((count, 3)) ** 3
    return lights


def test_no_lights():
    result = lay_out(np.zeros(0, DIRECT_LIGHT))
    assert len(result.records) == 0 and visible(result.records, BOX[None]).shape == (0, 1)


@pytest.mark.parametrize("size", [(64, 36), (640, 360), (360, 640), (1920, 1080), (7680, 4320)])
@pytest.mark.parametrize("eye", [(0, 0, 25), (0, 0, 5), (-9, 0, 5)])
def test_automatic_sides_of_sun_maps_follow_the_picture_but_add_no_map(eye, size):
    camera = Camera.look_at(eye, (0, 0, 0))
    sun = light(DIRECT_SUN, direction=(0.2, -1, 0.1))
    found = lay_out(sun, camera, size=size).records
    sides = {side: lay_out(sun, camera, size=size, sun=side).records for side in 2 ** np.arange(6, 12)}
    (side,) = np.unique(found["size"][:, 0]).tolist()
    assert np.array_equal(found, sides[side])
    enough = [s for s, records in sides.items() if s >= min(max(size), 2048) and len(records) <= len(sides[2048])]
    assert side == min(enough)


def test_atlas_is_no_larger_than_needed():
    result = lay_out(light(DIRECT_POINT), point=128)
    assert (result.records["size"] == 128).all() and result.atlas_size == 512
    assert lay_out(light(DIRECT_SUN), sun=1000).records["size"][0, 0] == 512  # rounded down


def test_all_kinds_share_the_atlas():
    lights = join(
        light(DIRECT_SUN, direction=(0.2, -1, 0.3), color=(100.0, 100, 100)),
        *(light(DIRECT_AREA, (0.1 * k, 1.9, 0), (0, -1, 0), area=0.1) for k in range(16)),
        light(DIRECT_POINT, (5, 1, 0)),
        spot(0.6, position=(-5, 1, 0), direction=(0, -1, 0)),
        spot(1.3, position=(-5, 1, 0), direction=(0, -1, 0)),
        light(DIRECT_AREA, (3, 0, 0), (0, 1, 0), area=0.1, both_sides=1),
    )
    result = lay_out(lights, sun=2048)
    assert result.lights["view_count"].tolist() == [1, *[5] * 16, 6, 1, 5, 6]
    assert lights["view_count"].sum() == 0  # those passed in are left as they were
    assert result.atlas_size == 4096
    sides = result.records["size"][result.lights["first_view"], 0]
    assert sides[0] == 2048 and (sides[1:17] >= 64).all() and sides[17] == 256


def test_brighter_lights_get_finer_maps():
    lights = join(*(light(DIRECT_POINT, (0, 0, 5), color=(c, c, c)) for c in (1.0, 100.0, 6.0, 1e-5)))
    sides = lay_out(lights).records["size"][::6, 0]
    assert sides.tolist() == [32, 256, 64, 32]


@pytest.mark.parametrize("atlas", [256, 512, 1024, 2048])
def test_a_small_atlas_reduces_resolution(atlas):
    lights = join(
        light(DIRECT_SUN, color=(9.0, 9, 9)),
        light(DIRECT_POINT, (0, 0, 5)),
        light(DIRECT_POINT, (0, 0, 5), color=(0.1,) * 3),
    )
    result = lay_out(lights, atlas=atlas, sun=2048)
    assert result.atlas_size <= atlas
    sun, bright, dim = result.records["size"][result.lights["first_view"], 0]
    assert sun >= bright >= dim >= SMALLEST
    assert (result.records["size"].prod(1).sum()) > atlas**2 / 4  # not halved more often than needed


@pytest.mark.parametrize("atlas", [1024, 4096])
def test_a_thousand_point_lights(atlas):
    lights = many_points(1000)
    best = math.inf
    for _ in range(3):
        start = time.perf_counter()
        result = lay_out_unchecked(lights, atlas)
        best = min(best, time.perf_counter() - start)
    check(result)
    assert len(result.records) == 6000
    assert result.atlas_size == max(atlas, 2048)  # the smallest maps take 1.5 million texels
    assert best < 0.5  # seconds; a loop over the faces would take longer


def lay_out_unchecked(lights, atlas):
    return build_shadow_views(
        lights,
        ShadowSettings(atlas=atlas),
        centre=np.zeros(3),
        radius=12.0,
        view=view_of(FROM_FRONT),
        surface_samples=points_in(BOX),
        box=BOX,
    )


def test_more_lights_than_fit_an_atlas():
    limit = MAX_TEXTURE_SIDE**2 // (6 * SMALLEST**2)
    with pytest.raises(GiError, match=f"{limit + 1} lights do not fit into 8192 x 8192 texels; use fewer"):
        lay_out_unchecked(many_points(limit + 1), 4096)


@pytest.mark.parametrize(("instances", "most"), [(2**19 + 1, 4096), (2**15 + 1, 65536)])
def test_more_views_than_can_be_numbered(instances, most):
    """A 32-bit number holds both the view and the instance."""
    draws = SimpleNamespace(slots=range(instances + 1), clusters=SimpleNamespace(boxes=np.zeros((0, 2, 3), np.float32)))
    shadows = ShadowDraws()
    with pytest.raises(GiError, match=f"{most + 1} shadow maps of a scene of {instances} instances .* use fewer"):
        shadows.update(np.zeros(most + 1, np.uint8), draws)
    shadows.update(np.zeros(most, np.uint8), draws)
    assert len(shadows.culling.views) == most


# ------------------------------------------------------------------------------------------------ Culling


def test_culling_keeps_every_visible_box():
    rng = np.random.default_rng(0)
    lights = many_points(15)
    lights["kind"] = np.arange(15) % 4
    lights["direction"] = random_directions(15)
    lights["area"], lights["cone_scale"], lights["cone_offset"] = 0.1, 2.0, rng.uniform(0.1, 2.5, 15)
    records = lay_out(lights).records
    middle, half = rng.uniform(-15, 15, (400, 3)), 10.0 ** rng.uniform(-4, 1, (400, 3))
    boxes = np.stack([middle - half, middle + half], 1).astype(np.float32)
    shown = visible(records, boxes)
    assert shown.shape == (len(records), 400) and 0.05 < shown.mean() < 0.8
    weights = rng.random((60, 1, 3))
    weights[:8, 0] = [[i >> a & 1 for a in range(3)] for i in range(8)]  # the corners, too
    points = boxes[:, 0] + weights * (boxes[:, 1].astype(np.float64) - boxes[:, 0])
    for record, of_view in zip(records, shown, strict=True):
        seen = inside(record, points.reshape(-1, 3), 0.0).reshape(60, 400).any(0)
        assert of_view[seen].all()


def test_planes_bound_the_view():
    for one in (light(DIRECT_POINT, (1, 2, 0)), light(DIRECT_SUN, direction=(0.3, -0.8, 0.5)), spot(0.5)):
        for record, planes in zip(*(lambda r: (r, frustum_planes(r)[0]))(lay_out(one).records), strict=True):
            points = points_in(3 * BOX, 3000)
            expected = inside(record, points, 0.0)
            held = (np.c_[points, np.ones(3000)] @ planes.T >= 0).all(1)
            assert (expected == held).mean() > 0.999


def test_culling_far_from_the_origin_and_tiny_scenes():
    """Boxes as thin as rounding errors, at the edge of a light's view."""
    for scale in (1e-4, 1e4):
        one = light(DIRECT_POINT, np.array([3.0, 1.0, 2.0]) * scale)
        records = lay_out(one, box=BOX * scale).records
        directions = random_directions(500)
        directions[:, 1] = np.abs(directions).max(1)  # many along the faces' edges
        points = (one["position"] + directions * scale).astype(np.float32)
        boxes = np.stack([points, points], 1)
        for record, of_view in zip(records, visible(records, boxes), strict=True):
            assert of_view[inside(record, points.astype(np.float64), 0.0)].all()
