"""Wrong and extreme values for every field of scenes and cameras, each as a change of a small scene that has it all."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from wgpu_gi.camera import Camera
from wgpu_gi.scene.animation import Animation, Channel, Track
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

NAN, INF = math.nan, math.inf
_TEXTURES = tuple(field.name for field in fields(Material) if field.name.endswith("_texture"))
OBJECTS = [None, "x", 5, object(), {}, [None], Material]  # wrong wherever an object of ours belongs
NUMBERS = [None, "1", [1.0], object(), True, NAN, INF, -INF, 1j, np.zeros(2), 10**5000]
SMALL_AND_LARGE = [0, 0.0, -0.0, np.float32(0.5), 1e-300, 5e-324, 1e-45, 1e-38, 1e-12, 1e12, 1e20, 3e38, 1e39, 1e300]


class Change(NamedTuple):
    """A value of one field: `path` is Python's name of it, below the scene or the camera."""

    path: str
    value: Any
    wrong: bool  # it must be refused; otherwise it may be, or it must give a finite picture

    def __str__(self) -> str:
        text = repr(self.value) if not isinstance(self.value, (np.ndarray, int)) else str(type(self.value).__name__)
        return f"{self.path}={text}"[:60].encode("ascii", "replace").decode().replace("\n", " ")

    def apply(self) -> tuple[Scene, Camera]:
        """Return a new scene and camera with the change."""
        scene, camera = everything()
        owner: Any = {"scene": scene, "camera": camera}[self.path.split(".")[0].split("[")[0]]
        *way, last = self.path.split(".")[1:]
        for name in way:
            name, _, index = name.partition("[")
            owner = getattr(owner, name)
            if index:
                owner = owner[int(index[:-1])]
        setattr(owner, last, self.value)
        return scene, camera


def everything() -> tuple[Scene, Camera]:
    """Return a scene with one object of each class, and its camera."""
    rng = np.random.default_rng(0)
    texture = Texture(Image(rng.integers(64, 256, (4, 4, 4)).astype(np.uint8)))
    material = Material("tiles", metallic=0.3, roughness=0.4, emission=(0.5, 0.2, 0.1), alpha_mode="mask")
    material.ior, material.specular, material.specular_color = 1.4, 0.8, (0.9, 0.7, 0.5)
    material.clearcoat, material.clearcoat_roughness, material.sheen_roughness = 0.5, 0.2, 0.4
    material.sheen_color, material.anisotropy, material.anisotropy_rotation = (0.3, 0.2, 0.1), 0.5, 0.7
    material.transmission, material.thickness = 0.3, 0.1
    material.attenuation_distance, material.attenuation_color = 0.5, (0.4, 0.6, 0.8)
    for name in _TEXTURES:
        setattr(material, name, texture)
    sheet = quad((-0.4, 0.3, -0.4), (0.8, 0, 0), (0, 0.8, 0), material)
    sheet.normals = np.tile(np.float32((0, 0, 1)), (4, 1))
    sheet.tangents = np.tile(np.float32((1, 0, 0, 1)), (4, 1))
    sheet.texcoords0 = sheet.texcoords1 = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    sheet.colors = np.ones((4, 4), np.float32)
    sheet.material_of_triangle = np.zeros(2, np.uint32)
    floor = box((-2, -0.2, -2), (2, 0, 2), Material("floor", (0.7, 0.6, 0.5, 1.0)))
    lights = [
        PointLight([0.5, 1.5, 0.5], 3.0, name="bulb"),
        SpotLight([0, 2, 1], [0, -2, -1], 0.2, 0.6, 4.0, name="spot"),
        DirectionalLight([0.3, -1, -0.2], 2.0, name="sun"),
    ]
    image = np.full((4, 8, 3), 0.3, np.float32)
    camera = Camera.look_at((0.3, 1.2, 2.5), (0, 0.4, 0), name="front")
    instances = [Instance(sheet, name="sheet"), Instance(floor), _flag()]
    scene = Scene(instances, lights, Environment(image=image), [camera])
    scene.animations = [Animation("dim", [Channel(lights[0], "intensity", Track(np.arange(2.0), np.ones(2)))])]
    return scene, camera


def _flag() -> Instance:
    """Return a skinned sheet with a morph target."""
    flag = quad((-1.2, 0.3, -0.4), (0.5, 0, 0), (0, 0.5, 0), Material("flag"))
    flag.skin = Skin(np.array([[0, 1]] * 4, np.uint16), np.full((4, 2), 0.5, np.float32))
    moves = np.full((4, 3), 0.1, np.float32)
    flag.morph_targets = [MorphTarget(moves, moves, moves, "wave")]
    flag.normals, flag.tangents = np.tile(np.float32((0, 0, 1)), (4, 1)), np.tile(np.float32((1, 0, 0, 1)), (4, 1))
    return Instance(flag, joint_matrices=np.tile(np.eye(4), (2, 1, 1)), morph_weights=(0.5,), name="flag")


def changes() -> Iterator[Change]:
    """Yield all changes."""
    mesh, lights = "scene.instances[0].mesh", [f"scene.lights[{k}]" for k in range(3)]
    material = f"{mesh}.materials[0]"
    owners = {
        "scene": Scene,
        "scene.instances[0]": Instance,
        mesh: Mesh,
        "scene.instances[2]": Instance,
        "scene.instances[2].mesh.skin": Skin,
        "scene.instances[2].mesh.morph_targets[0]": MorphTarget,
        "scene.animations[0]": Animation,
        "scene.animations[0].channels[0]": Channel,
        "scene.animations[0].channels[0].track": Track,
        material: Material,
        f"{material}.base_color_texture": Texture,
        f"{material}.base_color_texture.image": Image,
        lights[0]: PointLight,
        lights[1]: SpotLight,
        lights[2]: DirectionalLight,
        "scene.environment": Environment,
        "camera": Camera,
    }
    for path, kind in owners.items():
        for field in fields(kind):
            wrong, extreme = _values(kind, field.name)
            yield from (Change(f"{path}.{field.name}", value, True) for value in wrong)
            yield from (Change(f"{path}.{field.name}", value, False) for value in extreme)


def _values(kind: type, name: str) -> tuple[list[Any], list[Any]]:
    """Return the values of a field that are wrong, and those that are extreme."""
    for names, values in _TABLE:
        if name in names or f"{kind.__name__}.{name}" in names:
            return values()
    raise AssertionError(f"no values for {kind.__name__}.{name}")


def _vector(count: int, low: float, values: list[float]) -> tuple[list[Any], list[Any]]:
    one = [0.5] * (count - 1)
    wrong = [None, 0.5, "red", [], one, [*one, 0.5, 0.5], [[0.5] * count], np.zeros((count, count)), {}, object()]
    wrong += [[value, *one] for value in [None, "a", NAN, INF, -INF, 1j, [1], 1e301, 10**400]]
    extreme = [[value, *one] for value in values] + [[value] * count for value in values]
    extreme += [np.full(count, 0.25), np.full(count, 0.25, np.float32), tuple([0.5] * count), [np.float32(1)] * count]
    wrong += [[-1.0, *one], np.full(count, -0.5)] if low == 0 else []
    return wrong, extreme


def _array(good: np.ndarray, floats: bool) -> tuple[list[Any], list[Any]]:
    """Return wrong and extreme arrays in place of `good`."""
    count, *rest = good.shape
    wrong: list[Any] = ["x", 5, {}, good.tolist(), good.ravel()[None, None], good[..., None], good.astype(object)]
    wrong += [good.astype(str), good.astype(complex), good[:, :1] if rest else good[:0], np.zeros(0)]
    if not floats:
        return [*wrong, good.astype(np.float32), good + 1000, -1 - good.astype(np.int64)], [good.astype(np.int64)]
    wrong += [np.full(good.shape, value) for value in (NAN, INF, -INF)] + [good[:1], np.ones((count + 1, *rest))]
    extreme = [np.full(good.shape, v) for v in (0.0, -1.0, 1e-40, 1e12, 1e30)] + [good.astype(np.float64)]
    return wrong, [*extreme, np.asfortranarray(good), good.astype(np.float16)]


def _mesh_array(name: str, floats: bool) -> Callable[[], tuple[list[Any], list[Any]]]:
    return lambda: _array(getattr(everything()[0].instances[0].mesh, name), floats)


def _image() -> tuple[list[Any], list[Any]]:
    wrong: list[Any] = [5, "x", [[[1, 1, 1]]], np.zeros((0, 0, 3)), np.zeros((0, 8, 3)), np.zeros((8, 0, 3))]
    wrong += [np.ones((4, 8)), np.ones((4, 8, 4)), np.ones((4, 8, 3), complex), np.broadcast_to(1.0, (1, 8193, 3))]
    wrong += [np.full((4, 8, 3), value) for value in (NAN, INF, -1.0, 1e39, 1e300)]
    extreme = [np.full((4, 8, 3), v) for v in (0, 1e-40, 1e-20, 1e10, 1e20)]
    spike = np.full((4, 8, 3), 1e-6)
    spike[1, 3] = 1e6
    return wrong, [*extreme, spike, np.ones((1, 1, 3)), np.ones((1, 4, 3), np.uint8), np.ones((4, 8, 3), np.float16)]


def _pixels() -> tuple[list[Any], list[Any]]:
    wrong: list[Any] = [
        None,
        "x",
        [[[1] * 4]],
        *(np.zeros(s, np.uint8) for s in ((0, 0, 4), (4, 0, 4), (4, 4), (4, 4, 3))),
    ]
    wrong += [np.zeros((4, 4, 4), t) for t in (np.float32, np.int16, bool)]
    extreme = [np.full((1, 1, 4), v, np.uint8) for v in (0, 255)] + [np.zeros((1, 8192, 4), np.uint8)]
    extreme += [np.full((2, 2, 4), 65535, np.uint16)]
    return wrong, [*extreme, np.full((4, 8, 4), 99, np.uint8)[:, ::2]]


def _matrix() -> tuple[list[Any], list[Any]]:
    good = np.eye(4)
    wrong: list[Any] = [None, 5, "x", np.eye(3), np.zeros((4, 4)), np.diag([1, 0, 1, 1.0]), np.full((4, 4), NAN)]
    wrong += [
        [[1, 2], [3]],
        np.eye(4).astype(str),
        np.full((4, 4), INF),
        np.ones((4, 4)),
        np.diag([1, 1, 1, 2.0]),
        good * 1j,
    ]
    wrong += [np.diag([1, 1, 1, 0.0]), np.eye(4)[None], [[10**400] * 4] * 4]
    far = np.eye(4)
    far[:3, 3] = 1e300
    nearer = np.eye(4)
    nearer[:3, 3] = 1e7
    return [*wrong, far], [good.tolist(), good.astype(np.float32), good.astype(int), np.asfortranarray(good), nearer]


def _transform() -> tuple[list[Any], list[Any]]:
    wrong, extreme = _matrix()
    scales = [np.diag([s, s, s, 1.0]) for s in (1e-30, 1e-12, 1e-3, 1e3, 1e12, -1.0)]
    sheared = np.eye(4)
    sheared[0, 1] = 1e6
    return [*wrong, np.diag([1e300] * 3 + [1])], [*extreme, *scales, sheared]


def _pose() -> tuple[list[Any], list[Any]]:
    wrong, extreme = _matrix()
    wrong += [np.eye(4).tolist(), np.diag([2.0, 2, 2, 1]), np.diag([1e-3, 1, 1, 1])]
    return wrong, [*extreme[1:], np.diag([-1.0, 1, 1, 1])]


def _poses() -> tuple[list[Any], list[Any]]:
    good = np.tile(np.eye(4), (2, 1, 1))
    wrong: list[Any] = [5, "x", np.eye(4), good[:0], good[:1], good.tolist(), good * NAN, np.ones((2, 4, 4)), good * 1j]
    return wrong, [None, good * (1e-30, 1, 1, 1), good.astype(np.float32), np.tile(np.eye(4), (9, 1, 1))]


def _flag_array(owner: Callable[[Mesh], Any], name: str) -> Callable[[], tuple[list[Any], list[Any]]]:
    return lambda: _array(getattr(owner(_flag().mesh), name), name != "joints")


def _skin_weights() -> tuple[list[Any], list[Any]]:
    wrong, extreme = _flag_array(lambda mesh: mesh.skin, "weights")()
    return [*wrong, *extreme[:5], np.full((4, 2), 0.4), np.tile([2.0, -1], (4, 1))], [np.tile([0.0, 1], (4, 1))]


def _animation_part(name: str, *extreme: Any) -> Callable[[], tuple[list[Any], list[Any]]]:
    return lambda: ([*(x for x in OBJECTS if x is not None), *([None] if name != "factor" else [])], list(extreme))


def _names() -> tuple[list[Any], list[Any]]:
    return [None, 5, b"x", ["x"]], ["", "x" * 10000, "\0\n", "\U0001f9ea"]


_POSITIVE = [*NUMBERS, -1, -1e-30, -1e300]
_WEIGHTS = ["1", object(), True, NAN, INF, 1j, np.zeros(2), np.eye(2), 10**5000]
_WORDS = [None, 5, [], "Mask", "foo", "", "REPEAT", b"repeat", object()]
_PLACES = [0.0, 1e-300, 1e-30, 1e6, 1e7, -1e12, 1e16]
_TABLE: list[tuple[tuple[str, ...], Callable[[], tuple[list[Any], list[Any]]]]] = [
    (("name",), _names),
    (("instances", "lights", "cameras"), lambda: ([*OBJECTS, [Material()], np.zeros(3)], [[], ()])),
    (("animations", "channels", "attachments", "skeletons"), lambda: ([*OBJECTS, [Material()], np.zeros(3)], [[], ()])),
    (("skin",), lambda: ([x for x in OBJECTS if x is not None], [None])),
    (("morph_targets",), lambda: ([*OBJECTS, [Material()]], [[], ()])),
    (("joint_matrices",), _poses),
    (("morph_weights",), lambda: ([*_WEIGHTS, (NAN,), (1.0, 1.0, 1.0), ("1",), [None], (1e300,)], [(), [0], (-1e9,)])),
    (("Skin.joints",), _flag_array(lambda mesh: mesh.skin, "joints")),
    (("Skin.weights",), _skin_weights),
    (("MorphTarget.positions",), _flag_array(lambda mesh: mesh.morph_targets[0], "positions")),
    (("MorphTarget.normals",), _flag_array(lambda mesh: mesh.morph_targets[0], "normals")),
    (("MorphTarget.tangents",), _flag_array(lambda mesh: mesh.morph_targets[0], "tangents")),
    (("Channel.target",), _animation_part("target")),
    (("Channel.path",), lambda: ([*_WORDS, "translation"], ["range"])),
    (("Channel.track",), _animation_part("track")),
    (("factor",), _animation_part("factor", None, Track(np.zeros(1), np.zeros(1)))),
    (("index",), lambda: ([0, -1, "0", 0.5, [], True], [None])),
    (
        ("times",),
        lambda: ([None, "x", [], np.zeros(0), np.eye(2), [1.0, 0.0], np.array([1.0, 0.0]), [NAN, 1], np.ones(3)], []),
    ),
    (("values",), lambda: ([None, "x", [], np.zeros(0), np.eye(3), np.array([1.0, NAN]), np.ones(3)], [])),
    (("interpolation",), lambda: ([*_WORDS, "cubic"], ["step"])),
    (("notes",), lambda: ([None, "x", 5, [None], [5]], [[], ["x"]])),
    (("environment",), lambda: (["x", 5, object(), np.zeros((4, 8, 3)), [None]], [None])),
    (("mesh", "image_of_texture", "Texture.image"), lambda: (OBJECTS, [])),
    (("world_from_local",), _transform),
    (("world_from_view",), _pose),
    (
        ("materials",),
        lambda: ([*OBJECTS, [], [Image(np.zeros((1, 1, 4), np.uint8))]], [[Material()] * 3, (Material(),)]),
    ),
    (("positions",), _mesh_array("positions", True)),
    (("triangles",), _mesh_array("triangles", False)),
    (("material_of_triangle",), _mesh_array("material_of_triangle", False)),
    (("normals",), _mesh_array("normals", True)),
    (("tangents",), _mesh_array("tangents", True)),
    (("texcoords0",), _mesh_array("texcoords0", True)),
    (("texcoords1",), _mesh_array("texcoords1", True)),
    (("colors",), _mesh_array("colors", True)),
    (("base_color",), lambda: _vector(4, 0, [0.0, 1e-300, 1e-40, 1.0, 1 + 1e-9, 1e30])),
    (
        ("metallic", "roughness", "specular", "clearcoat", "clearcoat_roughness", "sheen_roughness", "anisotropy"),
        lambda: (_POSITIVE, SMALL_AND_LARGE),
    ),
    (("transmission", "thickness"), lambda: (_POSITIVE, SMALL_AND_LARGE)),
    (("ior",), lambda: ([*_POSITIVE, 0.5, 1e-300, 101.0], [0, 0.0, 1, 1 + 1e-12, 1.33, 100])),
    (("attenuation_distance",), lambda: ([*_POSITIVE[1:5], NAN, -1.0, 0.0, 1e-300], [None, INF, 1e-12, 1.0, 1e15])),
    (("sheen_color", "attenuation_color"), lambda: _vector(3, 0, [0.0, 1e-300, 1e-40, 1.0, 1 + 1e-9, 1e30])),
    (("emission", "color", "specular_color"), lambda: _vector(3, 0, SMALL_AND_LARGE)),
    (("intensity",), lambda: (_POSITIVE, SMALL_AND_LARGE)),
    (("alpha_mode",), lambda: (_WORDS, ["opaque", "mask", "blend"])),
    (("alpha_cutoff", "normal_scale", "clearcoat_normal_scale"), lambda: (NUMBERS, [*SMALL_AND_LARGE, -1, -1e300])),
    (("double_sided", "unlit"), lambda: ([None, "yes", 2, [], object()], [True, np.bool_(True)])),
    (
        _TEXTURES,
        lambda: ([x for x in OBJECTS if x is not None] + [Image(np.zeros((1, 1, 4), np.uint8)), "a.png"], [None]),
    ),
    (("wrap_u", "wrap_v"), lambda: (_WORDS, ["clamp", "mirror"])),
    (("filter",), lambda: (_WORDS, ["nearest"])),
    (("min_filter",), lambda: ([w for w in _WORDS if w is not None], [None, "linear", "nearest"])),
    (("mip_filter",), lambda: (_WORDS, ["nearest", "none"])),
    (("texcoord",), lambda: ([None, "0", 2, -1, 0.5, [], True], [1])),
    (("offset", "scale"), lambda: _vector(2, -1, [*SMALL_AND_LARGE, -1.0, 0.5])),
    (("rotation", "anisotropy_rotation"), lambda: (NUMBERS, [*SMALL_AND_LARGE, -1, -1e300])),
    (("position",), lambda: _vector(3, -1, _PLACES)),
    (
        ("direction",),
        lambda: (
            [v for v in [*_vector(3, -1, [])[0], [0, 0, 0]] if not isinstance(v, list) or v[:1] != [1e301]],
            [[0, 1e-300, 0], [0, -1e300, 1e300], [1e-30, 1, 0]],
        ),
    ),
    (("range",), lambda: ([*_POSITIVE[1:5], NAN, -1.0], [None, INF, *SMALL_AND_LARGE])),
    (("inner_cone_angle",), lambda: ([*_POSITIVE, 0.7, 4.0], [0, 1e-300, 0.6])),
    (("outer_cone_angle",), lambda: ([*_POSITIVE, 0.1, 4.0], [0.2, 0.2 + 1e-12, math.pi])),
    (("Environment.image",), _image),
    (("pixels",), _pixels),
    (("yfov",), lambda: ([*_POSITIVE, 0, 1e-300, 1e-40, 1e-7, math.pi, 4, 1e300], [1e-6, 1e-3, 3.05, math.pi - 1e-5])),
    (
        ("orthographic_height",),
        lambda: ([*_POSITIVE[1:], 0, 1e-300, 1e-40, 1e39, 1e300], [None, 1e-12, 1e-6, 1.0, 1e12, 1e15]),
    ),
]
