"""Direct light of emitters by rays: closed forms, convergence to the path tracer, invariances of the mean."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from helpers.form_factors import polygon_form_factor
from helpers.pictures import looking, moved, shoot
from helpers.techniques import swap_channels

from wgpu_gi.camera import Camera
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, grid, quad, sphere
from wgpu_gi.scene.scene import Image, Instance, Material, Mesh, Scene, Texture
from wgpu_gi.techniques.deferred.direct import DirectSettings

ALBEDO = (700 / 1023) ** 2  # exact in the G-buffer, which stores square roots in 10 bits
SIZE = (32, 18)


def still(scene, frames=24, seed=0, size=SIZE, diffuse=True, gi="none", **fields):
    """Return direct light, the mean of `frames` frames, float64."""
    camera = CameraSettings(jitter=False, frames=frames)
    renderer = Renderer(scene, size=size, settings=Settings(gi=gi, seed=seed, diffuse=diffuse, camera=camera, **fields))
    renderer.run(show=("direct",), check=True)
    return renderer.read_back("direct").astype(np.float64)


# ------------------------------------------------------------------------------------------------ Closed forms


@pytest.mark.parametrize("distance", [5.0, 1.0, 0.1, 0.002])
def test_a_rectangle_has_lamberts_form_factor(distance):
    """Far, near and almost touching: pixels of a floor under the middle, the edge and beside a lamp of 1 m x 0.6 m."""
    lamp = quad((-0.5, distance, -0.3), (1, 0, 0), (0, 0, 0.6), matte(0.0, "lamp", 3.0, double_sided=False))
    scene = Scene([Instance(grid(8.0, material=matte(ALBEDO))), Instance(lamp)])
    # Look at the floor from below: it reflects on both sides only what reaches each, so look from between.
    camera = Camera.look_at((0, distance / 2, 0), (0, 0, 0), up=(0, 0, -1))
    camera.orthographic_height = 1.0
    scene.cameras = [camera]
    x = ((np.arange(SIZE[0]) + 0.5) / SIZE[0] - 0.5) * SIZE[0] / SIZE[1]
    z = (np.arange(SIZE[1]) + 0.5) / SIZE[1] - 0.5
    points = np.stack([*np.meshgrid(x, z)], -1).reshape(-1, 2)
    points = np.stack([points[:, 0], np.zeros(len(points)), points[:, 1]], 1)
    corners = np.array([(-0.5, distance, -0.3), (0.5, distance, -0.3), (0.5, distance, 0.3), (-0.5, distance, 0.3)])
    expected = ALBEDO * 3.0 * polygon_form_factor(corners, points, np.array([0.0, 1.0, 0.0])).reshape(SIZE[::-1])
    got = still(scene)[..., 0]
    # The mean over 576 pixels and 24 frames, and pixel by pixel within the noise of 96 rays.
    assert got.mean() == pytest.approx(expected.mean(), rel=0.004)
    assert np.sqrt(((got - expected) ** 2).mean()) < 0.09 * expected.mean()


def test_a_sphere_has_its_form_factor():
    """F = r^2 / d^2 of a whole sphere straight above a floor (Howell, Menguc and Siegel, configuration B-42)."""
    ball = sphere((0, 1.5, 0), 0.5, subdivisions=4, material=matte(0.0, "lamp", 2.0, double_sided=False))
    scene = Scene([Instance(grid(8.0, material=matte(ALBEDO))), Instance(ball)])
    camera = Camera.look_at((0, 0.5, 0), (0, 0, 0), up=(0, 0, -1))
    camera.orthographic_height = 0.02
    scene.cameras = [camera]
    # The facets lie inside the sphere: 2560 of them have 0.15 % less projected area.
    assert still(scene)[..., 0].mean() == pytest.approx(ALBEDO * 2.0 * 0.25 / 2.25, rel=0.004)


@pytest.mark.parametrize("distance", [0.1, 1.0])
def test_plates_reflect_their_form_factor(distance):
    got = still(builtin.plates(distance, 1.0, ALBEDO), size=(32, 32))
    assert got.mean() == pytest.approx(ALBEDO * builtin.plates_form_factor(distance), rel=0.003)


# ------------------------------------------------------------------------------------------------ Convergence


def shining(*radiance, both=False):
    return Material(base_color=(0.0, 0.0, 0.0, 1.0), emission=radiance, double_sided=both)


def bright_texels():
    """Return a lamp whose texture is dark but for two texels, on two thirds of a quad's image."""
    pixels = np.full((32, 32, 4), 20, np.uint8)
    pixels[..., 3] = 255
    pixels[5, 20] = pixels[30, 2] = 255
    material = Material(emission=(40.0, 30.0, 20.0), emission_texture=Texture(Image(pixels)), base_color=(0, 0, 0, 1))
    panel = quad((-1.9, 0.3, -1.0), (0, 1.2, 0), (0, 0, 1.5), material)
    panel.texcoords0 = np.array([(0, 1), (1, 1), (1, 0.1), (0, 0.1)], np.float32)
    return panel


def lamp_room(glossy=False):
    """Return a closed room with things in it and lamps of all kinds: tiny, large, curved, textured, near a wall."""
    rough = dict(metallic=1.0, roughness=0.25) if glossy else dict(metallic=0.0, roughness=1.0)

    def painted(*color):
        return Material(base_color=(*color, 1.0), double_sided=True, **rough)

    parts = [
        box((-2, 0, -2), (2, 2.5, 2), painted(0.6, 0.5, 0.4), inward=True),
        box((-0.8, 0, -0.9), (-0.2, 0.9, -0.3), painted(0.3, 0.6, 0.5)),
        sphere((0.8, 0.5, -0.6), 0.5, subdivisions=3, material=painted(0.7, 0.7, 0.8)),
        quad((-1.2, 2.48, -1.2), (2.4, 0, 0), (0, 0, 2.4), shining(0.3, 0.4, 0.5)),
        sphere((0.3, 1.6, 0.2), 0.1, subdivisions=3, material=shining(6.0, 5.0, 3.0)),
        quad((1.98, 1.0, -0.6), (0, 0.4, 0), (0, 0, 0.4), shining(1.0, 2.0, 1.0, both=True)),
        quad((-0.4, 1.2, -1.6), (0.02, 0, 0), (0, 0, 0.02), shining(800.0, 800.0, 800.0, both=True)),
        bright_texels(),
    ]
    camera = Camera.look_at((-1.0, 1.5, 1.9), (0.2, 1.0, -1.0), yfov_deg=75)
    return Scene([Instance(part) for part in parts], cameras=[camera])


# Metals: the mean of 96 frames has a standard error of 0.7 % between seeds, so the bound is three of them. Over four
# seeds it is 0.4 % from five truths, within the noise.
@pytest.mark.parametrize(("glossy", "largest_bias"), [(False, 0.01), (True, 0.02)])
def test_error_falls_with_the_frames(glossy, largest_bias):
    """The mean of more and more frames approaches the path tracer; the bias over the picture is noise."""
    scene = lamp_room(glossy)
    truth = shoot(scene, SIZE, show=("direct",), gi="path", bounces=0, spp=768, diffuse=False)["direct"]
    squares = []
    for frames in (6, 96):
        got = still(scene, frames, diffuse=False)
        squares.append((((got - truth) / (truth + 0.1 * truth.mean())) ** 2).mean())
    assert squares[1] < squares[0] / 5  # 16 times the frames; the truth has noise, too
    assert got.mean() == pytest.approx(truth.mean(), rel=largest_bias)


def test_a_mirror_reflects_a_lamp():
    """A smooth metal plate shows the lamp's radiance times its reflectance, which light samples hardly find."""
    metal = Material(base_color=(0.8, 0.8, 0.8, 1.0), metallic=1.0, roughness=0.0)
    lamp = quad((-1, 1, -1), (2, 0, 0), (0, 0, 2), matte(0.0, "lamp", 5.0, double_sided=False))
    scene = Scene([Instance(grid(0.5, material=metal)), Instance(lamp)])
    scene.cameras = [looking((0, -1, -0.001), (0.0, 0.5, 0.0), height=0.2)]
    got = still(scene, diffuse=False)
    assert got.mean() == pytest.approx(0.8 * 5.0, rel=0.01)


# ------------------------------------------------------------------------------------------------ Invariances


def halves(scene):
    """Cut the meshes of all emitters in two instances."""
    cut = []
    for instance in scene.instances:
        mesh, middle = instance.mesh, len(instance.mesh.triangles) // 2
        if max(mesh.materials[0].emission) <= 0:
            cut.append(instance)
            continue
        for part in (mesh.triangles[:middle], mesh.triangles[middle:]):
            half = Mesh(mesh.positions, part, mesh.materials, texcoords0=mesh.texcoords0)
            cut.append(Instance(half, instance.world_from_local))
    return Scene(cut, cameras=scene.cameras)


MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])


def mirrored(scene):
    """Mirror the room at the plane x = 0; the camera, too, keeps its handedness, so its picture is flipped."""
    turned = moved(scene, MIRROR)
    eye, target = np.array([1.0, 1.5, 1.9]), np.array([-0.2, 1.0, -1.0])
    turned.cameras = [Camera.look_at(eye, target, yfov_deg=75)]
    return turned


CHANGES: dict[str, tuple[Callable[[Scene], Scene], Callable[[np.ndarray], np.ndarray]]] = {
    "cut in two": (halves, lambda picture: picture),
    "mirrored": (mirrored, lambda picture: picture[:, ::-1]),
    "channels swapped": (swap_channels, lambda picture: picture[..., [2, 0, 1]]),
    "another order": (lambda s: Scene(s.instances[::-1], cameras=s.cameras), lambda picture: picture),
}


@pytest.mark.parametrize("name", CHANGES)
def test_the_mean_does_not_depend_on_how_emitters_are_stored(name):
    """Means of blocks over four seeds differ by noise only: no |z| above 4.5 of 54 values, and few above 3."""
    change, back = CHANGES[name]
    plain = np.stack([still(lamp_room(), seed=seed, size=(36, 18)) for seed in range(4)])
    other = np.stack([back(still(change(lamp_room()), seed=seed + 50, size=(36, 18))) for seed in range(4)])

    def blocks(pictures):
        return pictures.reshape(4, 3, 6, 6, 6, 3).mean((2, 4)).reshape(4, -1)

    a, b = blocks(plain), blocks(other)
    # Few seeds estimate a variance badly: take the mean relative variance of all blocks as a floor.
    variance = (a.var(0, ddof=1) + b.var(0, ddof=1)) / 4
    floor = (variance / a.mean(0) ** 2).mean() * a.mean(0) ** 2
    z = (a.mean(0) - b.mean(0)) / np.sqrt(np.maximum(variance, floor))
    assert np.abs(z).max() < 4.5 and (np.abs(z) > 3).sum() <= 2, np.sort(np.abs(z))[-5:]
    assert a.mean() == pytest.approx(b.mean(), rel=0.01)


def test_same_seed_same_bits():
    assert np.array_equal(still(lamp_room(), 2, 5), still(lamp_room(), 2, 5))


# ------------------------------------------------------------------------------------------------ Settings


def test_scenes_without_emitters_run_no_pass_for_them():
    scene = builtin.cornell_point()
    renderer = Renderer(scene, size=SIZE, settings=Settings(gi="none", camera=CameraSettings(jitter=False)))
    renderer.run(show=("direct",))
    rows = [line.split()[:2] for line in renderer.plan().splitlines() if line.startswith("emitters")]
    assert rows == [["emitters", "culled"]]


def test_maps_stay_selectable():
    """Fixed samples give the same picture for every seed, and nearly the light that rays give."""
    scene = builtin.cornell()
    mapped = [still(scene, 1, seed, direct=DirectSettings(emitters="maps")) for seed in (0, 1)]
    assert np.array_equal(*mapped)
    assert still(scene).mean() == pytest.approx(mapped[0].mean(), rel=0.02)


def test_single_frames_are_blurred():
    """The blur lowers the error of a single frame, and leaves later frames alone."""
    scene, size = builtin.cornell(), (96, 54)
    truth = still(scene, 96, size=size)
    first = still(scene, 1, size=size)
    second = 2 * still(scene, 2, size=size) - first
    errors = [np.sqrt(((got - truth) ** 2).mean()) for got in (first, second)]
    assert errors[0] < 0.75 * errors[1]
