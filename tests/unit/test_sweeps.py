"""`tools/sweeps.py` finds every constant that it sweeps, and replaces its value and nothing else."""

from __future__ import annotations

import difflib

import pytest
import sweeps
from sweeps import ROOT, SWEEPS, Sweep, current_value, definition, make_copy


@pytest.mark.parametrize("sweep", SWEEPS, ids=lambda sweep: f"{sweep.file}:{sweep.constant}")
def test_the_value_in_use_is_swept(sweep):
    assert current_value(sweep) in sweep.values.split(", ")
    assert len(sweep.values.split(", ")) > 1
    assert sweep.reference in sweeps.REFERENCES


@pytest.mark.parametrize(
    ("line", "value"),
    [
        ("const FLAT: f32 = 0.03;  // of the depth", "0.03"),
        ("override FLAT: u32 = 4u;", "4u"),
        ("const FLAT = 2.0 / 3.0;", "2.0 / 3.0"),
        ("FLAT = 1 << 12  # at least; chosen", "1 << 12"),
        ("FLAT: float = 4.0", "4.0"),
    ],
)
def test_values_of_shaders_and_modules(line, value):
    assert definition(f"const FLATTER: f32 = 1.0;\n{line}\nfn f() {{}}\n", "FLAT")["value"] == value


def test_a_copy_differs_in_one_line(tmp_path):
    sweep = Sweep("shared/composite/display.wgsl", "DESATURATION", "", "none")
    make_copy(tmp_path, sweep, "0.5")
    before, after = ((root / sweep.path).read_text().splitlines() for root in (ROOT, tmp_path))
    changed = [line for line in difflib.ndiff(before, after) if line.startswith("+ ")]
    assert len(changed) == 1 and "DESATURATION: f32 = 0.5;" in changed[0]
    assert (tmp_path / "wgpu_gi" / "renderer.py").is_file()


def test_an_unknown_name_is_refused(capsys):
    assert sweeps.main(["NOTHING"]) == 2
    assert "no sweep matches NOTHING" in capsys.readouterr().out
