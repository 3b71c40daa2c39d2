"""`wgpu-gi bench`'s own part, with made-up measurements: arguments, messages, exit codes, files."""

from __future__ import annotations

import importlib.util
import os
from dataclasses import replace

import numpy as np
import pytest
from unit.bench_data import MACHINE, measurement, report, scene_report

from wgpu_gi.__main__ import main
from wgpu_gi.cli import bench as cli_bench
from wgpu_gi.cli import bench_survey
from wgpu_gi.cli.arguments import build_parser
from wgpu_gi.measure.bench_report import load_json, save_json
from wgpu_gi.measure.ranking import Point
from wgpu_gi.measure.survey import Survey
from wgpu_gi.pictures.image import save_image


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch, tmp_path):
    """Measure nothing; remember what was to be measured."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("WGPU_GI_CACHE", str(tmp_path / "cache"))
    calls = []

    def measure(scene, camera, size, candidates, truth_of, **options):
        calls.append((scene, camera, size, candidates, truth_of, options))
        made = scene_report(*(measurement(c.gi, c.quality) for c in candidates))
        return made.techniques, made.references

    monkeypatch.setattr(cli_bench, "machine", lambda adapter: MACHINE)
    monkeypatch.setattr(cli_bench, "measure_scene", measure)
    return calls


def test_defaults_beside_a_choice(stand_ins, capsys):
    assert main(["bench", "--truth-spp", "256"]) == 0
    ((scene, camera, size, candidates, _, options),) = stand_ins
    assert scene.name == "cornell"
    assert camera is scene.cameras[0]
    assert size == (640, 360)
    assert (options["frames"], options["moving"]) == (20, False)
    assert [(c.gi, c.quality) for c in candidates] == [(n, "medium") for n in cli_bench.TECHNIQUES if n != "path"]
    assert all(not c.settings.camera.jitter for c in candidates)
    printed = capsys.readouterr().out
    assert "cornell, 640x360" in printed
    assert "on Fake 1" in printed
    assert "cornell, 640x360: pictures by time, full image, truth all bounces" in printed
    assert not os.listdir()


@pytest.fixture
def surveyed(monkeypatch):
    """Return the calls of `survey_scene`, each with made-up points as its result."""
    calls = []

    def survey_scene(name, scene, camera, **options):
        calls.append((name, scene, camera, options))
        points = [Point("none", "low", "1 frame", 120.0, 0.3, -0.2), Point("path", "", "8 spp", 4000.0, 0.04, 0.0)]
        return Survey(name, (160, 90), "path tracer, 64 spp", 0.001, points, ["ssil, medium"])

    monkeypatch.setattr(bench_survey, "survey_scene", survey_scene)
    monkeypatch.setattr(bench_survey, "machine", lambda adapter: MACHINE)
    return calls


def test_scenes_alone_are_surveyed(surveyed, stand_ins, capsys):
    pytest.importorskip("matplotlib")
    assert main(["bench", "cornell", "corridor", "--light", "point 0,1,0 3", "--diffuse"]) == 0
    assert [name for name, *_ in surveyed] == ["cornell", "corridor"] and not stand_ins
    for _, scene, camera, options in surveyed:
        assert len(scene.lights) >= 1 and camera is scene.cameras[0] and options["diffuse"]
    printed = capsys.readouterr()
    assert printed.out.count("best within 1 s") == 2
    assert "note: cornell: no picture within 100 ms" in printed.err
    assert "note: corridor: no time for ssil, medium" in printed.err
    assert "on Fake 1, 4 cores" in printed.out
    assert os.listdir() == ["bench.png"]


def test_survey_checks_the_plot_first(surveyed, capsys):
    assert main(["bench", "--plot", "bench.txt"]) == 2
    assert "ends in .png or .svg or .pdf" in capsys.readouterr().err
    assert not surveyed


def test_survey_without_matplotlib_says_what_is_missing(surveyed, monkeypatch, capsys):
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name in ("matplotlib", "pyoidn") else found(name)
    )
    assert main(["bench"]) == 0
    notes = capsys.readouterr().err
    assert "pip install matplotlib" in notes and "pip install pyoidn" in notes
    assert not os.listdir()


def test_bench_and_render_list_the_same_techniques(capsys, stand_ins):
    printed = []
    for command in ("bench", "render"):
        assert main([command, "--gi", "help"]) == 0
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1]
    assert [line.split()[0] for line in printed[0].splitlines()] == list(cli_bench.TECHNIQUES)
    assert main(["bench", "--gi", ",".join(cli_bench.TECHNIQUES)]) == 0
    assert [c.gi for c in stand_ins[0][3]] == list(cli_bench.TECHNIQUES)


def test_arguments_reach_the_renderer(stand_ins):
    arguments = "bench cornell corridor --gi none,path --quality low,high --size 32x18 --frames 3 --diffuse --env 1,2,3"
    arguments += " --moving"
    lights = ("--light", "point 0,1,0 3", "--relight", "env=2,2,2")
    assert main([*arguments.split(), *lights, "--set", "seed=5", "--set", "bounces=1"]) == 0
    assert [call[0].name for call in stand_ins] == ["cornell", "corridor"]
    for scene, _, size, candidates, _, options in stand_ins:
        assert (size, options["frames"], options["moving"]) == ((32, 18), 3, True)
        assert tuple(scene.environment.color) == (2.0, 2.0, 2.0)
        assert len(scene.lights) >= 1
        names = [(c.gi, c.quality) for c in candidates]
        assert names == [("none", "low"), ("none", "high"), ("path", "low"), ("path", "high")]
        for c in candidates:
            assert (c.settings.gi, c.settings.seed, c.settings.bounces, c.settings.diffuse) == (c.gi, 5, 1, True)
        assert candidates[2].settings.spp == candidates[2].settings.path.samples_per_run


def test_sweep_measures_every_combination(stand_ins):
    arguments = "bench --gi many-light --sweep vpl.count=64,2048 --sweep gather.rays=1,4"
    assert main(arguments.split()) == 0
    ((_, _, _, candidates, _, _),) = stand_ins
    assert [(c.variant, c.settings.vpl.count, c.settings.gather.rays) for c in candidates] == [
        ("vpl.count=64 gather.rays=1", 64, 1),
        ("vpl.count=64 gather.rays=4", 64, 4),
        ("vpl.count=2048 gather.rays=1 (preset)", 2048, 1),
        ("vpl.count=2048 gather.rays=4", 2048, 4),
    ]


def test_truth_by_path_gets_the_arguments(stand_ins, monkeypatch):
    asked = {}
    monkeypatch.setattr(cli_bench, "truth_by_path", lambda *_, **options: asked.update(options))
    assert main(["bench", "--truth-spp", "32", "--diffuse", "--set", "path.visible_only=true"]) == 0
    stand_ins[0][4](1)
    assert (asked["spp"], asked["bounces"], asked["diffuse"], asked["visible_only"]) == (32, 1, True, True)


def test_file_of_the_truth_sets_the_size(stand_ins):
    save_image("truth.npz", {"radiance": np.ones((9, 16, 3), np.float32)})
    assert main(["bench", "--truth", "truth.npz"]) == 0
    _, _, size, _, truth_of, _ = stand_ins[0]
    assert size == (16, 9)
    assert truth_of(None).source == "truth.npz"


def test_files_and_comparison(stand_ins, capsys):
    save_json("old.json", report(replace(scene_report(measurement(ms=8.0), size=(640, 360)), env=None)))
    assert main(["bench", "--json", "new.json", "--compare", "old.json", "--gi", "none"]) == 0
    printed = capsys.readouterr().out
    assert "now / old.json" in printed
    assert "0.50" in printed
    assert load_json("new.json").scenes[0].techniques == [measurement()]
    assert sorted(os.listdir()) == ["new.json", "old.json"]


def test_comparison_with_another_machine_is_refused(capsys):
    save_json("old.json", report(adapter="Another"))
    assert main(["bench", "--compare", "old.json"]) == 0
    printed = capsys.readouterr()
    assert "warning: old.json was measured on Another" in printed.err
    assert "now / old.json" not in printed.out


def test_comparison_with_nothing_in_common_says_so(capsys):
    save_json("old.json", report(scene_report(scene="corridor")))
    assert main(["bench", "--compare", "old.json"]) == 0
    assert "holds nothing with the same scene" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("--gi magic", "--gi takes"),
        ("--gi ,", "--gi takes names"),
        ("--quality ultra", "--quality takes low, medium, high"),
        ("--frames 0", "--frames must lie between 1"),
        ("--frames many", "--frames"),
        ("--moving --frames 1", "with --moving, --frames must lie between 2"),
        ("--truth-spp 1", "--truth-spp must lie between 2"),
        ("--size 0x9", "0x9"),
        ("--set nonsense=1", "nonsense"),
        ("--set gi=path", "use --gi"),
        ("--sweep gi=path", "use --gi"),
        ("--sweep vpl.count", "a setting and its values"),
        ("--sweep vpl.count=,", "a setting and its values"),
        ("--sweep vpl.count=64,many", "many"),
        ("--set diffuse=true", "use --diffuse"),
        ("--set spp=4", "use --set path.samples_per_run"),
        ("--set camera.jitter=true", "pixel centres"),
        ("--set camera.frames=4", "pixel centres"),
        ("--json out.txt", "ends in .json"),
        ("--json no/out.json", "no folder"),
        ("--plot out.jpeg", "ends in .png or .svg or .pdf"),
        ("--compare missing.json", "missing.json"),
        ("--truth missing.npz", "no such file"),
        ("--truth truth.png", ".npz or .exr"),
        ("--truth small.npz --size 640x360", "small.npz is 16x9, but --size asks for 640x360"),
        ("cornell corridor --truth small.npz", "is for one scene"),
        ("missing.glb", "missing.glb"),
        ("--camera 99", "no camera"),
        ("--light sun", "sun"),
    ],
)
def test_bad_input_is_one_sentence(arguments, words, capsys):
    save_image("small.npz", {"radiance": np.ones((9, 16, 3), np.float32)})
    assert main(["bench", *arguments.split()]) == 2
    printed = capsys.readouterr()
    errors = [line for line in printed.err.splitlines() if not line.startswith(("note: ", "warning: "))]
    assert len(errors) == 1, printed.err
    assert errors[0].startswith("wgpu-gi: error: ")
    assert words in errors[0]
    assert printed.out == ""
    assert os.listdir() == ["small.npz"]


def test_attribution_takes_the_frames_of_the_still_picture():
    """What its advice says to raise, such as camera.frames=96."""
    words = ["bench", "--attribute", "--quality", "low", "--gi", "many-light", "--set", "camera.frames=96"]
    (candidate,) = cli_bench.candidates_from(build_parser().parse_args(words))
    assert candidate.settings.camera.frames == 96 and not candidate.settings.camera.jitter


def test_interruption_leaves_nothing(monkeypatch, capsys):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli_bench, "measure_scene", interrupted)
    assert main(["bench", "--json", "out.json", "--plot", "out.svg"]) == 130
    assert not os.listdir()


def test_set_help_lists_settings(capsys, stand_ins):
    assert main(["bench", "--set", "help"]) == 0
    assert "camera.jitter" in capsys.readouterr().out
    assert not stand_ins
