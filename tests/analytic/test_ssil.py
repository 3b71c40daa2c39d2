"""Parts of SSIL: samples cover the screen once, votes keep surfaces, light keeps its energy, voxels match the scene."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from helpers.techniques import SCENES, make_settings

from wgpu_gi.camera import Camera
from wgpu_gi.gpu.device import open_device
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, grid, quad
from wgpu_gi.scene.scene import DirectionalLight, Instance, Material, PointLight, Scene
from wgpu_gi.settings import assign
from wgpu_gi.techniques.ssil import voxels

SIZE = (64, 36)


def prepared(scene, *texts, size=SIZE, frames=1, bounces=1, **fields):
    settings = make_settings("ssil", diffuse=True, bounces=bounces, **fields)
    settings.camera.frames = frames
    for text in ("ssil.start=half", "ssil.visibility=voxels", *texts):
        assign(settings, text)
    return Renderer(scene, size=size, settings=settings)


def rendered(scene, *texts, **fields):
    renderer = prepared(scene, *texts, **fields)
    renderer.run(check=True)
    return renderer


def level(renderer, k):
    """Return positions relative to the camera and normals (h, w, 3) of level 0, 1 or 3, and where there are any."""
    name = "senders_3" if k == 3 else ("surfels_0", "receivers_1")[k]
    texels = renderer.graph.read_back(f"ssil/{name}")
    normal = np.stack([texels[..., 3] & 0xFFF, texels[..., 3] >> 12 & 0xFFF], -1).astype(np.float64)
    xy = (normal - 2048) / 2047
    z = 1 - np.abs(xy).sum(-1, keepdims=True)
    folded = (1 - np.abs(xy[..., ::-1])) * np.where(xy >= 0, 1, -1)
    v = np.concatenate([np.where(z < 0, folded, xy), z], -1)
    return (
        np.ascontiguousarray(texels[..., :3]).view(np.float32).astype(np.float64),
        v / np.linalg.norm(v, axis=-1, keepdims=True),
        texels[..., 3] > 0,
    )


def light(renderer, k, size):
    """Return the light (n, 3) of level k of a picture of `size` whose first level is 1."""
    counts = [-(-size[0] >> j) * -(-size[1] >> j) for j in range(1, k + 1)]
    codes = renderer.graph.read_back("ssil/light").reshape(-1, 2).astype(np.int64)[sum(counts[:-1]) : sum(counts)]
    exponent = (codes[:, 1] >> 16 & 255) - 110
    mantissa = np.stack([codes[:, 0] & 0xFFFF, codes[:, 0] >> 16, codes[:, 1] & 0xFFFF], -1)
    return mantissa * 2.0 ** (exponent - 16)[:, None]


def pattern(renderer, samples):
    """Return offsets and areas of the candidates in the disc and in the ring, all patterns together."""
    entries = renderer.graph.read_back("ssil/pattern").reshape(2, 16 * samples, 2).astype(np.uint32)
    offsets = np.ascontiguousarray(entries[..., 0]).view(np.float16).reshape(2, -1, 2).astype(np.float64)
    return offsets, np.ascontiguousarray(entries[..., 1]).view(np.float32) / 16


@pytest.mark.parametrize("place", [(0, 0), (40, 22), (79, 47)])
def test_samples_cover_the_screen_once(place):
    """The areas of all patterns together that lie on the screen add up to it, from any pixel, in the mean of turns."""
    size, levels = (160, 96), 4
    renderer = rendered(SCENES["cornell-point"](), size=size)
    offsets, areas = pattern(renderer, 64)
    covered = []
    for turn, k in product(np.linspace(0, 2 * np.pi, 16, endpoint=False), range(levels)):
        turned = offsets[min(k, 1)] @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        pixels = np.array([-(-size[0] >> (k + 1)), -(-size[1] >> (k + 1))])
        at = np.floor((np.array(place) + 0.5) / 2**k + turned)
        inside = ((at >= 0) & (at < pixels)).all(-1)
        covered.append(areas[min(k, 1)][inside].sum() * 4**k)
    assert np.sum(covered) / 16 == pytest.approx(80 * 48, rel=0.02)


def test_patterns_are_a_disc_and_a_ring():
    renderer = rendered(SCENES["cornell-point"](), "ssil.radius=40")
    offsets, areas = pattern(renderer, 64)
    radii = np.hypot(*offsets.transpose(2, 0, 1))
    assert radii.max() <= 40.1 and radii[1].min() >= 19.9
    assert areas[0].sum() == pytest.approx(math.pi * 40**2, rel=0.01)
    assert areas[1].sum() == pytest.approx(0.75 * math.pi * 40**2, rel=1e-5)


def test_levels_select_surfels_and_never_average():
    """Every surfel of a coarse level is one of the finest, somewhere in its square."""
    renderer = rendered(SCENES["courtyard"]())
    fine, fine_normals, _ = level(renderer, 0)
    for k in (1, 3):
        coarse, normals, some = level(renderer, k)
        for y, x in np.argwhere(some)[::7]:
            square = np.s_[y << k : (y + 1) << k, x << k : (x + 1) << k]
            same = (fine[square] == coarse[y, x]).all(-1)
            assert same.any()
            assert np.allclose(fine_normals[square][same], normals[y, x], atol=1e-3)


def test_the_vote_keeps_large_surfaces():
    """A wall with a single pixel in front of it: the pixel is gone at the next level."""
    wall = quad((-10, -10, -4), (20, 0, 0), (0, 20, 0), matte(0.5))
    width = 2 * 3 * math.tan(0.5) / 36
    speck = quad((0.05 * width, 0.05 * width, -3), (0.9 * width, 0, 0), (0, 0.9 * width, 0), matte(0.5))
    scene = Scene([Instance(wall), Instance(speck)], [PointLight((0, 0, 0))])
    scene.cameras = [Camera.look_at((0, 0, 0), (0, 0, -1), yfov_deg=math.degrees(1.0))]
    renderer = rendered(scene)
    assert (np.abs(level(renderer, 0)[0][..., 2] + 3) < 0.1).sum() == 1
    assert not (np.abs(level(renderer, 1)[0][..., 2] + 3) < 0.1).any()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell-point", "courtyard", "medley"])
def test_all_levels_send_the_same_light(name):
    size = (71, 35)
    renderer = rendered(SCENES[name](), size=size)
    first = light(renderer, 1, size).sum(0)
    assert first.any()
    for k in (2, 3, 4):
        assert np.allclose(light(renderer, k, size).sum(0), first, rtol=1e-4)


def test_light_is_radiance_times_area():
    """A floor that fills the picture, seen straight on: its area follows from the field of view."""
    scene = Scene([Instance(grid(100.0, material=matte(0.5)))], [DirectionalLight((0, -1, 0), math.pi)])
    scene.cameras = [Camera.look_at((0, 2, 0), (0, 0, 0), (0, 0, -1), yfov_deg=90.0)]
    renderer = rendered(scene, size=(64, 64))
    assert np.allclose(light(renderer, 1, (64, 64)).sum(0), 0.5 * 4.0**2, rtol=2e-3)


def test_two_plates_agree_with_the_path_tracer():
    """Two plates with nothing in between: within a few percent of `visible_only`."""
    scene = SCENES["plates"]()
    got = rendered(scene, "ssil.start=full", frames=16).read_back("indirect")
    settings = make_settings("path", diffuse=True, bounces=1, spp=256)
    settings.path.visible_only = True
    truth = Renderer(scene, size=SIZE, settings=settings)
    truth.run(show=("indirect",))
    expected = truth.read_back("indirect")
    assert got.mean() == pytest.approx(expected.mean(), rel=0.06)


def octaves(x):
    """Return a piecewise linear log2 of x plus a constant: the bits of a float as a fixed-point number."""
    return np.asarray(x, np.float32).view(np.int32) / 2.0**23


def slices_of(renderer, voxels, depths):
    """Return the fractional slices of view depths."""
    inverse_near, far = renderer.graph.read_back("voxels/range").view(np.float32).ravel()
    passed = [octaves(1) - octaves(1 / (inverse_near * np.asarray(d, np.float32))) for d in (depths, far)]
    return passed[0] * (voxels - 0.01) / passed[1]


def columns_of(renderer, grid, width):
    """Return the voxels (h, w, bits) of a grid."""
    words = renderer.graph.read_back(grid).ravel().astype("<u4")
    bits = np.unpackbits(words.view(np.uint8), bitorder="little").astype(bool)
    return bits.reshape(-1, width, 256)


@pytest.mark.parametrize("solids", ["auto", "none"])
def test_solid_boxes_are_filled_and_shells_are_hollow(solids):
    """Seen head-on: a solid is filled from its front to its back, a shell only at both."""
    block = box((-0.5, -0.5, -4.0), (0.5, 0.5, -3.0), matte(0.5))
    wall = quad((-10, -10, -6), (20, 0, 0), (0, 20, 0), matte(0.5))
    scene = Scene([Instance(wall), Instance(block)], [PointLight((0, 0, 0))])
    scene.cameras = [Camera.look_at((0, 0, 0), (0, 0, -1), yfov_deg=60.0)]
    renderer = rendered(scene, f"voxels.solids={solids}", "voxels.coarser=0", size=(64, 64))
    columns = columns_of(renderer, "voxels/grid_1", 32)
    column, beside = columns[16, 16], columns[2, 2]
    front, back, end = slices_of(renderer, 256, [3.0, 4.0, 6.0])
    inside = np.arange(256) + 0.5
    filled = (inside > front) & (inside < back)
    if solids == "auto":
        assert (column[: int(end) - 1] == filled[: int(end) - 1]).all()
    else:
        assert column[int(front)] and column[int(back)] and not column[int(front) + 2 : int(back) - 1].any()
    assert not beside[: int(end) - 1].any() and beside[int(end) - 1 :].any()


def test_a_coarse_voxel_is_set_where_its_four_finer_ones_are():
    renderer = rendered(SCENES["medley"](), "voxels.coarser=0", "voxels.finer=0", size=(61, 35))
    fine = columns_of(renderer, "voxels/grid_1", 31)
    coarse = columns_of(renderer, "voxels/grid_2", 16)
    padded = np.pad(fine, ((0, 0), (0, 1), (0, 0)), mode="edge")
    expected = padded[::2, ::2] & padded[1::2, ::2] & padded[::2, 1::2] & padded[1::2, 1::2]
    assert fine.any() and np.array_equal(coarse, expected)


@pytest.mark.parametrize("name", ["cornell", pytest.param("medley", marks=pytest.mark.slow)])
def test_tiles_of_large_triangles_set_the_same_voxels(name, monkeypatch):
    """However few cells make a triangle large, and if the list has room for a few tiles only."""
    device = open_device(large_buffers=True)
    grids, listed = [], []
    for serial_cells, most_tiles in ((1 << 20, 65535), (32, 65535), (1, 7)):
        monkeypatch.setattr(device, "capabilities", replace(device.capabilities, serial_cells=serial_cells))
        monkeypatch.setattr(voxels, "MOST_TILES", most_tiles)
        renderer = prepared(SCENES[name](), "voxels.coarser=0", size=(160, 90))
        renderer.run()
        grids.append(renderer.graph.read_back("voxels/grid_1").ravel())
        listed.append(int(renderer.graph.read_back("voxels/tile_groups").ravel()[0]))
    assert grids[0].any() and all(np.array_equal(grid, grids[0]) for grid in grids[1:])
    assert listed[0] == 0 and listed[1] > 7 and listed[2] == 7


@pytest.mark.parametrize("turn", [0.0, 0.6, 1.1, 1.5])
def test_shells_have_no_gaps(turn):
    """A sheet, turned from facing the camera to almost edge-on: every ray through it meets a voxel of its slices."""
    side = np.array((math.cos(turn), 0, -math.sin(turn)))
    sheet = quad(tuple((0, -1, -4) - side), tuple(2 * side), (0, 2, 0), matte(0.5))
    wall = quad((-10, -10, -8), (20, 0, 0), (0, 20, 0), matte(0.5))
    near = quad((-0.2, -1.2, -2), (0.1, 0, 0), (0, 0.1, 0), matte(0.5))
    scene = Scene([Instance(mesh) for mesh in (sheet, wall, near)], [PointLight((0, 0, 0))])
    scene.cameras = [Camera.look_at((0, 0, 0), (0, 0, -1), yfov_deg=60.0)]
    renderer = rendered(scene, "voxels.coarser=0", size=(64, 64))
    columns = columns_of(renderer, "voxels/grid_1", 32)
    along, up = np.meshgrid(np.linspace(-0.98, 0.98, 301), np.linspace(-0.9, 0.9, 31))
    points = np.array((0, 0, -4)) + along[..., None] * side + up[..., None] * (0, 1, 0)
    depth = -points[..., 2]
    at = ((points[..., :2] * (1, -1) / depth[..., None] / math.tan(math.radians(30)) + 1) * 16).astype(int)
    inside = ((at >= 0) & (at < 32)).all(-1)
    assert inside.mean() > 0.9
    assert columns[at[inside][:, 1], at[inside][:, 0], slices_of(renderer, 256, depth[inside]).astype(int)].all()


@pytest.mark.parametrize("name", ["plates", "cornell-point"])
def test_surfaces_do_not_occlude_themselves(name):
    """With only 16x9 cells, light with voxels is within a few percent of light with rays."""
    light = [
        rendered(SCENES[name](), f"ssil.visibility={kind}", frames=4).read_back("indirect").mean()
        for kind in ("voxels", "exact")
    ]
    assert light[0] == pytest.approx(light[1], rel=0.08)


def test_a_thin_sheet_seen_edge_on_occludes():
    """The sheet stands between two facing walls and is as tall; the camera lies in its plane."""
    walls = [quad((x, -1, -6), (0, 0, 4), (0, 2, 0), matte(0.8)) for x in (-1, 1)]
    sheet = quad((0, -1, -6), (0, 0, 4), (0, 2, 0), matte(0.8))
    found = {}
    for sheets in ((), (sheet,)):
        scene = Scene([Instance(mesh) for mesh in (*walls, *sheets)], [PointLight((-0.5, 0, -3))])
        scene.cameras = [Camera.look_at((0, 0, 0), (0, 0, -1), yfov_deg=60.0)]
        pixels = rendered(scene, frames=4).read_back("indirect")
        found[len(sheets)] = pixels[:, SIZE[0] // 2 + 4 :].mean()
    assert found[1] <= 0.1 * found[0]


def test_unrepresented_pixels_gather_at_full_resolution():
    """At the edges of boxes, upsampling would mix in light of other surfaces; all other pixels keep their values.

    Which pixels are unrepresented changes from frame to frame.
    """
    found, missed = {}, np.zeros((54, 96), int)
    for text in ("ssil.unrepresented=true", "ssil.unrepresented=false", "ssil.start=full"):
        texts = ("ssil.start=quarter", "ssil.visibility=exact", text)
        renderer = prepared(SCENES["cornell-point"](), *texts, size=(96, 54), frames=64)
        while renderer.step(show=("indirect",), check=True):
            if text == "ssil.unrepresented=true":
                count = renderer.graph.read_back("ssil/unrepresented_groups").ravel()[3]
                missed.ravel()[renderer.graph.read_back("ssil/unrepresented").ravel()[:count]] += 1
        found[text] = renderer.read_back("indirect").mean(-1)
    never, missed = missed == 0, missed >= 32
    assert 0.001 < missed.mean() < 0.2
    truth = found["ssil.start=full"]
    off = [
        np.abs(found[f"ssil.unrepresented={on}"] - truth)[missed].mean() / truth[missed].mean()
        for on in ("true", "false")
    ]
    assert off[0] <= 0.6 * off[1], off
    assert np.array_equal(found["ssil.unrepresented=true"][never], found["ssil.unrepresented=false"][never])


@pytest.mark.parametrize(("metallic", "roughness"), [(1.0, 0.1), (1.0, 0.5), (0.0, 0.3), (1.0, 1.0)])
def test_coats_reflect_what_the_path_tracer_reflects(metallic, roughness):
    """A coated floor before a lit wall; directions that leave the picture find nothing in both."""
    floor = quad((-8, 0, 0), (16, 0, 0), (0, 0, 6), Material("", (0.9, 0.6, 0.3, 1.0), metallic, roughness))
    wall = quad((-8, 0, 0), (16, 0, 0), (0, 3, 0), matte(0.8))
    camera = Camera.look_at((0, 1.7, 4.5), (0, 0.9, 0), (0, 1, 0), 75)
    scene = Scene(
        [Instance(floor), Instance(wall)], [DirectionalLight((0, 0, -1), 3.0, (1.0, 0.5, 0.25))], None, [camera]
    )
    found = {}
    for gi, frames, samples in (("ssil", 64, 1), ("path", 1, 512)):
        settings = make_settings(gi, bounces=1, spp=samples)
        settings.camera.frames, settings.path.visible_only = frames, True
        assign(settings, "ssil.start=full")
        renderer = Renderer(scene, size=(32, 24), settings=settings)
        renderer.run(check=True)
        found[gi] = renderer.read_back("indirect").astype(np.float64)
        _, y, z = np.moveaxis(renderer.read_back("position"), -1, 0)
    away = (np.abs(y) < 1e-3) & (z > 0.8) & (z < 3.0)
    off = found["ssil"][away].mean(0) / found["path"][away].mean(0) - 1
    assert away.sum() > 100
    # A matte floor has +0.019 in a picture as small as this.
    assert np.abs(off).max() <= 0.05
