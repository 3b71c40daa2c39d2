"""Imperfect shadow maps against closed forms: a plane casts no shadow on itself, a screen hides what is behind it."""

from __future__ import annotations

import numpy as np
import pytest
import wgpu

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.gpu.device import open_device
from wgpu_gi.gpu.graph import Graph
from wgpu_gi.measure.wgsl_evaluator import Evaluator
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import Instance, Scene
from wgpu_gi.techniques.many_light import ism
from wgpu_gi.techniques.many_light.ism import IsmSettings, declare_ism
from wgpu_gi.techniques.many_light.points import Points
from wgpu_gi.techniques.many_light.vpl import TABLE_WIDTH, Vpls
from wgpu_gi.techniques.shared.scene_inputs import share_scene
from wgpu_gi.upload.scene_upload import SceneUpload

SLOTS = 16
SHADER = """
#import "many_light/ism/lookup.wgsl"
@group(1) @binding(20) var<storage, read> receivers: array<vec4f>;
@group(1) @binding(21) var<storage, read_write> seen: array<f32>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let count = arrayLength(&receivers) / 2u;
    if (id.x < count) {
        let position = receivers[2u * id.x].xyz;
        let normal = receivers[2u * id.x + 1u].xyz;
        seen[id.y * count + id.x] = vpl_visibility(id.y, load_vpl(id.y), position, normal);
    }
}
"""


def octahedral_code(normals: np.ndarray) -> np.ndarray:
    """Unit vectors as two snorm16 in a word."""
    p = normals[:, :2] / np.abs(normals).sum(1, keepdims=True)
    folded = (1 - np.abs(p[:, ::-1])) * np.where(p >= 0, 1, -1)
    code = np.where(normals[:, 2:] < 0, folded, p)
    return np.round(np.clip(code, -1, 1) * 32767).astype(np.int16).view(np.uint32).ravel()


def visibility(tmp_path, scene, lights, normals, receivers, facing, on_surfaces=None, **settings):
    """Return the visibility that the maps give, (lights, receivers). All positions are in world space."""
    (tmp_path / "seen.wgsl").write_text(SHADER)
    device = open_device()
    upload = SceneUpload(device)
    upload.update(scene)
    table = np.zeros((TABLE_WIDTH, 4), np.uint32)
    used = 2 * len(lights)
    table[0:used:2, :3] = (lights - upload.origin).astype(np.float32).view(np.uint32)
    table[0:used:2, 3] = octahedral_code(normals)
    table[1:used:2] = np.ones(4, np.float32).view(np.uint32)
    usage = wgpu.TextureUsage.COPY_DST | wgpu.TextureUsage.STORAGE_BINDING
    texture = device.gpu.create_texture(size=(TABLE_WIDTH, 1, 1), format="rgba32uint", usage=usage)
    layout = {"bytes_per_row": 16 * TABLE_WIDTH}
    device.gpu.queue.write_texture({"texture": texture}, table, layout, (TABLE_WIDTH, 1, 1))
    given = np.zeros((len(receivers), 8), np.float32)
    given[:, :3], given[:, 4:7] = receivers - upload.origin, facing
    surface = np.zeros((1, 8), np.uint32) if on_surfaces is None else on_surfaces(upload.origin)
    storage = wgpu.BufferUsage.STORAGE
    graph = Graph(device, shader_root=tmp_path)
    graph.begin()
    graph.uniform("scene", upload.info)
    graph.uniform("view", upload.view(Camera(), (1, 1), False))
    vpls = Vpls(graph.share("vpls", texture), len(lights))
    shared = graph.share("points", device.gpu.create_buffer_with_data(data=surface, usage=storage))
    maps = declare_ism(graph, IsmSettings(**settings), share_scene(graph, upload), Points(shared, len(surface)), vpls)
    seen = graph.buffer("seen", count=len(lights) * len(receivers))
    reads = {"receivers": graph.share("given", device.gpu.create_buffer_with_data(data=given, usage=storage))}
    graph.compute(
        "seen",
        "seen.wgsl",
        over=(len(receivers), len(lights)),
        reads={**reads, "vpl_table": vpls.table, **maps.reads},
        writes={"seen": seen},
        constants={**maps.constants, **vpls.constants},
    )
    graph.compile([seen])
    graph.run(check=True)
    result = graph.read_back(seen).reshape(len(lights), len(receivers))
    graph.release()
    return result


def screen_scene() -> Scene:
    """A floor of 8 x 8 m and a screen of 2 x 2 m, 1 m above it; lights look down from 2 m."""
    floor = quad((-4, 0, -4), (0, 0, 8), (8, 0, 0), matte(0.5))
    screen = quad((-1, 1, -1), (0, 0, 2), (2, 0, 0), matte(0.5))
    return Scene([Instance(floor), Instance(screen)])


def placed(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Lights above the screen, and receivers on the floor."""
    rng = np.random.default_rng(seed)
    lights = np.column_stack([rng.uniform(-1, 1, SLOTS), np.full(SLOTS, 2.0), rng.uniform(-1, 1, SLOTS)])
    floor = np.column_stack([rng.uniform(-3.9, 3.9, 400), np.zeros(400), rng.uniform(-3.9, 3.9, 400)])
    return lights, floor


def through_screen(lights: np.ndarray, receivers: np.ndarray) -> np.ndarray:
    """How far inside the screen the lines from lights to receivers pass half-way, metres; negative: outside."""
    half = 0.5 * (lights[:, None] + receivers[None])
    return 1 - np.maximum(np.abs(half[..., 0]), np.abs(half[..., 2]))


DOWN, UP = np.tile((0.0, -1.0, 0.0), (SLOTS, 1)), (0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("settings", "leak"),
    [
        ({}, 0.005),
        ({"resolution": 128}, 0.005),
        ({"ray_spacing": 4}, 0.003),
        ({"resolution": 32, "ray_spacing": 4}, 0.005),
    ],
)
def test_a_screen_hides_what_is_behind_it(tmp_path, settings, leak):
    lights, floor = placed()
    got = visibility(tmp_path, screen_scene(), lights, DOWN, floor, UP, **settings)
    inside = through_screen(lights, floor)
    # A corner of the screen may fall between rays: a cell spans 2.5 * cell / resolution on average, 1 to 2 m away.
    margin = 1.5 * 2.5 * settings.get("ray_spacing", 8) / settings.get("resolution", 64)
    assert np.isin(got, (0, 1)).all()
    assert got[inside > margin].mean() < leak
    assert got[inside < -margin].mean() > 0.99


def test_refinement_finds_the_edges_of_a_screen(tmp_path):
    """Errors further than two texels from its edge; without refinement, rays of coarse cells miss the corners."""
    lights, floor = placed()
    inside = through_screen(lights, floor)
    wrong = []
    for refine in (False, True):
        got = visibility(tmp_path, screen_scene(), lights, DOWN, floor, UP, ray_spacing=16, refine=refine)
        wrong.append(got[inside > 2 * 2.5 / 64].mean() + 1 - got[inside < -2 * 2.5 / 64].mean())
    assert wrong[1] < 0.5 * wrong[0]
    assert wrong[1] < 0.05


def test_maps_refined_in_several_ranges_are_the_same(tmp_path, monkeypatch):
    """Several ranges are needed where one dispatch or buffer cannot hold the cells of all maps."""
    lights, floor = placed()
    together = visibility(tmp_path, screen_scene(), lights, DOWN, floor, UP)
    # Five maps of 64 cells of 4 rows each.
    monkeypatch.setattr(ism, "MAX_GROUPS", 5 * 64 * 4 // ism.REFINE_GROUP)
    apart = visibility(tmp_path, screen_scene(), lights, DOWN, floor, UP)
    assert np.array_equal(together, apart)


@pytest.mark.parametrize(("cell", "leak"), [(4, 0.07), (8, 0.1)])
def test_pull_push_closes_the_screen(tmp_path, cell, leak):
    """Without splats: each texel takes the plane of the nearest ray, so errors are within half of their spacing."""
    lights, floor = placed()
    got = visibility(tmp_path, screen_scene(), lights, DOWN, floor, UP, mode="pull-push", ray_spacing=cell, points=0)
    inside = through_screen(lights, floor)
    margin = 2.5 * cell / 64
    assert got[inside > margin].mean() < leak
    assert got[inside < -margin].mean() > 1 - leak


@pytest.mark.parametrize(
    ("scale", "least", "settings"),
    [(1e-3, 0.997, {}), (1.0, 0.997, {}), (1e3, 0.997, {}), (1.0, 0.99, {"mode": "pull-push", "points": 0})],
)
def test_a_plane_does_not_shadow_itself(tmp_path, scale, least, settings):
    """Lights of all directions over an unoccluded floor."""
    rng = np.random.default_rng(1)
    floor = scale * np.column_stack([rng.uniform(-3.9, 3.9, 400), np.zeros(400), rng.uniform(-3.9, 3.9, 400)])
    lights = scale * np.column_stack([rng.uniform(-3, 3, SLOTS), rng.uniform(0.2, 3, SLOTS), rng.uniform(-3, 3, SLOTS)])
    normals = rng.normal(size=(SLOTS, 3))
    normals[:, 1] = -np.abs(normals[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    scene = Scene([Instance(quad((-4 * scale, 0, -4 * scale), (0, 0, 8 * scale), (8 * scale, 0, 0), matte(0.5)))])
    got = visibility(tmp_path, scene, lights, normals, floor, UP, **settings)
    between = floor[None] - lights[:, None]
    above = (between * normals[:, None]).sum(-1) > 0.05 * np.linalg.norm(between, axis=-1)
    # At the floor's edge, a texel's centre may see past it.
    assert got[above].mean() > least


def test_splats_find_occluders_that_rays_miss(tmp_path):
    """A strip between the rays of coarse cells, splatted as points on it."""
    floor = quad((-4, 0, -4), (0, 0, 8), (8, 0, 0), matte(0.5))
    strip = quad((0.1, 1, -3), (0, 0, 6), (0.08, 0, 0), matte(0.5))
    rng = np.random.default_rng(2)
    on_strip = np.column_stack([rng.uniform(0.1, 0.18, 4096), np.ones(4096), rng.uniform(-3, 3, 4096)])

    def points(origin):
        data = np.zeros((4096, 8), np.uint32)
        data[:, :3] = (on_strip - origin).astype(np.float32).view(np.uint32)
        data[:, 3] = octahedral_code(np.tile((0.0, 1.0, 0.0), (4096, 1)))
        data[:, 4] = np.full(4096, np.sqrt(0.08 * 6 / 4096 / np.pi), np.float32).view(np.uint32)
        data[:, 5] = 0xFF000000  # black, not open
        return data

    lights = np.tile((0.0, 2.0, 0.0), (SLOTS, 1))
    behind = np.column_stack([np.full(200, 0.28), np.zeros(200), rng.uniform(-2, 2, 200)])
    scene = Scene([Instance(floor), Instance(strip)])
    got = [
        visibility(tmp_path, scene, lights, DOWN, behind, UP, points, points=count, ray_spacing=16).mean()
        for count in (0, 512)
    ]
    assert got[1] < 0.1 < got[0]


def test_sizes_must_be_powers_of_two(tmp_path):
    lights, floor = placed()
    for settings in ({"resolution": 48}, {"ray_spacing": 3}):
        with pytest.raises(GiError, match="power of two"):
            visibility(tmp_path, screen_scene(), lights, DOWN, floor, UP, **settings)


def test_hemisphere_mapping_round_trips(tmp_path):
    rng = np.random.default_rng(3)
    v = rng.normal(size=(500, 3))
    v[:, 2] = np.abs(v[:, 2])
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    back = "hemisphere_decode(hemisphere_encode(v(i)))"
    got = Evaluator(tmp_path)("many_light/ism/map.wgsl", back, "vec3f", v=v)
    assert np.allclose(got, v, atol=1e-5)


def test_a_texel_stores_the_distance_of_a_plane(tmp_path):
    """Decoded distances at the corners of texels against those of the plane."""
    rng = np.random.default_rng(4)
    place = rng.uniform(-0.6, 0.6, (500, 2))
    normal = rng.normal(size=(500, 3)) * 0.3 + (0, 0, 1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    off = "vec2f(0.5, -0.5)"
    texel = "plane_texel(hemisphere_decode(place(i)), plane(i))"
    at_corner = f"hemisphere_decode(place(i) + {off} * (2.0 / 64.0))"
    got = Evaluator(tmp_path)(
        "many_light/ism/map.wgsl",
        f"vec2f(texel_code({texel}, {off}), distance_code(1.0 / pow(dot({at_corner}, plane(i)), 2.0)))",
        "vec2f",
        place=place,
        plane=normal * 2,
        scene=screen_scene(),
    )
    squared = np.sqrt(2 - (place**2).sum(1))
    directions = np.column_stack([place * squared[:, None], 1 - (place**2).sum(1)])
    seen = (directions * normal).sum(1) > 0.3
    # 1 % of the distance: 60 codes.
    assert seen.sum() > 300
    assert np.abs(got[seen, 0] - got[seen, 1]).max() < 60
