"""Animations on the command line: a time, sequences that play, their records, errors; `info`."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from helpers.animated import animated_scene

from wgpu_gi.__main__ import main
from wgpu_gi.scene.built_in.scenes import BUILTIN_SCENES
from wgpu_gi.sequence import blocks

TINY = ["--size", "32x18", "--set", "camera.frames=2", "--gi", "none"]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setitem(BUILTIN_SCENES, "slide", animated_scene)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def render(output: str, *arguments: str) -> int:
    return main(["render", "slide", "-o", output, *TINY, *arguments])


def test_frames_play_the_animation_and_start_again_at_its_end():
    assert render("{frame}.npy", "--frames", "0:13:3", "--fps", "10") == 0
    for frame, time in ((0, "0"), (3, "0.3"), (9, "0.9"), (12, "0.2")):
        assert render("one.npy", "--at", time) == 0
        assert np.allclose(np.load(f"{frame}.npy"), np.load("one.npy"), rtol=1e-5, atol=1e-6), frame
    assert not np.allclose(np.load("0.npy"), np.load("9.npy"), rtol=1e-2)
    # The time of each frame, and the camera that moves with the animation, are in the record.
    assert render("ride_{frame}.npy", "--frames", "0:10:9", "--fps", "10", "--camera", "rider") == 0
    cameras = json.loads(Path("ride_job.json").read_text())["cameras"]
    assert cameras["9"]["time"] == pytest.approx(0.9)
    assert cameras["9"]["world_from_view"][0][3] == pytest.approx(0.45)
    assert render("one.npy", "--time", "0.9", "--camera", "rider") == 0
    assert np.allclose(np.load("ride_9.npy"), np.load("one.npy"), rtol=1e-5, atol=1e-6)


def test_a_time_holds_the_animation(capsys):
    assert render("{frame}.npy", "--frames", "0:2", "--time", "0.4", "--turntable") == 0
    assert render("one.npy", "--time", "0.4") == 0
    assert np.array_equal(np.load("0.npy"), np.load("one.npy"))
    assert render("still_{frame}.npy", "--frames", "0:2", "--time", "0.4") == 0
    assert "nothing moves" in capsys.readouterr().err


@pytest.mark.parametrize("more", [["--camera-path", "path.json"], ["--layers", "motion", "--set", "camera.frames=1"]])
def test_shards_and_resumed_runs_of_an_animation_equal_one_run(more, folder, monkeypatch):
    monkeypatch.setattr(blocks, "BLOCK", 2)
    monkeypatch.setattr(blocks, "WARM_UP", 2)
    keys = [{"frame": 9 * i, "position": [i, 1, 4], "target": [0, 0.5, 0]} for i in (0, 1)]
    Path("path.json").write_text(json.dumps(keys))
    arguments = ["--frames", "0:6", "--fps", "5", *more]
    assert render("whole/{frame}.npy", *arguments) == 0
    for part in ("2/2", "1/2"):
        assert render("parts/{frame}.npy", *arguments, "--shard", part) == 0
    for frame in (1, 4):
        Path(f"parts/{frame}.npy").unlink()
    assert render("parts/{frame}.npy", *arguments) == 0
    names = sorted(os.listdir("whole"))
    assert names == sorted(os.listdir("parts"))
    for name in names:
        assert Path("whole", name).read_bytes() == Path("parts", name).read_bytes(), name


@pytest.mark.parametrize("change", [["--animation", "dim"], ["--fps", "5"], ["--time", "0.3"]])
def test_resuming_at_another_time_is_refused(change, capsys):
    assert render("{frame}.npy", "--frames", "0:1") == 0
    assert render("{frame}.npy", "--frames", "0:1", *change) == 2
    assert change[0].strip("-") in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["slide", "--animation", "slied"], "slide"),
        (["slide", "--animation", "7"], "slide"),
        (["slide", "--time", "nan"], "a time is a number, not 'nan'"),
        (["cornell-point", "--at", "1"], "cornell-point has no animation for --at"),
        (["cornell-point", "--time", "0"], "a time budget must be a finite number of seconds above 0, not 0"),
        (["slide", "--at", "0.5", "--time", "-1"], "a time budget must be a finite number of seconds above 0, not -1"),
        (["cornell-point", "--animation", "a", "--time", "0"], "no animation for --time and --animation"),
        (["slide", "--frames", "0:2", "-o", "{frame}.png", "--fps", "0"], "--fps must lie between 1 and 1000"),
    ],
)
def test_bad_times_are_one_sentence(arguments, sentence, capsys):
    before = os.listdir()
    assert main(["render", *arguments]) == 2
    told = capsys.readouterr().err
    assert sentence in told and "error" in told and told.strip().count("error") == 1
    assert os.listdir() == before


def test_a_time_after_the_end_shows_the_last_pose_with_a_note(capsys):
    assert render("late.npy", "--time", "9") == 0
    assert "lasts from 0 to 1 s, so 9 s shows its last pose" in capsys.readouterr().err
    assert render("end.npy", "--time", "1") == 0
    assert np.array_equal(np.load("late.npy"), np.load("end.npy"))


def test_info_lists_the_animations(capsys):
    assert main(["info", "slide"]) == 0
    told = capsys.readouterr().out
    assert "slide 1 s, dim 2 s" in told and "rider" in told
    assert main(["info", "none.glb"]) == 2
