"""The G-buffer against primary rays, per pixel; depth peeling, a second camera, culling, motion vectors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.medley import at, medley, named
from helpers.pictures import moved, scaling, shoot, translation
from helpers.surfaces import read_surfaces, world_normals

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.gpu.device import open_device
from wgpu_gi.gpu.graph import Graph
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.built_in.shapes import grid, quad, sphere
from wgpu_gi.scene.scene import Image, Instance, Material, Scene, Texture
from wgpu_gi.techniques.shared import culling
from wgpu_gi.techniques.shared.culling import visible
from wgpu_gi.techniques.shared.gbuffer import declare_gbuffer
from wgpu_gi.techniques.shared.sampling import pixel_offset
from wgpu_gi.techniques.shared.scene_inputs import share_raster
from wgpu_gi.upload import draw_list
from wgpu_gi.upload.scene_upload import SceneUpload

SIZE = (160, 90)
SHOW = ("emission", "albedo", "normal", "depth", "position")
# Rasterisation snaps vertices to a grid of 1/256 pixel, rays use float32: along edges some pixels show another surface.
# On the medley at SIZE, 0.03 % of the pixels do.
EDGES = 6e-4


def renderer_of(scene, size=SIZE, camera=None, show=SHOW, jitter=False):
    # Textures are read at points, as primary rays read them.
    settings = Settings(gi="none", camera=CameraSettings(jitter=jitter, footprint=0.0))
    renderer = Renderer(scene, size=size, camera=camera, settings=settings)
    renderer.step(show=show)
    return renderer


def agreement(renderer):
    """Return for each pixel whether the G-buffer and the primary ray agree."""
    g, depth = read_surfaces(renderer.graph), renderer.read_back("depth")
    albedo, normal = renderer.read_back("albedo"), renderer.read_back("normal")
    # Colours are square roots of 10 bits, normals 16 bits for each coordinate.
    same_color = (np.abs(np.sqrt(g.base_color) - np.sqrt(albedo)) <= 0.51 / 1023).all(-1)
    same_normal = np.linalg.norm(g.normal - normal, axis=-1) <= 1e-4
    same_place = np.abs(g.distance - depth) <= 1e-5 * depth
    nothing = ~g.seen & (depth == 0)
    assert not g.distance[~g.seen].any() and (g.distance[g.seen] > 0).all()
    return nothing | (g.seen & (depth > 0) & same_color & same_normal & same_place)


VIEWS = {
    "front": (medley, SIZE, None),
    "tall": (medley, (33, 401), None),
    "below": (medley, (161, 91), Camera.look_at((2, -3, 1), (0, 0, 0))),
    "a million metres off": (lambda: moved(medley(), translation(1e6, -2e6, 3e6)), SIZE, None),
    "a thousandth": (lambda: moved(medley(), scaling(1e-3)), SIZE, None),
    "a thousand times": (lambda: moved(medley(), scaling(1e3)), SIZE, None),
}


@pytest.mark.parametrize("name", VIEWS)
def test_gbuffer_agrees_with_primary_rays(name):
    make, size, camera = VIEWS[name]
    renderer = renderer_of(make(), size, camera)
    assert (~agreement(renderer)).mean() <= EDGES
    g = read_surfaces(renderer.graph)
    assert 0.3 < g.seen.mean() < 0.9
    assert (np.linalg.norm(g.geometric_normal - world_normals(renderer, g), axis=-1)[g.seen] < 1e-4).all()


def test_orthographic_gbuffer_agrees_with_primary_rays():
    camera = Camera.look_at((3, 3, 3), (0, 0.8, 0))
    camera.orthographic_height = 5.0
    renderer = renderer_of(medley(), (161, 91), camera)
    assert (~agreement(renderer)).mean() <= EDGES


@pytest.mark.parametrize("far", [1e3, 1e4])
def test_distant_gbuffer_agrees_with_primary_rays(far):
    """A telephoto lens; float32 resolves a position 10 km away to half a millimetre."""
    camera = Camera.look_at(np.array((0.3, 0.35, 1)) * far, (0, 0.9, 0), yfov_deg=np.degrees(5 / far))
    assert (~agreement(renderer_of(medley(), camera=camera))).mean() <= (EDGES if far < 1e4 else 5e-3)


def test_tiny_pictures_have_the_depth_of_primary_rays():
    """Pixels are metres wide, so edges move by centimetres: each pixel shows a surface near the ray's hit."""
    for size in ((1, 1), (3, 1), (1, 7), (17, 13)):
        renderer = renderer_of(medley(), size)
        g, depth = read_surfaces(renderer.graph), renderer.read_back("depth")
        assert np.array_equal(g.seen, depth > 0)
        assert np.allclose(g.distance, depth, rtol=1e-4)


def test_depth_is_reversed():
    for camera in (None, Camera.look_at((3, 3, 3), (0, 0.8, 0))):
        if camera is not None:
            camera.orthographic_height = 5.0
        renderer = renderer_of(medley(), camera=camera)
        g, upload = read_surfaces(renderer.graph), renderer._gpu.upload
        clip = upload.view(renderer.camera, SIZE, False)["clip_from_world"].T.astype(np.float64)
        position = renderer.read_back("position").astype(np.float64) - upload.origin
        expected = position @ clip[:3, :3].T + clip[:3, 3]
        expected = expected[..., 2] / (position @ clip[3, :3] + clip[3, 3])
        same = agreement(renderer) & g.seen
        assert np.allclose(g.depth[same], expected[same], rtol=1e-4)
        assert not g.depth[~g.seen].any()


def test_materials_and_emission_are_those_of_the_hit_triangle():
    renderer = renderer_of(medley())
    g, same = read_surfaces(renderer.graph), agreement(renderer)
    hierarchy, materials = renderer._gpu.upload._hierarchy, renderer.scene.materials
    shown = [materials[k] for k in hierarchy.triangles["material"][g.triangle[g.seen]]]
    for name, values in (("roughness", g.roughness), ("metallic", g.metallic), ("unlit", g.unlit)):
        assert np.allclose(values[g.seen], [getattr(m, name) for m in shown], atol=1e-5), name
    assert g.coated[g.seen].all() and {m.name for m in shown} == {m.name for m in materials}
    # Emission equals the path tracer's at pixel centres.
    exact = shoot(medley(), SIZE, show=("emission",), diffuse=False, spp=1, bounces=0)["emission"]
    assert np.allclose(g.emission[same], exact[same], rtol=1e-5)
    assert np.array_equal(g.emission.astype(np.float32), renderer.read_back("emission"))


def test_diffuse_setting_removes_coats():
    renderer = Renderer(medley(), size=(32, 18), settings=Settings(gi="none", diffuse=True))
    renderer.step(show=("emission",))
    assert not read_surfaces(renderer.graph).coated.any()


# ------------------------------------------------------------------------------------------------ Layers and cameras


class Bench:
    """A graph with a scene, without a renderer."""

    def __init__(self, scene, size, camera):
        self.device = open_device(large_buffers=True)
        self.graph, self.upload, self.size = Graph(self.device), SceneUpload(self.device), size
        self.upload.update(scene)
        self.upload.update_draws(scene)
        self.graph.uniform("scene", self.upload.info)
        self.set_view("view", camera)
        self.graph.begin(size)
        self.inputs = share_raster(self.graph, self.upload)

    def set_view(self, name, camera):
        self.graph.uniform(name, self.upload.view(camera, self.size, False))

    def run(self, *layers):
        self.graph.compile([h for g in layers for h in (g.surfaces, g.emission, g.distance)])
        self.graph.run(check=True)


def plates():
    """Squares at 1, 2, 3, 4 and 5 m before the camera; the second and the fourth are cut to their right half."""
    half = np.full((1, 2, 4), 255, np.uint8)
    half[0, 0, 3] = 0
    cut = Texture(Image(half), filter="nearest")
    scene = Scene()
    for k in range(1, 6):
        color = (k / 8, 0.5, 0.5, 1.0)
        material = Material(f"{k}", color, alpha_mode="opaque" if k % 2 else "mask", base_color_texture=cut)
        plate = quad((-1, -1, -k), (2, 0, 0), (0, 2, 0), material)
        plate.texcoords0 = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
        scene.instances.append(Instance(plate))
    return scene


@pytest.mark.parametrize("height", [None, 1.0])
def test_layers_are_the_visible_plates_in_order(height):
    """The left half shows the plates 1, 3, 5, the right half 1, 2, 3, 4, in any draw order."""
    camera = Camera(yfov=np.radians(10), orthographic_height=height)
    for order in (1, -1):
        scene = plates()
        scene.instances = scene.instances[::order]
        bench = Bench(scene, (20, 10), camera)
        layers = declare_gbuffer(bench.graph, bench.inputs, layers=4)
        bench.run(*layers)
        found = [read_surfaces(bench.graph, suffix=suffix) for suffix in ("", "_1", "_2", "_3")]
        for k, (left, right) in enumerate([(1, 1), (3, 2), (5, 3), (0, 4)]):
            for half, plate in ((np.s_[:, :10], left), (np.s_[:, 10:], right)):
                assert np.array_equal(found[k].seen[half], np.full((10, 10), plate > 0))
                assert np.allclose(found[k].base_color[half][..., 0], plate / 8, atol=2e-3)
                if height:
                    assert np.allclose(found[k].distance[half], plate)
        assert not found[3].emission.any()


def test_layers_are_the_hits_of_rays_in_order():
    """Against all intersections of all triangles: nested spheres, as instances and in the world-space hierarchy."""
    ball = sphere(subdivisions=1)
    scene = Scene(
        [
            Instance(sphere(subdivisions=2)),
            Instance(ball, at(0.3, 0, 0, (0.6, 0.6, -0.6))),
            Instance(ball, at(-0.5, 0.4, 0.2, (0.5, 1.5, 0.5), 0.5)),
        ]
    )
    camera = Camera.look_at((1, 1, 3), (0, 0, 0), yfov_deg=45)
    bench = Bench(scene, (48, 32), camera)
    layers = declare_gbuffer(bench.graph, bench.inputs, layers=3)
    bench.run(*layers)
    hits = np.sort(all_hits(scene, camera, (48, 32)), axis=-1)
    assert (np.isfinite(hits).sum(-1) >= 4).mean() > 0.1
    for k, suffix in enumerate(("", "_1", "_2")):
        g = read_surfaces(bench.graph, suffix=suffix)
        expected = np.where(np.isfinite(hits[..., k]), hits[..., k], 0.0)
        assert (np.abs(g.distance - expected) > 1e-4).mean() < 5e-3


def rays(camera, size, offset=(0.5, 0.5)):
    """Directions of unit length through the pixels at an offset from their top left corner, (h, w, 3)."""
    half = np.tan(camera.yfov / 2)
    x, y = ((np.arange(n) + o) / n * 2 - 1 for n, o in zip(size, offset, strict=True))
    x, y = np.meshgrid(x, -y)
    local = np.stack([x * half * size[0] / size[1], y * half, -np.ones_like(x)], -1)
    return local @ camera.world_from_view[:3, :3].T / np.linalg.norm(local, axis=-1, keepdims=True)


def all_hits(scene, camera, size):
    """Distances at which the pixels' rays meet each triangle, (h, w, n), inf where they do not."""
    corners = np.concatenate(
        [
            i.mesh.positions[i.mesh.triangles] @ i.world_from_local[:3, :3].T + i.world_from_local[:3, 3]
            for i in scene.instances
        ]
    )
    origin, direction = camera.position, rays(camera, size)[..., None, :]
    v0, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(direction, e2)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / (e1 * p).sum(-1)
        s = origin - v0
        u, q = (s * p).sum(-1) * inverse, np.cross(s, e1)
        v, t = (direction * q).sum(-1) * inverse, (e2 * q).sum(-1) * inverse
        return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)


def test_second_camera_has_the_same_gbuffer_as_alone():
    scene = medley()
    first, second = scene.cameras[0], Camera.look_at((-4, 3, 2), (0, 0.5, 0), yfov_deg=60)
    both, alone = Bench(scene, (64, 40), first), Bench(scene, (64, 40), second)
    both.set_view("view_second", second)
    (near,) = declare_gbuffer(both.graph, both.inputs)
    (other,) = declare_gbuffer(both.graph, both.inputs, name="second", view="view_second")
    both.run(near, other)
    alone.run(*declare_gbuffer(alone.graph, alone.inputs))
    got, expected = read_surfaces(both.graph, "second"), read_surfaces(alone.graph)
    for name in vars(expected):
        assert np.array_equal(getattr(got, name), getattr(expected, name)), name
    assert not np.array_equal(read_surfaces(both.graph).distance, got.distance)
    # Only the second G-buffer runs again when its camera moves.
    both.set_view("view_second", first)
    both.graph.run()
    assert {name.split("/")[0] for name in both.graph.last_run} == {"second"}


# ------------------------------------------------------------------------------------------------ Culling

RASTERED = ("visibility", "depth")


def crowd():
    """The medley with many tufts and balls, and a ground of many clusters, on all sides of its camera."""
    scene = medley()
    ball, sheet = named(scene, "left").mesh, scene.instances[6].mesh
    scene.instances.append(Instance(grid(60.0, 40, Material("ground"))))
    scene.instances[-1].world_from_local = at(0, -0.5, 0)
    for k in range(60):
        angle, far = 2.4 * k, 1.0 + 0.4 * k
        scene.instances.append(Instance((ball, sheet)[k % 2], at(far * np.cos(angle), 0.4, far * np.sin(angle))))
    return scene


def orthographic(position, target, height):
    camera = Camera.look_at(position, target)
    camera.orthographic_height = height
    return camera


CROWD_VIEWS = {
    "own": None,
    "in a ball": Camera.look_at((-1.5, 0.9, 0.5), (4, 0.5, -3)),
    "on the ground": Camera.look_at((2, -0.5, 1), (20, -0.5, 3), yfov_deg=90),
    "down": Camera.look_at((3, 2, 1), (3, 0, 1)),
    "wide": Camera.look_at((0, 1, 0), (-5, 0, 2), yfov_deg=150),
    "narrow": Camera.look_at((30, 8, 20), (0, 0, 0), yfov_deg=3),
    "parallel": orthographic((3, 3, 3), (0, 0.8, 0), 3.0),
    "parallel, from within": orthographic((0, 0.3, 0), (5, 0, 2), 2.0),
}


@pytest.fixture
def small_clusters(monkeypatch):
    """Clusters and gaps so small that the scenes here have many."""
    monkeypatch.setattr(draw_list, "CLUSTER", 40)
    monkeypatch.setattr(draw_list, "MANY_INSTANCES", 4)
    monkeypatch.setattr(draw_list, "SMALL_GAP", 45)


def draw_everything(monkeypatch):
    monkeypatch.setattr(culling, "visible", lambda views, boxes: np.ones((len(views), len(boxes)), bool))


def drawn_share(renderer):
    """The share of the triangles that the opaque pass draws."""
    draw = next(p for p in renderer.graph.order if p.name == "gbuffer/opaque").raster.draw
    runs, everything = draw.culling.runs(False)[0], renderer._gpu.upload.draws.opaque
    return sum(r[1] * r[3] for r in runs) / sum(r[1] * r[3] for r in everything)


def frames_of(camera, size):
    """Return pictures and drawn shares: a still and a jittered frame, moving instances, an added instance."""
    scene = crowd()
    renderer = renderer_of(scene, size, camera, show=("emission",), jitter=True)
    shares, pictures = [], []

    def record():
        pictures.append([renderer.graph.read_back(f"gbuffer/{name}") for name in RASTERED])
        shares.append(drawn_share(renderer))

    record()
    renderer.step(show=("emission",))
    record()
    for place in (at(0, 0.5, 3), at(8, 0, 2), at(-2, 1, -1)):
        named(scene, "block").world_from_local = place
        named(scene, "left").world_from_local = place @ at(1, 0.5)
        renderer.step(show=("emission",))
        record()
    scene.instances.append(Instance(named(scene, "block").mesh, at(1, 1, 2)))
    renderer.step(show=("emission",))
    record()
    return pictures, shares


@pytest.mark.parametrize("name", CROWD_VIEWS)
def test_culling_keeps_the_gbuffer_bit_for_bit(name, monkeypatch, small_clusters):
    camera = CROWD_VIEWS[name]
    got, shares = frames_of(camera, (97, 55))
    draw_everything(monkeypatch)
    expected, unculled = frames_of(camera, (97, 55))
    assert max(shares) < 0.9 and set(unculled) == {1.0}
    for k, (ours, theirs) in enumerate(zip(got, expected, strict=True)):
        assert theirs[0].any()
        for part, a, b in zip(RASTERED, ours, theirs, strict=True):
            assert np.array_equal(a, b), (k, part)


def test_culling_keeps_layers_and_a_second_camera_bit_for_bit(monkeypatch, small_clusters):
    scene = crowd()

    def layers_of_both():
        bench = Bench(scene, (64, 40), scene.cameras[0])
        bench.set_view("view_second", CROWD_VIEWS["parallel, from within"])
        found = declare_gbuffer(bench.graph, bench.inputs, layers=3)
        found += declare_gbuffer(bench.graph, bench.inputs, name="second", view="view_second", layers=2)
        bench.run(*found)
        return [bench.graph.read_back(handle) for g in found for handle in (g.visibility, g.depth)]

    got = layers_of_both()
    draw_everything(monkeypatch)
    for a, b in zip(got, layers_of_both(), strict=True):
        assert b.any() and np.array_equal(a, b)


def test_a_moving_camera_keeps_the_declaration_and_a_still_one_does_not_cull(monkeypatch):
    scene, calls = crowd(), []
    renderer = renderer_of(scene)
    monkeypatch.setattr(culling, "visible", lambda *a: calls.append(len(a[0])) or visible(*a))
    declared = dict(renderer.graph.passes)
    first = renderer.graph.read_back("gbuffer/visibility")
    for k in range(1, 4):
        renderer.camera = Camera.look_at((0.3 + k, 2.3, 6), (0, 0.9, 0), yfov_deg=50)
        renderer.step(show=SHOW)
        assert all(renderer.graph.passes[name] is p for name, p in declared.items())
        assert calls.count(1) == k  # once for all passes of the camera
    assert not np.array_equal(renderer.graph.read_back("gbuffer/visibility"), first)
    renderer.run(show=SHOW)
    before = len(calls)
    assert not renderer.step(show=SHOW) and len(calls) == before
    # A changed light does not cull again.
    scene.lights[0].intensity *= 2
    renderer.step(show=SHOW)
    assert calls.count(1) == 3


def test_empty_view_clears_the_gbuffer(monkeypatch):
    """The G-buffer is cleared; when the camera turns back, it is the same as before."""
    renderer = renderer_of(crowd())
    first, camera = renderer.graph.read_back("gbuffer/visibility"), renderer.camera
    declared = dict(renderer.graph.passes)
    renderer.camera = Camera.look_at((0, 2, 40), (0, 3, 80))
    renderer.step(show=SHOW)
    assert drawn_share(renderer) == 0
    assert {"gbuffer/opaque", "gbuffer/masked"} <= renderer.graph.last_run.keys()
    assert not any(renderer.graph.read_back(f"gbuffer/{name}").any() for name in (*RASTERED, "distance"))
    assert np.allclose(renderer.read_back("emission"), (0.2, 0.3, 0.4))
    renderer.camera = camera
    renderer.step(show=SHOW)
    assert all(renderer.graph.passes[name] is p for name, p in declared.items())
    assert np.array_equal(renderer.graph.read_back("gbuffer/visibility"), first)


def test_replaced_mesh_of_equal_size_updates_culling(small_clusters):
    """The declaration is kept, the culling result is not."""
    scene = crowd()
    renderer = renderer_of(scene)
    declared = renderer.graph.passes["gbuffer/opaque"]
    assert len(scene.instances[12].mesh.positions) == 41 * 41
    moved_ground = grid(60.0, 40, Material("ground"))
    moved_ground.positions = moved_ground.positions[:, [1, 0, 2]]  # a wall
    scene.instances[12].mesh = moved_ground
    renderer.step(show=SHOW)
    assert renderer.graph.passes["gbuffer/opaque"] is declared
    fresh = renderer_of(scene)
    for name in RASTERED:
        assert np.array_equal(*(r.graph.read_back(f"gbuffer/{name}") for r in (renderer, fresh)))


def test_unknown_view_is_an_error():
    bench = Bench(plates(), (8, 8), Camera())
    with pytest.raises(GiError, match="G-buffer 'gbuffer': there is no shared uniform 'view_third'"):
        declare_gbuffer(bench.graph, bench.inputs, view="view_third")


# ------------------------------------------------------------------------------------------------ Motion

STILL = 2e-3  # pixels: rounding of float32 in two projections


def place_of(camera, size, points):
    """Return pixel coordinates from the top left corner, and distances from the camera, of world points."""
    clip = camera.clip_from_world(size, np.zeros(3), 1.0, 100.0)
    p = np.asarray(points, np.float64) @ clip[:, :3].T + clip[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):  # a point at the camera has no pixel
        ndc = p[..., :2] / p[..., 3:]
    return (ndc * (0.5, -0.5) + 0.5) * size, np.linalg.norm(points - camera.position, axis=-1)


def motion_of(renderer):
    """Render a frame; return its motion, positions and depth."""
    renderer.step(show=("motion", "position", "depth"))
    depth = renderer.read_back("depth")
    return renderer.read_back("motion"), renderer.read_back("position").astype(np.float64), depth


def test_first_and_still_frames_have_no_motion():
    renderer = renderer_of(medley(), show=("motion", "depth"))
    depth = renderer.read_back("depth")
    for _ in range(2):
        motion = renderer.read_back("motion")
        assert np.abs(motion[..., :2]).max() < STILL
        # The third channel is the distance in the frame before, here the same.
        assert (np.abs(motion[..., 2] - depth) > 1e-4 * depth).mean() < EDGES
        renderer.run(show=("motion", "depth"))


@pytest.mark.parametrize("jitter", [False, True])
def test_motion_of_a_camera_is_the_reprojection(jitter):
    """Motion of the points that the jittered rays hit, without the jitter itself."""
    renderer = renderer_of(medley(), show=("motion",), jitter=jitter)
    renderer.step(show=("motion",))
    before = renderer.camera
    renderer.camera = Camera.look_at((0.8, 2.0, 5.5), (0.1, 1.0, 0), yfov_deg=50)
    renderer.step(show=("motion",))
    motion, g = renderer.read_back("motion"), read_surfaces(renderer.graph)
    offset = pixel_offset(0, renderer.settings.seed) if jitter else (0.5, 0.5)
    position = renderer.camera.position + rays(renderer.camera, SIZE, offset) * g.distance[..., None]
    now, _ = place_of(renderer.camera, SIZE, position)
    then, distance = place_of(before, SIZE, position)
    assert np.median(np.linalg.norm(now - then, axis=-1)[g.seen]) > 5
    assert np.abs(motion[..., :2] - (now - then)).max(-1)[g.seen].max() < STILL
    assert np.abs(motion[..., 2] - distance)[g.seen].max() < 1e-4
    # In the next frame, jittered or not, the camera is still.
    renderer.step(show=("motion",))
    assert np.abs(renderer.read_back("motion")[..., :2]).max() < STILL


def test_jitter_is_no_motion():
    renderer = renderer_of(medley(), show=("motion",), jitter=True)
    for _ in range(5):
        assert renderer.step(show=("motion",))
        assert np.abs(renderer.read_back("motion")[..., :2]).max() < STILL


def test_motion_of_an_orthographic_camera_has_the_distance_along_its_ray():
    """As `depth` has: what is at rest, seen by a camera that goes sideways, keeps its distance."""
    camera = replace(Camera.look_at((1.0, 2.0, 5.0), (0, 1.0, 0)), orthographic_height=4.0)
    renderer = renderer_of(medley(), show=("motion", "depth"), camera=camera)
    pose = camera.world_from_view.copy()
    pose[:3, 3] += 0.3 * pose[:3, 0]
    renderer.camera = replace(camera, world_from_view=pose)
    motion, _, depth = motion_of(renderer)
    seen = depth > 0
    assert seen.mean() > 0.3 and np.abs(motion[..., 2] - depth)[seen].max() < 1e-4 * depth.max()
    assert np.abs(motion[..., 0] + 0.3 * SIZE[1] / 4.0)[seen].max() < STILL


def test_motion_of_the_sky_is_the_rotation_of_the_camera():
    """The camera's translation does not count."""
    renderer = renderer_of(medley(), show=("motion",))
    eye, before = renderer.camera.position, renderer.camera
    step = np.array([5.0, 0, 0])
    renderer.camera = Camera.look_at(eye + step, eye + step + [0.4, -0.2, -3], yfov_deg=50)
    motion, _, depth = motion_of(renderer)
    sky = depth == 0
    directions = rays(renderer.camera, SIZE)
    far = 1e9 * directions
    now, then = (place_of(c, SIZE, far)[0] for c in (renderer.camera, before))
    assert sky.mean() > 0.2 and np.abs(now - then)[sky].min() > 1
    assert (np.abs(motion[..., :2] - (now - then)).max(-1)[sky] > 0.01).mean() < 2 * EDGES
    assert not motion[..., 2][sky].any()


MOVES = {
    "moved": ("left", at(-1.2, 1.1, 0.8, (0.6, 0.9, 0.6), 0.4)),
    "turned and mirrored": ("right", at(1.4, 0.5, 1.2, (0.5, 0.5, -0.5), 1.0)),
    "out of the world's tree": ("block", at(-2.2, 0.1, 2, (-1, 1.2, 1), 0.9)),
}


@pytest.mark.parametrize("name", MOVES)
def test_motion_of_an_instance_is_the_reprojection(name):
    which, after = MOVES[name]
    scene = medley()
    renderer = renderer_of(scene, show=("motion", "position", "depth"))
    instance = named(scene, which)
    back = instance.world_from_local @ np.linalg.inv(after)
    instance.world_from_local = after
    motion, position, _ = motion_of(renderer)
    g = read_surfaces(renderer.graph)
    mine = g.instance == scene.instances.index(instance)
    assert mine.sum() > 100
    was = position @ back[:3, :3].T + back[:3, 3]
    (now, _), (then, distance) = (place_of(renderer.camera, SIZE, p) for p in (position, was))
    assert (np.abs(motion[..., :2] - (now - then)).max(-1)[mine] > 0.01).mean() < 0.01
    assert (np.abs(motion[..., 2] - distance)[mine] > 1e-3).mean() < 0.01
    assert np.abs(motion[..., :2])[~mine].max() < STILL
    # It moves once more, then is still.
    instance.world_from_local = at(0.1, 0.05) @ after
    motion, _, _ = motion_of(renderer)
    mine = read_surfaces(renderer.graph).instance == scene.instances.index(instance)
    assert np.abs(motion[mine][..., :2]).min(0).max() > 0.5 and np.abs(motion[..., :2])[~mine].max() < STILL
    motion, _, _ = motion_of(renderer)
    assert np.abs(motion[..., :2]).max() < STILL


def test_added_and_removed_instances_give_others_no_motion():
    scene = medley()
    renderer = renderer_of(scene, show=("motion",))
    left, right = named(scene, "left"), named(scene, "right")
    for instances in (
        [i for i in scene.instances if i is not left],
        [left, *[i for i in scene.instances if i is not left]],
        [right, *[i for i in scene.instances if i not in (left, right)], left],
        [Instance(left.mesh, right.world_from_local), *[i for i in scene.instances if i is not right]],
    ):
        scene.instances = instances
        motion, _, _ = motion_of(renderer)
        assert np.abs(motion[..., :2]).max() < STILL


def test_a_new_origin_is_no_motion():
    """Positions are relative to the scene's centre. Added instances shift it, and the shift is no motion."""
    scene = medley()
    renderer = renderer_of(scene, show=("motion", "position", "depth"))
    ball = named(scene, "left").mesh
    for place in (at(40, 20, -60), at(-30, 0, -90)):
        origin = renderer._gpu.upload.origin
        scene.instances.append(Instance(ball, place))
        motion, _, _ = motion_of(renderer)
        assert np.abs(renderer._gpu.upload.origin - origin).max() > 5
        assert np.abs(motion[..., :2]).max() < STILL
    # A new origin and a camera move in the same frame.
    before = renderer.camera
    renderer.camera = Camera.look_at((0.8, 2.0, 5.5), (0.1, 1.0, 0), yfov_deg=50)
    scene.instances = scene.instances[:-1]
    motion, position, depth = motion_of(renderer)
    (now, _), (then, distance) = (place_of(camera, SIZE, position) for camera in (renderer.camera, before))
    off = np.abs(motion[..., :2] - (now - then)).max(-1)[depth > 0]
    assert (off > 0.01).mean() < 2 * EDGES
    assert (np.abs(motion[..., 2] - distance)[depth > 0] > 1e-3).mean() < 2 * EDGES


def test_a_new_picture_size_is_no_motion():
    renderer = renderer_of(medley(), show=("motion",))
    for size in ((80, 45), (60, 70)):
        renderer.size = size
        motion, _, _ = motion_of(renderer)
        assert np.abs(motion[..., :2]).max() < STILL


def test_points_behind_the_previous_camera_have_no_motion():
    scene = medley()
    renderer = renderer_of(scene, show=("motion",))
    camera = renderer.camera
    renderer.camera = Camera.look_at((0, 1, 20), (0, 1, 40))
    renderer.step(show=("motion",))
    renderer.camera = camera
    motion, _, _ = motion_of(renderer)
    assert not renderer.graph.read_back("gbuffer/motion").any() and not motion.any()
