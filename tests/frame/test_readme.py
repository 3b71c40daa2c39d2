"""README.md: its Python examples run, its links lead somewhere, and it stays short."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from wgpu_gi.cli.arguments import build_parser

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("README.md", "CHANGES.md", "tests/truth/README.md", "tools/README.md")


def test_python_examples_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    examples = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.S)
    assert len(examples) >= 3
    for example in examples:
        exec(example, names)
    assert names["picture"].shape == names["truth"].shape == (180, 320, 3)
    assert names["renderer"].read_back().mean() == pytest.approx(names["truth"].mean(), rel=0.05)
    assert np.unique(names["instance"]).tolist() == [0, 1, 2]
    assert {path.name for path in tmp_path.iterdir()} >= {"picture.exr", "frame_0.png", "frame_2.png"}


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    links = [link.partition("#")[0] for link in re.findall(r"\]\(([^)]+)\)", text) if "://" not in link]
    missing = [link for link in links if link and not ((ROOT / page).parent / link).exists()]
    assert not missing


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 250


def test_commands_can_be_parsed():
    lines = re.findall(r"^    wgpu-gi (.*?)(?:\s+#.*)?$", (ROOT / "README.md").read_text(encoding="utf-8"), re.M)
    assert len(lines) > 10
    for line in lines:
        build_parser().parse_args(shlex.split(line))
