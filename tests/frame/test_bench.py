"""`wgpu-gi bench` end to end on a tiny picture, on whatever adapter there is."""

from __future__ import annotations

import importlib.util
import os

import pytest

import wgpu_gi as gi
from wgpu_gi.__main__ import main
from wgpu_gi.measure import moving_bench, moving_play, survey
from wgpu_gi.measure.bench_report import load_json
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.pictures.image import load_image

TINY = ["--size", "32x18", "--frames", "3", "--truth-spp", "16", "--gi", "none"]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("WGPU_GI_CACHE", str(tmp_path / "cache"))
    return tmp_path


def test_bench_measures_compares_and_plots(capsys, folder):
    assert main(["bench", "cornell", *TINY, "--json", "one.json"]) == 0
    (entry,) = (folder / "cache" / "truth").iterdir()
    made = entry.stat().st_mtime_ns
    plot = ["--plot", "two.png"] if importlib.util.find_spec("matplotlib") else []
    assert main(["bench", "cornell", *TINY, "--json", "two.json", "--compare", "one.json", *plot]) == 0
    assert entry.stat().st_mtime_ns == made  # the truth was kept
    assert "now / one.json" in capsys.readouterr().out

    one, two = load_json("one.json"), load_json("two.json")
    assert one.machine == two.machine
    (technique,) = two.scenes[0].techniques
    assert technique.errors == one.scenes[0].techniques[0].errors  # pictures are deterministic
    errors = technique.errors
    assert errors["indirect"].bias == pytest.approx(-1.0)  # there is none in direct light alone
    assert errors["indirect"].relmse + errors["indirect"].floor < 1.0
    assert abs(errors["direct"].bias) < 0.1
    assert -0.5 < errors["full"].bias < -0.05
    assert errors["full"].pixels == 32 * 18

    assert technique.cases["still"].passes_run == 0
    assert technique.cases["still"].gpu_ms.median == 0.0
    moving = technique.cases["all"]
    assert moving.passes_run == len(moving.passes) > 0
    assert 0 < moving.gpu_ms.median <= moving.gpu_ms.p95
    assert technique.cases["camera"].passes.keys() <= moving.passes.keys()
    assert technique.bytes > 32 * 18 * 16

    (reference,) = two.scenes[0].references
    assert [p.spp for p in reference.curve[:3]] == [1, 2, 4]
    assert reference.curve[-1].errors["full"].relmse < reference.curve[0].errors["full"].relmse
    if plot:
        assert load_image("two.png").std() > 0.05
    assert set(os.listdir()) == {"cache", "one.json", "two.json", *plot[1:]}


def test_moving_pictures_are_measured(capsys, monkeypatch):
    """Light that is averaged over frames lags behind a step of all lights; direct light does not."""
    monkeypatch.setattr(moving_bench, "SETTLED_FRAMES", 2)
    arguments = [*TINY[:-1], "ssdo", "--moving", "--sweep", "temporal.frames=1,4", "--set", "bounces=1"]
    assert main(["bench", "cornell-point", *arguments, "--json", "m.json"]) == 0
    assert "ghost, camera" in capsys.readouterr().out
    alone, shared = (m.moving for m in load_json("m.json").scenes[0].techniques)
    assert (alone["full"].lag, alone["indirect"].lag) == (1, 1)
    assert shared["full"].lag <= shared["indirect"].lag and 1 < shared["indirect"].lag < 12
    assert all(set(m) == {"full", "indirect", "aliased", "antialiased"} for m in (alone, shared))
    assert all(m["indirect"].ghost_camera > 0 and m["indirect"].flicker > 0 for m in (alone, shared))


def test_truth_from_a_file_sets_the_size(capsys):
    shows = [f"--show={name}" for name in ("radiance", "direct", "indirect", "standard_error", "depth")]
    assert (
        main(
            [
                "render",
                "cornell",
                "-o",
                "t.npz",
                "--size=16x9",
                "--gi=path",
                "--spp=64",
                "--set=camera.jitter=0",
                *shows,
            ]
        )
        == 0
    )
    assert main(["bench", "cornell", "--truth", "t.npz", "--frames", "1", "--gi", "none", "--json", "b.json"]) == 0
    scene = load_json("b.json").scenes[0]
    assert (scene.size, scene.references[0].truth) == ((16, 9), "t.npz")
    assert scene.techniques[0].errors["full"].floor > 0
    assert scene.techniques[0].errors["direct"].floor is None  # the file has no standard error of direct light


@pytest.mark.slow
def test_every_technique_is_measured_by_default():
    tiny = TINY[: TINY.index("--gi")]
    assert main(["bench", "cornell-point", *tiny, "--json", "b.json"]) == 0
    names = [m.gi for m in load_json("b.json").scenes[0].techniques]
    assert names == [name for name in TECHNIQUES if name != "path"]


@pytest.mark.slow
def test_an_animation_is_measured_against_path_traced_poses(capsys, monkeypatch):
    monkeypatch.setattr(moving_bench, "SETTLED_FRAMES", 2)
    monkeypatch.setattr(moving_play, "HISTORIES", (1, 10))
    assert main(["bench", "walk", *TINY, "--moving", "--json", "m.json"]) == 0
    assert "while its animation plays, against the path tracer" in capsys.readouterr().out
    first, last = load_json("m.json").scenes[0].techniques[0].played
    assert (first.frames, last.frames) == (1, 10)
    # Direct light alone: it has no history, and no indirect light at all.
    assert first.relmse_full == pytest.approx(last.relmse_full, rel=0.05)
    assert -0.9 < first.bias_full < -0.1 and first.bias_indirect == pytest.approx(-1.0)
    assert first.ghost_full == pytest.approx(last.ghost_full, rel=0.05)


@pytest.mark.slow
def test_survey_measures_every_technique(monkeypatch):
    monkeypatch.setattr(survey, "PATH_SECONDS", 0.3)
    monkeypatch.setattr(survey, "TRUTH_SECONDS", 1.0)
    scene = gi.load("cornell-point")
    done = []
    found = survey.survey_scene(
        "box", scene, scene.cameras[0], size=(32, 18), progress=lambda what, fraction: done.append(fraction)
    )
    assert {p.gi for p in found.points} - {"path, denoised"} == set(TECHNIQUES)
    assert {p.quality for p in found.points if p.gi == "many-light"} == {"low", "medium"}
    assert all(p.ms > 0 for p in found.points) and not found.left_out
    assert done == sorted(done) and done[-1] == 1.0
    best = {gi: min(p.relmse for p in found.points if p.gi == gi) for gi in TECHNIQUES}
    assert best["many-light"] < 0.1 * best["none"]
    traced = [p.relmse for p in found.points if p.gi == "path"]
    assert traced[-1] < traced[0]
