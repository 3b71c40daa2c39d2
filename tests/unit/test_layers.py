"""The rules that the source itself holds: imports go one way, ruff and mypy have nothing to say."""

from __future__ import annotations

import ast
import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "wgpu_gi"

# What a module may import of the package, by its place; the first pattern that fits counts. A name ending in "." is a
# folder. Everything may import errors, resources and tables.
EVERYWHERE = ("errors", "resources", "tables")
RULES = [
    (r"errors|resources|tables", ()),
    (r"__init__", ("",)),
    (r"__main__|cli_\w+", ("",)),
    (r"settings|camera", ()),
    (r"image|metrics", ("image", "atomic_file")),
    (r"compare_page", ("image", "metrics")),
    (r"atomic_file", ()),
    (r"video", ("image", "atomic_file")),
    (r"picture", ("image",)),
    (r"viewer\.\w+", ("viewer.", "renderer", "frame", "scene.", "gpu.", "settings", "camera", "image", "metrics")),
    (r"gpu\.\w+", ("gpu.",)),
    (r"scene\.upload(_materials)?", ("scene.", "gpu.", "camera", "settings")),
    (r"scene\.\w+", ("scene.", "camera", "settings", "image")),
    (r"techniques\.\w+", ("techniques.", "gpu.", "scene.", "settings", "camera")),
    (r"renderer|frame\w*", ("frame", "techniques.", "gpu.", "scene.", "settings", "camera", "image", "picture")),
    (r"truth_cache", ("renderer", "frame", "scene.", "gpu.wgsl", "camera", "image", "atomic_file")),
    (
        r"bench",
        (
            *("bench_results", "truth_cache", "renderer", "frame", "techniques.", "scene.", "gpu."),
            *("camera", "metrics", "__init__"),
        ),
    ),
    (r"bench_\w+", ("bench_results", "metrics", "atomic_file")),
]
NEVER_IMPORTED = re.compile(r"__main__|cli_\w+|viewer\.\w+")
IMPORTS_ALL = re.compile(r"__init__|" + NEVER_IMPORTED.pattern)


def modules() -> dict[str, Path]:
    """Return every module of the package by its dotted name within it."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        if parts[0] in ("wgsl", "scenes"):
            continue
        found[".".join(parts)] = path
    return found


def imports_of(name: str, text: str, known: set[str]) -> set[str]:
    """Return the modules of the package that the source text of module `name` imports, anywhere in it."""
    folder = name.split(".")[:-1]
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and (node.level or (node.module or "").split(".")[0] == "wgpu_gi"):
            base = folder[: len(folder) - node.level + 1] if node.level else []
            module = (node.module or "").split(".")[0 if node.level else 1 :]
            source = [part for part in (*base, *module) if part]
            for alias in node.names:
                candidates = (".".join([*source, alias.name]), ".".join(source), ".".join([*source, "__init__"]))
                found.update([next(c for c in (*candidates, "__init__") if c in known)])
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.split(".")[0] == "wgpu_gi":
                    found.add(alias.name.partition(".")[2] or "__init__")
    return found


def allowed(name: str, target: str) -> bool:
    prefixes = next(what for pattern, what in RULES if re.fullmatch(pattern, name))
    if name in ("__init__", "__main__") or name.startswith("cli_"):
        return True
    return target in EVERYWHERE or any(target == p or (p.endswith(".") and target.startswith(p)) for p in prefixes)


def test_imports_go_one_way():
    known = set(modules())
    wrong = []
    for name, path in modules().items():
        assert any(re.fullmatch(pattern, name) for pattern, _ in RULES), f"no import rule covers {name}; add one"
        for target in imports_of(name, path.read_text(encoding="utf-8"), known):
            if not allowed(name, target) or (NEVER_IMPORTED.fullmatch(target) and not IMPORTS_ALL.fullmatch(name)):
                wrong.append(f"{name} imports {target}")
    assert not wrong


@pytest.mark.parametrize(
    ("name", "text", "found"),
    [
        ("gpu.graph", "from ..errors import GiError", {"errors"}),
        ("gpu.graph", "from . import device", {"gpu.device"}),
        ("gpu.graph", "from .device import open_device", {"gpu.device"}),
        ("gpu.graph", "def f():\n    from ..scene import scene", {"scene.scene"}),
        ("image", "import numpy\nfrom .errors import GiError", {"errors"}),
        ("image", "import wgpu_gi.scene.scene", {"scene.scene"}),
        ("image", "from wgpu_gi.scene.scene import Scene", {"scene.scene"}),
        ("image", "from . import __version__", {"__init__"}),
    ],
)
def test_import_finder(name, text, found):
    known = {"__init__", "errors", "image", "gpu.device", "gpu.graph", "scene.scene"}
    assert imports_of(name, text, known) == found


def test_forbidden_imports_would_be_seen():
    assert allowed("techniques.reference", "gpu.graph")
    assert allowed("scene.upload", "gpu.graph")
    for name, target in [("gpu.graph", "scene.scene"), ("scene.gltf", "gpu.graph"), ("techniques.rsm", "renderer")]:
        assert not allowed(name, target)


def test_every_module_opens_with_what_it_is():
    silent = [name for name, path in modules().items() if not ast.get_docstring(ast.parse(path.read_text()))]
    assert not [name for name in silent if not name.endswith("__init__")]


@pytest.mark.parametrize("tool", [("ruff", "check"), ("mypy",)], ids=lambda tool: tool[0])
def test_linter_is_silent(tool):
    name, *arguments = tool
    if importlib.util.find_spec(name) is None and not os.environ.get("CI"):
        pytest.skip(f"{name} is not installed")
    command = [sys.executable, "-m", name, *arguments]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
