"""Pictures rendered in tiles equal those rendered whole, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.medley import at, medley

import wgpu_gi as gi
from wgpu_gi.__main__ import main
from wgpu_gi.buffers import buffers_of
from wgpu_gi.camera import Window
from wgpu_gi.errors import GiError
from wgpu_gi.measure.scenes import make_scene
from wgpu_gi.options import Settings
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import DirectionalLight, Instance, Material, SpotLight
from wgpu_gi.settings import assign
from wgpu_gi.tiles import tile_plan

SIZE = 77, 45


def settings_of(technique: str, **values) -> Settings:
    settings = Settings(gi=technique, spp=2, **values)
    settings.camera.frames = 3
    return settings


def everything():
    """Return every kind of surface, panes, a sun, and enough spots for lists of lights."""
    scene = medley()
    panes = [
        Material("sheet", (0.9, 0.3, 0.2, 0.4), alpha_mode="blend"),
        Material("glass", (0.6, 0.9, 0.7, 1.0), transmission=1.0, roughness=0.0),
    ]
    for x, pane in zip((-1.5, 0.5), panes, strict=True):
        scene.instances.append(Instance(quad((-1, 0, 0), (2, 0, 0), (0, 2, 0), pane), at(x, 0.2, 3.0, turn=0.2)))
    scene.lights.append(DirectionalLight((0.3, -1.0, -0.4), 3.0))
    for k in range(9):
        scene.lights.append(SpotLight((k - 4.0, 3.0, 1.0), (0, -1, 0), 0.1, 0.5, 5.0))
    return scene


def assert_same(scene, settings, tiles, size=SIZE):
    names = buffers_of(settings.gi)
    whole = gi.render(scene, size=size, settings=settings, show=names)
    parts = gi.render(scene, size=size, settings=settings, show=names, tiles=tiles)
    for name in names:
        assert np.array_equal(parts[name], whole[name]), name
    assert whole["radiance"].std() > 0 and whole["standard_error"].std() > 0


def test_all_buffers_equal_those_of_the_whole_picture_of_one_room():
    assert_same(gi.load("cornell"), settings_of("path"), 4)


@pytest.mark.slow
@pytest.mark.parametrize("technique", ["path", "none"])
def test_all_buffers_equal_those_of_the_whole_picture(technique):
    assert_same(everything(), settings_of(technique), 4)


def test_tiles_may_be_narrower_than_their_margins():
    scene = gi.load("cornell")
    scene.cameras[0].orthographic_height = 4.0
    assert_same(scene, settings_of("none"), (33, 9))


@pytest.mark.slow
@pytest.mark.parametrize(("size", "tiles"), [((200, 110), (100, 110)), ((320, 20), 2)])
def test_many_light_equals_the_whole_picture(size, tiles):
    settings = settings_of("many-light")
    assert {t.window_corner for t in tile_plan(size, settings, tiles).tiles} != {(0, 0)}
    assert_same(gi.load("cornell"), settings, tiles, size)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        ("glossy", {}),
        ("layered", {}),
        ("foliage", {"gather.interleave": 3}),
        ("street", {"gather.scale": "half", "vpl.importance": "flux"}),
    ],
)
def test_many_light_of_random_scenes_equals_the_whole_picture(kind, changes):
    settings = settings_of("many-light")
    for name, value in changes.items():
        assign(settings, f"{name}={value}")
    assert_same(make_scene(kind, 2), settings, (120, 65), (240, 130))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["street", "foliage", "textured", "many", "layered", "far", "glass"])
@pytest.mark.parametrize("technique", ["path", "none"])
def test_random_scenes_equal_the_whole_picture(technique, kind):
    scene = make_scene(kind, 1)
    try:
        assert_same(scene, settings_of(technique), (40, 30))
    except GiError as error:
        assert technique == "none" and "glass" in str(error)


def test_transparent_pictures_keep_their_alpha():
    picture, parts = (gi.render("cornell", size=SIZE, gi="none", transparent=True, tiles=tiles) for tiles in (False, 3))
    assert parts.shape == (SIZE[1], SIZE[0], 4)
    assert np.array_equal(picture, parts)


def test_the_command_writes_the_same_picture(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    common = ["render", "--size", "48x27", "--gi", "path", "--spp", "1", "--show", "radiance", "--show", "depth"]
    assert main([*common, "-o", "whole.npz"]) == 0
    assert main([*common, "-o", "tiles.npz", "--tiles", "20x20"]) == 0
    with np.load("whole.npz") as whole, np.load("tiles.npz") as tiles:
        assert set(whole.files) == set(tiles.files)
        for name in whole.files:
            assert np.array_equal(whole[name], tiles[name])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("--gi ssdo --tiles 4", "all over the picture"),
        ("--tiles 4 --frames 0:2 --gi path -o f{frame}.png", "--frames does not go with tiles"),
        ("--tiles 4 --gi path --time 2s", "--time does not go with tiles"),
        ("--tiles 4 --gi path --error 0.1", "--error does not go with tiles"),
        ("--tiles 4 --gi path --certify", "--certify does not go with tiles"),
        ("--tiles 0 --gi path", "tiles are their number"),
        ("--tiles 4 --gi path --size 9000x10", "8192"),
        ("--tiles cornell", "write the scene before it"),
    ],
)
def test_what_tiles_cannot_do_is_one_sentence(arguments, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    try:
        code = main(["render", *arguments.split()])
    except SystemExit as stop:
        code = stop.code
    error = capsys.readouterr().err
    assert code == 2 and words in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_light_through_solid_glass_is_refused():
    scene = gi.load("cornell")
    scene.instances[0].mesh.materials = [Material("ice", transmission=1.0, roughness=0.3)]
    with pytest.raises(GiError, match="glass"):
        gi.render(scene, size=(32, 18), gi="none", tiles=2)


@pytest.mark.parametrize(
    "window",
    [
        Window((0, 0), (9, 20)),
        Window((1, 0), (16, 9)),
        Window((-1, 0), (32, 32)),
        Window((0, 0), (9000, 20)),
        Window((0.5, 0), (32, 32)),
        Window((0, 0), 5),
        "window",
        (0, 0, 32, 32),
    ],
)
def test_wrong_windows_are_refused(window):
    with gi.Renderer("cornell", size=(16, 9), settings=settings_of("none")) as renderer:
        renderer.window = window
        with pytest.raises(GiError, match=r"window|size"):
            renderer.run()


def test_moving_pictures_have_no_window():
    with gi.Renderer("cornell", size=(16, 9), settings=settings_of("none")) as renderer:
        renderer.window, renderer.moving = Window((0, 0), (32, 32)), True
        with pytest.raises(GiError, match="moving"):
            renderer.run()
