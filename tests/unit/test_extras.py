"""Install hints name packages that exist: the project itself is on no index."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from wgpu_gi.extras import EXTRAS, install_hint

ROOT = Path(__file__).resolve().parents[2]
PROJECT = ROOT / "pyproject.toml"


def requirements() -> dict[str, list[str]]:
    """Return the names of the packages of each extra of pyproject.toml, and the required ones under ""."""
    tomllib = pytest.importorskip("tomllib")
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    lists = {"": project["dependencies"], **project["optional-dependencies"]}
    found = {extra: [re.match(r"[\w.-]+", text)[0] for text in packages] for extra, packages in lists.items()}
    return {extra: [name for name in names if name != "wgpu_gi"] for extra, names in found.items()}


@pytest.mark.parametrize("extra", EXTRAS)
def test_extras_are_those_of_the_project(extra):
    assert list(EXTRAS[extra].packages) == requirements()[extra]


def test_every_extra_for_users_has_a_hint():
    assert set(EXTRAS) == set(requirements()) - {"", "dev", "lab"}
    assert install_hint("viewer") == "pip install glfw imgui-bundle"


def test_no_hint_names_the_project():
    """Commands in texts and messages install required or optional packages, or a folder."""
    known = {name.lower() for names in requirements().values() for name in names}
    paths = [path for folder in ("wgpu_gi", "tools", "tests") for path in (ROOT / folder).rglob("*")]
    hints = []
    for path in (ROOT / "README.md", *paths):
        if path.suffix in (".py", ".md", ".ipynb") and path != Path(__file__):
            hints += re.findall(r"pip install ([\w'.\[-]+)", path.read_text(encoding="utf-8"))
    assert len(hints) > 8
    assert not [hint for hint in hints if hint[0] not in "-'." and hint.rstrip(".").lower() not in known]
