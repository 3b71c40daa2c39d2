"""Wheel, sdist, editable and plain installs all contain the shaders and the scenes."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SHADERS = sorted(p.relative_to(ROOT).as_posix() for p in (ROOT / "wgsl").rglob("*.wgsl"))
# Data files of the package.
DATA = [
    path.relative_to(ROOT).as_posix()
    for path in (ROOT / "wgpu_gi").rglob("*")
    if path.is_file() and path.suffix != ".py" and "__pycache__" not in path.parts
]
SCENES = sorted(p.relative_to(ROOT).as_posix() for p in (ROOT / "scenes").rglob("*") if p.is_file())

pytestmark = pytest.mark.skipif(
    not (ROOT / "pyproject.toml").is_file() or not all(map(importlib.util.find_spec, ("hatchling", "build"))),
    reason="needs the repository, hatchling and build",
)


def run(*command: object, folder: Path = ROOT) -> str:
    """Run a command away from this checkout's PYTHONPATH; return what it printed."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    result = subprocess.run(
        [str(part) for part in command], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> tuple[Path, Path]:
    """Build the sdist, and the wheel from it, as a release does; return both files."""
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, ROOT)
    return next(folder.glob("*.tar.gz")), next(folder.glob("*.whl"))


def test_wheel_holds_everything(built):
    with zipfile.ZipFile(built[1]) as wheel:
        names = set(wheel.namelist())
        metadata = wheel.read(next(n for n in names if n.endswith("METADATA"))).decode()
    assert names >= {f"wgpu_gi/{name}" for name in (*SHADERS, *SCENES, "__main__.py")}
    assert {"wgpu_gi/py.typed", "wgpu_gi/measure/compare_page.html"} <= set(DATA) <= names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not [name for name in names if name.startswith(("tests/", "tools/", "wgsl/"))]
    required = re.findall(r"^Requires-Dist: ([\w-]+)(?!.*extra ==)", metadata, re.M)
    assert sorted(map(str.lower, required)) == ["mapbox-earcut", "numpy", "openexr", "pillow", "rich", "tomli", "wgpu"]


def test_sdist_holds_everything(built):
    with tarfile.open(built[0]) as sdist:
        names = {name.partition("/")[2] for name in sdist.getnames()}
    assert names >= {*SHADERS, *SCENES, "pyproject.toml", "LICENSE", "README.md", "tools/dev.py", "tests/conftest.py"}
    assert not [name for name in names if name.startswith((".venv", ".git/"))]


@pytest.mark.parametrize("kind", ["wheel", "sdist", "editable"])
def test_install_finds_shaders_and_scenes(kind, built, tmp_path):
    """Install without dependencies into an environment that sees the packages of this one, and ask from elsewhere."""
    environment = tmp_path / "env"
    venv.create(environment, with_pip=False, symlinks=os.name != "nt")
    python = environment / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    site = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip())
    here = run(sys.executable, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip()
    (site / "packages_of_the_tests.pth").write_text(here)
    source = {"wheel": [built[1]], "sdist": [built[0]], "editable": ["-e", ROOT]}[kind]
    install = [sys.executable, "-m", "pip", "--python", python, "install", "-q", "--disable-pip-version-check"]
    run(*install, "--no-deps", "--no-build-isolation", "--no-index", "--ignore-installed", *source)

    code = "from wgpu_gi import resources as r; print(r.__file__, *map(r.resource_dir, ('wgsl', 'scenes')), sep='\\n')"
    module, shaders, scenes = map(Path, run(python, "-c", code, folder=tmp_path).split("\n")[:3])
    assert module.is_relative_to(ROOT if kind == "editable" else site)
    expected = {name.partition("/")[2] for name in SHADERS}
    assert {p.relative_to(shaders).as_posix() for p in shaders.rglob("*.wgsl")} == expected
    assert {f"scenes/{p.relative_to(scenes).as_posix()}" for p in scenes.rglob("*") if p.is_file()} == set(SCENES)
    assert run(python.parent / "wgpu-gi", "--version", folder=tmp_path).startswith("wgpu_gi ")
