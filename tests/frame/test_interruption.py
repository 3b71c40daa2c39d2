"""Ctrl-C at many moments of every command, or SIGTERM: one sentence, exit code 130 or 143, whole files, nothing left.

A picture that has a complete frame is saved; before, and by the other commands, no file is.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wgpu_gi.pictures.image import load_image

SMALL = ["--size", "32x18"]
MOVING = ["--frames", "0:400", "--turntable", "--gi", "none", *SMALL]
COMMANDS = {
    "render": ["render", "cornell", "-o", "a.exr", "--size", "64x36", "--show", "radiance", "--show", "depth"],
    "path": ["render", "cornell", "-o", "a.png", "--size", "160x90", "--gi", "path", "--spp", "1000"],
    "sequence": ["render", "cornell", "-o", "f_{frame}.png", "--layers", "depth", *MOVING],
    "video": ["render", "cornell", "-o", "a.mp4", *MOVING],
    "bench": ["bench", "cornell", "--gi", "none,ssao", *SMALL, "--frames", "50", "--json", "a.json"],
    "stress": ["stress", "--kinds", "room", "--gi", "none", *SMALL, "--seeds", "0:9", "--json", "a.json", "-o", "page"],
    "compare": ["compare", "x.npy", "y.npy", "--html", "a.html", "--json", "a.json"],
}
# Before it is ready, the interpreter starts, and takes Ctrl-C.
START = "import sys; from wgpu_gi.__main__ import main; print('ready', flush=True); sys.exit(main(sys.argv[1:]))"
QUICK = [("render", 0.3, "SIGINT"), ("path", 0.9, "SIGINT"), ("sequence", 1.2, "SIGTERM"), ("compare", 0.1, "SIGINT")]
DELAYS = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.1, 1.3, 1.5, 1.8, 2.1, 2.5, 3.0]
CASES = [(name, delay, "SIGINT") for name in COMMANDS for delay in DELAYS]
CASES += [(name, delay, "SIGTERM") for name in ("path", "sequence") for delay in DELAYS[5:]]
SLOW = [pytest.param(*case, marks=pytest.mark.slow) for case in CASES]
MOST_SECONDS = 20  # from Ctrl-C to the end; on a quiet machine it is less than one


def take_interrupts():
    """Set what a command in the background of a shell would ignore."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.parametrize(("name", "delay", "sent"), QUICK + SLOW)
def test_interrupt_at_any_moment_ends_cleanly(name, delay, sent, tmp_path):
    for file in ("x", "y"):
        np.save(tmp_path / f"{file}.npy", np.random.default_rng(0).random((300, 400, 3)).astype(np.float32))
    process = subprocess.Popen(
        [sys.executable, "-c", START, *COMMANDS[name]],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=take_interrupts,
    )
    assert process.stdout.readline() == "ready\n"
    time.sleep(delay)
    process.send_signal(signal.Signals[sent])
    try:
        _, error = process.communicate(timeout=MOST_SECONDS)
    finally:
        process.kill()
    said = [line for line in error.splitlines() if not line.startswith(("note:", "warning:"))]
    # Where code within an import was interrupted, Python ends itself by SIGINT: for a shell, 130 as well.
    if process.returncode in (128 + signal.Signals[sent], -signal.SIGINT):
        # An interrupted `stress` reports what it has found so far.
        saved = [file.name for file in tmp_path.glob("a.*")] if name in ("render", "path") else []
        words = f"{saved[0]} holds the picture so far, " if saved else "no file was left half-written"
        assert (name == "stress" and not said) or (len(said) == 1 and f"wgpu-gi: interrupted; {words}" in said[0])
    else:
        assert process.returncode == 0 and not said
    check_files(tmp_path)


def check_files(folder):
    """Check that each file can be read, and that none is a temporary one."""
    for file in filter(Path.is_file, folder.rglob("*")):
        if file.suffix in (".npy", ".npz", ".exr"):
            assert load_image(file, "depth" if file.suffix == ".npz" else None).size
        elif file.suffix == ".json":
            assert json.loads(file.read_text())
        elif file.suffix == ".png":
            Image.open(file).load()
        elif file.suffix == ".html":
            assert "</html>" in file.read_text()
        else:
            assert file.suffix == ".mp4" and frames_of(file) > 0


def frames_of(file):
    """Return the number of frames of a video."""
    av = pytest.importorskip("av")
    with av.open(str(file)) as container:
        return sum(1 for _ in container.decode(video=0))
