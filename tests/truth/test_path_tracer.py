"""The path tracer against references by Mitsuba 3, an engine that shares no code with ours.

References hold linear radiance of the pixel centres, 64x36, by number of scatterings: emit, direct (one), one (two: one
indirect bounce), multi (three and more); every material Lambert; with standard errors.
"""

from pathlib import Path

import numpy as np
import pytest

import wgpu_gi as gi
from wgpu_gi.metrics import bias, relmse
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.resources import resource_dir

REFERENCES = Path(__file__).parent / "references"
CORNELL_CAMERA = gi.Camera.look_at((2.78, 2.73, -2.6), (2.78, 2.73, 0.0), yfov_deg=62.0)
CORRIDOR_CAMERA = gi.Camera.look_at((9.5, 1.6, 1.0), (2.0, 1.15, 1.15), yfov_deg=60.0)
# Scene file, camera, and the most relMSE of the full picture at 512 spp: our noise plus the reference's own.
CASES = {
    "cornell_area": ("cornell/cornell_area.glb", CORNELL_CAMERA, 0.003),
    "cornell_point": ("cornell/cornell_point.glb", CORNELL_CAMERA, 0.003),
    "cornell_spot": ("cornell/cornell_spot.glb", CORNELL_CAMERA, 0.006),
    "leak_corridor_a": ("leak_corridor/leak_corridor.glb", CORRIDOR_CAMERA, 0.12),
}


def layers_of(name: str) -> dict[str, np.ndarray]:
    with np.load(REFERENCES / f"{name}_64x36.npz") as file:
        return {key: file[key].astype(np.float32) for key in file.files if key != "meta"}


def renderer_of(name: str, spp: int, bounces: int | None) -> Renderer:
    file, camera, _ = CASES[name]
    settings = Settings(spp=spp, bounces=bounces, diffuse=True, camera=CameraSettings(jitter=False))
    renderer = Renderer(gi.load(resource_dir("scenes") / file), size=(64, 36), camera=camera, settings=settings)
    renderer.run()
    return renderer


@pytest.mark.parametrize("name", CASES)
def test_all_bounces(name):
    truth = layers_of(name)
    renderer = renderer_of(name, 512, None)
    full = truth["emit"] + truth["direct"] + truth["one"] + truth["multi"]
    radiance, error = renderer.read_back("radiance"), renderer.read_back("standard_error")
    # Three standard errors of a mean over independent pixels, ours and theirs, beside half a per cent.
    noise = 3 * np.sqrt((error**2 + truth["se_full"] ** 2).sum()) / full.sum()
    assert abs(bias(radiance, full)) < 0.005 + noise
    assert abs(bias(renderer.read_back("direct"), truth["direct"])) < 0.005
    assert abs(bias(renderer.read_back("indirect"), truth["one"] + truth["multi"])) < 0.005 + 2 * noise
    assert relmse(radiance, full) < CASES[name][2]


@pytest.mark.parametrize("name", CASES)
def test_one_bounce(name):
    truth = layers_of(name)
    renderer = renderer_of(name, 512, 1)
    error = renderer.read_back("standard_error")
    noise = 3 * np.sqrt((error**2 + truth["se_indirect"] ** 2).sum()) / truth["one"].sum()
    assert abs(bias(renderer.read_back("indirect"), truth["one"])) < 0.005 + noise


@pytest.mark.parametrize("name", CASES)
def test_what_is_seen(name):
    truth = layers_of(name)
    renderer = renderer_of(name, 1, 0)
    assert renderer.read_back("depth") == pytest.approx(truth["depth"], rel=2e-3)
    assert renderer.read_back("albedo") == pytest.approx(truth["albedo"], abs=2e-3)
    assert (renderer.read_back("normal") * truth["normal"]).sum(-1) == pytest.approx(1.0, abs=2e-3)


def test_error_falls_with_the_number_of_samples():
    truth = layers_of("cornell_spot")
    full = truth["emit"] + truth["direct"] + truth["one"] + truth["multi"]
    floor = np.mean(truth["se_full"] ** 2 / (full**2 + 0.01 * full.mean() ** 2))
    errors = [relmse(renderer_of("cornell_spot", spp, None).read_back(), full) - floor for spp in (16, 256)]
    # 16 times the samples: a sixteenth of the error, or less with stratified ones.
    assert errors[1] < errors[0] / 10
