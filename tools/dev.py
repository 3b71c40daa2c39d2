"""Set up the project on a bare machine, then run one of these commands; standard library only.

    python3 tools/dev.py render [wgpu-gi render arguments]   # a picture: out.png
    python3 tools/dev.py view [wgpu-gi view arguments]       # a window
    python3 tools/dev.py notebook [jupyter lab arguments]    # JupyterLab with a copy of the example: example.ipynb
    python3 tools/dev.py bench [wgpu-gi bench arguments]     # error and time of every technique
    python3 tools/dev.py lint                                # ruff, mypy, check_wgsl.py
    python3 tools/dev.py test [pytest arguments]             # the test suite
    python3 tools/dev.py setup                               # only the set-up, for all of these

The set-up makes `.venv` beside this folder, installs the package into it, and finds or installs a Vulkan driver; the
tests also need Xvfb and xdotool. A stamp in `.venv` records the Python, the pyproject.toml and the extras that are
installed, so the next run skips the set-up. After an interrupted set-up the next run starts from an empty `.venv`.
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
DEV = ("dev", "viewer", "lab", "bench")  # extras; the first includes the others
EXAMPLE = ROOT / "tests" / "notebook" / "example.ipynb"
DRIVER_PACKAGES = ("mesa-vulkan-drivers", "libvulkan1")
DISPLAY_TOOLS = {"Xvfb": "xvfb", "xdotool": "xdotool"}  # command: Debian package


class SetupError(Exception):
    """One sentence: what is missing and what to do."""


def main() -> int:
    """Run the command; return the exit code."""
    verb, arguments = (sys.argv[1] if len(sys.argv) > 1 else ""), sys.argv[2:]
    # Mesa complains once per device if this is not set.
    os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())
    try:
        if verb in VERBS:
            extras, action = VERBS[verb]
            set_up(extras)
            return action(arguments)
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


def render(arguments: list[str]) -> int:
    """Render a picture to out.png, unless the arguments name another file."""
    return run_tool([BIN / "wgpu-gi", "render", "-o", "out.png", *arguments])


def view(arguments: list[str]) -> int:
    """Open the window."""
    return run_tool([BIN / "wgpu-gi", "view", *arguments])


def notebook(arguments: list[str]) -> int:
    """Open JupyterLab with a copy of the example in the current folder; an existing copy stays unchanged."""
    copy = Path("example.ipynb")
    if not copy.exists():
        shutil.copyfile(EXAMPLE, copy)
    # Jupyter refuses to start for root, which is the usual user of a container. It serves this machine only.
    root = ["--allow-root"] if os.name != "nt" and os.geteuid() == 0 else []
    return run_tool([PYTHON, "-m", "jupyterlab", *root, copy, *arguments])


def bench(arguments: list[str]) -> int:
    """Measure error and time."""
    return run_tool([BIN / "wgpu-gi", "bench", *arguments])


def lint(arguments: list[str]) -> int:
    """Run all linters, even if one complains; return 1 if any does."""
    if arguments:
        raise SetupError(f"lint takes no arguments, not {' '.join(arguments)}")
    linters: list[list] = [
        ["-m", "ruff", "check"],
        ["-m", "ruff", "format", "--check"],
        ["-m", "mypy"],
        [ROOT / "tools" / "check_wgsl.py"],
    ]
    codes = []
    for linter in linters:
        say(" ".join(Path(part).name if isinstance(part, Path) else part for part in linter if part != "-m"))
        codes.append(run_tool([PYTHON, *linter], folder=ROOT))
    return int(any(codes))


def test(arguments: list[str]) -> int:
    """Run the tests, two at a time: they compile many shaders, and compiling keeps one core busy."""
    ensure_display_tools()
    return run_tool([PYTHON, "-m", "pytest", "-n", "2", "--dist", "worksteal", *arguments], folder=ROOT)


def setup(arguments: list[str]) -> int:
    """Install what the tests need besides Python packages."""
    ensure_display_tools()
    return 0


# The extras of pyproject.toml that a command needs, and its function.
VERBS = {
    "render": ((), render),
    "view": (("viewer",), view),
    "notebook": (("lab",), notebook),
    "bench": (("bench",), bench),
    "lint": (DEV, lint),
    "test": (DEV, test),
    "setup": (DEV, setup),
}


def set_up(extras: tuple[str, ...]) -> None:
    """Install what `pyproject.toml` requires, unless the stamp says that it is done; ensure a Vulkan driver."""
    if sys.version_info < (3, 10):  # noqa: UP036 - an older Python must get this message
        raise SetupError(f"Python 3.10 or newer is needed, not {platform.python_version()}")
    found = STAMP.read_text().splitlines() if STAMP.is_file() else []
    place, content = stamp_lines()
    installed = set(found[2].split()) if found[:2] == [place, content] else set()
    if found[:2] != [place, content] or not installed.issuperset(extras):
        if found[:1] != [place]:
            make_venv()
        STAMP.write_text(INCOMPLETE)
        install(extras)
        STAMP.write_text("\n".join((place, content, " ".join(sorted(installed.union(extras))), "")))
    ensure_vulkan()


def install(extras: tuple[str, ...]) -> None:
    """Install the package, editable, with its dependencies and those of `extras`."""
    name = f"[{','.join(extras)}]" if extras else ""
    say(f"installing wgpu_gi{name} and what it depends on (a minute or two)")
    pip_install = [PYTHON, "-m", "pip", "install", "-q", "--disable-pip-version-check", "-e"]
    run_quietly([*pip_install, f".{name}"], "pip install")
    # meshoptimizer, of the [gltf] extra, comes as source only; without it the tests that need it are skipped.
    if "dev" in extras and not succeeds([*pip_install, ".[gltf]"]):
        say("meshoptimizer could not be built (that needs a C++ compiler), so its tests will be skipped")


def stamp_lines() -> tuple[str, str]:
    """Return the first lines of a finished set-up's stamp: the Python and the folder; the hash of pyproject.toml."""
    content = hashlib.sha256((ROOT / "pyproject.toml").read_bytes()).hexdigest()
    return f"{platform.python_version()} {sys.base_prefix} {ROOT}", content


def make_venv() -> None:
    """Make an empty virtual environment, marked as incomplete from the start."""
    if importlib.util.find_spec("ensurepip") is None:  # Debian has it in a separate package
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
    """Check that a Vulkan device answers; if none does, install Mesa's CPU driver on Debian and Ubuntu."""
    if sys.platform != "linux" or has_vulkan_device():
        return
    apt_install(*DRIVER_PACKAGES)
    if not has_vulkan_device():
        raise SetupError(
            "no Vulkan device answers; install your GPU's Vulkan driver, or for rendering on the CPU "
            f"(Debian, Ubuntu, as root): apt-get install {' '.join(DRIVER_PACKAGES)}"
        )


def ensure_display_tools() -> None:
    """Check for a virtual display and simulated input, which the tests of the window need; install them if possible."""
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
    """Count devices in a new process: it finds newly installed libraries, and only it crashes if a driver does."""
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
    """Install Debian packages as root, or with sudo if it asks for no password; else do nothing."""
    if shutil.which("apt-get") is None:
        return
    prefix = [] if os.geteuid() == 0 else ["sudo", "-n"]
    if prefix and not (shutil.which("sudo") and succeeds([*prefix, "true"])):
        return
    say(f"installing {' '.join(packages)} with apt-get")
    apt = [*prefix, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "-q", "-y"]
    succeeds([*apt, "update"])  # it also fails for sources that are not needed here, so its result says little
    run_quietly([*apt, "install", "--no-install-recommends", *packages], "apt-get install")


def run_tool(command: list, folder: Path | None = None) -> int:
    """Run a command in the foreground, which handles Ctrl-C itself; return its exit code."""
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
        raise SetupError(f"{what} failed (its output is above); fix that, then run this again")


def succeeds(command: list) -> bool:
    """Run a command without showing its output; return whether it exited with 0."""
    command = [str(part) for part in command]
    return subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, capture_output=True, check=False).returncode == 0


def say(sentence: str) -> None:
    """Print one line of progress."""
    print(f"dev.py: {sentence}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
