"""The denoiser against references (`wgpu_gi.measure.references`): error, energy, and remaining patterns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.measure.references import SIZE, layers_of, scene_of
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.settings import assign


def rendered(name, gi, *texts, size=SIZE):
    """Return the indirect light of one bounce at the pixel centres, every material Lambert."""
    settings = Settings(gi=gi, diffuse=True, bounces=1)
    settings.camera.jitter, settings.camera.frames = False, 1
    for text in texts:
        assign(settings, text)
    renderer = Renderer(scene_of(name), size=size, settings=settings)
    renderer.run(show=("indirect",), check=True)
    return renderer.read_back("indirect")


@pytest.mark.parametrize(
    ("name", "gi", "least"),
    [
        ("leak_corridor_a", "many-light", 1.4),
        pytest.param("cornell_point", "many-light", 1.05, marks=pytest.mark.slow),
        pytest.param("cornell_area", "many-light", 1.15, marks=pytest.mark.slow),
        pytest.param("cornell_point", "ssdo", 1.3, marks=pytest.mark.slow),
        pytest.param("cornell_area", "ssil", 1.2, marks=pytest.mark.slow),
    ],
)
def test_the_filter_lowers_the_error_of_a_frame_and_keeps_its_energy(name, gi, least):
    """Measured gains: 1.6, 1.1, 1.24, 1.6, 1.4. One-sided weights (Schied et al. 2017) lose 4 % in the corridor."""
    truth = visible_light(name) if gi == "ssil" else layers_of(name)["one"]
    blurred, filtered = (rendered(name, gi, f"denoise.levels={levels}") for levels in (0, 2))
    assert relmse(blurred, truth) > least * relmse(filtered, truth)
    assert abs(bias(filtered, blurred)) < 0.005


def visible_light(name):
    """Return one bounce of the light of visible surfaces."""
    with np.load(Path(__file__).parent / "visible" / f"{name}_{SIZE[0]}x{SIZE[1]}.npz") as file:
        return file["one"].astype(np.float32)


def share_of_period(picture, period):
    """Return the share of the power of a picture, at periods up to six pixels, that sits at a period on each axis."""
    height, width = picture.shape
    y, x = (np.linspace(-1, 1, n) for n in picture.shape)
    smooth = np.stack([np.outer(y**i, x**j).ravel() for i in range(4) for j in range(4 - i)], 1)
    detail = picture.ravel() - smooth @ np.linalg.lstsq(smooth, picture.ravel(), rcond=None)[0]
    window = np.outer(np.hanning(height + 2)[1:-1], np.hanning(width + 2)[1:-1])
    power = np.abs(np.fft.fft2(detail.reshape(picture.shape) * window)) ** 2
    rows, columns = (np.abs(np.fft.fftfreq(n)) * period for n in picture.shape)
    fast = np.maximum(rows[:, None], columns) > period / 6
    on_rows, on_columns = (np.abs(f - np.round(f)) < 1 / 8 + 1e-9 for f in (rows, columns))
    return power[fast & on_rows[:, None] & on_columns].sum() / power[fast].sum()


def test_noise_and_patterns_have_known_shares():
    """The measure itself: 8 % of noise, all of a pattern but what the window spreads."""
    noise = np.random.default_rng(0).normal(size=(40, 16))
    assert 0.05 < share_of_period(noise, 4) < 0.11
    pattern = np.tile(np.random.default_rng(1).normal(size=(4, 4)), (10, 4))
    assert share_of_period(pattern, 4) > 0.6


def test_still_pictures_keep_little_of_the_interleaving():
    """The tall box, 24 frames: 21 %; a guide of single pixels only keeps 37 %."""
    picture = rendered("cornell_point", "many-light", "camera.frames=24", size=(160, 90))
    assert share_of_period(picture[40:80, 62:78, 1].astype(np.float64), 4) < 0.27
