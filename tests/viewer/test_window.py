"""The viewer as a person uses it: a window on a virtual display, a real mouse and keyboard, and what is on the screen.

A display of its own is started. Needs Xvfb, xdotool and the extra [viewer]: `python3 tools/dev.py test` installs them.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wgpu_gi.__main__ import main
from wgpu_gi.options import TECHNIQUES

pytestmark = [
    pytest.mark.window,
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="Xvfb is for Linux"),
]

SIZE = (640, 240)
FREE = (520, 120)  # a place outside the panel
HEADER = (200, 205)  # of the panel's section on the pixel under the mouse
QUICK = ["cornell-point", "--size", "640x240", "--set", "camera.frames=2"]
SECONDS = 60.0  # the limit of each wait


@pytest.fixture(scope="module")
def display():
    """Start an X server on a free number; yield its name."""
    read, write = os.pipe()
    # Without -noreset the server restarts, unreachable for a moment, whenever its last client leaves.
    command = ["Xvfb", "-displayfd", str(write), "-noreset", "-screen", "0", "1000x700x24"]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as number:
        name = f":{number.readline().strip()}"
    yield name
    server.terminate()
    server.wait()


class Viewer:
    """A running `wgpu-gi view`."""

    def __init__(self, display: str, folder: Path, *arguments: str) -> None:
        self.environment = {**os.environ, "DISPLAY": display}
        self.display, self.folder, self.log = display, folder, folder / "log.txt"
        command = [sys.executable, "-u", "-m", "wgpu_gi", "view", *arguments]
        with self.log.open("w") as log:
            self.process = subprocess.Popen(command, cwd=folder, env=self.environment, stdout=log, stderr=log)
        self.until(lambda: self.picture().max() > 60)
        self.settle()

    def xdotool(self, *words: object) -> None:
        subprocess.run(["xdotool", *map(str, words)], env=self.environment, check=True, capture_output=True)

    def move(self, x: float, y: float) -> None:
        self.xdotool("mousemove", int(x), int(y))

    def drag(self, button: int, *places: tuple[float, float]) -> None:
        self.move(*places[0])
        time.sleep(0.2)
        self.xdotool("mousedown", button)
        for place in places[1:]:
            self.move(*place)
            time.sleep(0.05)
        self.xdotool("mouseup", button)

    def screen(self) -> np.ndarray:
        """Return the screen's pixels in the window."""
        from PIL import ImageGrab

        grabbed = np.asarray(ImageGrab.grab(xdisplay=self.display).convert("RGB"))
        return grabbed[: SIZE[1], : SIZE[0]].astype(int)

    def picture(self) -> np.ndarray:
        """Return the part of the screen that no panel covers."""
        return self.screen()[:, 420:]

    def until(self, done) -> None:
        deadline = time.monotonic() + SECONDS
        while not done():
            assert self.process.poll() is None, self.log.read_text()
            assert time.monotonic() < deadline, self.log.read_text()
            time.sleep(0.1)

    def cpu(self) -> float:
        """Return the seconds of processor time used so far."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def memory(self) -> float:
        """Return the MiB in memory."""
        return int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20

    def settle(self) -> None:
        """Wait until the process is idle and the screen does not change."""
        quiet, seen = 0, self.screen()
        while quiet < 4:
            assert self.process.poll() is None, self.log.read_text()
            before = self.cpu()
            time.sleep(0.25)
            seen, last = self.screen(), seen
            quiet = quiet + 1 if self.cpu() - before < 0.03 and np.array_equal(seen, last) else 0

    def close(self) -> None:
        self.process.terminate()
        self.process.wait()

    def quit(self) -> int:
        """Close it by its own key; return the exit code."""
        self.xdotool("key", "ctrl+q")
        return self.process.wait(SECONDS)


@pytest.fixture(scope="module")
def running(display, tmp_path_factory):
    """One viewer for all tests that leave it as it was."""
    viewer = Viewer(display, tmp_path_factory.mktemp("viewer"), *QUICK, "--gi", "none")
    yield viewer
    viewer.close()


@pytest.fixture
def viewer(running):
    """The viewer with the camera it began with."""
    running.move(*FREE)
    running.xdotool("key", "Home")
    running.settle()
    return running


def test_mouse_and_keys_move_the_view(viewer):
    def changes(what) -> bool:
        before = viewer.picture()
        what()
        viewer.until(lambda: np.abs(viewer.picture() - before).mean() > 1)
        viewer.settle()
        return True

    start = viewer.picture()
    assert changes(lambda: viewer.drag(1, FREE, (530, 122), (540, 124)))
    assert changes(lambda: viewer.drag(3, FREE, (510, 120)))
    assert changes(lambda: viewer.drag(2, FREE, (540, 135)))
    assert changes(lambda: viewer.xdotool("click", 4))
    assert changes(lambda: viewer.xdotool("key", "Home"))
    assert np.abs(viewer.picture() - start).mean() < 1
    viewer.xdotool("mousemove", *FREE, "mousedown", 3, "keydown", "w")
    viewer.until(lambda: np.abs(viewer.picture() - start).mean() > 1)
    viewer.xdotool("keyup", "w", "mouseup", 3)
    viewer.settle()
    assert changes(lambda: viewer.xdotool("key", "f"))
    assert changes(lambda: viewer.xdotool("key", "1"))
    assert np.abs(viewer.picture() - start).mean() < 1


def test_still_view_uses_no_cpu(viewer):
    viewer.move(*FREE)
    viewer.settle()
    before = viewer.cpu()
    time.sleep(4)
    assert viewer.cpu() - before < 0.2


def test_probe_shows_the_pixel_under_the_mouse(viewer):
    # Must run before the tests that leave a message above this section of the panel.
    def panel() -> np.ndarray:
        return viewer.screen()[200:240, :380]

    viewer.xdotool("mousemove", *HEADER, "click", 1)
    viewer.move(*FREE)
    viewer.settle()
    before = panel()
    viewer.move(FREE[0] - 60, FREE[1] + 60)
    viewer.until(lambda: np.abs(panel() - before).max() > 50)
    viewer.xdotool("mousemove", *HEADER, "click", 1)


def test_double_click_sets_the_pivot(viewer):
    viewer.xdotool("mousemove", *FREE, "click", "--repeat", 2, "--delay", 100, 1)
    viewer.settle()
    at = viewer.picture()
    viewer.drag(1, FREE, (530, 120))
    viewer.settle()
    assert np.abs(viewer.picture() - at).mean() > 1


def test_saved_picture_equals_the_screen_and_the_copied_command(viewer, tmp_path, monkeypatch):
    viewer.drag(1, FREE, (530, 124))
    viewer.settle()
    viewer.xdotool("key", "s")
    viewer.until(lambda: (viewer.folder / "cornell-point-001.exr").exists())
    viewer.xdotool("key", "c")
    viewer.until(lambda: "wgpu-gi render" in viewer.log.read_text())
    viewer.settle()
    saved = np.asarray(Image.open(viewer.folder / "cornell-point-001.png")).astype(int)
    assert (np.abs(saved[:, 420:] - viewer.picture()).max(-1) <= 2).mean() > 0.99
    monkeypatch.chdir(tmp_path)
    command = re.search(r"^wgpu-gi (render .*)$", viewer.log.read_text(), re.MULTILINE)[1]
    assert main(shlex.split(command)) == 0
    again = np.asarray(Image.open("view.png")).astype(int)
    assert (np.abs(saved - again).max(-1) <= 2).mean() > 0.99


def test_panel_and_help_toggle(viewer):
    before = viewer.screen()
    viewer.xdotool("key", "Tab")
    viewer.until(lambda: np.abs(viewer.screen() - before)[:, :380].mean() > 10)
    without = viewer.screen()
    viewer.xdotool("key", "question")
    viewer.until(lambda: np.abs(viewer.screen() - without).mean() > 5)
    viewer.xdotool("key", "Escape")
    viewer.until(lambda: np.abs(viewer.screen() - without).mean() < 1)
    viewer.xdotool("key", "Tab")
    viewer.until(lambda: np.abs(viewer.screen() - without)[:, :380].mean() > 10)


def test_window_can_have_any_size(viewer):
    before = viewer.picture()
    for width, height in ((120, 90), (1, 1), (700, 3), (3, 400), SIZE):
        viewer.xdotool("search", "--onlyvisible", "--name", "wgpu_gi", "windowsize", width, height)
        viewer.settle()
    viewer.until(lambda: np.abs(viewer.picture() - before).mean() < 1)


def test_memory_does_not_grow_over_five_hundred_frames(viewer):
    def orbit(count: int) -> None:
        viewer.move(*FREE)
        viewer.xdotool("mousedown", 1)
        for i in range(count):
            viewer.move(FREE[0] + 20 * (i % 2), FREE[1] + i % 7)
        viewer.xdotool("mouseup", 1)
        viewer.settle()

    orbit(100)
    before = viewer.memory()
    orbit(500)
    assert viewer.memory() - before < 20
    assert "error" not in viewer.log.read_text().lower()


@pytest.mark.parametrize("gi", TECHNIQUES)
def test_every_technique_renders_and_quits(gi, display, tmp_path):
    viewer = Viewer(display, tmp_path, *QUICK, "--gi", gi, "--quality", "low", "--spp", "2")
    try:
        before = viewer.picture()
        viewer.drag(1, FREE, (540, 124))
        viewer.until(lambda: np.abs(viewer.picture() - before).mean() > 1)
        viewer.settle()
        assert "error" not in viewer.log.read_text().lower()
        assert viewer.quit() == 0
        lines = viewer.log.read_text().splitlines()
        assert not [line for line in lines if not line.startswith(("loading ", "note: ", "warning: "))]
    finally:
        viewer.close()


def test_space_plays_and_pauses_the_animation(display, tmp_path):
    viewer = Viewer(display, tmp_path, "walk", *QUICK[1:], "--gi", "none")
    try:
        viewer.move(*FREE)
        viewer.xdotool("key", "space")
        for _ in range(3):
            before = viewer.picture()
            viewer.until(lambda before=before: np.abs(viewer.picture() - before).mean() > 1)
        viewer.xdotool("key", "space")
        viewer.settle()
        viewer.xdotool("key", "c")
        viewer.until(lambda: re.search(r"--at \d\.\d+ --animation=walk", viewer.log.read_text()))
    finally:
        viewer.close()


@pytest.mark.parametrize(("name", "message"), [(None, "DISPLAY is not set"), (":9999", "no window can be opened")])
def test_a_missing_display_is_one_sentence(name, message, tmp_path):
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    if name is not None:
        environment["DISPLAY"] = name
    command = [sys.executable, "-m", "wgpu_gi", "view"]
    result = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
