"""Image sequences: shards and resumed runs equal one run; layers, cameras, videos, messages."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wgpu_gi.__main__ import main
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.pictures.image import load_image
from wgpu_gi.sequence import blocks
from wgpu_gi.sequence.claims import Claims

TINY = ["--size", "32x18", "--spp", "2", "--set", "camera.frames=2"]
SMALL_LIGHTS = ["--set", "vpl.count=128", "--set", "vpl.paths=1024", "--set", "ism.resolution=32"]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def frames(*arguments: str, output: str = "f_{frame:03d}.npy", range_: str = "0:7") -> int:
    """Render a camera that moves sideways."""
    keys = [{"frame": 9 * i, "position": [1 + 3 * i, 2.7, -8], "target": [2.8, 2.7, 0], "yfov_deg": 39} for i in (0, 1)]
    Path("path.json").write_text(json.dumps(keys))
    moving = ["--camera-path", "path.json", "--frames", range_]
    return main(["render", "cornell-point", "-o", output, *moving, *TINY, *arguments])


def assert_same_files(one: Path, other: Path) -> None:
    assert sorted(os.listdir(one)) == sorted(os.listdir(other))
    for file in one.iterdir():
        assert file.read_bytes() == (other / file.name).read_bytes(), file.name


@pytest.mark.slow
@pytest.mark.parametrize("gi", [*TECHNIQUES, "temporal", "motion", "antialias"])
def test_shards_and_resumed_runs_equal_one_run(gi, folder, monkeypatch):
    monkeypatch.setattr(blocks, "BLOCK", 2)
    monkeypatch.setattr(blocks, "WARM_UP", 2)
    arguments = ["--gi", gi, *SMALL_LIGHTS]
    if gi == "temporal":
        arguments = ["--gi", "many-light", *SMALL_LIGHTS, "--set", "temporal.frames=16"]
    if gi == "antialias":
        arguments = ["--gi", "none", "--set", "camera.frames=1", "--layers", "motion"]
    if gi == "motion":
        arguments = ["--gi", "none", "--layers", "motion"]
    assert frames(*arguments, output="whole/f_{frame:03d}.npy") == 0
    for part in ("2-3/3", "1/3"):
        assert frames(*arguments, "--shard", part, output="parts/f_{frame:03d}.npy") == 0
    assert_same_files(folder / "whole", folder / "parts")
    # Resume after an interruption.
    for frame in (1, 4, 5):
        Path(f"parts/f_{frame:03d}.npy").unlink()
    assert frames(*arguments, output="parts/f_{frame:03d}.npy") == 0
    assert_same_files(folder / "whole", folder / "parts")
    pictures = [np.load(f"whole/f_{frame:03d}.npy") for frame in range(7)]
    assert len({picture.tobytes() for picture in pictures}) == 7


def test_frame_without_history_equals_a_single_picture():
    Path("path.json").write_text(json.dumps([{"frame": 0, "position": [0, 1, 3], "target": [0, 1, 0]}]))
    Path("one.json").write_text(json.dumps({"position": [0, 1, 3], "target": [0, 1, 0]}))
    command = ["render", "cornell", *TINY, "--gi", "none"]
    assert main([*command, "-o", "{frame}.npy", "--frames", "3:7:3", "--camera-path", "path.json"]) == 0
    assert main([*command, "-o", "one.npy", "--camera", "one.json"]) == 0
    assert sorted(name for name in os.listdir() if name.endswith(".npy")) == ["3.npy", "6.npy", "one.npy"]
    assert np.array_equal(np.load("6.npy"), np.load("one.npy"))


def test_motion_leads_to_the_same_point_in_the_previous_frame():
    """Layers hold depth, position and motion; the job file holds the cameras."""
    key = {"target": [2.78, 2.73, 0], "yfov_deg": 39}
    keys = [{**key, "frame": i, "position": [2.78 + 0.1 * i, 2.73, -8.0]} for i in (0, 2)]
    Path("path.json").write_text(json.dumps(keys))
    command = ["render", "cornell", *TINY, "--gi", "none", "--set", "camera.jitter=false"]
    arguments = ["--camera-path", "path.json", "--layers", "depth,position,motion", "--frames", "0:3"]
    assert main([*command, *arguments, "-o", "f_{frame}.exr"]) == 0
    assert np.abs(load_image("f_0.npz", "motion")[..., :2]).max() < 1e-4
    cameras = json.loads(Path("f_job.json").read_text())["cameras"]
    before = np.array(cameras["0"]["world_from_view"])
    assert np.allclose(before[:3, 3], keys[0]["position"])
    motion, position, depth = (load_image("f_1.npz", name) for name in ("motion", "position", "depth"))
    seen = depth > 0
    assert seen.any()
    view = (position[seen] - before[:3, 3]) @ before[:3, :3]
    scale = 9 / np.tan(cameras["0"]["yfov"] / 2)
    place = view[:, :2] / -view[:, 2:] * (scale, -scale) + (16, 9)
    y, x = np.nonzero(seen)
    assert np.allclose(np.stack([x, y], -1) + 0.5 - place, motion[seen][:, :2], atol=0.01)
    assert np.allclose(np.linalg.norm(view, axis=1), motion[seen][:, 2], rtol=1e-4)


def test_resuming_with_another_command_is_refused(capsys):
    assert frames("--gi", "none", range_="0:2") == 0
    before = Path("f_001.npy").read_bytes()
    assert frames("--gi", "none", "--seed", "3", range_="0:2") == 2
    assert "seed" in capsys.readouterr().err
    assert frames("--gi", "none", range_="0:3") == 2
    assert "frames" in capsys.readouterr().err
    assert Path("f_001.npy").read_bytes() == before


def test_killed_run_leaves_no_broken_frame(folder):
    command = ["render", "cornell", "-o", "f_{frame}.exr", "--frames", "0:500", "--turntable", "--gi", "none", *TINY]
    process = subprocess.Popen([sys.executable, "-m", "wgpu_gi", *command, "--layers", "depth"])
    deadline = time.monotonic() + 120
    while len(list(folder.glob("*.exr"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    pictures = list(folder.glob("f_*.exr"))
    assert 3 <= len(pictures) < 500
    for picture in pictures:
        assert load_image(picture).shape == (18, 32, 3)
        assert load_image(picture.with_suffix(".npz"), "depth").shape == (18, 32)


def test_commands_at_once_share_the_frames(folder, capsys):
    """A command leaves the frames that another claims to it, waits for them, and renders those that it gives up."""
    arguments = ["--gi", "none", "--exposure", "0"]
    assert frames(*arguments, output="whole/{frame}.npy") == 0
    capsys.readouterr()

    def finish_one_of_two() -> None:
        while not Path("shared/6.npy").exists() or "waiting for process" not in "".join(told):
            told.append(capsys.readouterr().err)
            time.sleep(0.02)
        shutil.copy("whole/3.npy", "shared/3.npy")
        other.drop([4])
        other._write()

    told: list[str] = []
    Path("shared").mkdir()
    with Claims("shared/job.json") as other:
        assert other.take([3, 4]) == [3, 4]
        thread = threading.Thread(target=finish_one_of_two)
        thread.start()
        assert frames(*arguments, output="shared/{frame}.npy") == 0
        thread.join()
    assert "shared/{frame}.npy: 6 new frames" in capsys.readouterr().out
    assert_same_files(folder / "whole", folder / "shared")


def test_video_shows_the_frames():
    av = pytest.importorskip("av")
    assert frames("--gi", "none", "--fps", "12", output="out.mp4", range_="0:5") == 0
    assert frames("--gi", "none", output="{frame}.png", range_="0:5") == 0
    with av.open("out.mp4") as container:
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        assert container.streams.video[0].average_rate == 12
    assert len(pictures) == 5
    from PIL import Image

    for i, picture in enumerate(pictures):
        still = np.asarray(Image.open(f"{i}.png"), np.float64)
        assert abs(picture.mean() - still.mean()) < 4
        # In blocks, since video halves the resolution of colour.
        blocks = (picture - still).reshape(3, 6, 4, 8, 3).mean((1, 3))
        assert np.abs(blocks).max() < 12


def test_all_frames_have_the_exposure_of_the_first(capsys, folder):
    """In one run, in shards, and after an interruption; resuming with another exposure is refused."""

    def exposures() -> set[str]:
        found = set()
        for file in folder.glob("f_*.png"):
            with Image.open(file) as picture:
                found.add(picture.text["exposure"])
        return found

    assert frames("--gi", "none", output="f_{frame}.png", range_="0:3") == 0
    (text,) = exposures()
    assert f"exposure {text}, " in capsys.readouterr().out
    stops = json.loads(Path("f_job.json").read_text())["exposure"]
    assert text == f"{stops:+g} EV (automatic)"
    whole = Path("f_2.png").read_bytes()
    for file in folder.glob("f_*"):
        file.unlink()
    for part in ("3/3", "1/3", "2/3"):
        assert frames("--gi", "none", "--shard", part, output="f_{frame}.png", range_="0:3") == 0
    assert Path("f_2.png").read_bytes() == whole
    Path("f_2.png").unlink()
    assert frames("--gi", "none", output="f_{frame}.png", range_="0:3") == 0
    assert Path("f_2.png").read_bytes() == whole
    assert frames("--gi", "none", "--exposure", "1", output="f_{frame}.png", range_="0:3") == 2
    assert "exposure" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "a.png", "--turntable"], "--frames"),
        (["-o", "a.png", "--shard", "1/2"], "--frames"),
        (["-o", "a{frame}.png"], "--frames"),
        (["-o", "a.png", "--fps", "30"], "--fps needs several frames"),
        (["-o", "a.png", "--frames", "0:3"], "{frame}"),
        (["-o", "a{frame}{frame}.png", "--frames", "0:3"], "{frame}"),
        (["-o", "{frame}/a.png", "--frames", "0:3"], "{frame}"),
        (["-o", "{frame}.npz", "--frames", "0:3", "--layers", "depth"], "--show"),
        (["-o", "{frame}.png", "--frames", "0:3", "--layers", "depht"], "depht"),
        (["-o", "{frame}.png", "--frames", "0:3", "--layers", "motion", "--gi", "path"], "motion"),
        (["-o", "{frame}.png", "--frames", "3:3"], "0:240"),
        (["-o", "{frame}.png", "--frames", "0:9:0"], "0:240"),
        (["-o", "{frame}.png", "--frames", "0:3", "--shard", "0/2"], "1/N"),
        (["-o", "{frame}.png", "--frames", "0:3", "--shard", "3/2"], "1/N"),
        (["-o", "{frame}.png", "--frames", "0:3", "--shard", "2-3/2"], "3-5/8"),
        (["-o", "{frame}.png", "--frames", "0:3", "--shard", "2-1/2"], "3-5/8"),
        (["-o", "{frame}.png", "--frames", "0:3", "--camera-path", "none.json"], "does not exist"),
        (["-o", "{frame}.png", "--frames", "0:3", "--camera-path", "a.json", "--turntable"], "--turntable"),
        (["-o", "{frame}.bmp", "--frames", "0:3"], ".bmp"),
    ],
)
def test_bad_arguments_are_one_sentence(arguments, message, capsys, folder):
    assert main(["render", "cornell", "--size", "16x16", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("wgpu-gi: error:")
    assert message in error
    assert error.count("\n") == 1
    assert os.listdir(folder) == []
