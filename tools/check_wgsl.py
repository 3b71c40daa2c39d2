"""Compile every shader with naga, through wgpu, and with Tint, through Debian's chromium if that is installed.

    python tools/check_wgsl.py [shader.wgsl ...]      # paths below wgsl/; without any: all that have an entry point

Browsers use Tint or naga, so shaders that pass both run everywhere. Only Tint checks that control flow is uniform where
WGSL requires it.
"""

from __future__ import annotations

import json
import queue
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # also where the package is not installed

from wgpu_gi.errors import GiError
from wgpu_gi.gpu.device import open_device
from wgpu_gi.gpu.messages import compiler_message
from wgpu_gi.gpu.wgsl.load import ShaderSource, load
from wgpu_gi.resources import resource_dir

CHROMIUM_NAMES = ("chromium", "chromium-browser", "google-chrome")
# Chromium includes SwiftShader, a Vulkan driver on the CPU, so no GPU is needed. Chromium's sandbox does not start for
# root; it is not needed, since the page is our own.
CHROMIUM_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader",
    "--disable-extensions",
    "--no-first-run",
    "--remote-debugging-port=0",  # keeps chromium running until the answer arrives
)
TINT_TIMEOUT = 120.0  # seconds
PAGE = """<!doctype html><script type="module">
const answer = {};
try {
  const adapter = await navigator.gpu?.requestAdapter();
  if (!adapter) throw new Error("no WebGPU adapter");
  const device = await adapter.requestDevice();
  for (const [name, code] of Object.entries(await (await fetch("/sources")).json())) {
    device.pushErrorScope("validation");
    const info = await device.createShaderModule({ code }).getCompilationInfo();
    await device.popErrorScope();
    answer[name] = info.messages.map(m => [m.type, m.lineNum, m.message]);
  }
} catch (error) { answer[""] = String(error); }
await fetch("/answer", { method: "POST", body: JSON.stringify(answer) });
</script>"""


def entry_shaders() -> list[str]:
    """Return the paths, below wgsl/, of all shaders that have an entry point."""
    root = resource_dir("wgsl")
    paths = sorted(path.relative_to(root).as_posix() for path in root.rglob("*.wgsl"))
    return [path for path in paths if re.search(r"@(compute|vertex|fragment)\b", (root / path).read_text("utf-8"))]


def naga_errors(source: ShaderSource) -> list[str]:
    """Compile with naga; return its messages, each with file and line."""
    try:
        open_device().gpu.create_shader_module(label=source.path, code=source.text)
    except GiError:
        raise
    except Exception as error:  # wgpu's own kinds of error differ from version to version
        return [compiler_message(error, source)]
    return []


def find_chromium() -> str | None:
    """Return the path of a chromium, or None."""
    return next((path for name in CHROMIUM_NAMES if (path := shutil.which(name))), None)


def tint_errors(chromium: str, sources: Sequence[ShaderSource]) -> list[str]:
    """Compile with Tint; return its errors and warnings, each with file and line.

    Raises GiError if this chromium offers no WebGPU.
    """
    answer = _ask_page(chromium, {source.path: source.text for source in sources})
    if "" in answer:
        raise GiError(f"{chromium} offers no WebGPU here: {answer['']}")
    return [
        f"{source.where(line)}: {kind}: {message}"
        for source in sources
        for kind, line, message in answer[source.path]
        if kind != "info"
    ]


def _ask_page(chromium: str, sources: dict[str, str]) -> dict[str, list]:
    """Serve the page to a local chromium; return what the page posts: messages by shader, or {"": reason}."""
    answer: queue.Queue[dict[str, list]] = queue.Queue()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self._reply(json.dumps(sources) if self.path == "/sources" else PAGE)

        def do_POST(self) -> None:
            answer.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self._reply("")

        def _reply(self, text: str) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.end_headers()
            self.wfile.write(text.encode())

        def log_message(self, *_: object) -> None:
            pass

    with (
        ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server,
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile,
    ):
        threading.Thread(target=server.serve_forever, daemon=True).start()
        command = [chromium, *CHROMIUM_FLAGS, f"--user-data-dir={profile}", f"http://127.0.0.1:{server.server_port}/"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            return answer.get(timeout=TINT_TIMEOUT)
        except queue.Empty:
            raise GiError(f"{chromium} gave no answer within {TINT_TIMEOUT:.0f} s") from None
        finally:
            process.terminate()
            process.wait()
            server.shutdown()


def main() -> int:
    """Check the shaders named on the command line, or all; return 1 if a compiler reports anything."""
    try:
        sources = [load(path) for path in sys.argv[1:] or entry_shaders()]
        errors = [error for source in sources for error in naga_errors(source)]
        compilers = "naga"
        chromium = find_chromium()
        if chromium is None:
            print("Tint: skipped, chromium is not installed (Debian: apt-get install chromium)", file=sys.stderr)
        else:
            errors += tint_errors(chromium, sources)
            compilers = "naga and Tint"
    except GiError as error:
        print(f"check_wgsl: error: {error}", file=sys.stderr)
        return 2
    print("\n".join([*errors, f"{len(sources)} shaders, {compilers}: {len(errors)} messages"]))
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())
