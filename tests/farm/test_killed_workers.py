"""Frames by worker processes that are killed: all are there, bit for bit those of one machine, and nothing else."""

import os
import random
import signal
import threading
from pathlib import Path

import pytest

import wgpu_gi as gi
from wgpu_gi.farm.client import connected

pytest.importorskip("distributed")
psutil = pytest.importorskip("psutil")
pytestmark = [pytest.mark.slow, pytest.mark.timeout(400)]

OPTIONS = {
    "frames": {
        "scene": "cornell-point",
        "frames": range(60),
        "turntable": True,
        "gi": "none",
        "spp": 2,
        "size": (64, 36),
    },
    # Each block of 32 frames has a history: it is rendered anew from its start.
    "blocks": {"scene": "walk", "frames": range(96), "gi": "none", "spp": 1, "size": (64, 36), "layers": ("motion",)},
}
KILLS = 4


def worker_processes():
    """Return the worker processes that this process has started."""
    return [child for child in psutil.Process().children() if "spawn_main" in " ".join(child.cmdline())]


def kill_workers(folder, count, over, killed):
    """Kill a worker at random each time that some frames more are there, so that all deaths lie within the run."""
    rng = random.Random(1)
    for number in range(1, KILLS + 1):
        while len(list(folder.glob("*.npy"))) < number * count // (KILLS + 2):
            if over.wait(0.01):
                return
        worker = rng.choice(worker_processes())
        worker.send_signal(signal.SIGKILL)
        killed.append(worker.pid)


@pytest.mark.parametrize("name", OPTIONS)
def test_no_frame_is_lost_when_workers_are_killed(name, tmp_path):
    options = dict(OPTIONS[name])
    scene, count = options.pop("scene"), len(options["frames"])
    with connected(workers=1) as client:
        one = gi.farm.render(client, scene, tmp_path / "one/{frame}.npy", **options)
    assert one.is_complete and one.done == count and one.repeated == one.deaths == 0

    over, killed = threading.Event(), []
    with connected(workers=2) as client:
        killer = threading.Thread(target=kill_workers, args=(tmp_path / "farm", count, over, killed))
        killer.start()
        try:
            farm = gi.farm.render(client, scene, tmp_path / "farm/{frame}.npy", **options)
        finally:
            over.set()
            killer.join()
    assert farm.is_complete, farm.sentence()
    assert killed and 1 <= farm.deaths <= len(killed)
    # The chunk of a dead worker, at most a third of half the frames, may be given out again, be slow, and start twice.
    assert 1 <= farm.repeated <= len(killed) * count / 3
    assert "started again" in farm.sentence()
    assert_same_files(tmp_path / "one", tmp_path / "farm")


def assert_same_files(one: Path, other: Path) -> None:
    assert sorted(os.listdir(one)) == sorted(os.listdir(other))
    for file in one.iterdir():
        if file.suffix != ".json":
            assert file.read_bytes() == (other / file.name).read_bytes(), file.name
