"""The path tracer against references by Mitsuba 3, an engine that shares no code with ours.

References are made by `tools/make_references.py --size 128x72 --spp 16384`, where their layers are explained: linear
radiance of the pixel centres by number of scatterings, every material Lambert, with standard errors. `courtyard_sun` is
the built-in courtyard with `--env 0`, `leak_corridor_a` the corridor with `--camera a`, `curtain` a built-in scene.
"""

import json

import numpy as np
import pytest
from helpers.marks import slow_but
from reference_file import scene_hash

import wgpu_gi as gi
from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.resources import resource_dir
from wgpu_gi.scene.scene import Environment

REFERENCES = resource_dir("scenes") / "references"
# Scene, environment that replaces its own, samples per pixel for all bounces, and bound of relMSE of the full picture:
# our noise plus that of the reference.
CASES: dict[str, tuple[str, Environment | None, int, float]] = {
    "cornell_area": ("cornell/cornell_area.glb", None, 96, 0.003),
    "cornell_point": ("cornell/cornell_point.glb", None, 192, 0.003),
    "cornell_spot": ("cornell/cornell_spot.glb", None, 128, 0.006),
    "leak_corridor_a": ("leak_corridor/leak_corridor.glb", None, 224, 0.12),
    "curtain": ("curtain", None, 256, 0.2),
    "courtyard_sun": ("courtyard", Environment((0.0, 0.0, 0.0)), 32, 0.002),
    "courtyard_sky": ("courtyard", None, 32, 0.001),
}
ONE_BOUNCE_SPP = 64
MOST_BIAS = 0.003  # in addition to noise


def source_of(name: str) -> str:
    scene = CASES[name][0]
    return str(resource_dir("scenes") / scene) if "." in scene else scene


def meta_of(name: str) -> dict:
    with np.load(REFERENCES / f"{name}_128x72.npz") as file:
        return json.loads(str(file["meta"]))


def layers_of(name: str) -> dict[str, np.ndarray]:
    with np.load(REFERENCES / f"{name}_128x72.npz") as file:
        return {key: file[key].astype(np.float32) for key in file.files if key != "meta"}


def renderer_of(name: str, spp: int, bounces: int | None) -> Renderer:
    camera = meta_of(name)["camera"]
    scene = gi.load(source_of(name), environment=CASES[name][1])
    settings = Settings(gi="path", spp=spp, bounces=bounces, diffuse=True, camera=CameraSettings(jitter=False))
    view = gi.Camera(np.array(camera["world_from_view"]), camera["yfov"])
    renderer = Renderer(scene, size=(128, 72), camera=view, settings=settings)
    renderer.run()
    return renderer


@pytest.mark.parametrize("name", CASES)
def test_references_have_the_hash_of_their_scene(name):
    source = source_of(name)
    assert meta_of(name)["scene_sha256"] == scene_hash(source, gi.load(source, environment=CASES[name][1]))


@pytest.mark.parametrize("name", slow_but(("cornell_point", "courtyard_sky"), CASES))
def test_all_bounces_agree_with_mitsuba(name):
    truth = layers_of(name)
    _, _, spp, most_error = CASES[name]
    renderer = renderer_of(name, spp, None)
    full = truth["emit"] + truth["direct"] + truth["one"] + truth["multi"]
    radiance, error = renderer.read_back("radiance"), renderer.read_back("standard_error")
    # Three standard errors of a mean over independent pixels, ours and theirs.
    noise = 3 * np.sqrt((error**2 + truth["se_full"] ** 2).sum()) / full.sum()
    assert abs(bias(radiance, full)) < MOST_BIAS + noise
    # The view of the curtain has no direct light.
    direct = truth["direct"].mean()
    assert abs(renderer.read_back("direct").mean() - direct) <= MOST_BIAS * direct
    assert abs(bias(renderer.read_back("indirect"), truth["one"] + truth["multi"])) < MOST_BIAS + 2 * noise
    assert relmse(radiance, full) < most_error


@pytest.mark.parametrize("name", CASES)
def test_one_bounce_agrees_with_mitsuba(name):
    truth = layers_of(name)
    renderer = renderer_of(name, ONE_BOUNCE_SPP, 1)
    error = renderer.read_back("standard_error")
    noise = 3 * np.sqrt((error**2 + truth["se_indirect"] ** 2).sum()) / truth["one"].sum()
    assert abs(bias(renderer.read_back("indirect"), truth["one"])) < MOST_BIAS + noise


@pytest.mark.parametrize("name", CASES)
def test_depth_albedo_and_normal_agree_with_mitsuba(name):
    truth = layers_of(name)
    renderer = renderer_of(name, 1, 0)
    assert renderer.read_back("depth") == pytest.approx(truth["depth"], rel=2e-3)
    assert renderer.read_back("albedo") == pytest.approx(truth["albedo"], abs=2e-3)
    hit = (truth["depth"] > 0).astype(np.float32)
    assert (renderer.read_back("normal") * truth["normal"]).sum(-1) == pytest.approx(hit, abs=2e-3)


def test_error_falls_with_the_number_of_samples():
    truth = layers_of("cornell_spot")
    full = truth["emit"] + truth["direct"] + truth["one"] + truth["multi"]
    floor = np.mean(truth["se_full"] ** 2 / (full**2 + 0.01 * full.mean() ** 2))
    errors = [relmse(renderer_of("cornell_spot", spp, None).read_back(), full) - floor for spp in (4, 64)]
    # 16 times the samples: a sixteenth of the error, or less with stratified ones.
    assert errors[1] < errors[0] / 10
