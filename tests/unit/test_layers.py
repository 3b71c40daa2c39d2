"""The rules that the source itself holds: imports go one way. `tools/dev.py lint` runs ruff and mypy."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "wgpu_gi"

# The units of the package, a module or a folder each, by layers: a unit may import itself and lower layers, never
# another unit of its own layer.
LAYERS = [
    ("__init__", "__main__"),
    ("cli",),
    ("viewer",),
    ("farm",),
    ("dataset",),
    ("measure", "sequence"),
    ("rendering",),
    ("budget", "tiles"),
    ("renderer",),
    ("gpu_frame",),
    ("frame", "pixel_tracer", "surface_tracer"),
    ("buffers",),
    ("options",),
    ("techniques",),
    ("upload",),
    ("scene", "gpu"),
    ("settings", "camera", "pictures"),
    ("records",),
    ("errors", "extras", "float_limits", "reports", "resources", "version", "webgpu_limits"),
]
LEVEL = {unit: len(LAYERS) - number for number, units in enumerate(LAYERS) for unit in units}
# The layers within `techniques`: the systems stand beside one another, on the deferred base and what all share.
TECHNIQUE_LAYERS = [("many_light", "ssil", "ssao", "reference"), ("ssdo",), ("deferred",), ("shared",)]
TECHNIQUE_LEVEL = {name: -number for number, names in enumerate(TECHNIQUE_LAYERS) for name in names}
MIRRORED = ("deferred", "many_light", "ssdo", "ssil", "reference", "shared")
LIBRARIES = ("common", "scene")
# Direct light takes SSDO's search as contact shadow where a shadow map's bias lost it (Ritschel 2009, section 5).
CONTACT_SHADOWS = ("deferred", "ssdo/contact")


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
    """Return whether the module `name` may import `target`."""
    unit, other = name.split(".")[0], target.split(".")[0]
    if unit == other == "techniques" and "." in name and "." in target:
        unit, other = (module.split(".")[1] for module in (name, target))
        return unit == other or TECHNIQUE_LEVEL[unit] > TECHNIQUE_LEVEL[other]
    return unit == other or LEVEL[unit] > LEVEL[other]


def test_imports_go_one_way():
    known = set(modules())
    wrong = []
    for name, path in modules().items():
        assert name.split(".")[0] in LEVEL, f"{name} is in no layer; add it to LAYERS"
        for target in imports_of(name, path.read_text(encoding="utf-8"), known):
            if not allowed(name, target):
                wrong.append(f"{name} imports {target}")
    assert not wrong


def test_modules_import_one_another_in_no_circle():
    known = set(modules())
    graph = {
        name: {t for t in imports_of(name, path.read_text(encoding="utf-8"), known) if t != "__init__"} - {name}
        for name, path in modules().items()
    }
    # Take away modules that import nothing that is left; what remains imports in circles.
    while ready := {name for name, targets in graph.items() if not targets & graph.keys()}:
        graph = {name: targets for name, targets in graph.items() if name not in ready}
    assert not graph


def test_shaders_mirror_the_techniques():
    folders = {path.name for path in (ROOT / "wgsl").iterdir() if path.is_dir()}
    assert folders == {*MIRRORED, *LIBRARIES, "measure", "viewer"}
    # A folder within a technique's folder is a module of that technique.
    for folder in MIRRORED:
        for part in (path for path in (ROOT / "wgsl" / folder).iterdir() if path.is_dir()):
            assert (PACKAGE / "techniques" / folder / f"{part.name}.py").exists(), f"wgsl/{folder}/{part.name}"
    # A technique declares passes of its own shaders only, a shader imports only what its technique may.
    for name, path in modules().items():
        if name.startswith("techniques."):
            for shader in re.findall(r'"([a-z_/]+)\.wgsl"', path.read_text(encoding="utf-8")):
                assert allowed_shader(name.split(".")[1], shader), f"{name} uses {shader}.wgsl"
    for path in sorted((ROOT / "wgsl").rglob("*.wgsl")):
        place = path.relative_to(ROOT / "wgsl").parts[0]
        for shader in re.findall(r'#import "([a-z_/]+)\.wgsl"', path.read_text(encoding="utf-8")):
            assert allowed_shader(place, shader), f"{path} imports {shader}.wgsl"


def allowed_shader(folder: str, shader: str) -> bool:
    """Return whether a technique, or a shader in its folder, may use a shader."""
    place = shader.split("/")[0]
    if place in LIBRARIES or (folder, shader) == CONTACT_SHADOWS:
        return True
    return place == folder or TECHNIQUE_LEVEL.get(folder, -9) > TECHNIQUE_LEVEL[place]


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
    assert allowed("upload.scene_upload", "gpu.graph")
    assert allowed("techniques.ssdo.bounce", "techniques.deferred.shadow")
    for name, target in [
        ("gpu.graph", "scene.scene"),
        ("scene.gltf.load", "gpu.graph"),
        ("techniques.many_light.rsm", "renderer"),
        ("techniques.ssil.ssil", "techniques.many_light.gather"),
        ("techniques.shared.denoise", "techniques.deferred.sky"),
    ]:
        assert not allowed(name, target)


def test_every_module_opens_with_what_it_is():
    silent = [name for name, path in modules().items() if not ast.get_docstring(ast.parse(path.read_text()))]
    assert not [name for name in silent if not name.endswith("__init__")]


def test_a_technique_is_known_in_its_folder_in_options_and_in_the_frame():
    """`ssao` shows what adding a technique takes; nothing above the frame, and nothing below it, names any."""
    from wgpu_gi.options import TECHNIQUES

    naming = {
        gi: [name for name, path in modules().items() if re.search(rf'"{gi}"', path.read_text(encoding="utf-8"))]
        for gi in TECHNIQUES
    }
    assert naming["ssao"] == ["frame", "options"]
    # "none" and "path" are also words for other things.
    for gi in ("many-light", "ssdo", "ssil", "ssao"):
        assert not {"renderer", "buffers"} & {*naming[gi]}, gi


def test_functions_and_shaders_are_short():
    """At most 60 lines for a function, 300 for a shader, so that each can be read at once."""
    long = []
    for name, path in modules().items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.end_lineno - node.lineno >= 60:
                long.append(f"{name}.{node.name}")
    for path in (ROOT / "wgsl").rglob("*.wgsl"):
        if len(path.read_text(encoding="utf-8").splitlines()) > 300:
            long.append(str(path.relative_to(ROOT)))
    assert not long
