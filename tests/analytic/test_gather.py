"""Gathering from VPLs against closed forms; culling and interleaving must not change the picture."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.vpls import Gatherer, vpl_texels
from mitsuba_scene import camera_rays, pixel_centres

from wgpu_gi.camera import Camera
from wgpu_gi.gpu.wgsl.load import load
from wgpu_gi.scene.built_in.scenes import closed_box, courtyard, matte, plane_point, sphere_light
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import DirectionalLight, Instance, Material, Scene

SIZE = (70, 45)  # no multiple of any tile
BOUND_SHARE = float(load("many_light/gather/gather.wgsl").constants["BOUND_SHARE"])  # of a VPL's area


def corner(distance, half_width, height):
    """Return the form factor of a point of a floor to a wall, `distance` away and `half_width` to both sides of it.

    Twice Howell's configuration of a plane element to a rectangle in a plane at 90 degrees, above the element's.
    """
    x, y = height / half_width, distance / half_width
    root = np.hypot(x, y)
    return (np.arctan(1 / y) - y / root * np.arctan(1 / root)) / np.pi


def random_vpls(count, seed=0, low=(-2, 0, -2), high=(2, 2, 2)):
    """VPLs at random places, every fourth black."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    flux = rng.random((count, 3)) * (np.arange(count) % 4 > 0)[:, None]
    return vpl_texels(rng.uniform(low, high, (count, 3)), normal, flux, rng.uniform(0.001, 0.1, count))


def floor_points(size, height=4.0):
    """Positions that `plane_point` shows, (h, w, 3): its camera is orthographic, 4 m high."""
    w, h = size
    x = ((np.arange(w) + 0.5) / w * 2 - 1) * height / 2 * w / h
    z = ((np.arange(h) + 0.5) / h * 2 - 1) * height / 2
    return np.stack(np.broadcast_arrays(x[None, :], 0.0, z[:, None]), -1)


@pytest.mark.parametrize("clamping", ["disc", "none"])
def test_one_vpl_over_a_floor_has_its_closed_form(clamping):
    """L = rho / pi Phi / pi cos cos / (d^2 + share A / pi); without clamping, A = 0."""
    gatherer = Gatherer(plane_point(albedo=0.5), SIZE)
    place, normal, area = np.array((0.4, 0.7, -0.3)), np.array((0.6, -0.8, 0.0)), 0.3
    flux = np.array((1.0, 2.0, 4.0))
    origin = gatherer.upload.origin
    table = vpl_texels([place - origin], [normal], [flux], [area])
    way = floor_points(SIZE) - place
    squared = (way**2).sum(-1)
    cosines = np.maximum(way @ normal, 0) * -way[..., 1] / squared
    bound = BOUND_SHARE * area / np.pi if clamping == "disc" else 0.0
    expected = 0.5 / np.pi**2 * (cosines / (squared + bound))[..., None] * flux
    got = gatherer(table, 1, interleave=1, clamping=clamping)
    # Colours of the G-buffer are square roots of 10 bits, normals 16 bits.
    assert np.allclose(got, expected, rtol=3e-3, atol=1e-4 * expected.max())


@pytest.mark.parametrize("scene", [plane_point, courtyard])
@pytest.mark.parametrize("interleave", [1, 3, 4, 8])
def test_culling_keeps_pictures_bit_for_bit(scene, interleave):
    gatherer = Gatherer(scene(), SIZE)
    low, high = gatherer.upload.box
    table = random_vpls(200, low=low, high=high + 0.1)
    pictures = [gatherer(table, 200, interleave=interleave, culling=c) for c in ("none", "tiled", "clustered")]
    assert pictures[0].any()
    assert np.array_equal(pictures[0], pictures[1])
    assert np.array_equal(pictures[0], pictures[2])


@pytest.mark.parametrize("interleave", [2, 4, 8])
def test_blur_removes_the_interleaving_pattern_on_a_plane(interleave):
    """One distant VPL per interleaving class: every pixel of a flat floor, borders included, gets their mean."""
    count = interleave**2
    rng = np.random.default_rng(1)
    far = 1e4
    flux = rng.random((count, 3))
    table = vpl_texels([(0, far, 0)] * count, [(0, -1, 0)] * count, flux, [0.1] * count)
    perspective = Camera.look_at((0, 1, 2), (0, 0, 1), yfov_deg=40)
    for camera in (None, perspective):
        gatherer = Gatherer(plane_point(size=100.0), SIZE, camera)
        interleaved, together = (gatherer(table, count, interleave=n) for n in (interleave, 1))
        raw = gatherer(table, count, interleave=interleave, blur=False)
        assert np.abs(raw / together - 1).max() > 0.1
        assert np.allclose(interleaved, together, rtol=2e-5)


@pytest.mark.parametrize("perspective", [False, True])
def test_light_of_half_resolution_is_that_of_all_pixels_up_to_its_curvature(perspective):
    """Bilinear weights are exact for light that is linear between pixels, and keep the mean."""
    camera = Camera.look_at((0, 3, 2), (0, 0, 0), yfov_deg=40) if perspective else None
    gatherer = Gatherer(plane_point(size=20.0), SIZE, camera)
    table = vpl_texels([(0.3, 3.0, -0.2)], [(0, -1, 0)], [(1.0, 2.0, 4.0)], [0.1])
    full, half = (gatherer(table, 1, interleave=1, blur=False, stride=stride) for stride in (1, 2))
    assert np.allclose(half[::2, ::2], full[::2, ::2], rtol=1e-3)
    half, full = half[:-1, :-1], full[:-1, :-1]  # an even number of pixels ends beyond the grid
    assert np.allclose(half, full, rtol=5e-3)
    assert abs(half.mean() / full.mean() - 1) < 1e-3


def test_half_resolution_keeps_edges_and_light():
    """Edges between surfaces stay sharp and their light stays; thin features take the light of other surfaces."""
    gatherer = Gatherer(courtyard(), SIZE)
    low, high = gatherer.upload.box
    table = vpl_texels([(low + high) / 2 + (0, 3, 0)], [(0, -1, 0)], [(1.0, 1.0, 1.0)], [1.0])
    full, half = (gatherer(table, 1, interleave=1, blur=False, stride=stride) for stride in (1, 2))
    assert abs(half.mean() / full.mean() - 1) < 0.02
    nearest = full[::2, ::2].repeat(2, 0).repeat(2, 1)[: SIZE[1], : SIZE[0]]
    blocky, kept = (
        (np.abs(x - full).max(-1) / (full.max(-1) + 0.1 * full.mean()) > 0.1).mean() for x in (nearest, half)
    )
    assert kept < 0.33 * blocky


def test_blur_does_not_leak_across_depth_edges():
    """A VPL between the planes of two squares lights only the far one; the blur leaks nothing to the near one."""
    near = quad((-2, 0, 0), (2, 0, 0), (0, 2, 0), matte(0.5))
    far = quad((0, 0, -0.3), (2, 0, 0), (0, 2, 0), matte(0.5))
    gatherer = Gatherer(Scene([Instance(near), Instance(far)]), (64, 36), Camera.look_at((0, 1, 3), (0, 1, 0)))
    place = np.array((0.1, 1.0, -0.15)) - gatherer.upload.origin
    table = vpl_texels([place] * 16, [(0, 0, -1)] * 16, [(1 / 16,) * 3] * 16, [0.01] * 16)
    sharp, blurred = (gatherer(table, 16, interleave=n) for n in (1, 4))
    lit = sharp.max(-1) > 0
    assert 0.1 < lit.mean() < 0.5
    assert np.array_equal(blurred.max(-1) > 0, lit)


@pytest.mark.parametrize("scene", [closed_box, sphere_light])
def test_convex_rooms_have_no_shadows(scene):
    room = scene()
    gatherer = Gatherer(room, (48, 27))
    mesh = room.instances[0].mesh
    corners = mesh.positions[mesh.triangles].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    count = min(len(corners), 64)
    chosen = np.random.default_rng(0).permutation(len(corners))[:count]
    places = corners[chosen].mean(1) - gatherer.upload.origin
    table = vpl_texels(places, normals[chosen], np.ones((count, 3)), np.full(count, 0.1))
    exact, free = (gatherer(table, count, interleave=2, visibility=v) for v in ("exact", "none"))
    assert free.min() > 0
    assert np.abs(exact - free).sum() < 1e-4 * free.sum()


def test_exact_visibility_finds_an_occluder():
    """A board between a VPL and a floor: its shadow is the board's central projection."""
    scene = plane_point()
    scene.instances.append(Instance(quad((-0.5, 0.5, -0.5), (0, 0, 1), (1, 0, 0), matte(0.5))))
    # The camera lies below the board, which would hide a part of the floor from above.
    camera = Camera.look_at((0, 0.4, 1.9), (0, 0, 0), yfov_deg=50)
    gatherer = Gatherer(scene, SIZE, camera)
    table = vpl_texels([(0, 1, 0) - gatherer.upload.origin], [(0, -1, 0)], [(1, 1, 1)], [0.001])
    lit = gatherer(table, 1, interleave=1)
    exact = gatherer(table, 1, interleave=1, visibility="exact")
    hit = exact.max(-1) > 0
    assert np.array_equal(exact[hit], lit[hit])
    assert 0.2 < hit[lit.max(-1) > 0].mean() < 0.9


def test_a_vpl_at_a_pixel_is_finite():
    gatherer = Gatherer(plane_point(), (9, 9))
    points = floor_points((9, 9)).reshape(-1, 3) - gatherer.upload.origin
    up, down = (np.tile((0, y, 0), (81, 1)) for y in (1, -1))
    for clamping in ("disc", "none"):
        for normal in (up, down):
            table = vpl_texels(points, normal, np.ones((81, 3)), np.zeros(81))
            assert np.isfinite(gatherer(table, 81, interleave=1, clamping=clamping)).all()


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.5])
def test_a_mirrored_vpl_has_at_most_the_radiance_of_its_disc(roughness):
    """A metal floor below a VPL: no pixel shines more than the disc, Phi / (pi A), does."""
    metal = Material(base_color=(1, 1, 1, 1), metallic=1.0, roughness=roughness)
    scene = plane_point()
    scene.instances = [Instance(quad((-4, 0, 4), (8, 0, 0), (0, 0, -8), metal))]
    gatherer = Gatherer(scene, SIZE, Camera.look_at((0, 1, 2), (0, 0, 0)), diffuse=False)
    table = vpl_texels([(0, 1, -2) - gatherer.upload.origin], [(0, -(0.5**0.5), 0.5**0.5)], [(1, 1, 1)], [0.02])
    got = gatherer(table, 1, interleave=1)
    disc = 1 / (np.pi * 0.02)
    assert got.max() <= 1.01 * disc
    # The highlight of a mirror is about as wide as a pixel.
    assert got.max() > {0.0: 0.1, 0.1: 0.1, 0.5: 0.001}[roughness] * disc


def test_interleaving_keeps_the_mean_of_a_coat():
    scene = plane_point()
    scene.instances[0].mesh.materials[0] = Material(base_color=(0.5, 0.4, 0.3, 1), metallic=0.0, roughness=0.6)
    gatherer = Gatherer(scene, SIZE, diffuse=False)
    table = random_vpls(64, low=(-1, 1, -1))
    interleaved, together = (gatherer(table, 64, interleave=n) for n in (4, 1))
    assert np.allclose(interleaved.mean((0, 1)), together.mean((0, 1)), rtol=0.05)


@pytest.mark.parametrize("visibility", ["none", "sampled"])
@pytest.mark.parametrize("height", [None, 1.6])
def test_compensation_restores_the_light_of_a_corner(visibility, height):
    """The irradiance of a floor before a wall of radiosity 1 is the form factor, with VPLs of large areas."""
    size = (160, 90)
    floor = quad((-2, 0, 0), (0, 0, 2), (4, 0, 0), matte(0.5))
    wall = quad((-2, 0, 0), (4, 0, 0), (0, 2, 0), matte(0.5))
    camera = Camera.look_at((0, 1.6, 1.6), (0, 0, 0), yfov_deg=40)
    camera.orthographic_height = height
    # Light along the floor gives the wall a radiosity of 1.
    sun = DirectionalLight((0, 0, -1), 2.0)
    gatherer = Gatherer(Scene([Instance(floor), Instance(wall)], [sun]), size, camera)
    starts, ways = (v.reshape(90, 160, 3) for v in camera_rays(camera, size, pixel_centres(size)))
    points = starts + ways * np.minimum(-starts[..., 1] / ways[..., 1], -starts[..., 2] / ways[..., 2])[..., None]
    on_floor = points[..., 1] < 1e-6
    side, area = 0.05, 0.4  # the bound is about 13 pixels long
    x, y = (v.ravel() for v in np.meshgrid(np.arange(80) * side - 1.975, np.arange(40) * side + 0.025))
    table = vpl_texels(
        np.stack([x, y, 0 * x], -1) - gatherer.upload.origin,
        np.tile((0.0, 0.0, 1.0), (len(x), 1)),
        np.full((len(x), 3), side**2),
        np.full(len(x), area),
    )
    # Pixels nearer to the wall than the bound, in the middle.
    near = on_floor & (points[..., 2] < np.sqrt(BOUND_SHARE * area / np.pi)) & (np.abs(points[..., 0]) < 0.8)
    expected = 0.5 / np.pi * corner(points[near, 2], 2.0, 2.0)
    lost, found = (
        gatherer(table, len(x), interleave=1, compensated=on, visibility=visibility)[near, 0].sum() / expected.sum()
        for on in (False, True)
    )
    assert lost < 0.6
    assert found == pytest.approx(1.0, abs=0.03)
