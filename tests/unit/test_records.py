"""Texts of scenes and settings: a summary, and a short line for each part, however large its arrays are."""

from __future__ import annotations

import copy
import pickle
from dataclasses import fields, replace

import numpy as np
import pytest
from helpers.values import everything

import wgpu_gi as gi
from wgpu_gi.scene.built_in.scenes import builtin_scene
from wgpu_gi.scene.scene import values_of


def large() -> gi.Scene:
    mesh = gi.Mesh(np.zeros((100_000, 3), np.float32), np.zeros((200_000, 3), np.uint32), [gi.Material("m")] * 900)
    cameras = [gi.Camera(name=f"camera {k}") for k in range(1000)]
    instances = [gi.Instance(mesh) for _ in range(2000)]
    return gi.Scene(instances, [gi.PointLight((0, 0, 0))] * 500, None, cameras, "large")


def test_print_is_a_summary():
    scene = builtin_scene("cornell-point")
    lines = dict((line[:22].strip(), line[22:]) for line in str(scene).splitlines())
    assert lines["scene"] == "cornell-point" and lines["triangles"] == "36" and lines["lights"] == "1 PointLight"
    assert lines["size in metres"] == "5.56 x 5.488 x 5.592" and lines["cameras"] == "camera"
    assert str(builtin_scene("cornell")).count("emissive materials    1") == 1


def test_texts_stay_short():
    scene = large()
    assert len(str(scene)) < 1000 and "camera 4 and 995 more" in str(scene)
    parts = [scene, scene.instances[0], scene.instances[0].mesh, scene.cameras[0], scene.lights[0], gi.Settings()]
    parts += [gi.Image(np.zeros((4000, 4000, 4), np.uint8)), gi.Environment(image=np.zeros((4000, 8000, 3)))]
    for part in parts:
        assert len(repr(part)) < 300 and "\n" not in repr(part)
    assert repr(scene) == (
        "<Scene 'large': 2000 instances of 1 meshes, 400000000 triangles, 500 lights, 1000 cameras, no environment>"
    )
    assert repr(scene.instances[0].mesh) == (
        "Mesh(positions=<100000 x 3 float32>, triangles=<200000 x 3 uint32>, materials=<900 items>)"
    )


def test_texts_show_what_was_given():
    assert repr(gi.Material("tiles", metallic=0.3)) == "Material(name='tiles', metallic=0.3)"
    assert repr(gi.Settings(gi="path", spp=3)) == "Settings(gi='path', spp=3)"
    settings = gi.Settings()
    settings.ssdo.directions = 8
    assert repr(settings) == "Settings(ssdo=SsdoSettings(directions=8))"
    assert repr(gi.SpotLight((0, 1, 0), (0, -1, 0), outer_cone_angle=0.5)) == (
        "SpotLight(position=(0, 1, 0), direction=(0, -1, 0), outer_cone_angle=0.5)"
    )


def test_texts_of_wrong_objects_do_not_raise():
    for wrong in (gi.Scene(5), gi.Scene([None]), gi.Mesh(None, "x"), gi.Instance(3), gi.Scene(cameras=None)):
        assert repr(wrong)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, replace, lambda part: pickle.loads(pickle.dumps(part))])
def test_objects_can_be_copied(copied):
    scene, camera = everything()
    parts = [
        scene,
        camera,
        scene.instances[0],
        scene.instances[0].mesh,
        *scene.lights,
        scene.environment,
        gi.Settings(),
    ]
    for part in parts:
        found = copied(part)
        assert type(found) is type(part) and found is not part
        assert repr(found) == repr(part) and [f.name for f in fields(found)] == [f.name for f in fields(part)]
    assert values_of(copied(scene.lights[0])) == values_of(scene.lights[0])
