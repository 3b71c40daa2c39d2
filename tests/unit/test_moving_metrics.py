"""Metrics of moving pictures on made-up sequences, by closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.measure.moving import Seen, flicker, lag, relative_errors, revealed, squared_errors
from wgpu_gi.measure.moving_bench import brightened
from wgpu_gi.scene.built_in.scenes import BUILTIN_SCENES

SIZE = (16, 8)  # width, height
OLD = 1000


def grey(values) -> np.ndarray:
    return np.repeat(np.asarray(values, np.float32)[..., None], 3, -1)


def test_flicker_of_independent_noise_is_its_relative_variance():
    """A picture of constant 2 and noise of 10 %, over truth + a tenth of its mean: 0.01 / 1.1^2."""
    random = np.random.default_rng(0)
    truth = grey(np.full((40, 50), 2.0))
    frames = [truth * grey(1 + 0.1 * random.standard_normal((40, 50))) for _ in range(16)]
    errors = np.array([relative_errors(x, truth).ravel() for x in frames])
    assert flicker(errors, np.ones(errors.shape, bool)) == pytest.approx(0.01 / 1.21, rel=0.03)


def test_a_constant_error_does_not_flicker():
    """Nor does a truth that changes: errors are relative to it."""
    ramps = [grey(np.linspace(1, 2, 30)[None] * level) for level in (1.0, 3.0, 9.0)]
    errors = np.array([relative_errors(np.float32(1.25) * t, t).ravel() for t in ramps])
    assert flicker(errors, np.ones(errors.shape, bool)) < 1e-12


def test_flicker_counts_points_in_view_throughout():
    errors = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 100.0]])
    seen = np.array([[True, True, True], [True, True, False]])
    assert flicker(errors, seen) == pytest.approx((2.0 + 0.0) / 2)
    assert flicker(errors, np.zeros(seen.shape, bool)) is None


@pytest.mark.parametrize("frames", [2, 4, 8, 16])
def test_lag_of_an_exponential_mean(frames):
    """1 - (1 - 1/n)^k reaches 0.9 at k = ln 0.1 / ln(1 - 1/n), rounded up."""
    progress = [1 - (1 - 1 / frames) ** k for k in range(1, 60)]
    assert lag(progress) == int(np.ceil(np.log(0.1) / np.log(1 - 1 / frames)))


def test_lag_ends_when_the_light_stays():
    assert lag([1.0, 1.0, 1.0]) == 1
    assert lag([0.2, 0.95, 0.5, 0.9, 1.0]) == 4
    assert lag([0.1, 0.2, 0.3]) == 4  # never


def test_squared_errors_are_those_of_relmse():
    truth = grey([[1.0, 3.0]])
    assert np.allclose(squared_errors(grey([[2.0, 3.0]]), truth), [[1 / (1 + 0.01 * 4), 0.0]])
    assert not squared_errors(truth, 0 * truth).any()  # a black truth has no relative error


def wall(camera: Camera, distance: float = 4.0, near: tuple[int, int] | None = None, depth: float = 2.0) -> Seen:
    """Return what a camera sees of a wall across its view at z = -distance; columns `near` see one at z = -depth."""
    width, height = SIZE
    tangent = np.tan(camera.yfov / 2)
    x = ((np.arange(width) + 0.5) / width * 2 - 1) * tangent * width / height
    y = (1 - (np.arange(height) + 0.5) / height * 2) * tangent
    ways = np.stack(np.broadcast_arrays(x[None], y[:, None], -1.0), -1)
    away = np.full((height, width, 1), distance)
    if near is not None:
        away[:, near[0] : near[1]] = depth
    normal = np.broadcast_to((0.0, 0.0, 1.0), ways.shape)
    return Seen(camera, camera.position + ways * away, normal, np.ones((height, width), bool))


def test_points_are_found_where_they_were_seen():
    frame = wall(Camera())
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    assert np.allclose(frame.places(frame.position), np.stack([columns, rows], -1), atol=1e-6)
    shown, pixels = frame.shows(frame.position.reshape(-1, 3), frame.normal.reshape(-1, 3))
    assert shown.all() and np.array_equal(pixels, np.stack([rows, columns], -1).reshape(-1, 2))
    behind, _ = frame.shows(np.array([[0.0, 0.0, 4.0]]), np.array([[0.0, 0.0, 1.0]]))
    assert not behind.any()


def test_what_a_moving_object_uncovers_is_new_and_grows_old():
    """An object of four columns moves right by two columns a frame, with its points."""
    camera = Camera()
    frames = [wall(camera, near=(2 + 2 * k, 6 + 2 * k)) for k in range(4)]
    column = 2.0 * 2 * np.tan(camera.yfov / 2) / SIZE[1]  # width of a pixel on the object, metres
    ages = None
    for k in range(1, 4):
        before = frames[k].position.copy()
        before[:, 2 + 2 * k : 6 + 2 * k, 0] -= 2 * column
        ages = revealed(frames[k], frames[k - 1], before, ages)
        young = np.minimum(ages[0], OLD)
        expected = np.full(SIZE[0], OLD)
        for age in range(k):
            expected[2 * (k - age) : 2 * (k - age) + 2] = age
        assert np.array_equal(young, expected) and (np.minimum(ages, OLD) == expected).all()


def test_a_turning_camera_reveals_the_edge_of_the_picture():
    camera = Camera()
    shifted = np.eye(4)
    shifted[0, 3] = 2 * 4.0 * 2 * np.tan(camera.yfov / 2) / SIZE[1]  # two pixels of the wall
    now, before = wall(replace(camera, world_from_view=shifted)), wall(camera)
    ages = revealed(now, before, now.position, None)
    assert (ages[:, -2:] == 0).all() and (ages[:, :-2] > OLD).all()


def test_brightened_scenes_scale_all_light():
    scene = BUILTIN_SCENES["cornell"]()
    bright = brightened(scene, 4.0)
    before, after = ([max(m.emission) for m in s.materials] for s in (scene, bright))
    assert max(before) > 0 and np.allclose(after, 4 * np.array(before))
    sky = BUILTIN_SCENES["courtyard"]()
    assert np.allclose(brightened(sky, 2.0).environment.color, 2 * np.array(sky.environment.color))
    assert [light.intensity for light in brightened(sky, 2.0).lights] == [2 * light.intensity for light in sky.lights]
