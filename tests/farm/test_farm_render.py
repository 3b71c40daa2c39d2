"""`wgpu-gi farm render`: pictures are those of one machine; what cannot work is refused before anything is written."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import wgpu_gi as gi
from wgpu_gi.__main__ import main
from wgpu_gi.errors import GiError
from wgpu_gi.farm import checking, client, run, worker
from wgpu_gi.gpu.device import AdapterInfo

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.usefixtures("folder")

TINY = ["--size", "32x18", "--set", "camera.frames=2", "--gi", "none"]
SEQUENCE = ["cornell-point", "--frames", "0:6", "--turntable", *TINY]
WALK = ["walk", "--frames", "0:5", "--fps", "7", "--layers", "motion,depth", "--size", "32x18", "--gi", "none"]


def assert_same_files(one: Path, other: Path) -> None:
    assert sorted(os.listdir(one)) == sorted(os.listdir(other))
    for file in one.iterdir():
        assert file.read_bytes() == (other / file.name).read_bytes(), file.name


def farm(*arguments: str) -> int:
    return main(["farm", "render", *arguments])


@pytest.mark.parametrize("more", [[], ["--gather"]])
@pytest.mark.parametrize(
    "arguments",
    [[*SEQUENCE, "-o", "{frame}.png"], pytest.param([*WALK, "-o", "{frame}.exr"], marks=pytest.mark.slow)],
)
def test_files_are_those_of_one_machine(arguments, more, cluster, folder, capsys):
    """Also the exposure, measured once, and the .json: so either command resumes the other's frames."""
    *start, output = arguments
    assert main(["render", *start, f"one/{output}"]) == 0
    assert farm(*start, f"farm/{output}", "--scheduler", cluster, *more) == 0
    assert_same_files(folder / "one", folder / "farm")
    # Resume.
    Path("farm", output.format(frame=3)).unlink()
    capsys.readouterr()
    assert farm(*start, f"farm/{output}", "--scheduler", cluster, *more) == 0
    assert f"farm/{output}: 1 new frames" in capsys.readouterr().out
    assert_same_files(folder / "one", folder / "farm")
    assert farm(*start, f"farm/{output}", "--scheduler", cluster, *more) == 0
    assert ": 0 new frames" in capsys.readouterr().out


@pytest.mark.slow
def test_processes_of_this_machine_render_the_same(folder, capsys):
    assert main(["render", *SEQUENCE, "-o", "one/{frame}.npy"]) == 0
    assert farm(*SEQUENCE, "-o", "farm/{frame}.npy", "--workers", "2", "-v") == 0
    told = capsys.readouterr()
    assert "farm/{frame}.npy: 6 new frames in " in told.out and "worker" in told.err
    assert_same_files(folder / "one", folder / "farm")


def test_python_renders_a_scene_that_no_file_holds(cluster, folder):
    scene = gi.load("cornell-point")
    scene.lights[0].intensity *= 2
    camera = gi.Camera.look_at((2.78, 2.73, -8.0), (2.78, 2.73, 0), yfov_deg=39)
    options = {"size": (32, 18), "gi": "none", "camera": camera}
    fractions: list[float] = []
    with distributed.Client(cluster, set_as_default=False) as dask:
        result = gi.farm.render(
            dask, scene, "f/{frame}.npy", frames=range(3), turntable=True, progress=fractions.append, **options
        )
        assert result.is_complete and result.done == 3 and "3 new frames" in result.sentence()
        assert "worker" in result.workers and fractions and min(fractions) >= 0 and max(fractions) <= 1
        assert np.array_equal(np.load("f/0.npy"), gi.render(scene, **options))
        again = gi.farm.render(dask, scene, "f/{frame}.npy", frames=range(3), turntable=True, **options)
        assert again.is_complete and again.done == 0
        scene.lights[0].intensity *= 2
        with pytest.raises(GiError, match=r"another command \(scene differ"):
            gi.farm.render(dask, scene, "f/{frame}.npy", frames=range(3), turntable=True, **options)


def test_failed_frames_are_told_and_the_exit_code_is_1(cluster, folder, capsys, monkeypatch):
    """The same command renders them when the reason is gone."""
    add = worker.FrameFiles.add

    def fail(self, frame, *arguments):
        if frame == 4:
            raise GiError("no such luck")
        add(self, frame, *arguments)

    monkeypatch.setattr(worker.FrameFiles, "add", fail)
    assert farm(*SEQUENCE, "-o", "f/{frame}.npy", "--scheduler", cluster) == 1
    told = capsys.readouterr()
    assert "5 new frames" in told.err and "1 frame failed, such as 4: no such luck" in told.err
    assert "the same command renders what is missing" in told.err and not told.out
    assert sorted(os.listdir("f")) == sorted(["job.json", *(f"{frame}.npy" for frame in (0, 1, 2, 3, 5))])
    monkeypatch.undo()
    os.chdir(folder)
    assert farm(*SEQUENCE, "-o", "f/{frame}.npy", "--scheduler", cluster) == 0
    assert len(list(Path("f").glob("*.npy"))) == 6


# ------------------------------------------------------------------------------------------------ Checks


def assert_refused(arguments: list[str], message: str, capsys, monkeypatch) -> None:
    assert farm(*SEQUENCE, "-o", "new/f/{frame}.npy", *arguments) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if not line.startswith(("note:", "warning:"))]
    assert len(errors) == 1 and errors[0].startswith("wgpu-gi: error:") and message in errors[0], errors
    assert not Path("new").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--scheduler", "tcp://127.0.0.1:1"], "no Dask scheduler answers at tcp://127.0.0.1:1"),
        (["--scheduler", "here"], "an address is tcp://HOST:PORT"),
        (["--scheduler", "http://127.0.0.1:80"], "an address is tcp://HOST:PORT"),
        (["--scheduler", "tcp://127.0.0.1:99999"], "an address is tcp://HOST:PORT"),
        (["--scheduler", "tls://127.0.0.1:1"], "no certificates"),
        (["--scheduler", "127.0.0.1:1", "--workers", "2"], "leave them out with --scheduler"),
        (["--workers", "0"], "a number from 1"),
        (["--adapter", "voodoo"], "no adapter is called 'voodoo'"),
        (["--plan"], "--plan tells of one process"),
        (["--timings"], "--timings tells of one process"),
        (["--time", "2s"], "--frames does not go with --time"),
        (["--certify"], "--certify states the error of one picture"),
        (["-o", "new/f.mp4"], "no video"),
        (["-o", "new/f.npy"], "{frame}"),
        (["--layers", "depht"], "depht"),
    ],
)
def test_bad_arguments_are_one_sentence(arguments, message, capsys, monkeypatch):
    monkeypatch.setattr(client, "CONNECT", 0.5)
    assert_refused(arguments, message, capsys, monkeypatch)


def test_frames_are_needed(capsys):
    assert farm("cornell") == 2
    assert "add --frames" in capsys.readouterr().err


def test_missing_package_is_one_sentence(capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    assert_refused([], "pip install distributed", capsys, monkeypatch)


def test_scheduler_without_workers(capsys, monkeypatch):
    monkeypatch.setattr(client, "CONNECT", 1.0)
    scheduler = {"cls": distributed.Scheduler, "options": {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}}
    with distributed.SpecCluster(workers={}, scheduler=scheduler) as empty:
        assert_refused(["--scheduler", empty.scheduler_address], "has no workers", capsys, monkeypatch)


@pytest.mark.parametrize(
    ("target", "name", "value", "message"),
    [
        (client, "_versions", None, "has distributed 1, and this machine 2"),
        (run, "code_digest", lambda: "other", "wgpu_gi on the worker on"),
        (run, "digest_of", lambda scene: "other", "is another than here"),
        (run, "_token_in", None, "is not shared with the worker on"),
        (checking, "check", "unknown", "cannot run wgpu_gi"),
    ],
)
def test_unfit_workers_are_one_sentence(target, name, value, message, cluster, capsys, monkeypatch):
    if name == "_versions":
        seen: list[int] = []

        def value(found):
            seen.append(1)
            return {"python": "3", "distributed": "2" if len(seen) == 1 else "1"}

    if name == "_token_in":
        value = _wrong_token
    if value == "unknown":
        value = _unknown
    monkeypatch.setattr(target, name, value)
    assert_refused(["--scheduler", cluster], message, capsys, monkeypatch)


class _wrong_token:
    """A token that is not in the folder, which another machine has under the same name."""

    def __init__(self, files, gather):
        self.token = None if gather else (str(Path(files.output).parent.absolute() / "token"), "text")

    def __enter__(self):
        return self.token

    def __exit__(self, *error):
        pass


def _unknown(work):
    raise ModuleNotFoundError("No module named 'wgpu_gi.farm'")


def test_scene_that_a_worker_cannot_load(cluster, capsys, monkeypatch):
    monkeypatch.setattr(run, "_placed", lambda source: "elsewhere.glb" if source == "cornell-point" else source)
    assert_refused(["--scheduler", cluster], "elsewhere.glb on the worker on", capsys, monkeypatch)


def test_another_job_in_the_folder_is_refused(cluster, capsys, folder):
    command = [*SEQUENCE, "--scheduler", cluster, "-o", "f/{frame}.npy"]
    assert farm(*command) == 0
    before = Path("f/3.npy").read_bytes()
    assert farm(*command, "--seed", "7") == 2
    assert "seed differ" in capsys.readouterr().err
    assert Path("f/3.npy").read_bytes() == before and json.loads(Path("f/job.json").read_text())["command"]["seed"] == 0
    assert sorted(os.listdir("f")) == sorted(["job.json", *(f"{frame}.npy" for frame in range(6))])


def test_two_commands_at_once_share_the_frames(cluster, folder, capsys):
    """A farm and `render`: the frames that one claims, the other leaves to it, and waits for."""
    from wgpu_gi.sequence.claims import Claims

    assert main(["render", *SEQUENCE, "-o", "one/{frame}.npy"]) == 0
    os.mkdir("f")

    def finish():
        while len(list(Path("f").glob("*.npy"))) < 4:
            time.sleep(0.01)
        for frame in (1, 2):
            Path(f"f/{frame}.npy").write_bytes(Path(f"one/{frame}.npy").read_bytes())

    with Claims("f/job.json") as other:
        other.take([1, 2])
        thread = threading.Thread(target=finish)
        thread.start()
        assert farm(*SEQUENCE, "-o", "f/{frame}.npy", "--scheduler", cluster) == 0
        thread.join()
    assert "4 new frames" in capsys.readouterr().out
    assert_same_files(folder / "one", folder / "f")


def test_frames_that_another_command_rendered_meanwhile_are_left_alone(cluster, folder, capsys, monkeypatch):
    """Also with --gather, whose workers do not see the files."""
    assert main(["render", *SEQUENCE, "-o", "one/{frame}.npy"]) == 0

    class Late(run.Claims):
        def __enter__(self):
            for frame in (1, 2):
                Path(f"f/{frame}.npy").write_bytes(Path(f"one/{frame}.npy").read_bytes())
            return super().__enter__()

    monkeypatch.setattr(run, "Claims", Late)
    assert farm(*SEQUENCE, "-o", "f/{frame}.npy", "--scheduler", cluster, "--gather") == 0
    assert "4 new frames" in capsys.readouterr().out
    assert_same_files(folder / "one", folder / "f")


def test_two_commands_with_failed_frames_do_not_wait_for_each_other(cluster, folder, capsys, monkeypatch):
    """Each tries what the other gives up, once."""
    from wgpu_gi.sequence.claims import Claims, wait_for

    add, deadline, taken = worker.FrameFiles.add, time.monotonic() + 120, []

    def fail(self, frame, *arguments):
        if frame == 4:
            raise GiError("no such luck")
        add(self, frame, *arguments)

    def tell(*_others):
        assert time.monotonic() < deadline

    def wait_for_4():
        taken.extend(wait_for(other, [4], lambda number: False, tell))
        other.give_up([1, 4])

    monkeypatch.setattr(worker.FrameFiles, "add", fail)
    os.mkdir("f")
    with Claims("f/job.json") as other:
        other.take([1])
        other_command = threading.Thread(target=_once_claimed, args=(other, 4, wait_for_4))
        other_command.start()
        assert farm(*SEQUENCE, "-o", "f/{frame}.npy", "--scheduler", cluster) == 1
        other_command.join()
    assert taken == [4] and "5 new frames" in capsys.readouterr().err
    assert {path.name for path in Path("f").glob("*.npy")} == {f"{frame}.npy" for frame in (0, 1, 2, 3, 5)}


def _once_claimed(claims, block, then):
    """Call a function when another command claims a block."""
    while not any(block in claim.blocks for claim in claims.others()):
        time.sleep(0.001)
    then()


# ------------------------------------------------------------------------------------------------ Workers


def test_workers_that_join_late_are_checked_too(cluster, folder, capsys, monkeypatch):
    """Here the folder is no longer shared after the check; a frame that nobody finds must not count as done."""

    def ask(*arguments):
        found = checking.ask(*arguments)
        (token,) = Path("f").glob(".*.token")
        token.unlink()
        return found

    monkeypatch.setattr(run, "ask", ask)
    assert farm(*SEQUENCE, "-o", "f/{frame}.npy", "--scheduler", cluster) == 1
    told = capsys.readouterr().err
    assert "0 new frames" in told and "no worker can go on" in told and "is not shared with the worker on" in told
    assert os.listdir("f") == ["job.json"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"workers": "2"}, "workers must be a whole number from 1"),
        ({"workers": -1}, "workers must be a whole number from 1"),
        ({"workers": True}, "workers must be a whole number from 1"),
        ({"threads": 1.5}, "threads must be a whole number from 1"),
        ({"gather": 1}, "gather must be True or False"),
        ({"client": "tcp://127.0.0.1:1"}, "client must be a distributed.Client"),
    ],
)
def test_bad_values_from_python_are_one_sentence(options, message, folder):
    client = options.pop("client", None)
    with pytest.raises(GiError, match=message):
        gi.farm.render(client, "cornell-point", "f/{frame}.npy", frames=range(2), **options)
    assert os.listdir() == []


def test_only_a_large_scene_is_kept_by_the_cluster():
    """A small description goes with each chunk: a result may be lost with its worker, or have to be fetched again."""
    work = worker.Work("name", None, "", "", None, {})

    class Client:
        def submit(self, task, work, pure):
            return task, work

    assert run.sent(Client(), work) is work
    large = worker.Work("name", bytes(2 * run.SMALL), "", "", None, {})
    assert run.sent(Client(), large)[1] is large


@pytest.mark.slow
def test_script_without_a_main_guard_is_one_sentence(folder):
    script = folder / "script.py"
    script.write_text(
        "import wgpu_gi as gi\n"
        "try:\n"
        "    gi.farm.render(None, 'cornell-point', 'f/{frame}.npy', frames=range(2), workers=1, size=(32, 18))\n"
        "except gi.GiError as error:\n"
        "    print(error)\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=120, check=False)
    assert "below if __name__ == '__main__'" in done.stdout and len(done.stdout.splitlines()) == 1, done.stdout
    assert "Traceback" not in done.stderr, done.stderr
    assert not Path("f").exists()


def adapter(name: str, kind: str, backend: str = "Vulkan") -> AdapterInfo:
    return AdapterInfo(name, backend, kind, "", (), {}, True)


@pytest.mark.parametrize(
    ("adapters", "arguments", "environments"),
    [
        (["CPU"], (8, None, None, None), [{"LP_NUM_THREADS": "1"}] * 8),
        (["CPU"], (8, None, 3, None), [{"LP_NUM_THREADS": "3"}] * 2),
        (["CPU"], (8, 2, None, None), [{"LP_NUM_THREADS": "4"}] * 2),
        (["CPU"], (2, 5, None, None), [{"LP_NUM_THREADS": "1"}] * 5),
        (["DiscreteGPU", "DiscreteGPU", "CPU"], (8, None, None, None), [{"WGPU_GI_ADAPTER": n} for n in "01"]),
        (["DiscreteGPU", "DiscreteGPU", "CPU"], (8, 3, None, None), [{"WGPU_GI_ADAPTER": n} for n in "010"]),
        (["DiscreteGPU", "CPU"], (4, None, None, "cpu"), [{"LP_NUM_THREADS": "1"}] * 4),
    ],
)
def test_one_worker_for_each_gpu_or_core(adapters, arguments, environments):
    assert client.worker_environments([adapter(kind, kind) for kind in adapters], *arguments) == environments


def test_threads_are_for_cpus():
    with pytest.raises(GiError, match="--threads is for rendering on a CPU"):
        client.worker_environments([adapter("X", "DiscreteGPU")], 8, None, 2, None)


def test_lost_device_is_tried_once_more_then_the_process_ends(monkeypatch):
    exits, uses = [], []
    monkeypatch.setattr(worker, "_load", lambda work: worker.Loaded(work.name, None, None))
    monkeypatch.setattr(worker.os, "_exit", exits.append)
    monkeypatch.setattr(worker, "_has_nanny", lambda: has_nanny)

    def use(state):
        uses.append(state)
        if len(uses) < lost:
            raise gi.errors.LostDevice("lost")
        return "a picture"

    work = worker.Work("name", None, "", "", None, {})
    lost, has_nanny = 2, True
    assert worker.with_new_device(work, use) == "a picture" and not exits
    uses.clear()
    lost = 3
    worker.with_new_device(work, use)
    assert exits == [worker.LOST_DEVICE]
    worker._kept.clear()
    # A worker without a nanny may be the user's process.
    uses.clear()
    exits.clear()
    lost, has_nanny = 3, False
    monkeypatch.setattr(worker, "release", worker._kept.clear)
    with pytest.raises(gi.errors.LostDevice):
        worker.with_new_device(work, use)
    assert not exits and not worker._kept


def test_progress_is_a_line_and_a_table():
    progress = run.FarmProgress(10)
    assert progress.line() == "0 of 10 frames, 0 workers"
    progress.start -= 4
    progress.add("tcp://b:1", 2, 3.0)
    progress.add("tcp://a:1", 4, 2.0)
    progress.failed = 1
    assert progress.line() == "6 of 10 frames, 1.5 frames/s, 0:02 left, 2 workers, 1 failed"
    assert progress.fraction == 0.7
    head, one, other = progress.table().splitlines()
    assert head.split() == ["worker", "frames", "frames/s", "busy", "last"]
    assert one.split()[:4] == ["tcp://a:1", "4", "2", "50%"] and other.split()[1:4] == ["2", "0.667", "75%"]


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="only POSIX sends Ctrl-C to a group of processes")
def test_ctrl_c_ends_all_processes_without_a_traceback(folder):
    """The terminal sends it to the workers, too. The complete frames stay, and the same command goes on."""
    command = ["farm", "render", "cornell", "-o", "f/{frame}.npy", "--frames", "0:500", "--turntable", *TINY]
    process = subprocess.Popen(
        [sys.executable, "-m", "wgpu_gi", *command, "--workers", "2"],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        deadline = time.monotonic() + 120
        while len(list(folder.glob("f/*.npy"))) < 3 and time.monotonic() < deadline:
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGINT)
        told = process.communicate(timeout=60)[1]
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130 and "Traceback" not in told and "interrupted" in told, told
    left = sorted(path.name for path in Path("f").iterdir() if path.suffix != ".npy")
    assert left == ["job.json"] and len(list(Path("f").glob("*.npy"))) >= 3
    assert all(np.load(path).shape == (18, 32, 3) for path in Path("f").glob("*.npy"))
