"""Render small pictures on other Vulkan drivers for the CPU, and compare them with those of the first.

    python3 tools/drivers.py                      # every technique on SwiftShader and on a newer Mesa
    python3 tools/drivers.py ssdo ssil --only swiftshader
    python3 tools/drivers.py --tests              # the shader tests and the self-test of `wgpu-gi report` instead
    python3 tools/drivers.py --times              # milliseconds of each technique's frames instead

The first driver is the one that this machine uses. SwiftShader comes with Debian's Chromium, the newer Mesa from the
backports of the installed Debian; both are unpacked into a folder, and nothing is installed.

Two pictures of different seeds tell how much noise a picture has. A driver passes if its means are those of the first
within 0.3 %, or within the noise, and if no more pixels differ by more than 3/255 than between two seeds. Pixels at
edges are counted apart: drivers snap corners to grids of 1/16 to 1/256 pixel, so another surface may cover a pixel.
The exit code is 0 if all pass, 1 if not, 2 if a driver cannot be had.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # also where the package is not installed

from wgpu_gi.errors import GiError
from wgpu_gi.measure.truth import cache_folder
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.pictures.color import srgb_from_linear
from wgpu_gi.pictures.exposure import automatic_exposure

ROOT = Path(__file__).resolve().parents[1]
SWIFTSHADER = Path("/usr/lib/chromium/libvk_swiftshader.so")
STEP = 3  # of 255: smaller differences are not seen
MEAN_BOUND = 0.003
PIXEL_BOUND = 0.002  # share of pixels away from edges, beyond the noise
SCENES = ("cornell-spot", "courtyard")
TESTS = ("tests/shader", "tests/analytic/test_self_test.py")
LEFT_OUT = ("tests/shader/test_wgsl_compiles.py",)  # tests compilers


def swiftshader(folder: Path) -> Path:
    """Return the ICD file of SwiftShader, from Chromium if it is installed, else from its package."""
    library = SWIFTSHADER
    if not library.is_file():
        library = folder / "chromium" / SWIFTSHADER.relative_to("/")
        if not library.is_file():
            _unpack("chromium-common", folder / "chromium")
    return _icd(folder / "swiftshader.json", library, "1.3.0")


def mesa(folder: Path) -> Path:
    """Return the ICD file of lavapipe from the backports of this Debian."""
    unpacked = folder / "mesa"
    found = sorted(unpacked.rglob("libvulkan_lvp.so"))
    if not found:
        _unpack("mesa-vulkan-drivers", unpacked, backports=True)
        found = sorted(unpacked.rglob("libvulkan_lvp.so"))
    if not found:
        raise GiError("the package mesa-vulkan-drivers has no libvulkan_lvp.so")
    return _icd(folder / "mesa.json", found[0], "1.3.0")


DRIVERS = {"swiftshader": swiftshader, "mesa": mesa}


def _icd(path: Path, library: Path, version: str) -> Path:
    """Write the file that tells Vulkan's loader where a driver is."""
    path.parent.mkdir(parents=True, exist_ok=True)
    icd = {"library_path": str(library), "api_version": version}
    path.write_text(json.dumps({"file_format_version": "1.0.0", "ICD": icd}))
    return path


def _unpack(package: str, folder: Path, backports: bool = False) -> None:
    """Download a package of this Debian and unpack it into a folder. Raises GiError if that fails."""
    if shutil.which("apt-get") is None or shutil.which("dpkg") is None:
        raise GiError(f"{package} comes from Debian or Ubuntu, and this system has no apt-get")
    with tempfile.TemporaryDirectory() as temporary:
        options: list[str] = []
        if backports:
            options = _backports(Path(temporary))
            _run(["apt-get", *options, "-qq", "update"], temporary)
        _run(["apt-get", *options, "-qq", "download", package], temporary)
        (deb,) = Path(temporary).glob("*.deb")
        folder.parent.mkdir(parents=True, exist_ok=True)
        half = folder.with_name(folder.name + ".part")
        shutil.rmtree(half, ignore_errors=True)
        _run(["dpkg", "-x", str(deb), str(half)], temporary)
        shutil.rmtree(folder, ignore_errors=True)
        half.rename(folder)


def _backports(folder: Path) -> list[str]:
    """Return options that make apt-get read the backports of the installed release, and nothing else."""
    release = dict(
        line.partition("=")[::2] for line in Path("/etc/os-release").read_text(encoding="utf-8").splitlines()
    ).get("VERSION_CODENAME", "")
    targets = _run(["apt-get", "indextargets", "--format", "$(CODENAME) $(COMPONENT) $(REPO_URI)"], str(folder))
    mirrors = [line.split()[2] for line in targets.splitlines() if line.startswith(f"{release} main ")]
    if not mirrors:
        raise GiError(f"no package source of {release or 'this system'} is known; run apt-get update first")
    (folder / "lists" / "partial").mkdir(parents=True)
    (folder / "sources.list").write_text(f"deb {mirrors[0]} {release}-backports main\n")
    values = {
        "Dir::Etc::SourceList": folder / "sources.list",
        "Dir::Etc::SourceParts": "/dev/null",
        "Dir::State::Lists": folder / "lists",
        "Dir::Cache": folder,
        "APT::Sandbox::User": "root",
        "APT::Default-Release": f"{release}-backports",
    }
    return [f"-o{name}={value}" for name, value in values.items()]


def _run(command: Sequence[str], folder: str) -> str:
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if result.returncode:
        why = (result.stderr.strip() or result.stdout.strip() or "no message").splitlines()[-1]
        raise GiError(f"{' '.join(command[:1])} failed: {why}")
    return result.stdout


def environment(icd: Path | None) -> dict[str, str]:
    """Return the environment of a process that uses a driver; None: the first one."""
    more = {} if icd is None else {"VK_ICD_FILENAMES": str(icd), "VK_DRIVER_FILES": str(icd)}
    paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, **more, "PYTHONPATH": os.pathsep.join(filter(None, paths))}


def render(icd: Path | None, techniques: Sequence[str], folder: Path, name: str, more: Sequence[str]) -> Any:
    """Render the pictures, or measure the times, in a process of its own; return the arrays by name."""
    path = folder / f"{name}.npz"
    command = [sys.executable, str(ROOT / "tools" / "driver_pictures.py"), str(path), *techniques, *more]
    result = subprocess.run(command, env=environment(icd), capture_output=True, text=True, check=False)
    if result.returncode:
        why = (result.stderr.strip() or f"exit code {result.returncode}").splitlines()[-1]
        raise GiError(f"{name}: rendering failed: {why}")
    with np.load(path) as file:
        return {key: file[key] for key in file.files}


def compare(first: dict[str, NDArray], other: dict[str, NDArray], scene: str, gi: str) -> tuple[list[str], bool]:
    """Return the cells of a row, and whether the driver passes."""
    a, b, seed = first[f"{scene} {gi} 0"], other[f"{scene} {gi} 0"], first[f"{scene} {gi} 1"]
    edges = first[f"{scene} edges"] | other[f"{scene} edges"]
    mean, noise = float(b.mean() / a.mean() - 1), float(seed.mean() / a.mean() - 1)
    exposure = 2.0 ** automatic_exposure(a)

    def beyond(x: NDArray, where: NDArray[np.bool_]) -> float:
        off = np.abs(np.round(srgb_from_linear(x * exposure) * 255) - np.round(srgb_from_linear(a * exposure) * 255))
        return float((off.max(-1) > STEP)[where].mean()) if where.any() else 0.0

    flat, at_edges, noisy = beyond(b, ~edges), beyond(b, edges), beyond(seed, ~edges)
    passed = abs(mean) <= max(MEAN_BOUND, abs(noise)) and flat <= noisy + PIXEL_BOUND
    cells = [scene, gi, f"{mean:+.3%}", f"{noise:+.3%}", f"{flat:.2%}", f"{noisy:.2%}", f"{at_edges:.2%}"]
    return [*cells, "yes" if passed else "NO"], passed


def print_comparison(first: dict[str, NDArray], other: dict[str, NDArray], techniques: Sequence[str]) -> bool:
    """Print a row for each scene and technique; return whether all pass."""
    print("| scene | technique | mean | mean, other seed | > 3/255 | > 3/255, other seed | > 3/255 at edges | passes |")
    print("|---|---|---|---|---|---|---|---|")
    rows = [compare(first, other, scene, gi) for scene in SCENES for gi in techniques]
    for cells, _ in rows:
        print("| " + " | ".join(cells) + " |")
    return all(passed for _, passed in rows)


def print_times(times: dict[str, dict[str, NDArray]], techniques: Sequence[str]) -> None:
    """Print the milliseconds of a frame by technique and driver."""
    print(f"| technique | {' | '.join(times)} |\n|---|{'---|' * len(times)}")
    for gi in techniques:
        print(f"| {gi} | {' | '.join(f'{float(found[gi]):.0f}' for found in times.values())} |")


def run_tests(icd: Path | None) -> bool:
    """Run the tests that depend on the driver; return whether they pass."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not hour", "--tb=line", *TESTS]
    command += [f"--ignore={name}" for name in LEFT_OUT]
    return subprocess.run(command, cwd=ROOT, env=environment(icd), check=False).returncode == 0


def main(arguments: Sequence[str]) -> int:
    """Do what the arguments say; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("techniques", nargs="*", metavar="TECHNIQUE", help=f"of {', '.join(TECHNIQUES)}; default all")
    parser.add_argument("--only", choices=DRIVERS, help="one driver instead of all")
    parser.add_argument("--tests", action="store_true", help="run tests instead")
    parser.add_argument("--times", action="store_true", help="measure times instead")
    parser.add_argument("--folder", type=Path, help="where drivers are unpacked, default in the cache of truths")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.techniques if name not in TECHNIQUES]
    if unknown:
        raise GiError(f"there is no technique {unknown[0]!r}; available: {', '.join(TECHNIQUES)}")
    techniques = options.techniques or list(TECHNIQUES)
    folder = options.folder or cache_folder().with_name("drivers")
    icds = {name: DRIVERS[name](folder) for name in ([options.only] if options.only else DRIVERS)}
    if options.tests:
        passed = True
        for name, icd in icds.items():
            print(f"{name}:", flush=True)
            passed = run_tests(icd) and passed
        return 0 if passed else 1

    # Render on each driver.
    more = ["--times"] if options.times else []
    with tempfile.TemporaryDirectory() as temporary:
        found = {"first": render(None, techniques, Path(temporary), "first", more)}
        for name, icd in icds.items():
            found[name] = render(icd, techniques, Path(temporary), name, more)
    titles = {name: str(arrays["driver"]) for name, arrays in found.items()}
    if options.times:
        print_times({titles[name]: arrays for name, arrays in found.items()}, techniques)
        return 0
    passed = True
    for name in icds:
        print(f"\n{titles[name]}, against {titles['first']}:\n")
        passed = print_comparison(found["first"], found[name], techniques) and passed
    return 0 if passed else 1


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except GiError as error:
        print(f"drivers.py: error: {error}", file=sys.stderr)
        sys.exit(2)
