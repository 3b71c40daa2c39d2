"""gi.render and gi.Renderer from Python: what they take, what they return, and what they tell."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh

import wgpu_gi as gi
from wgpu_gi.rendering import settings_of

SIZE = (16, 9)
SKY = gi.Environment((0.5, 0.7, 1.0))


def box() -> trimesh.Trimesh:
    mesh = trimesh.creation.box()
    mesh.visual.face_colors = [200, 60, 40, 255]
    return mesh


def render(source: object, **arguments: object) -> object:
    return gi.render(source, **{"size": SIZE, "gi": "none", "environment": SKY} | arguments)


def test_every_kind_of_scene_gives_the_same_picture(tmp_path):
    """A trimesh mesh, a scene of it, arrays, a Mesh, a Scene, and a file."""
    mesh = box()
    arrays = np.array(mesh.vertices), np.array(mesh.faces)
    scene = gi.Scene.from_arrays(*arrays, colors=np.uint8([200, 60, 40]))
    expected = render(scene)
    assert isinstance(expected, np.ndarray) and expected.shape == (9, 16, 3) and np.ptp(expected) > 0.05
    for source in (mesh, trimesh.Scene(mesh), gi.load(scene, environment=SKY)):
        np.testing.assert_allclose(render(source), expected, rtol=1e-5)
    grey = render(arrays)
    mesh.visual = trimesh.visual.ColorVisuals()
    mesh.export(tmp_path / "box.ply")
    for source in (tmp_path / "box.ply", str(tmp_path / "box.ply"), gi.Scene.from_arrays(*arrays).instances[0].mesh):
        np.testing.assert_allclose(render(source), grey, rtol=1e-5)
    assert not np.allclose(grey, expected, rtol=0.05)


def test_several_buffers_come_from_one_view():
    found = render(box(), show=("radiance", "depth", "normal"))
    assert list(found) == ["radiance", "depth", "normal"] and found["depth"].shape == (9, 16)
    assert np.array_equal(found["depth"], render(box(), show="depth"))


def test_depth_is_the_distance_along_the_ray_and_zero_without_a_surface():
    wall = gi.Scene.from_arrays([[-1, -9, -2], [9, -9, -2], [9, 9, -2], [-1, 9, -2]], [[0, 1, 2, 3]])
    depth = gi.render(wall, size=(64, 1), camera=gi.Camera(yfov=0.02), gi="none", environment=SKY, show="depth")
    x = ((np.arange(64) + 0.5) / 32 - 1) * 64 * np.tan(0.01)
    expected = np.where(2 * x > -1, 2 * np.sqrt(1 + x * x), 0)
    np.testing.assert_allclose(depth[0], expected, rtol=1e-4)
    assert (depth == 0).any() and (depth > 2.1).any()


def test_a_camera_by_name_or_index():
    front, side = (gi.Camera.look_at(p, (0, 0, 0), name=n) for p, n in (((0, 0, 3), "front"), ((3, 0, 3), "side")))
    scene = gi.load(box(), environment=SKY)
    scene.cameras = [front, side]
    assert np.array_equal(render(scene, camera="side"), render(scene, camera=side))
    assert np.array_equal(render(scene, camera=1), render(scene, camera=side))
    assert np.array_equal(render(scene), render(scene, camera=0))


def test_arguments_override_settings_only_where_they_are_given():
    settings = gi.Settings(gi="path", spp=3, bounces=2)
    settings.path.samples_per_run = 2
    same = settings_of(settings, {"gi": None, "spp": None}, None)
    assert same == settings and same is not settings and same.path is not settings.path
    other = settings_of(settings, {"gi": None, "spp": 5}, None)
    assert (other.gi, other.spp, other.bounces, settings.spp) == ("path", 5, 2, 3)
    picture = render(box(), gi=None, settings=settings)
    np.testing.assert_allclose(picture, render(box(), gi="path", spp=3, bounces=2), rtol=1e-5)
    assert not np.allclose(picture, render(box(), gi=None, settings=settings, spp=4), rtol=1e-3)


def test_what_has_no_effect_is_a_warning():
    with pytest.warns(gi.GiWarning) as caught:
        render(box(), spp=4, bounces=3)
    told = [str(warning.message) for warning in caught]
    assert any("at most 0 indirect bounces, not 3" in text for text in told) and len(told) == 2
    assert any("spp changes nothing: the technique none averages frames" in text for text in told)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        render(box(), gi="path", spp=4, bounces=3, seed=1)


def test_the_sky_of_a_scene_without_light_is_told_once_and_the_scene_stays():
    scene = gi.Scene.from_arrays(box().vertices, box().faces)
    with pytest.warns(gi.GiWarning, match="the scene has no light") as caught:
        lighted = render(scene, environment=None)
    assert len(caught) == 1 and lighted.mean() > 0.1 and scene.environment is None and not scene.notes
    # A Renderer shows a scene as it stands.
    with gi.Renderer(scene, size=SIZE, settings=gi.Settings(gi="none")) as renderer:
        renderer.run()
        assert not renderer.read_back().any()


def test_a_closed_renderer_says_so():
    with gi.Renderer(gi.load(box(), environment=SKY), size=SIZE, settings=gi.Settings(gi="none")) as renderer:
        renderer.run(show=("radiance",))
        picture = renderer.read_back()
    assert picture.any() and repr(renderer) == "<Renderer 16x9, none, closed>"
    renderer.close()
    for use in (renderer.run, renderer.step, renderer.read_back, renderer.forget, renderer.release):
        with pytest.raises(gi.GiError, match="this Renderer is closed; make a new one"):
            use()
    with pytest.raises(ValueError), gi.Renderer(gi.load("cornell"), size=SIZE) as renderer:
        raise ValueError
    assert repr(renderer).endswith("closed>")
