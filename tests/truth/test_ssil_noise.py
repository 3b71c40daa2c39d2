"""The noise of SSIL: it falls with every frame and leaves no structure; drawing samples by light keeps the mean."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from helpers.techniques import SCENES

from wgpu_gi.camera import Camera
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.settings import assign

ROOT = Path(__file__).parents[2]
SIZE = (128, 72)
LAGS = range(4, 13)  # pixels of the first level: beyond the filter of 3x3 pixels, for both pixels, and the upsampling
NAMES = ("cornell-point", "curtain")


@cache
def rendered(name, frames, seed):
    """Return one bounce at pixel centres without the denoiser, and the first level as the mean of 2x2 pixels."""
    scene = SCENES[name]()
    settings = Settings(gi="ssil", diffuse=True, bounces=1, seed=seed)
    settings.camera.jitter, settings.camera.frames = False, frames
    assign(settings, "denoise.levels=0")
    # The lit side of the room with the curtain.
    camera = Camera.look_at((-2.7, 1.6, -1.5), (-0.2, 1.1, 0.5), (0, 1, 0), 65.0) if name == "curtain" else None
    renderer = Renderer(scene, size=SIZE, settings=settings, camera=camera)
    renderer.run(show=("indirect",))
    luminance = renderer.read_back("indirect").astype(np.float64).mean(-1)
    return luminance.reshape(SIZE[1] // 2, 2, SIZE[0] // 2, 2).mean((1, 3))


def noise(name, frames):
    """Return the relative noise of a picture: its difference from the mean of many frames with other samples."""
    mean = (rendered(name, 128, 1) + rendered(name, 128, 2)) / 2
    return (rendered(name, frames, 0) - mean) / np.maximum(mean, 0.05 * mean.mean())


def structure(values):
    """Return the root mean square autocorrelation along rows and columns at LAGS."""
    # Few bright pixels beside edges must not decide.
    most = 3 * np.median(np.abs(values)) / 0.6745
    values = np.clip(values, -most, most)
    values = values - values.mean()
    found = [(values * np.roll(values, k, axis)).mean() for k in LAGS for axis in (0, 1)]
    return np.sqrt(np.mean(np.square(found))) / np.square(values).mean()


def blurred_white_noise(count):
    """Return pictures of white noise after the filter of `combine.wgsl`."""
    white = np.random.default_rng(0).normal(size=(count, SIZE[1] // 2, SIZE[0] // 2))
    for axis in (1, 2):
        white = 2 * white + np.roll(white, 1, axis) + np.roll(white, -1, axis)
    return white


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_still_picture_has_no_structure(name):
    """Over 24 frames, noise is as uncorrelated beyond the filter's reach as white noise after the same filter."""
    white = [structure(values) for values in blurred_white_noise(200)]
    assert structure(noise(name, 24)) <= max(white)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_noise_falls_with_every_frame(name):
    """From 4 to 64 frames by 8 times or more; 16 times if frames were independent, less the noise of the mean."""
    few, many = (np.square(noise(name, frames)).mean() for frames in (4, 64))
    assert many <= few / 8


MEAN_OF_A_COPY = """
import sys
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.load import load
from wgpu_gi.settings import assign
settings = Settings(gi="ssil", bounces=1)
settings.camera.jitter, settings.camera.frames = False, 1024
renderer = Renderer(load("cornell"), size=(32, 18), settings=settings)
renderer.run(show=("indirect",))
print(*renderer.read_back("indirect").mean((0, 1)))
"""


@pytest.mark.slow
def test_drawing_by_light_keeps_the_mean(tmp_path):
    """The mean of 1024 frames and its colour, with one of four samples drawn and with all samples tested."""
    sys.path.append(str(ROOT / "tools"))
    from sweeps import Sweep, make_copy

    means = []
    for value in ("4u", "1u"):
        copy = tmp_path / value
        make_copy(copy, Sweep("ssil/interleaving.wgsl", "CANDIDATES", value, "ssil"), value)
        run = subprocess.run(
            [sys.executable, "-c", MEAN_OF_A_COPY],
            cwd=copy,
            env={"PYTHONPATH": str(copy)},
            capture_output=True,
            text=True,
        )
        assert run.returncode == 0, run.stderr
        means.append(np.array(run.stdout.split(), float))
    assert np.allclose(means[0], means[1], rtol=0.01)
