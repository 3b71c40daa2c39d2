"""What each object would show alone: closed forms, and pictures of each object alone."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.dataset.labels import frame_data
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.built_in.shapes import box, quad
from wgpu_gi.scene.scene import Image, Instance, Material, PointLight, Scene, Texture

SIZE = (48, 32)
CAMERA = Camera(yfov=np.pi / 2)  # a length at the distance 1 covers 16 pixels


def card(centre, width, height, name, **material):
    """Return a rectangle that faces +Z."""
    x, y, z = centre
    mesh = quad((x - width / 2, y - height / 2, z), (width, 0, 0), (0, height, 0), Material(name, **material))
    return Instance(mesh, name=name)


def objects_of(instances, size=SIZE, camera=CAMERA):
    """Return the objects of a frame, by name."""
    scene = Scene(instances, [PointLight((0, 0, 0), 1.0)])
    with Renderer(scene, size=size, camera=camera, settings=Settings(gi="none")) as renderer:
        return {found.name: found for found in frame_data(renderer, {"amodal"}).objects}


def test_card_half_behind_another():
    """At z = -2 a metre covers 8 pixels: the far card spans 24 +- 8 by 16 +- 4; the near one hides the left half."""
    found = objects_of([card((0, 0, -2), 2, 1, "far"), card((-0.5, 0, -1), 1, 1, "near")])
    far, near = found["far"], found["near"]
    assert (far.visible_pixels, far.amodal_pixels, far.visible_fraction) == (64, 128, 0.5)
    assert far.box == (24, 12, 8, 8) and far.amodal_box_clipped == (16, 12, 16, 8)
    assert far.amodal_box == pytest.approx((16, 12, 16, 8), abs=1e-9)
    assert near.box == near.amodal_box_clipped == (8, 8, 16, 16) and near.visible_fraction == 1.0


def test_hidden_card_is_listed_and_one_out_of_view_is_not():
    found = objects_of([card((0, 0, -2), 1, 1, "far"), card((0, 0, -1), 2, 2, "near"), card((9, 0, -1), 1, 1, "out")])
    assert {*found} == {"far", "near"}
    assert found["far"].visible_pixels == 0 and found["far"].box is None and found["far"].visible_fraction == 0.0
    assert found["far"].amodal_pixels == 64


def test_box_beyond_the_picture():
    found = objects_of([card((1.5, 0, -1), 1, 1, "edge")])["edge"]
    assert found.amodal_box == pytest.approx((40, 8, 16, 16), abs=1e-9)
    assert found.amodal_box_clipped == found.box == (40, 8, 8, 16)


def test_object_around_the_camera_has_no_box_without_bounds():
    room = Instance(box((-3, -3, -3), (3, 3, 3), Material("room"), inward=True), name="room")
    found = objects_of([room, card((0, 0, -1), 0.5, 0.5, "card")])
    assert found["room"].amodal_box is None
    assert found["room"].amodal_box_clipped == (0, 0, *SIZE) and found["room"].amodal_pixels == SIZE[0] * SIZE[1]


def test_open_parts_do_not_cover():
    """A pixel that a mask cuts out, or whose surface lets pass more than half of the light, is not covered."""
    pixels = np.full((1, 2, 4), 255, np.uint8)
    pixels[0, 1, 3] = 0
    mask = Texture(Image(pixels), "clamp", "clamp", "nearest", mip_filter="none")
    cut = card((0, 0, -1), 1, 1, "cut", alpha_mode="mask", base_color_texture=mask)
    cut.mesh.texcoords0 = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    # Their diagonals miss the pixel centres: there, each of two triangles is half of the surface.
    thin = card((0.01, 0, -2), 2, 2, "thin", alpha_mode="blend", base_color=(1, 1, 1, 0.4))
    thick = card((0.01, 0, -3), 3, 3, "thick", alpha_mode="blend", base_color=(1, 1, 1, 0.6))
    wall = card((0, 0, -4), 4, 4, "wall")
    found = objects_of([cut, thin, thick, wall])
    assert "thin" not in found
    assert found["cut"].amodal_pixels == found["cut"].visible_pixels == 128
    assert found["thick"].amodal_pixels == found["wall"].amodal_pixels == 256
    assert found["thick"].visible_pixels == 128 and found["wall"].visible_pixels == 0


@pytest.mark.parametrize("seed", range(2))
def test_amodal_pixels_are_those_of_each_object_alone(seed):
    """Boxes through one another, one mesh several times, seen in perspective and from afar."""
    rng = np.random.default_rng(seed)
    shared = box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), Material("shared"))
    instances = []
    for k in range(24):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn * rng.uniform(0.2, 2), rng.uniform((-3, -2, -8), (3, 2, -1))
        mesh = shared if k % 2 else box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), Material(f"{k}"))
        instances.append(Instance(mesh, matrix, f"{k}"))
    settings = Settings(gi="none")
    with Renderer(Scene(instances), size=(64, 48), camera=CAMERA, settings=settings) as renderer:
        together = renderer.amodal()
        for k, instance in enumerate(instances):
            renderer.scene = Scene([instance])
            renderer.run(show=("instance",))
            rows, columns = np.nonzero(renderer.read_back("instance"))
            assert together[k, 0] == len(rows)
            if len(rows):
                width, height = columns.max() - columns.min() + 1, rows.max() - rows.min() + 1
                assert together[k, 1:].tolist() == [columns.min(), rows.min(), width, height]


def test_bands_of_rows_give_the_same(monkeypatch):
    import wgpu_gi.techniques.reference.surfaces as module

    instances = [card((0, 0, -2), 2, 1, "far"), card((-0.5, 0.1, -1), 1, 1, "near")]
    with Renderer(Scene(instances), size=SIZE, camera=CAMERA, settings=Settings(gi="none")) as renderer:
        whole = renderer.amodal()
        monkeypatch.setattr(module, "MOST_BITS", 2 * SIZE[0] * 5)
        np.testing.assert_array_equal(renderer.amodal(), whole)
