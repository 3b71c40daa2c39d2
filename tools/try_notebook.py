"""Drive the example notebook in JupyterLab in Chromium, as a user would, and take screenshots.

pip install -e '.[jupyter]' jupyterlab playwright      # and, on Debian: apt-get install chromium
python tools/try_notebook.py [FOLDER FOR SCREENSHOTS]
"""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from socket import socket
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import sync_playwright

EXAMPLE = Path(__file__).resolve().parent.parent / "tests/notebook/example.ipynb"
CANVAS = ".renderview-wrapper img.renderview-view"
SECONDS = 60.0  # longest wait for each condition
DRAG_SECONDS = 5.0  # length of the drag during which frames are counted


def main() -> int:
    """Run all steps; return the exit code."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "notebook-screens")
    folder.mkdir(parents=True, exist_ok=True)
    browser_path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if browser_path is None:
        print("no Chromium is installed; on Debian: apt-get install chromium", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as home, closing(socket()) as free:
        shutil.copy(EXAMPLE, home)
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
        free.close()
        server = start_lab(Path(home), port)
        try:
            with sync_playwright() as playwright:
                browser = playwright.chromium.launch(executable_path=browser_path, args=["--no-sandbox"])
                page = browser.new_page(viewport={"width": 1300, "height": 1000})
                page.goto(f"http://127.0.0.1:{port}/lab/tree/{EXAMPLE.name}?reset")
                try:
                    drive(page, folder, Path(home) / EXAMPLE.name)
                finally:
                    page.screenshot(path=str(folder / "last.png"))
                    browser.close()
        finally:
            server.terminate()
            server.wait()
    return 0


def start_lab(home: Path, port: int) -> subprocess.Popen[bytes]:
    """Start JupyterLab, reachable from this machine only, and wait until it answers."""
    options = [f"--port={port}", "--ip=127.0.0.1", "--no-browser", "--allow-root", "--IdentityProvider.token="]
    command = [sys.executable, "-m", "jupyterlab", *options, f"--ServerApp.root_dir={home}"]
    environment = {**os.environ, "JUPYTER_CONFIG_DIR": str(home / "config"), "JUPYTER_DATA_DIR": str(home / "data")}
    log = (home / "lab.log").open("w")
    server = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
    until(lambda: answers(port), "JupyterLab does not answer")
    return server


def answers(port: int) -> bool:
    """Tell whether the server answers."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/status", timeout=5):
            return True
    except (urllib.error.URLError, OSError):
        return False


def drive(page: Any, folder: Path, notebook: Path) -> None:
    """Run the notebook, drag the view, change exposure and buffer, and check the saved notebook."""
    page.wait_for_selector(".jp-Notebook .jp-Cell", timeout=SECONDS * 1e3)
    page.get_by_text("| Idle").wait_for(timeout=SECONDS * 1e3)  # a cell that is run before the kernel is ready is lost
    page.get_by_text("Run", exact=True).first.click()
    page.get_by_text("Run All Cells", exact=True).click()
    page.wait_for_selector(CANVAS, timeout=SECONDS * 1e3)
    canvas = page.locator(CANVAS).first
    canvas.scroll_into_view_if_needed()

    def picture() -> NDArray[np.int64]:
        return np.asarray(Image.open(io.BytesIO(canvas.screenshot())).convert("RGB")).astype(np.int64)

    def changed(before: NDArray[np.int64]) -> Callable[[], bool]:
        return lambda: bool(np.abs(picture() - before).mean() > 2)

    until(lambda: picture().mean() > 20, "the canvas stays dark")
    until(lambda: page.locator(".jp-InputPrompt", has_text="*").count() == 0, "the cells take too long")
    page.wait_for_timeout(5000)
    page.screenshot(path=str(folder / "1-shown.png"))
    start = picture()

    frames = page.evaluate(COUNT_FRAMES)
    box = canvas.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    begin, step = time.monotonic(), 0
    while time.monotonic() - begin < DRAG_SECONDS:
        step += 1
        page.mouse.move(x + 30 * np.sin(step / 10), y)
        page.wait_for_timeout(15)
    frames = page.evaluate("window.framesSeen") - frames
    page.mouse.move(x + 40, y)
    page.mouse.up()
    print(f"frames per second while dragging: {frames / (time.monotonic() - begin):.1f}")
    until(changed(start), "a drag does not turn the box")
    page.wait_for_timeout(3000)
    page.screenshot(path=str(folder / "2-turned.png"))

    before = picture()
    handle = page.locator(".noUi-handle").first
    handle.click()
    for _ in range(20):
        page.keyboard.press("ArrowRight")
    until(changed(before), "the slider of the exposure does nothing")
    page.wait_for_timeout(3000)
    page.screenshot(path=str(folder / "3-brighter.png"))

    before = picture()
    page.locator(".widget-dropdown select").nth(2).select_option("normal")
    until(changed(before), "the list of buffers does nothing")
    page.get_by_text("passes", exact=True).first.click()
    page.wait_for_timeout(3000)
    page.screenshot(path=str(folder / "4-normals.png"))
    still_there(page, folder, notebook)


COUNT_FRAMES = f"""() => {{
  window.framesSeen = 0;
  const image = document.querySelector("{CANVAS}");
  image.addEventListener("load", () => window.framesSeen++);
  return 0;
}}"""


def still_there(page: Any, folder: Path, notebook: Path) -> None:
    """Save the notebook and reload it without its kernel: the picture must be there."""
    page.keyboard.press("Control+s")
    until(lambda: "base64" in notebook.read_text(encoding="utf-8"), "the saved notebook holds no picture")
    page.get_by_text("Kernel", exact=True).first.click()
    page.get_by_text("Shut Down Kernel", exact=True).click()
    page.wait_for_timeout(2000)
    page.reload()
    page.wait_for_selector(".jp-Notebook .jp-Cell", timeout=SECONDS * 1e3)
    page.wait_for_selector("div[class^=wgpu-gi] img", timeout=SECONDS * 1e3)
    page.wait_for_timeout(2000)
    page.screenshot(path=str(folder / "5-saved.png"))
    assert page.locator("div[class^=wgpu-gi] img").first.is_visible(), "the picture of a saved notebook is hidden"


def until(done: Callable[[], bool], otherwise: str) -> None:
    """Wait until `done` returns True; fail with `otherwise` after SECONDS."""
    deadline = time.monotonic() + SECONDS
    while not done():
        assert time.monotonic() < deadline, otherwise
        time.sleep(0.2)


if __name__ == "__main__":
    sys.exit(main())
