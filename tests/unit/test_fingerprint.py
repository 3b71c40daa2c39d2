"""Change detection finds a change of any field of the scene's dataclasses, and reports no other."""

from __future__ import annotations

import dataclasses
from copy import copy
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.scene.built_in.shapes import box, quad
from wgpu_gi.scene.scene import (
    DirectionalLight,
    Environment,
    Image,
    Instance,
    Material,
    Mesh,
    MorphTarget,
    PointLight,
    Scene,
    Skin,
    SpotLight,
    Texture,
)
from wgpu_gi.upload.fingerprint import Fingerprint

KINDS = (Scene, Instance, Mesh, Material, Texture, Image, PointLight, SpotLight, DirectionalLight, Environment)
# Cameras are compared elsewhere; names, notes and animations that nobody plays change no picture.
NO_CHANGE = {(kind, name) for kind in KINDS for name in ("name", "notes", "cameras", "animations")}
SEEN = [
    (kind, f.name)
    for kind in KINDS
    for f in dataclasses.fields(kind)
    if (kind, f.name) not in NO_CHANGE | {(Image, "pixels")}  # images are compared by identity
]
IMMUTABLE = {(Mesh, f.name) for f in dataclasses.fields(Mesh) if f.name != "materials"} | {(Environment, "image")}


def image():
    return Image(np.zeros((2, 2, 4), np.uint8))


def scene():
    """Return a scene with one object of each class, and all optional fields set."""
    material = Material("all", attenuation_distance=1.0)
    for f in dataclasses.fields(Material):
        if f.name.endswith("_texture"):
            setattr(material, f.name, Texture(image(), min_filter="nearest"))
    first = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), material)
    first.material_of_triangle = np.zeros(2, np.uint32)
    for name, width in (("normals", 3), ("tangents", 4), ("texcoords0", 2), ("texcoords1", 2), ("colors", 4)):
        setattr(first, name, np.ones((4, width), np.float32))
    first.skin = Skin(np.zeros((4, 1), np.uint16), np.ones((4, 1), np.float32))
    first.morph_targets = [MorphTarget(np.ones((4, 3), np.float32))]
    pose = {"joint_matrices": np.eye(4)[None], "morph_weights": (0.5,)}
    return Scene(
        [Instance(first, name="first", **pose), Instance(first), Instance(box((0, 0, 0), (1, 1, 1)))],
        [
            PointLight([0.0, 1.0, 0.0], range=3.0),
            SpotLight([0, 1, 0], [0, -1, 0], range=2.0),
            DirectionalLight([0, -1, 0]),
        ],
        Environment((1.0, 0.5, 0.25), np.zeros((2, 4, 3), np.float32)),
        [Camera()],
        "scene",
        ["note"],
    )


def owner_of(scene: Scene, kind: type) -> Any:
    """Return the scene's object of a class."""
    material = scene.instances[0].mesh.materials[0]
    objects = [scene, scene.instances[0], scene.instances[0].mesh, material, *scene.lights, scene.environment]
    objects += [material.base_color_texture, material.base_color_texture.image]
    return next(o for o in objects if type(o) is kind)


def others(kind: type, name: str, value: Any) -> list[Any]:
    """Return other values of a field, one of each type that it may have."""
    found: list[Any] = []
    hint = get_type_hints(kind)[name]
    if type(None) in get_args(hint):
        found.append(None)
    if isinstance(value, bool):
        return [*found, not value]
    literals = [kind for kind in (hint, *get_args(hint)) if get_origin(kind) is Literal]
    if literals:
        return [*found, *[choice for choice in get_args(literals[0]) if choice != value]]
    if isinstance(value, (int, float)):
        return [*found, value + 0.125]
    if isinstance(value, np.ndarray):
        more = value.copy()
        more.flat[-2] += 1
        return [*found, more]
    if isinstance(value, (tuple, list)) and isinstance(value[0], (int, float)):
        return [*found, *[type(value)(v + 0.125 * (k == j) for j, v in enumerate(value)) for k in range(len(value))]]
    if isinstance(value, list):
        return [*found, value[1:], [*value, copy(value[-1])], value[::-1] if len(value) > 1 else []]
    assert dataclasses.is_dataclass(value), f"no other value is known for {kind.__name__}.{name}"
    # Textures and environments compare by value, meshes and images by identity.
    return [*found, dataclasses.replace(value, **({"rotation": 1.0} if hasattr(value, "rotation") else {}))]


@pytest.mark.parametrize(("kind", "name"), SEEN, ids=lambda v: v if isinstance(v, str) else v.__name__)
def test_every_field_is_compared(kind, name):
    s = scene()
    owner, before = owner_of(s, kind), Fingerprint(s)
    value = getattr(owner, name)
    assert value is not None
    for other in others(kind, name, value):
        setattr(owner, name, other)
        assert Fingerprint(s) != before, other
        setattr(owner, name, value)
        assert Fingerprint(s) == before


@pytest.mark.parametrize(("kind", "name"), SEEN, ids=lambda v: v if isinstance(v, str) else v.__name__)
def test_changes_in_place_are_found(kind, name):
    """In lists and arrays, also for fields that usually hold tuples."""
    value = getattr(owner_of(scene(), kind), name)
    if (kind, name) in IMMUTABLE or not isinstance(value, (tuple, list, np.ndarray)):
        return
    for as_type in (list, np.array):
        s = scene()
        owner = owner_of(s, kind)
        value = getattr(owner, name)
        numbers = not isinstance(value, list) or isinstance(value[0], (int, float))
        if not numbers and as_type is np.array:
            continue
        held = value if isinstance(value, np.ndarray) else as_type(value)
        setattr(owner, name, held)
        before = Fingerprint(s)
        assert Fingerprint(s) == before
        if isinstance(held, np.ndarray):
            held.flat[-1] += 1
        elif numbers:
            held[-1] += 1
        else:
            held.append(copy(held[0]))
        assert Fingerprint(s) != before


def test_other_fields_are_ignored():
    s = scene()
    before = Fingerprint(s)
    assert Fingerprint(s) == before and before != object()
    for kind, name in sorted(NO_CHANGE, key=str):
        if name not in {f.name for f in dataclasses.fields(kind)}:
            continue
        owner = owner_of(s, kind)
        setattr(owner, name, "other" if name == "name" else [])
        assert Fingerprint(s) == before, (kind, name)
    # The same objects in other containers.
    s.instances, s.lights = list(s.instances), [copy(light) for light in s.lights]
    s.environment = copy(s.environment)
    material = s.instances[0].mesh.materials[0]
    material.base_color_texture = copy(material.base_color_texture)
    s.instances[0].world_from_local = s.instances[0].world_from_local.copy()
    assert Fingerprint(s) == before
    same = Scene(s.instances, s.lights, s.environment)
    assert Fingerprint(same) == before


def test_kinds_of_lights_differ():
    s = scene()
    s.lights = [PointLight((0, 1, 0))]
    before = Fingerprint(s)
    s.lights = [SpotLight((0, 1, 0), (0, -1, 0))]
    assert Fingerprint(s) != before


def test_a_material_that_moves_between_meshes_is_found():
    s = scene()
    first, second = s.instances[0].mesh, s.instances[2].mesh
    first.materials.append(Material("spare"))
    before = Fingerprint(s)
    second.materials.insert(0, first.materials.pop())
    assert Fingerprint(s) != before


def test_objects_with_reused_ids_differ():
    """Ids are unique among living objects only, so a fingerprint keeps alive what it compares by identity."""
    s = scene()
    for _ in range(50):
        before = Fingerprint(s)
        s.instances[0] = Instance(s.instances[1].mesh)
        s.instances[2].mesh.materials[0] = Material()
        s.instances[1].mesh.materials[0].normal_texture.image = image()
        s.environment.image = np.zeros((2, 4, 3), np.float32)
        assert Fingerprint(s) != before
    parts = [
        lambda: s.instances.__setitem__(0, Instance(s.instances[1].mesh)),
        lambda: s.instances[2].mesh.materials.__setitem__(0, Material()),
        lambda: setattr(s.instances[1].mesh.materials[0].normal_texture, "image", image()),
        lambda: setattr(s.environment, "image", np.zeros((2, 4, 3), np.float32)),
    ]
    for part in parts:
        before = Fingerprint(s)
        part()
        assert Fingerprint(s) != before
