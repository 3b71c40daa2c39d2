"""A scene that changes between frames: only changes are sent, and the picture equals that of a newly loaded scene."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.memory import resident

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.gpu.device import open_device
from wgpu_gi.options import CameraSettings, Settings
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.built_in.shapes import box, quad, sphere
from wgpu_gi.scene.scene import (
    DirectionalLight,
    Environment,
    Image,
    Instance,
    Material,
    Mesh,
    PointLight,
    Scene,
    Texture,
)
from wgpu_gi.techniques.reference import PathSettings
from wgpu_gi.upload.scene_upload import SceneUpload

SIZE = (32, 18)
SHOW = ("radiance", "albedo", "normal", "depth", "position")


def at(x, y, z, scale=1.0):
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = (x, y, z)
    return matrix


def pixels(seed, size=(8, 8)):
    return np.random.default_rng(seed).integers(0, 256, (*size, 4)).astype(np.uint8)


def square(corner, edge_u, edge_v, material):
    """A quad with texture coordinates."""
    mesh = quad(corner, edge_u, edge_v, material)
    mesh.texcoords0 = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    return mesh


def everything():
    """Return a scene with objects of every kind, so that all tests share the same shader variants."""
    texture, mask = Texture(Image(pixels(0)), filter="nearest"), Texture(Image(pixels(1)), filter="nearest")
    floor = Material("floor", base_color_texture=texture, roughness=0.4)
    leaf = Material("leaf", base_color_texture=mask, alpha_mode="mask", double_sided=True)
    ball = sphere(subdivisions=1, material=Material("ball", (0.8, 0.3, 0.2, 1.0), metallic=0.5, roughness=0.3))
    lamp = Material("lamp", emission=(4.0, 3.0, 2.0))
    return Scene(
        instances=[
            Instance(square((-4, 0, -4), (0, 0, 8), (8, 0, 0), floor), name="floor"),
            Instance(square((-2, 0, -2), (4, 0, 0), (0, 3, 0), leaf), name="leaf"),
            Instance(ball, at(-1, 0.7, 0, 0.7), "left"),
            Instance(ball, at(1, 0.7, 0.5, 0.7), "right"),
            Instance(box((-0.3, 2.5, -0.3), (0.3, 2.6, 0.3), lamp), name="lamp"),
            Instance(box((1.5, 0, 1), (2, 1, 1.5), Material("block", (0.2, 0.4, 0.9, 1.0))), name="block"),
        ],
        lights=[PointLight((2, 3, 2), 20.0, name="point")],
        environment=Environment(image=np.random.default_rng(2).random((4, 8, 3)).astype(np.float32)),
        cameras=[Camera.look_at((0, 1.5, 6), (0, 1, 0), yfov_deg=50)],
    )


def named(scene, name):
    return next(i for i in scene.instances if i.name == name)


def material(scene, name):
    return next(m for m in scene.materials if m.name == name)


def settings(**fields):
    return Settings(gi="path", spp=4, bounces=2, **fields)


def picture(scene, **fields):
    """Return all buffers of a scene from a new renderer."""
    return shown(Renderer(scene, size=SIZE, settings=settings(**fields)))


def shown(renderer):
    renderer.run(show=SHOW)
    return {name: renderer.read_back(name) for name in SHOW}


# ------------------------------------------------------------------------------------------------ What changes

DEFORMED = {"nodes", "triangles", "instances"}  # change with the positions of a mesh
BAKED = {"nodes", "triangles", "instances"}  # change when a baked mesh moves
ALL_GEOMETRY = BAKED | {"vertices"}


def light_moves(scene):
    scene.lights[0].position = (-2, 2, 2)


def light_dims(scene):
    scene.lights[0].intensity = 5.0


def light_comes(scene):
    scene.lights.append(DirectionalLight((0.2, -1, -0.3), 2.0))


def lights_go(scene):
    scene.lights.clear()


def factor(scene):
    material(scene, "ball").base_color = (0.1, 0.9, 0.1, 1.0)
    material(scene, "ball").roughness = 0.7


def emission(scene):
    material(scene, "lamp").emission = (1.0, 1.0, 5.0)


def other_material(scene):
    named(scene, "block").mesh.materials = [material(scene, "floor")]


def one_of_two_moves(scene):
    named(scene, "right").world_from_local = at(1.2, 1.0, 0.3, 0.6)


def baked_moves(scene):
    named(scene, "block").world_from_local = at(-0.5, 0.2, 0.4)


def dented(scene):
    mesh = named(scene, "left").mesh
    mesh.positions = mesh.positions * np.where(mesh.positions[:, :1] > 0, np.float32(0.4), np.float32(1.0))


def baked_deforms(scene):
    mesh = named(scene, "block").mesh
    mesh.positions = mesh.positions * np.float32(0.5) + np.float32(0.4)


def lamp_deforms(scene):
    mesh = named(scene, "lamp").mesh
    mesh.positions = mesh.positions * np.array([4, 1, 1], np.float32)


def normals_given(scene):
    mesh = named(scene, "block").mesh
    mesh.normals = (mesh.positions - mesh.positions.mean(0)).astype(np.float32)


def texture_shifts(scene):
    mesh = named(scene, "leaf").mesh
    mesh.texcoords0 = mesh.texcoords0 * np.float32(0.5) + np.float32(0.3)


def colored(scene):
    mesh = named(scene, "block").mesh
    mesh.colors = np.tile(np.array([0.5, 1, 0.25, 1], np.float32), (len(mesh.positions), 1))


def fewer_triangles(scene):
    mesh = named(scene, "block").mesh
    mesh.triangles = mesh.triangles[:-4]


def other_arrays(scene):
    mesh, other = named(scene, "block").mesh, sphere((1.0, 1.0, 1.0), subdivisions=1)
    mesh.normals, mesh.positions, mesh.triangles = other.normals, other.positions, other.triangles


def lamp_moves(scene):
    named(scene, "lamp").world_from_local = at(0.6, 0.3, 0.0)


def mirrored(scene):
    named(scene, "block").world_from_local = at(3.0, 0, 0) @ np.diag([-1.0, 1, 1, 1])


def far_away(scene):
    named(scene, "block").world_from_local = at(0, 0, -40.0, 10.0)


def instance_goes(scene):
    scene.instances.remove(named(scene, "left"))


def instance_comes(scene):
    scene.instances.append(Instance(named(scene, "left").mesh, at(0, 0.3, 2, 0.3)))


def cutoff(scene):
    material(scene, "leaf").alpha_cutoff = 0.8


def opaque(scene):
    material(scene, "leaf").alpha_mode = "opaque"


def other_texture(scene):
    material(scene, "floor").base_color_texture = Texture(Image(pixels(5)), filter="nearest")


def larger_texture(scene):
    material(scene, "floor").base_color_texture = Texture(Image(pixels(5, (300, 20))))


def rough_texture(scene):
    material(scene, "ball").metallic_roughness_texture = Texture(Image(pixels(6)))


def layers(scene):
    ball = material(scene, "ball")
    ball.clearcoat, ball.clearcoat_roughness, ball.ior = 0.8, 0.2, 1.8
    ball.sheen_color, ball.sheen_roughness, ball.anisotropy = (0.5, 0.3, 0.1), 0.4, 0.7


def layer_texture(scene):
    """The texture of a clear coat; that of a sheen, which the material lacks, is not sent."""
    floor = material(scene, "floor")
    floor.clearcoat, floor.clearcoat_texture = 1.0, Texture(Image(pixels(8)))
    floor.sheen_color_texture = Texture(Image(pixels(9)))


def sampler(scene):
    material(scene, "floor").base_color_texture.wrap_u = "mirror"
    material(scene, "floor").base_color_texture.scale = (2.0, 3.0)


def environment(scene):
    scene.environment = Environment(image=np.random.default_rng(7).random((4, 8, 3)).astype(np.float32))


def environment_turns(scene):
    scene.environment.rotation = 1.0


def environment_dims(scene):
    scene.environment.color = (0.2, 0.3, 0.4)


# The change, the resources that must be sent for it, those that may be sent besides (lights and materials share
# probabilities), and whether the picture then equals that of a newly loaded scene exactly.
CHANGES = [
    (light_moves, {"lights"}, set(), True),
    (light_dims, {"lights"}, {"materials"}, True),
    (light_comes, {"lights"}, {"materials"}, True),
    (lights_go, {"lights"}, {"materials"}, True),
    (factor, {"materials"}, set(), True),
    (emission, {"materials", "lights"}, set(), True),
    (other_material, {"materials", "triangles"}, {"lights"}, True),
    (one_of_two_moves, {"nodes", "instances"}, {"lights", "materials"}, False),
    (baked_moves, BAKED, {"lights", "materials"}, False),
    (lamp_moves, BAKED | {"lights"}, {"materials"}, False),
    (dented, DEFORMED, {"lights", "materials"}, True),
    (baked_deforms, DEFORMED, {"lights", "materials"}, False),
    (lamp_deforms, DEFORMED | {"lights"}, {"materials"}, False),
    (normals_given, DEFORMED | {"vertices"}, {"lights", "materials"}, False),
    (texture_shifts, DEFORMED | {"vertices"}, {"lights", "materials"}, False),
    (colored, DEFORMED | {"vertices"}, {"lights", "materials"}, False),
    (fewer_triangles, {"triangles"}, {*ALL_GEOMETRY, "lights", "materials"}, True),
    (other_arrays, ALL_GEOMETRY, {"lights", "materials"}, True),
    (mirrored, BAKED, {"lights", "materials"}, False),
    (far_away, BAKED, {"lights", "materials"}, False),
    (instance_goes, {"nodes", "instances"}, {*ALL_GEOMETRY, "lights", "materials"}, True),
    (instance_comes, {"nodes", "instances"}, {*ALL_GEOMETRY, "lights", "materials"}, True),
    (cutoff, {"materials"}, {"atlas_srgb"}, True),
    (opaque, {"materials", "triangles", "atlas_srgb"}, set(), True),
    (other_texture, {"atlas_srgb"}, {"materials"}, True),
    (larger_texture, {"atlas_srgb", "materials"}, set(), True),
    (rough_texture, {"atlas_linear", "materials"}, set(), True),
    (layers, {"materials"}, set(), True),
    (layer_texture, {"atlas_linear", "materials"}, set(), True),
    (sampler, {"materials", "atlas_srgb"}, set(), True),
    (environment, {"environment", "environment_cdf"}, {"lights", "materials"}, True),
    (environment_turns, set(), set(), True),
    (environment_dims, {"lights"}, {"environment", "environment_cdf", "materials"}, True),
]


@pytest.mark.parametrize(
    ("change", "sent", "besides"), [c[:3] for c in CHANGES], ids=lambda c: getattr(c, "__name__", "")
)
def test_only_what_changed_is_sent(change, sent, besides):
    scene, upload = everything(), SceneUpload(open_device(large_buffers=True))

    def versions():
        upload.update(scene)
        return upload.resources.versions()

    first = versions()
    assert versions() == first
    change(scene)
    second = versions()
    changed = {name for name in second if second[name] != first.get(name)}
    assert sent <= changed <= sent | besides
    assert versions() == second


@pytest.mark.parametrize(("change", "exact"), [(c[0], c[3]) for c in CHANGES], ids=lambda c: getattr(c, "__name__", ""))
def test_picture_after_a_change_equals_that_of_a_new_renderer(change, exact):
    scene, changed = everything(), everything()
    renderer = Renderer(scene, size=SIZE, settings=settings())
    before = shown(renderer)
    change(scene), change(changed)
    after, fresh = shown(renderer), picture(changed)
    assert any(not np.array_equal(before[name], after[name]) for name in SHOW)
    if exact:
        for name in SHOW:
            assert np.allclose(after[name], fresh[name], rtol=1e-5, atol=1e-5), name
        return
    # In local space hits differ by rounding, so a pixel on an edge may show the surface behind it.
    for name in ("albedo", "normal", "depth", "position"):
        off = np.abs(after[name] - fresh[name]).reshape(SIZE[0] * SIZE[1], -1).max(1) > 1e-3
        assert off.mean() < 0.02, name
    assert np.isclose(after["radiance"].mean(), fresh["radiance"].mean(), rtol=0.03)


def test_camera_move_sends_nothing():
    scene, changed = everything(), everything()
    renderer = Renderer(scene, size=SIZE, settings=settings())
    before = shown(renderer)
    versions = renderer._gpu.upload.resources.versions()
    camera = Camera.look_at((3, 3, 3), (0, 0, 0), yfov_deg=70)
    renderer.camera = changed.cameras[0] = camera
    after, fresh = shown(renderer), picture(changed)
    assert versions == renderer._gpu.upload.resources.versions()
    assert not np.array_equal(before["depth"], after["depth"])
    for name in SHOW:
        assert np.array_equal(after[name], fresh[name])


def test_changing_back_restores_the_picture():
    """Changing a light, a material and a camera back restores the first frame."""
    scene = everything()
    renderer = Renderer(scene, size=SIZE, settings=settings())
    first, camera = shown(renderer), renderer.camera
    light, ball = scene.lights[0].position, material(scene, "ball").base_color
    light_moves(scene), factor(scene)
    renderer.camera = Camera.look_at((3, 3, 3), (0, 0, 0))
    assert not np.array_equal(shown(renderer)["radiance"], first["radiance"])
    scene.lights[0].position, material(scene, "ball").base_color, renderer.camera = light, ball, camera
    material(scene, "ball").roughness = 0.3
    back = shown(renderer)
    for name in SHOW:
        assert np.array_equal(back[name], first[name])
    block = named(scene, "block")
    here = block.world_from_local
    shown(renderer)
    for x in (1.0, 100.0):
        block.world_from_local = at(x, 0, 0)
        shown(renderer)
    block.world_from_local = here
    assert (np.abs(shown(renderer)["albedo"] - first["albedo"]).max(-1) > 1e-5).mean() < 0.01


def test_another_scene_in_the_same_renderer_equals_that_of_a_new_one():
    renderer = Renderer(everything(), size=SIZE, settings=settings())
    shown(renderer)
    other = everything()
    one_of_two_moves(other), environment(other), light_comes(other)
    renderer.scene = other
    after, fresh = shown(renderer), picture(other)
    for name in SHOW:
        assert np.array_equal(after[name], fresh[name])


# ------------------------------------------------------------------------------------------------ Random numbers


def test_the_seed_determines_the_picture():
    first, second, other = picture(everything()), picture(everything()), picture(everything(), seed=1)
    assert np.array_equal(first["radiance"], second["radiance"])
    assert not np.array_equal(first["radiance"], other["radiance"])
    assert np.isclose(first["radiance"].mean(), other["radiance"].mean(), rtol=0.15)
    assert np.array_equal(first["albedo"], other["albedo"])


def test_samples_per_run_do_not_change_the_picture():
    """The standard error is an estimate from the halves of the samples, which the runs divide."""
    layers = ("radiance", "direct", "indirect", "emission")
    names = (*layers, "standard_error")

    def rendered(samples):
        chosen = Settings(gi="path", spp=64, bounces=2, path=PathSettings(samples_per_run=samples))
        renderer = Renderer(everything(), size=SIZE, settings=chosen)
        renderer.run(show=names)
        return {name: renderer.read_back(name) for name in names}

    whole = rendered(16)
    for samples in (1, 7):
        parts = rendered(samples)
        for name in layers:
            assert np.allclose(parts[name], whole[name], rtol=1e-4, atol=1e-5 * whole["radiance"].max()), name
        ratio = np.linalg.norm(parts["standard_error"]) / np.linalg.norm(whole["standard_error"])
        assert 0.8 < ratio < 1.25


def test_steps_continue_until_all_samples_are_done():
    chosen = Settings(gi="path", spp=5, bounces=1, path=PathSettings(samples_per_run=2))
    renderer = Renderer(everything(), size=SIZE, settings=chosen)
    fractions = []
    assert [renderer.step(fractions.append) for _ in range(4)] == [True, True, True, False]
    assert fractions == sorted(fractions) and fractions[-1] == pytest.approx(1)


# ------------------------------------------------------------------------------------------------ The plan


def status(renderer):
    """Return what each pass did in the last frame, by name, without the summary line."""
    rows = dict(line.split()[:2] for line in renderer.plan().splitlines()[1:])
    assert rows.pop("deform") == "culled"  # nothing is skinned or morphed
    for name in ("composite/display", "path/features", "path/standard_error"):
        assert rows.pop(name) == "culled"  # not requested
    assert rows.pop("bounces/further") == "culled"  # the settings limit them
    for name in ("path/learn_guide", "path/tile_errors", "path/tile_shares"):
        assert rows.pop(name) == "culled"  # path.adaptive is off
    return rows


def test_plan_lists_passes_that_ran_and_were_kept():
    scene = everything()
    renderer = Renderer(scene, size=SIZE, settings=settings())
    renderer.step(show=SHOW)
    assert set(status(renderer).values()) == {"ran"} and status(renderer).keys() >= {"path/trace", "primary"}
    light_moves(scene)
    renderer.step(show=SHOW)
    assert status(renderer) == {"path/trace": "ran", "path/resolve": "ran", "primary": "kept"}
    assert "scene/lights" in renderer.plan()
    renderer.camera = Camera.look_at((1, 1, 5), (0, 1, 0))
    renderer.step(show=SHOW)
    assert set(status(renderer).values()) == {"ran"} and "view" in renderer.plan()
    renderer.camera = Camera.look_at((2, 1, 5), (0, 1, 0))
    renderer.step(show=("albedo",))
    assert status(renderer) == {"path/trace": "culled", "path/resolve": "culled", "primary": "ran"}


# ------------------------------------------------------------------------------------------------ Odd scenes

EMPTY_MESH = Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
CAMERA = Camera.look_at((0, 1, 5), (0, 0, 0))


def rendered(scene, **fields):
    renderer = Renderer(scene, size=SIZE, camera=CAMERA, settings=Settings(gi="path", spp=2, diffuse=True, **fields))
    renderer.run(show=SHOW, check=True)
    return {name: renderer.read_back(name) for name in SHOW}


@pytest.mark.parametrize("instances", [[], [Instance(EMPTY_MESH)]], ids=["nothing", "no triangles"])
def test_scenes_without_geometry_show_only_their_sky(instances):
    got = rendered(Scene(instances))
    assert not any(values.any() for values in got.values())
    got = rendered(Scene(instances, [PointLight((0, 1, 0))], Environment((0.25, 0.5, 1.0))))
    assert (got["radiance"] == (0.25, 0.5, 1.0)).all() and not got["depth"].any()


def test_geometry_can_be_added_and_removed():
    """One renderer with no geometry, then some, then also an empty mesh, then none."""
    scene = Scene(environment=Environment((1.0, 1.0, 1.0)))
    renderer = Renderer(scene, size=SIZE, camera=CAMERA, settings=Settings(gi="path", spp=2, diffuse=True, bounces=0))
    empty = shown(renderer)
    scene.instances = [Instance(quad((-1, -1, 0), (2, 0, 0), (0, 2, 0), Material(base_color=(0.5, 0.5, 0.5, 1.0))))]
    seen = shown(renderer)
    assert (seen["depth"] > 0).mean() > 0.05 and seen["radiance"].min() < 0.6
    scene.instances.append(Instance(EMPTY_MESH))
    assert np.array_equal(shown(renderer)["radiance"], seen["radiance"])
    del scene.instances[:]
    assert np.array_equal(shown(renderer)["radiance"], empty["radiance"])


def test_scene_without_lights_is_black_but_seen():
    got = rendered(Scene([Instance(quad((-1, -1, 0), (2, 0, 0), (0, 2, 0)))]))
    assert not got["radiance"].any() and (got["depth"] > 0).any() and got["albedo"].max() == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: setattr(s.instances[0], "world_from_local", np.diag([1.0, 0, 1, 1])), "instance 'floor'"),
        (lambda s: setattr(s.instances[0], "world_from_local", np.full((4, 4), np.nan)), "instance 'floor'"),
        (lambda s: setattr(s.lights[0], "intensity", -1.0), "light 'point'"),
        (lambda s: setattr(material(s, "ball"), "roughness", np.nan), "material 'ball'"),
        (lambda s: setattr(s.instances[0].mesh, "materials", []), "mesh.materials"),
    ],
)
def test_bad_values_raise_and_the_renderer_recovers(change, message):
    scene = everything()
    with pytest.raises(GiError, match=message):
        change(scene)
        picture(scene)
    renderer = Renderer(everything(), size=SIZE, settings=settings())
    first = shown(renderer)
    renderer.scene = scene
    with pytest.raises(GiError, match=message):
        shown(renderer)
    renderer.scene = everything()
    assert np.array_equal(shown(renderer)["radiance"], first["radiance"])


# ------------------------------------------------------------------------------------------------ Memory


@pytest.mark.parametrize("kind", ["fresh", "frames", "resized", "moved"])
def test_many_renders_do_not_leak_memory(kind):
    """Thirty pictures with new renderers, a moving camera, changing sizes, or a moving instance."""
    scene, chosen = everything(), settings(camera=CameraSettings(jitter=False))
    renderer = Renderer(scene, size=SIZE, settings=chosen)

    def render(k):
        nonlocal renderer
        if kind == "fresh":
            renderer = Renderer(everything(), size=SIZE, settings=chosen)
        elif kind == "frames":
            renderer.camera = Camera.look_at((0, 1.5, 6 + 0.01 * k), (0, 1, 0))
        elif kind == "resized":
            renderer.size = (SIZE[0] + k % 2, SIZE[1])
        else:
            named(scene, "block").world_from_local = at(0, 0.01 * k, 0)
        renderer.run(show=("radiance", "depth"))
        renderer.read_back()

    for k in range(10):
        render(k)
    before = resident()
    for k in range(30):
        render(10 + k)
    # Leaking one small texture, buffer or command per picture would take 3 MiB or more.
    assert resident() - before < 3
