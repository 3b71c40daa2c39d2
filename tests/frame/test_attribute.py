"""`bench --attribute` on tiny pictures whose errors have a known cause."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

import wgpu_gi as gi
from wgpu_gi.__main__ import main
from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.measure.attribute import attribute
from wgpu_gi.measure.truth import truth_by_path
from wgpu_gi.options import Settings
from wgpu_gi.pictures.image import load_image
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import Instance, Material, Scene
from wgpu_gi.settings import assign

SIZE = (32, 18)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("WGPU_GI_CACHE", str(tmp_path / "cache"))


def shares(technique: str, *texts: str, scene: str = "cornell", spp: int = 256) -> dict[str, float]:
    """Return the parts of the indirect light's error in single frames, as shares of the whole."""
    loaded = gi.load(scene)
    settings = Settings(gi=technique, diffuse=True)
    for text in ("camera.frames=1", *texts):
        assign(settings, text)

    def truth_of(bounces, visible):
        return truth_by_path(
            loaded, loaded.cameras[0], SIZE, spp=spp, bounces=bounces, diffuse=True, visible_only=visible
        )

    found = attribute(loaded, loaded.cameras[0], SIZE, settings, truth_of, timed=1)
    (bar,) = [bar for bar in found.bars if bar.layer == "indirect"]
    assert sum(part.split.total for part in bar.parts) == pytest.approx(bar.whole.total)
    return {part.name: part.split.total / bar.whole.total for part in bar.parts}


def test_direct_light_alone_lacks_bounces(capsys):
    plot = ["--plot", "a.png"] if importlib.util.find_spec("matplotlib") else []
    arguments = ["bench", "cornell", "--attribute", "--gi", "none", "--size", "32x18", "--frames", "1"]
    assert main([*arguments, "--truth-spp", "64", "--json", "a.json", *plot]) == 0
    printed = capsys.readouterr().out
    assert "bounces left out" in printed
    assert "a single frame: no setting that was tried" in printed
    (entry,) = json.loads(Path("a.json").read_text(encoding="utf-8"))["entries"]
    for bar in entry["bars"]:
        parts = {part["name"]: part["noise"] + part["bias"] for part in bar["parts"]}
        whole = bar["whole"]["noise"] + bar["whole"]["bias"]
        assert sum(parts.values()) == pytest.approx(whole)
        assert parts["bounces left out"] > 0.9 * whole
    if plot:
        assert load_image("a.png").std() > 0.05


def test_a_picture_without_error_is_told():
    """All that the picture shows glows and reflects nothing."""
    glowing = Material(base_color=(0.0, 0.0, 0.0, 1.0), emission=(1.0, 1.0, 1.0), double_sided=True)
    scene = Scene([Instance(quad((-5, -5, -2), (10, 0, 0), (0, 10, 0), glowing))], [])
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), (0, 1, 0), 60)

    def truth_of(bounces, visible):
        return truth_by_path(scene, camera, SIZE, spp=2, bounces=bounces, diffuse=True, visible_only=visible)

    with pytest.raises(GiError, match="no error exceeds the noise of the truth"):
        attribute(scene, camera, SIZE, Settings(gi="none", diffuse=True), truth_of, timed=1)


@pytest.mark.slow
def test_causes_that_are_known():
    """Lights without shadows err by visibility; a filter over 8 pixels of a tiny picture by reconstruction."""
    assert shares("many-light", "gather.visibility=none", "denoise.levels=0")["visibility"] > 0.6
    few = shares("many-light", "vpl.count=64", "gather.visibility=exact", "denoise.radius=1", "denoise.levels=0")
    assert few["choice of lights"] > 0.9
    assert "reconstruction" not in few
    blurred = shares("many-light", "vpl.count=8192", "gather.visibility=exact", "denoise.radius=8", "denoise.levels=4")
    assert blurred["reconstruction"] > 0.6


@pytest.mark.slow
def test_screen_space_lacks_surfaces_out_of_view():
    found = shares("ssil", "ssil.bounces=1")
    assert found["surfaces out of view"] + found["bounces left out"] > 0.6
