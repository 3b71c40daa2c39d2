"""Gathering with few rays to VPLs, sampled by their light: unbiased against rays to all VPLs."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.vpls import Gatherer, vpl_texels

from wgpu_gi.camera import Camera
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.built_in.scenes import corridor, courtyard, matte
from wgpu_gi.scene.built_in.shapes import box, quad, sphere
from wgpu_gi.scene.scene import Instance, Material, PointLight, Scene
from wgpu_gi.settings import assign

SIZE = (32, 18)


def room(glossy=True):
    """A closed room with a board that hides much of it, and a ball, coated if `glossy`."""
    walls = box((-2, 0, -2), (2, 3, 2), matte((0.7, 0.6, 0.5)), inward=True)
    board = quad((-1.2, 0.0, 0.2), (1.6, 0, 0), (0, 2, 0), matte((0.3, 0.5, 0.7)))
    shiny = Material(base_color=(0.8, 0.6, 0.3, 1.0), metallic=0.7, roughness=0.5)
    ball = sphere((0.8, 0.6, 0.9), 0.6, material=shiny if glossy else matte(0.5))
    scene = Scene([Instance(walls), Instance(board), Instance(ball)], [PointLight((-0.5, 2.4, -0.8), 20.0)])
    scene.cameras = [Camera.look_at((1.6, 1.5, 1.9), (-0.4, 1.0, -0.4), yfov_deg=70)]
    return scene


def rendered(scene, frames=1, *texts, bounces=None, size=SIZE):
    settings = Settings(gi="many-light", bounces=bounces, camera=CameraSettings(jitter=False, frames=frames))
    settings.vpl.count, settings.vpl.paths, settings.rsm.texels = 256, 1024, 4096
    # The blur is off, because its weights depend on noise.
    for text in ("denoise.radius=1", "gather.interleave=2", *texts):
        assign(settings, text)
    renderer = Renderer(scene, size=size, settings=settings)
    renderer.run(show=("indirect",), check=True)
    return renderer.read_back("indirect").astype(np.float64)


@pytest.mark.slow
@pytest.mark.parametrize("adaptive", ["false", "true"])
@pytest.mark.parametrize("glossy", [False, True])
def test_sampled_visibility_is_unbiased(glossy, adaptive):
    """The mean over frames is that of rays to all VPLs, in all parts of the picture and all channels."""
    scene = room(glossy)
    sampled, exact = (
        rendered(scene, 128, f"gather.visibility={v}", f"gather.adaptive={adaptive}") for v in ("sampled", "exact")
    )
    assert sampled.mean((0, 1)) == pytest.approx(exact.mean((0, 1)), rel=0.01)
    parts = [p.reshape(3, 6, 4, 8, 3).mean((1, 3)) for p in (sampled, exact)]
    assert parts[0] == pytest.approx(parts[1], rel=0.05)


@pytest.mark.slow
def test_more_rays_have_less_noise():
    scene = room()
    exact = rendered(scene, 1, "gather.visibility=exact")
    errors = [((rendered(scene, 1, f"gather.rays={rays}") - exact) ** 2).mean() for rays in (1, 2, 4, 8)]
    assert errors[0] > 1.5 * errors[1] > 2.25 * errors[2] > 3.3 * errors[3] > 0


def still_picture(scene, frames=4, size=(64, 36)):
    """Return a renderer after a still picture with adaptive rays, and the rays per pixel of tiles of 16 x 8 pixels."""
    settings = Settings(gi="many-light", bounces=1, camera=CameraSettings(jitter=False, frames=frames))
    settings.vpl.count, settings.rsm.texels = 256, 4096
    settings.gather.interleave, settings.gather.adaptive = 2, True
    renderer = Renderer(scene, size=size, settings=settings)
    renderer.run(show=("indirect",), check=True)
    return renderer, renderer.graph.read_back("gather/ray_counts")[..., 0]


def test_rays_go_where_visibility_is_noisy():
    """An open floor takes one ray per pixel; the shadow of a board's light takes more than the rest of a room."""
    corner = [quad((-2, 0, -2), (4, 0, 0), (0, 0, -4), matte(0.5)), quad((-2, 0, -6), (4, 0, 0), (0, 4, 0), matte(0.8))]
    floor = Scene([Instance(mesh) for mesh in corner], [PointLight((0.0, 1.0, -4.0), 20.0)])
    floor.cameras = [Camera.look_at((0, 2.0, 0.5), (0, 0.5, -5), yfov_deg=60)]
    open_scene = still_picture(floor)[1]
    hidden = still_picture(room(glossy=False))[1]
    lit = hidden[:5]  # the last rows of tiles lie below the picture
    assert open_scene.max() == 1
    assert 1 <= lit.min() < lit.max() <= 8 and np.median(lit) > 1


@pytest.mark.slow
def test_adaptive_rays_lower_the_noise():
    scene, choices = room(glossy=False), ("visibility=exact", "adaptive=false", "adaptive=true")
    exact, one, adaptive = (rendered(scene, 16, f"gather.{choice}", bounces=1, size=(64, 36)) for choice in choices)
    assert ((adaptive - exact) ** 2).mean() < 0.7 * ((one - exact) ** 2).mean()


def test_counts_of_rays_do_not_outlive_the_still_picture():
    """After a move and back, and after a change of light by a power of two, the picture is the same, bit for bit."""
    scene = room()
    renderer, counts = still_picture(scene)
    first, camera = renderer.read_back("indirect"), renderer.camera
    renderer.camera = Camera.look_at((-1.6, 1.5, 1.9), (0.4, 1.0, -0.4), yfov_deg=70)
    renderer.run(show=("indirect",))
    renderer.camera = camera
    renderer.run(show=("indirect",))
    assert np.array_equal(renderer.read_back("indirect"), first)
    scene.lights[0] = PointLight(scene.lights[0].position, scene.lights[0].intensity * 2.0**-40)
    renderer.run(show=("indirect",))
    assert np.array_equal(renderer.read_back("indirect") * 2.0**40, first)
    assert np.array_equal(renderer.graph.read_back("gather/ray_counts")[..., 0], counts)


def test_single_frames_take_the_same_rays_with_and_without_adaptive():
    scene = room()
    first, second = (rendered(scene, 1, f"gather.adaptive={v}") for v in ("false", "true"))
    assert np.array_equal(first, second)


@pytest.mark.parametrize("scene", [room, courtyard])
@pytest.mark.parametrize("interleave", [1, 4])
def test_culling_keeps_pictures_bit_for_bit(scene, interleave):
    gatherer = Gatherer(scene(), (70, 45), diffuse=False)
    low, high = gatherer.upload.box
    rng = np.random.default_rng(3)
    normal = rng.normal(size=(200, 3))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    table = vpl_texels(rng.uniform(low, high, (200, 3)), normal, rng.random((200, 3)), rng.uniform(0.001, 0.1, 200))
    pictures = [
        gatherer(table, 200, interleave=interleave, culling=culling, visibility="sampled")
        for culling in ("none", "tiled", "clustered")
    ]
    assert pictures[0].any()
    assert np.array_equal(pictures[0], pictures[1])
    assert np.array_equal(pictures[0], pictures[2])


@pytest.mark.parametrize("thickness", [0.0, 0.01])
def test_no_light_comes_through_a_closed_wall(thickness):
    """A lamp in one of two rooms: the other is exactly black, or black up to rounding if the wall is a sheet."""
    walls = box((-2, 0, -2), (2, 3, 2), matte(0.7), inward=True)
    wall = quad((-2, 0, 0), (4, 0, 0), (0, 3, 0), matte(0.7))
    if thickness > 0:
        wall = box((-2.1, -0.1, 0), (2.1, 3.1, thickness), matte(0.7))
    scene = Scene([Instance(walls), Instance(wall)], [PointLight((0.3, 1.5, -0.1), 50.0)])
    scene.cameras = [Camera.look_at((1.5, 2.0, 1.8), (-0.3, 1.0, 0), yfov_deg=80)]
    assert rendered(scene, 8, "denoise.radius=4").max() <= (0.0 if thickness > 0 else 1e-9)


def test_no_light_leaves_a_sealed_chamber():
    assert not rendered(corridor(lamp=0.0), 4).any()


def test_sampled_visibility_is_deterministic():
    first, second = (rendered(room(), 3) for _ in range(2))
    assert first.any() and np.array_equal(first, second)
