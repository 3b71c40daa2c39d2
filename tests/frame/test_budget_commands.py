"""`--time`, `--error` and `--certify` on the command line and in `gi.render`: what is chosen, printed and stored."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.terminal import interrupted
from PIL import Image

import wgpu_gi as gi
from wgpu_gi.__main__ import main

SMALL = ["--size", "32x18"]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("WGPU_GI_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_time_chooses_technique_and_frames(capsys):
    assert main(["render", "cornell", *SMALL, "--time", "500ms", "-o", "a.png"]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].startswith("a.png: 32x18, ")
    assert "; expected relMSE " in printed[1] and printed[1].endswith("; the time is over")
    with Image.open("a.png") as picture:
        text = picture.text
    assert text["budget"] == "--time 0.5s" and text["stopped"] == "the time is over"
    assert printed[1].startswith(text["gi"])
    assert printed[0].startswith(f"a.png: 32x18, {text['frames']}, exposure ")


def test_an_error_of_the_given_technique_is_certified(capsys):
    """A relMSE of 0.5 is many times that of direct light alone."""
    assert main(["render", "cornell", *SMALL, "--gi", "none", "--error", "0.5", "-o", "a.npz"]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[1].startswith("none, ") and printed[1].endswith("relMSE 0.5 is reached")
    with np.load("a.npz") as file:
        stored = json.loads(str(file["metadata"]))
    assert stored["gi"] == "none" and stored["certificate"].startswith("relMSE ") and printed[2].startswith("relMSE ")
    assert float(stored["certificate.relmse"].split()[0]) <= 0.5


def test_certificate_of_a_picture(capsys):
    assert main(["render", "cornell", *SMALL, "--gi", "none", "--certify", "50", "-o", "a.png"]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[1].startswith("relMSE ") and "from 50 path-traced pixels" in printed[1]
    with Image.open("a.png") as picture:
        assert picture.text["certificate"] in printed[1]


def test_an_error_in_python_is_certified():
    pictures = gi.render("cornell", size=(32, 18), error=0.5, gi="none", show=("radiance", "depth"))
    assert pictures["radiance"].certificate.relmse.value <= 0.5
    assert pictures["depth"].certificate is None


def test_a_time_in_python_is_a_budget_or_in_the_animation():
    picture = gi.render("cornell", size=(32, 18), time=0.3, gi="none")
    assert picture.outcome.sentence().startswith("none, ")
    assert picture.certificate is None
    picture.save("a.png")
    with Image.open("a.png") as file:
        assert file.text["outcome"] == picture.outcome.sentence()
    shown = [gi.render("walk", size=(32, 18), gi="none", **{name: 0.5}) for name in ("time", "at")]
    assert np.array_equal(*shown) and shown[0].outcome is None
    assert gi.render("walk", size=(32, 18), gi="none", at=0.5, time=0.1).outcome is not None


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to a single process")
def test_interrupted_budget_saves_the_picture_so_far(folder):
    # The bar names the frames so far.
    command = ("render", "cornell", *SMALL, "--gi", "none", "--time", "1h", "-v", "-o", "a.npy")
    code, seen = interrupted(rb"[1-9]\d* frames", *command)
    assert code == 130
    assert b"holds the picture so far, " in seen and b"Traceback" not in seen
    assert np.load(Path("a.npy")).mean() > 0
