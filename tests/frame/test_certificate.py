"""Path-traced pixels and certificates of a renderer's picture."""

from __future__ import annotations

import json

import numpy as np
import OpenEXR
import pytest
from PIL import Image

import wgpu_gi as gi
from wgpu_gi.__main__ import main
from wgpu_gi.budget.certificate import Certificate, certify
from wgpu_gi.budget.intervals import Interval
from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.renderer import Renderer

SIZE = (16, 9)


def all_pixels():
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    return np.stack([x.ravel(), y.ravel()], axis=-1)


def as_picture(values):
    return values.reshape(SIZE[1], SIZE[0], 3)


@pytest.fixture(scope="module")
def truth():
    """The truth of the Cornell box: pixels, and their squared standard error."""
    with Renderer(gi.load("cornell"), size=SIZE) as renderer:
        traced = renderer.trace_pixels(all_pixels(), 1024, seed=9)
        return as_picture(traced.mean), as_picture(traced.squared_error)


def test_traced_pixels_are_those_of_a_path_traced_picture(truth):
    """Their difference is noise: with a quarter of the paths, the picture has at most four times the squared error."""
    mean, squared = truth
    with Renderer(gi.load("cornell"), size=SIZE, settings=gi.Settings(gi="path", spp=256)) as renderer:
        renderer.run(show=("radiance",))
        picture = np.asarray(renderer.read_back(), np.float64)
        renderer.trace_pixels([[3, 4]], 16)
        assert (renderer.read_back() == picture).all()  # the picture stays
    expected = 5 * squared
    assert np.mean((picture - mean) ** 2 > 16 * expected) < 0.02
    assert abs(np.mean(picture - mean)) < 4 * np.sqrt(np.mean(expected) / picture.size)


def test_certificate_of_all_pixels_is_the_error_of_the_picture(truth):
    """relMSE and bias of measure.metrics, with the truth of another seed: only the noise of both truths is left."""
    mean, squared = truth
    with Renderer(gi.load("cornell"), size=SIZE, settings=gi.Settings(gi="none")) as renderer:
        renderer.run(show=("radiance",))
        picture = renderer.read_back()
        certificate = certify(renderer, SIZE[0] * SIZE[1])
        assert certify(renderer, 50).texts() == certify(renderer, 50).texts()
    known = relmse(picture, mean, np.sqrt(squared))
    assert certificate.pixels == SIZE[0] * SIZE[1]
    assert certificate.relmse.value == pytest.approx(known, rel=0.02)
    assert certificate.bias.value == pytest.approx(bias(picture, mean), abs=0.004)
    assert certificate.bias.low < bias(picture, mean) < certificate.bias.high


def test_files_hold_the_certificate(tmp_path):
    picture = gi.render("cornell", size=SIZE, gi="none", certify=50)
    texts = picture.certificate.texts()
    assert texts["certificate"].startswith("relMSE ")
    assert (picture * 2).certificate is None
    for name in ("p.png", "p.exr", "p.npz"):
        picture.save(tmp_path / name)
    with Image.open(tmp_path / "p.png") as file:
        assert texts.items() <= file.text.items()
    with OpenEXR.File(str(tmp_path / "p.exr"), header_only=True) as file:
        assert texts.items() <= file.header().items()
    assert json.loads(str(np.load(tmp_path / "p.npz")["metadata"])) == texts


def test_what_cannot_be_certified_gets_a_sentence():
    with pytest.warns(gi.GiWarning, match="no certificate: the truth is black"):
        empty = gi.Scene(environment=gi.Environment((1.0, 1.0, 1.0)))
        assert gi.render(empty, size=SIZE, transparent=True, gi="none", certify=50).certificate is None
    with pytest.raises(gi.GiError, match="certify measures radiance"):
        gi.render("cornell", size=SIZE, show="depth", certify=True)


def test_wrong_pixels_get_a_sentence():
    with Renderer(gi.load("cornell"), size=SIZE) as renderer:
        for pixels in ([[16, 0]], [[0, -1]], [[0.5, 1]], [0, 1], [], [[0, 0, 0]], [[0, 0], [1]]):
            with pytest.raises(gi.GiError, match="pixels must"):
                renderer.trace_pixels(pixels, 16)
        for seed in (-1, "x"):
            with pytest.raises(gi.GiError, match="seed must"):
                renderer.trace_pixels([[0, 0]], 16, seed=seed)
            with pytest.raises(gi.GiError, match="seed must"):
                certify(renderer, seed=seed)
        with pytest.raises(gi.GiError, match="spp must be"):
            renderer.trace_pixels([[0, 0]], 4)
        for count in (0, 1, 49, -3, 2.5, float("nan"), "many"):
            with pytest.raises(gi.GiError, match="certify must be"):
                certify(renderer, count)


def test_command_prints_and_stores_a_certificate(tmp_path, capsys):
    file = str(tmp_path / "p.exr")
    assert main(["render", "cornell", "--gi", "none", "--size", "16x9", "-q", "-o", file, "--certify", "50"]) == 0
    with OpenEXR.File(file, header_only=True) as picture:
        assert picture.header()["certificate.pixels"] == "50"
    assert main(["render", "cornell", "--gi", "none", "--size", "16x9", "-o", file, "--certify"]) == 0
    assert "relMSE" in capsys.readouterr().out
    for wrong in (["--certify", "1"], ["--certify", "--show", "depth"], ["--certify", "--frames", "0:2"]):
        assert main(["render", "cornell", *wrong]) == 2
        assert "--certify" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("pixels", "words"), [(1, "from 1 path-traced pixel of 16"), (50, "from 50 path-traced pixels of 16")]
)
def test_sentence_counts_its_pixels(pixels, words):
    interval = Interval(0.1, 0.05, 0.2)
    assert words in Certificate(interval, interval, pixels, 16, 1.0).sentence()
