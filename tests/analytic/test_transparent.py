"""A transparent background: the picture over the environment is the opaque picture, and alpha is the covered share."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.marks import slow_but
from PIL import Image as Pillow

import wgpu_gi as gi
from wgpu_gi.__main__ import main
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.scene.built_in.shapes import box

SKY = (0.5, 0.7, 1.0)
SIZE = (40, 24)
SAMPLES = 64


def scene() -> gi.Scene:
    """Return a box of 2 x 2 m in front of the sky, lit by it and a sun, and a lamp beside it that is cut off."""
    lamp = gi.Material("lamp", emission=(2.0, 1.0, 0.5))
    parts = [box((-1, -1, -1), (1, 1, 0)), box((1.5, -1, -1), (1.7, 1, 0), lamp)]
    return gi.Scene(
        [gi.Instance(part) for part in parts], [gi.DirectionalLight((-1, -1, -2), 2.0)], gi.Environment(SKY)
    )


def render(gi_name: str, **arguments: object) -> object:
    settings = gi.Settings(spp=SAMPLES)
    settings.camera.frames = 16
    camera = gi.Camera.look_at((0, 0, 4), (0, 0, 0), yfov_deg=60)
    return gi.render(scene(), size=SIZE, camera=camera, gi=gi_name, settings=settings, **arguments)


@pytest.mark.parametrize("technique", slow_but(("path", "none"), TECHNIQUES))
def test_the_picture_over_the_sky_is_the_opaque_picture(technique):
    """radiance = transparent + (1 - alpha) sky, to the rounding of means of float32."""
    opaque = render(technique, show=("radiance", "alpha", "emission"))
    found = render(technique, transparent=True)
    assert found.shape == (24, 40, 4) and np.array_equal(found[..., 3], opaque["alpha"])
    expected = found[..., :3] + (1 - found[..., 3:]) * np.float32(SKY)
    np.testing.assert_allclose(opaque["radiance"], expected, rtol=2e-6, atol=1e-6)
    # Nothing but the sky lies outside the boxes.
    assert (found[found[..., 3] == 0] == 0).all() and (found[..., 3] == 0).any() and (found[..., 3] == 1).any()


@pytest.mark.parametrize("technique", slow_but(("path", "none"), TECHNIQUES))
def test_alpha_is_the_covered_share_of_a_pixel(technique):
    """The front of the box, at 4 m, covers tan(30 degrees) x 8 / 24 m a pixel; samples are stratified."""
    alpha = np.asarray(render(technique, show="alpha"))
    pixel = np.tan(np.radians(30)) * 8 / 24
    covered = (2 / pixel) ** 2
    left = alpha[:, : 20 + round(1.25 / pixel)]
    assert left.sum() == pytest.approx(covered, rel=0.01)
    assert (alpha >= 0).all() and (alpha <= 1).all()


def test_the_command_line_writes_alpha(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    common = ["render", "s.obj", "--env", "1,1,1", "--size", "16x9", "--gi", "none", "-q", "--transparent"]
    (tmp_path / "s.obj").write_text("v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n")
    assert main([*common, "-o", "a.png"]) == 0
    with Pillow.open("a.png") as image:
        assert image.mode == "RGBA" and image.getextrema()[3] == (0, 255)
    assert main([*common, "-o", "a.jpg"]) == 2
    assert main([*common, "-o", "a.mp4", "--frames", "0:2", "--size", "16x8"]) == 2
    assert main([*common, "-o", "f{frame}.npz", "--frames", "0:2"]) == 0
    with np.load("f1.npz") as file:
        assert file["radiance"].shape == (9, 16, 4)
