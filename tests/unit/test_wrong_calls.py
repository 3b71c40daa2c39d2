"""Wrong calls from Python: each raises one sentence that names the argument or field, in Python's words."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wgpu_gi as gi

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
FACES = np.array([[0, 1, 2], [1, 3, 2]])


def mesh(**changes: Any) -> gi.Mesh:
    values = {"positions": VERTICES, "triangles": FACES.astype(np.uint32)} | changes
    return gi.Mesh(**values)


def scene(**changes: Any) -> gi.Scene:
    instance = gi.Instance(mesh(), np.eye(4))
    camera = gi.Camera.look_at((0.5, 0.5, 3), (0.5, 0.5, 0), name="front")
    values = {"instances": [instance], "lights": [gi.PointLight((0, 0, 2))], "cameras": [camera]} | changes
    return gi.Scene(**values)


def of_mesh(**changes: Any) -> gi.Scene:
    return scene(instances=[gi.Instance(mesh(**changes))])


def of_material(**changes: Any) -> gi.Scene:
    return of_mesh(materials=[gi.Material(**changes)])


def assign(owner: Any, name: str, value: Any = 1) -> None:
    setattr(owner, name, value)


def assign_and_run(**values: Any) -> None:
    renderer = gi.Renderer(scene(), size=(4, 4))
    for name, value in values.items():
        assign(renderer, name, value)
    renderer.step()


def nan_vertices() -> np.ndarray:
    vertices = VERTICES.copy()
    vertices[2, 1] = np.nan
    return vertices


CALLS: dict[str, tuple[Callable[[], Any], str]] = {
    # Misspelt names.
    "scene.light": (lambda: assign(scene(), "light"), "a Scene has no attribute 'light'; did you mean 'lights'?"),
    "scene.camera": (lambda: scene().camera, "a Scene has no attribute 'camera'; did you mean 'cameras'?"),
    "scene.environement": (lambda: assign(scene(), "environement"), "did you mean 'environment'"),
    "material.roughnes": (lambda: assign(gi.Material(), "roughnes"), "did you mean 'roughness'"),
    "material.base_colour": (lambda: assign(gi.Material(), "base_colour"), "did you mean 'base_color'"),
    "mesh.vertices": (
        lambda: mesh().vertices,
        "a Mesh has no attribute 'vertices'; available: .*positions, .*triangles",
    ),
    "instance.transform": (lambda: assign(scene().instances[0], "transform"), "available: .*world_from_local"),
    "light.colour": (lambda: assign(gi.PointLight((0, 0, 0)), "colour"), "did you mean 'color'"),
    "environment.images": (lambda: assign(gi.Environment(), "images"), "an Environment .*did you mean 'image'"),
    "camera.fov": (lambda: assign(gi.Camera(), "fov"), "did you mean 'yfov'"),
    "settings.gi_": (lambda: assign(gi.Settings(), "gi_"), "did you mean 'gi'"),
    "settings.ssdo.radiuss": (lambda: assign(gi.Settings().ssdo, "radiuss"), "did you mean 'radius'"),
    "scene.meshes =": (lambda: assign(scene(), "meshes", []), "meshes"),
    "gi.Materail": (lambda: gi.Materail, "did you mean 'Material'"),
    "Material(roughnes=)": (lambda: gi.Material(roughnes=1), "unexpected keyword argument 'roughnes'"),
    "render(samples=)": (lambda: gi.render(scene(), samples=4), "unexpected keyword argument 'samples'"),
    "renderer.setings": (lambda: assign(gi.Renderer.__new__(gi.Renderer), "setings"), "did you mean 'settings'"),
    # What is no scene.
    "render(None)": (lambda: gi.render(None), "a scene is a path, .*, not None"),
    "render(5)": (lambda: gi.render(5), "a scene is a path, .*, not 5"),
    "render(array)": (lambda: gi.render(VERTICES), r"a scene is .*, not an array of shape \(4, 3\)"),
    "render(material)": (lambda: gi.render(gi.Material()), "a scene is .*, not a Material"),
    "render([mesh])": (lambda: gi.render([mesh()]), "a scene is "),
    "render(misspelt name)": (lambda: gi.render("cornel"), "did you mean cornell"),
    "load(missing)": (lambda: gi.load("none.glb"), "none.glb does not exist"),
    "load(unknown format)": (lambda: gi.load(__file__), ".py is not a supported scene format"),
    "Renderer(5)": (lambda: gi.Renderer(5), "a scene is "),
    "instances of meshes": (
        lambda: gi.render(scene(instances=[mesh()])),
        "scene.instances must be a list, each item a",
    ),
    "None in a list": (lambda: gi.render(scene(lights=[None])), "scene.lights must be a list, each item"),
    "a light for lights": (lambda: gi.render(scene(lights=gi.PointLight((0, 0, 0)))), "scene.lights must be a list"),
    "a matrix for a camera": (lambda: gi.render(scene(cameras=[np.eye(4)])), "scene.cameras must be a list"),
    # Arguments of render, Renderer and load.
    "size=640": (lambda: gi.render(scene(), size=640), r"size must be \(width, height\) in whole pixels, not 640"),
    "size=text": (lambda: gi.render(scene(), size="64x36"), r"size must be .*, not '64x36'"),
    "size of floats": (
        lambda: gi.render(scene(), size=(64.0, 36.0)),
        r"size must be .*whole pixels, not \(64.0, 36.0\)",
    ),
    "size of three": (lambda: gi.Renderer(scene(), size=(64, 36, 3)), "size must be"),
    "size of zero": (lambda: gi.Renderer(scene(), size=(0, 0)), "size 0x0: a picture has at least 1x1 pixels"),
    "size too large": (lambda: gi.render(scene(), size=(9000, 9000)), "make the picture smaller"),
    "camera=unknown": (
        lambda: gi.render(scene(), camera="main"),
        "there is no camera 'main'; this scene has 0 'front'",
    ),
    "camera=5": (lambda: gi.render(scene(), camera=5), "there is no camera 5"),
    "camera=matrix": (lambda: gi.render(scene(), camera=np.eye(4)), "camera must be a Camera, .*, not an array"),
    "camera=position": (
        lambda: gi.Renderer(scene(), camera=(0, 0, 5)),
        r"camera must be a Camera, .*, not \(0, 0, 5\)",
    ),
    "gi=unknown": (lambda: gi.render(scene(), gi="manylight"), "gi must be one of .*; did you mean 'many-light'"),
    "gi=5": (lambda: gi.render(scene(), gi=5), "gi must be one of .*, not 5"),
    "quality=ultra": (lambda: gi.render(scene(), quality="ultra"), "there is no quality 'ultra'; available: low"),
    "spp=text": (lambda: gi.render(scene(), spp="64"), "spp takes a whole number .*, not '64'"),
    "spp=0": (lambda: gi.render(scene(), spp=0), "spp must lie between 1 and"),
    "bounces=1.5": (lambda: gi.render(scene(), bounces=1.5), "bounces takes a whole number"),
    "seed=-1": (lambda: gi.render(scene(), seed=-1), "seed must lie between 0"),
    "diffuse=text": (lambda: gi.render(scene(), diffuse="no"), "diffuse takes true or false, not 'no'"),
    "show=misspelt": (lambda: gi.render(scene(), show="radience"), "no buffer 'radience'; did you mean 'radiance'"),
    "show with one misspelt": (lambda: gi.render(scene(), show=("depth", "norml")), "did you mean 'normal'"),
    "show=()": (lambda: gi.render(scene(), show=()), r"show must be the name of a buffer, .*, not \(\)"),
    "show=5": (lambda: gi.render(scene(), show=5), "show must be the name of a buffer"),
    "settings=dictionary": (lambda: gi.render(scene(), settings={"spp": 4}), "settings must be Settings"),
    "settings=class": (lambda: gi.Renderer(scene(), settings=gi.Settings), "settings must be Settings"),
    "time=text": (lambda: gi.render(scene(), time="1.5"), "time '1.5' has no unit; write '1.5s', or a number instead"),
    "time=unit": (
        lambda: gi.render(scene(), time="2m"),
        "a time is a number, with a unit .*, not '2m'",
    ),
    "time=0": (lambda: gi.render(scene(), time=0), "a time budget must be a finite number of seconds above 0, not 0"),
    "time=-1s": (lambda: gi.render(scene(), time="-1s"), "a time budget must be .*, not '-1s'"),
    "error=0": (lambda: gi.render(scene(), error=0.0), "error must be a relMSE above 0, such as 0.01, not 0.0"),
    "error=nan": (lambda: gi.render(scene(), error=math.nan), "error must be .*, not nan"),
    "error=1e-9": (lambda: gi.render(scene(), error=1e-9), "error 1e-09 is out of reach: .* ask for that or more"),
    "error=text": (lambda: gi.render(scene(), error="0.01"), "error must be .*, not '0.01'"),
    "time=nan": (lambda: gi.render(scene(), time=math.nan), "time must be .*, not nan"),
    "at=text": (lambda: gi.render(scene(), at="1"), "time must be .*, not '1'"),
    "at without animation": (lambda: gi.render(scene(), at=1), "the scene has no animation"),
    "renderer.time=text": (lambda: assign_and_run(time="1"), "time must be .*, not '1'"),
    "renderer.animation without any": (lambda: assign_and_run(animation="walk"), "the scene has no animation"),
    "adapter=5": (lambda: gi.render(scene(), adapter=5), "adapter must be a part of the name of an adapter, not 5"),
    "progress=True": (lambda: gi.render(scene(), progress=True), "progress must be a function"),
    "environment=5": (lambda: gi.render(scene(), environment=5), "environment must be an Environment or the path"),
    "environment missing": (lambda: gi.load("cornell", environment="none.hdr"), "none.hdr does not exist"),
    "lights=light": (lambda: gi.load("cornell", lights=gi.PointLight((0, 1, 0))), "lights must be a list of lights"),
    "max_memory=text": (lambda: gi.load("cornell", max_memory="4 GB"), "max_memory must be .*, not '4 GB'"),
    # Values in a scene.
    "Environment(path)": (lambda: gi.Environment("sky.hdr"), r"gi\.load_environment\('sky\.hdr'\)"),
    "environment=None in load_environment": (lambda: gi.load_environment(None), "an environment is loaded from a path"),
    "an image of 8 bits": (
        lambda: gi.render(scene(environment=gi.Environment(image=np.ones((4, 8))))),
        r"scene.environment.image must be None or a numpy array \(n, n, 3\) of numbers, not an array of shape \(4, 8\)",
    ),
    "3x3 matrix": (
        lambda: gi.render(scene(instances=[gi.Instance(mesh(), np.eye(3))])),
        r"scene.instances\[0\].world_from_local must be a finite \(4, 4\) matrix, not an array of shape \(3, 3\)",
    ),
    "a flat matrix": (lambda: gi.render(scene(instances=[gi.Instance(mesh(), np.zeros((4, 4)))])), "world_from_local"),
    "NaN vertices": (
        lambda: gi.render(of_mesh(positions=nan_vertices())),
        r"scene.instances\[0\].mesh.positions\[2\] must be finite, not \(0, nan, 0\)",
    ),
    "infinite normals": (
        lambda: gi.render(of_mesh(normals=np.full((4, 3), np.inf))),
        r"normals\[0\] must be finite, not \(inf, inf, inf\)",
    ),
    "vertices as a list": (lambda: gi.render(of_mesh(positions=VERTICES.tolist())), "positions must be a numpy array"),
    "vertices of texts": (
        lambda: gi.render(of_mesh(positions=VERTICES.astype(str))),
        "positions must be a numpy array",
    ),
    "float faces": (
        lambda: gi.render(of_mesh(triangles=FACES.astype(np.float32))),
        "triangles must be a numpy array .*of integers, not an array of shape .* and type float32",
    ),
    "an index out of range": (lambda: gi.render(of_mesh(triangles=FACES + 2)), "triangles must be indices from 0 to 3"),
    "three colour channels": (lambda: gi.render(of_mesh(colors=np.ones((4, 3)))), r"colors must be .*\(n, 4\)"),
    "too few normals": (
        lambda: gi.render(of_mesh(normals=np.ones((3, 3)))),
        "normals must have a row for each of the 4",
    ),
    "base_color of three": (lambda: gi.render(of_material(base_color=(1, 0, 0))), "base_color must be 4 numbers"),
    "base_color of bytes": (lambda: gi.render(of_material(base_color=(255, 0, 0, 255))), "4 numbers from 0 to 1"),
    "an image for a texture": (
        lambda: gi.render(of_material(base_color_texture=np.zeros((4, 4, 4), np.uint8))),
        "base_color_texture must be None or a Texture, not an array",
    ),
    "a texture of floats": (
        lambda: gi.render(of_material(base_color_texture=gi.Texture(gi.Image(np.zeros((4, 4, 4)))))),
        "base_color_texture.image.pixels must be .* of uint8 or uint16, not an array of shape .* and type float64",
    ),
    "roughness=text": (lambda: gi.render(of_material(roughness="0.5")), "roughness must be a number from 0 to 1"),
    "alpha_mode=BLEND": (
        lambda: gi.render(of_material(alpha_mode="BLEND")),
        "alpha_mode must be one of 'opaque', 'mask', 'blend'",
    ),
    "negative light": (lambda: gi.render(scene(lights=[gi.PointLight((0, 0, 0), -1)])), "intensity must be a number"),
    "position of two": (lambda: gi.render(scene(lights=[gi.PointLight((0, 0))])), "position must be 3 numbers"),
    "yfov in degrees": (lambda: gi.render(scene(), camera=gi.Camera(yfov=60)), "camera.yfov must be a number from"),
    "a camera with scale": (
        lambda: gi.render(scene(), camera=gi.Camera(np.eye(4) * 2)),
        "camera.world_from_view must be",
    ),
    "look_at(point, point)": (
        lambda: gi.Camera.look_at((0, 0, 0), (0, 0, 0)),
        "position and target are the same point",
    ),
    # Arrays.
    "from_arrays: vertices (n, 2)": (
        lambda: gi.Scene.from_arrays(VERTICES[:, :2], FACES),
        r"vertices must be an array of numbers of shape \(n, 3\), not of shape \(4, 2\)",
    ),
    "from_arrays: NaN": (
        lambda: gi.Scene.from_arrays(nan_vertices(), FACES),
        r"vertices\[2\] must be finite .*, not \(0, nan, 0\)",
    ),
    "from_arrays: rows of different lengths": (
        lambda: gi.Scene.from_arrays([[0, 0, 0], [1, 0]], FACES),
        "vertices must be an array of numbers",
    ),
    "from_arrays: None": (
        lambda: gi.Scene.from_arrays(None, FACES),
        "vertices must be an array of numbers .*, not None",
    ),
    "from_arrays: float faces": (
        lambda: gi.Scene.from_arrays(VERTICES, FACES.astype(float)),
        r"faces must be .*whole numbers.*, not of type float64; convert them with .astype\(int\)",
    ),
    "from_arrays: faces out of range": (
        lambda: gi.Scene.from_arrays(VERTICES, FACES + 1),
        r"faces\[1\] must be indices from 0 to 3 into vertices, not \(2, 4, 3\)",
    ),
    "from_arrays: pentagons": (lambda: gi.Scene.from_arrays(VERTICES, [[0, 1, 2, 3, 0]]), r"faces must be .*\(m, 3\)"),
    "from_arrays: no faces": (lambda: gi.Scene.from_arrays(VERTICES, np.zeros((0, 3), int)), "faces must not be empty"),
    "from_arrays: 7 colours": (
        lambda: gi.Scene.from_arrays(VERTICES, FACES, colors=np.ones((7, 3))),
        r"colors must be .* \(4 vertices, 2 faces\), not of shape \(7, 3\)",
    ),
    "from_arrays: bytes as floats": (
        lambda: gi.Scene.from_arrays(VERTICES, FACES, colors=[255.0, 0, 0]),
        "colors must be numbers from 0 to 1",
    ),
    "from_arrays: material=colour": (
        lambda: gi.Scene.from_arrays(VERTICES, FACES, material=(1, 0, 0)),
        "material must be a Material",
    ),
    "pair with NaN": (lambda: gi.render((nan_vertices(), FACES)), r"vertices\[2\] must be finite"),
    # Pictures.
    "save_image(text)": (lambda: gi.save_image("a.png", "picture"), "layers must be a picture, or a dictionary"),
    "save_image(None)": (lambda: gi.save_image("a.png", {"radiance": None}), "layer 'radiance' must be an array"),
    "save_image without extension": (lambda: gi.save_image("a", {"radiance": np.zeros((2, 2, 3))}), "picture format"),
    "save_image in no folder": (
        lambda: gi.save_image("no/such/folder/a.png", {"radiance": np.zeros((2, 2, 3))}),
        "there is no folder",
    ),
    "load_image(5)": (lambda: gi.load_image(5), "a picture is loaded from a path, not 5"),
    "load_image(missing)": (lambda: gi.load_image("none.png"), "none.png: no such file"),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_call_raises_one_sentence(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    call, sentence = CALLS[name]
    with pytest.raises((gi.GiError, AttributeError, TypeError)) as caught:
        call()
    message = str(caught.value)
    assert re.search(sentence, message), message
    # One line in Python's words: no flag of the command line.
    assert "\n" not in message and len(message) < 400 and not re.search(r"(^|\s)--\w", message), message
    # TypeError is Python's own for unknown keywords; AttributeError is ours, except for properties.
    assert not isinstance(caught.value, TypeError) or "keyword" in message, message
    assert not list(tmp_path.iterdir())


def test_there_are_many():
    assert len(CALLS) >= 100
