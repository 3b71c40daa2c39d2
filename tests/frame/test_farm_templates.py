"""Jobs of `farm template`, run as their managers run them: the frames are those of one run of `render`."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from wgpu_gi.__main__ import main

pytestmark = pytest.mark.slow
# Motion depends on the frame before: two blocks of at most 32 frames, each with a warm-up.
COUNT = 40
SEQUENCE = ["cornell-point", "--gi", "none", "--size", "16x10", "--set", "camera.frames=1", "--turntable"]
SEQUENCE += ["--layers", "motion", "--frames", f"0:{COUNT}"]
PROGRAM = shlex.join([sys.executable, "-m", "wgpu_gi"])


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    root = Path(__file__).resolve().parents[2]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")]))
    return tmp_path


@pytest.fixture
def whole(folder):
    """Render the frames by one command; return its folder."""
    assert main(["render", *SEQUENCE, "-o", "whole/f_{frame:03d}.npy"]) == 0
    return folder / "whole"


def make(manager: str, file: str, *more: str) -> None:
    words = ["--for", manager, "--to", file, "--program", PROGRAM, *SEQUENCE, "-o", "it's parts/f_{frame:03d}.npy"]
    assert main(["farm", "template", *words, *more]) == 0


def run(*command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command in another folder, as a manager does."""
    Path("elsewhere").mkdir(exist_ok=True)
    variables = {**os.environ, **environment}
    return subprocess.run(command, cwd="elsewhere", env=variables, capture_output=True, text=True, check=False)


def assert_same(one: Path, other: Path) -> None:
    assert sorted(os.listdir(one)) == sorted(os.listdir(other)) and len(os.listdir(one)) == 2 * COUNT + 1
    for file in one.iterdir():
        assert file.read_bytes() == (other / file.name).read_bytes(), file.name


def test_slurm_tasks_render_the_frames(folder, whole):
    make("slurm", "job.sh")
    script, parts = str(folder / "job.sh"), folder / "it's parts"
    assert "#SBATCH --array=1-2\n" in Path(script).read_text()
    for task in ("2", "1"):
        done = run("sh", script, SLURM_ARRAY_TASK_ID=task)
        assert done.returncode == 0, done.stderr
    assert_same(whole, parts)
    # A task that runs again after it was cut off renders what is missing, alone.
    kept = {file: file.stat().st_mtime_ns for file in parts.iterdir()}
    for frame in (34, 39):
        (parts / f"f_{frame:03d}.npy").unlink()
    assert "2 new frames" in run("sh", script, SLURM_ARRAY_TASK_ID="2").stdout
    assert_same(whole, parts)
    again = {file.name for file, time in kept.items() if file.stat().st_mtime_ns != time}
    assert again == {"f_034.npy", "f_034.npz", "f_039.npy", "f_039.npz"}


def test_openjd_chunks_render_the_frames(folder, whole):
    pytest.importorskip("openjd.cli")
    make("openjd", "job.json")
    openjd, file = [sys.executable, "-m", "openjd"], str(folder / "job.json")
    assert run(*openjd, "check", file).returncode == 0
    # One task, then a chunk of both, which finds the frames of the first.
    first = run(*openjd, "run", file, "--task-param", "Part=2-2")
    assert first.returncode == 0, first.stdout + first.stderr
    parts = folder / "it's parts"
    assert {int(name.stem[2:]) for name in parts.glob("*.npy")} == set(range(32, COUNT))
    both = run(*openjd, "run", file, "--task-param", "Part=1-2")
    assert both.returncode == 0 and "32 new frames" in both.stdout
    assert_same(whole, parts)


@pytest.mark.parametrize("manager", ["slurm", "openjd"])
def test_failing_task_fails_its_job(manager, folder):
    """With the exit code of `render`, 2, which a manager need not try again."""
    if manager == "openjd":
        pytest.importorskip("openjd.cli")
    words = ["--program", PROGRAM, "missing.glb", "-o", "f_{frame}.png", "--frames", "0:3"]
    assert main(["farm", "template", "--for", manager, "--to", "job", *words]) == 0
    if manager == "openjd":
        failed = run(sys.executable, "-m", "openjd", "run", str(folder / "job"))
        assert failed.returncode != 0 and "exited with code: 2" in failed.stdout
    else:
        failed = run("sh", str(folder / "job"), SLURM_ARRAY_TASK_ID="1")
        assert failed.returncode == 2 and "missing.glb" in failed.stderr
