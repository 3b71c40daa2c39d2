"""Set the project up on a bare machine, then render the Cornell box or run the tests; standard library only.

    python3 tools/dev.py render [wgpu-gi render arguments]   # a picture: out.png
    python3 tools/dev.py view [wgpu-gi view arguments]       # a window
    python3 tools/dev.py test [pytest arguments]             # the test suite
    python3 tools/dev.py setup                               # only the set-up

Set-up makes `.venv` beside this folder, installs the package into it, and sees to a Vulkan driver; for the tests also
to Xvfb and xdotool. It is done once: a stamp in `.venv` says for which pyproject.toml and which Python. An interrupted
set-up is started again from nothing.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
STAMP = VENV / "wgpu_gi-setup"
INCOMPLETE = "incomplete"
BIN = VENV / ("Scripts" if os.name == "nt" else "bin")
PYTHON = BIN / ("python.exe" if os.name == "nt" else "python")
EXTRAS = ("", "[viewer]", "[dev]")  # each includes those before it
DRIVER_PACKAGES = ("mesa-vulkan-drivers", "libvulkan1")
DISPLAY_TOOLS = {"Xvfb": "xvfb", "xdotool": "xdotool"}  # of the tests of the window; in which package each is


class SetupError(Exception):
    """One sentence: what is missing and what to do."""


def main() -> int:
    """Carry out the verb; return the exit code."""
    verb, arguments = (sys.argv[1] if len(sys.argv) > 1 else ""), sys.argv[2:]
    # Mesa complains once per device if this is not set.
    os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())
    try:
        if verb == "render":
            set_up("")
            return run_tool([BIN / "wgpu-gi", "render", "-o", "out.png", *arguments])
        if verb == "view":
            set_up("[viewer]")
            return run_tool([BIN / "wgpu-gi", "view", *arguments])
        if verb == "test":
            set_up("[dev]")
            ensure_display_tools()
            # Two at a time: compiling shaders, the most of it, keeps one core busy.
            return run_tool([PYTHON, "-m", "pytest", "-n", "2", "--dist", "worksteal", *arguments], folder=ROOT)
        if verb == "setup":
            set_up("[dev]")
            ensure_display_tools()
            return 0
        if verb == "_vulkan":
            return 0 if count_vulkan_devices() > 0 else 1
    except SetupError as error:
        print(f"dev.py: error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("dev.py: interrupted", file=sys.stderr)
        return 130
    print(__doc__, file=sys.stderr)
    return 2


def set_up(extras: str) -> None:
    """Bring `.venv` and the driver to what `pyproject.toml` asks for; nothing to do if the stamp says so."""
    if sys.version_info < (3, 10):  # noqa: UP036 - this file is what tells an older Python
        raise SetupError(f"Python 3.10 or newer is needed, not {platform.python_version()}")
    wanted = stamp_text(extras)
    found = STAMP.read_text() if STAMP.is_file() else ""
    if found not in map(stamp_text, EXTRAS[EXTRAS.index(extras) :]):
        if found.partition("\n")[0] != wanted.partition("\n")[0]:
            make_venv()
        STAMP.write_text(INCOMPLETE)
        say(f"installing wgpu_gi{extras} and what it depends on (a minute or two)")
        pip_install = [PYTHON, "-m", "pip", "install", "-q", "--disable-pip-version-check", "-e"]
        run_quietly([*pip_install, f".{extras}"], "pip install")
        # meshoptimizer, of the [gltf] extra, comes as source only; the tests that need it can be skipped.
        if extras == "[dev]" and not succeeds([*pip_install, ".[gltf]"]):
            say("meshoptimizer could not be built (that needs a C++ compiler), so its tests will be skipped")
        STAMP.write_text(wanted)
    ensure_vulkan()


def stamp_text(extras: str) -> str:
    """Return what a finished set-up is known by: the Python and the place (first line), the requirements."""
    content = hashlib.sha256((ROOT / "pyproject.toml").read_bytes()).hexdigest()
    return f"{platform.python_version()} {sys.base_prefix} {ROOT}\n{content}\n{extras}\n"


def make_venv() -> None:
    """Make an empty virtual environment, marked as incomplete from its first moment."""
    if importlib.util.find_spec("ensurepip") is None:  # Debian keeps it in a package of its own
        apt_install("python3-venv")
        if not succeeds([sys.executable, "-c", "import ensurepip"]):
            raise SetupError("this Python has no ensurepip, which venv needs; on Debian: apt-get install python3-venv")
    if STAMP.exists():
        shutil.rmtree(VENV)
    elif VENV.exists() and any(VENV.iterdir()):
        raise SetupError(f"{VENV} was not made by this script; rename or remove it, then run this again")
    say(f"making a virtual environment in {VENV}")
    VENV.mkdir(exist_ok=True)
    STAMP.write_text(INCOMPLETE)
    run_quietly([sys.executable, "-m", "venv", str(VENV)], "venv")


def ensure_vulkan() -> None:
    """See that some Vulkan device answers; on Debian and Ubuntu install Mesa's, which runs on the CPU, if none does."""
    if sys.platform != "linux" or has_vulkan_device():
        return
    apt_install(*DRIVER_PACKAGES)
    if not has_vulkan_device():
        raise SetupError(
            "no Vulkan device answers; install your GPU's Vulkan driver, or for rendering on the CPU "
            f"(Debian, Ubuntu, as root): apt-get install {' '.join(DRIVER_PACKAGES)}"
        )


def ensure_display_tools() -> None:
    """See that there is what tests open windows with: a display that no one sees, a mouse that no one moves."""
    if sys.platform != "linux":
        return
    missing = [package for tool, package in DISPLAY_TOOLS.items() if shutil.which(tool) is None]
    if missing:
        apt_install(*missing)
    if not all(map(shutil.which, DISPLAY_TOOLS)):
        raise SetupError(
            f"the tests of the window need {' and '.join(DISPLAY_TOOLS)}; "
            f"on Debian and Ubuntu, as root: apt-get install {' '.join(missing)}"
        )


def has_vulkan_device() -> bool:
    """Ask in a process of its own, which sees libraries installed a moment ago and may die of a broken driver."""
    return succeeds([sys.executable, Path(__file__).resolve(), "_vulkan"])


def count_vulkan_devices() -> int:
    """Return how many devices the Vulkan loader offers; 0 without loader or driver."""
    try:
        vulkan = ctypes.CDLL("libvulkan.so.1")
    except OSError:
        return 0
    # VkInstanceCreateInfo: sType 1 (padded to 8), pNext, flags (padded), pApplicationInfo, layers, extensions: 64 bytes
    # on 64-bit systems, all zero but the first.
    create_info = (ctypes.c_uint64 * 8)(1)
    instance, count = ctypes.c_void_p(), ctypes.c_uint32()
    if vulkan.vkCreateInstance(create_info, None, ctypes.byref(instance)) != 0:
        return 0
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None)
    return count.value


def apt_install(*packages: str) -> None:
    """Install Debian packages where that needs no question: as root, or with sudo that asks for no password."""
    if shutil.which("apt-get") is None:
        return
    prefix = [] if os.geteuid() == 0 else ["sudo", "-n"]
    if prefix and not (shutil.which("sudo") and succeeds([*prefix, "true"])):
        return
    say(f"installing {' '.join(packages)} with apt-get")
    apt = [*prefix, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "-q", "-y"]
    succeeds([*apt, "update"])  # fails if any source does; whether the ones that matter are there shows below
    run_quietly([*apt, "install", "--no-install-recommends", *packages], "apt-get install")


def run_tool(command: list, folder: Path | None = None) -> int:
    """Run what the user asked for in the foreground; on Ctrl-C let it end in its own way."""
    process = subprocess.Popen([str(part) for part in command], cwd=folder)
    while True:
        try:
            return process.wait()
        except KeyboardInterrupt:
            continue


def run_quietly(command: list, what: str) -> None:
    """Run one step of the set-up; show its output only if it fails."""
    result = subprocess.run(
        [str(part) for part in command], cwd=ROOT, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    if result.returncode:
        print(result.stdout[-4000:], result.stderr[-4000:], sep="\n", file=sys.stderr)
        raise SetupError(f"{what} failed (its output is above); once that is put right, run this again")


def succeeds(command: list) -> bool:
    """Run a command in silence; return whether it exited with 0."""
    command = [str(part) for part in command]
    return subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, capture_output=True, check=False).returncode == 0


def say(sentence: str) -> None:
    """Print one line of progress."""
    print(f"dev.py: {sentence}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
