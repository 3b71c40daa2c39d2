"""`tools/drivers.py`: what it accepts, and its arguments."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import drivers
import numpy as np
import pytest
from driver_pictures import edges

from wgpu_gi.errors import GiError

SHAPE = (20, 30)


def pictures(change=0.0, seed_change=0.0, pixels=0, mean=1.0):
    """Return arrays of a driver: a grey picture with `pixels` off by `change`, and its other seed."""
    radiance = np.full((*SHAPE, 3), 0.2) * mean
    radiance.reshape(-1, 3)[:pixels] += change
    other = np.full((*SHAPE, 3), 0.2)
    other.reshape(-1, 3)[:60] += seed_change
    edge = np.zeros(SHAPE, bool)
    edge[-5:] = True
    return {"s none 0": radiance, "s none 1": other, "s edges": edge}


@pytest.mark.parametrize(
    ("made", "passes"),
    [
        ({}, True),
        ({"mean": 1.002}, True),
        ({"mean": 1.004}, False),
        ({"pixels": 1, "change": 0.1}, False),  # more than PIXEL_BOUND of the flat pixels, without noise
        ({"pixels": 60, "change": 1e-4}, True),  # not seen
    ],
)
def test_a_driver_without_noise_must_agree(made, passes):
    assert drivers.compare(pictures(), pictures(**made), "s", "none")[1] == passes


def test_noise_between_seeds_is_allowed():
    first = pictures(seed_change=0.1)
    assert drivers.compare(first, pictures(0.1, pixels=50), "s", "none")[1]
    assert not drivers.compare(first, pictures(0.1, pixels=90), "s", "none")[1]


def test_pixels_at_edges_are_counted_apart():
    other = pictures()
    other["s none 0"][-1, :2] += 0.05
    cells, passes = drivers.compare(pictures(), other, "s", "none")
    assert passes and cells[4] == "0.00%" and cells[6] == "1.33%"


def test_edges_are_where_neighbours_show_another_surface():
    depth, normal = np.full((5, 6), 2.0), np.zeros((5, 6, 3))
    normal[..., 2] = 1.0
    assert not edges(depth, normal).any()
    depth[:, 3:] = 3.0
    assert edges(depth, normal).tolist() == [[False, False, True, True, False, False]] * 5


def test_icd_names_the_library(tmp_path):
    path = drivers._icd(tmp_path / "new" / "a.json", Path("/x/lib.so"), "1.3.0")
    assert json.loads(path.read_text())["ICD"] == {"library_path": "/x/lib.so", "api_version": "1.3.0"}
    assert drivers.environment(path)["VK_ICD_FILENAMES"] == str(path)


def test_what_cannot_be_had_is_a_sentence(tmp_path, monkeypatch):
    with pytest.raises(GiError, match="there is no technique 'photon'"):
        drivers.main(["photon"])
    monkeypatch.setattr(drivers.shutil, "which", lambda name: None)
    monkeypatch.setattr(drivers, "SWIFTSHADER", Path("/nowhere/lib.so"))
    with pytest.raises(GiError, match="this system has no apt-get"):
        drivers.main(["none", "--only", "swiftshader", "--folder", str(tmp_path)])
    with pytest.raises(GiError, match="python failed: no"):
        drivers._run(["python", "-c", "import sys; sys.exit('first\\nno')"], str(tmp_path))
    assert not list(tmp_path.iterdir())


def test_a_driver_that_fails_is_named(tmp_path, monkeypatch):
    failed = subprocess.CompletedProcess([], 1, "", "Traceback\nGiError: no adapter")
    monkeypatch.setattr(drivers.subprocess, "run", lambda *a, **k: failed)
    with pytest.raises(GiError, match="mesa: rendering failed: GiError: no adapter"):
        drivers.render(None, ["none"], tmp_path, "mesa", [])
