"""Generated scenes: pure functions of kind and seed, valid, and with what the description of their kind says."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from helpers.scene_strategies import FIXED, digest, scenes
from hypothesis import given

from wgpu_gi.errors import GiError
from wgpu_gi.measure.scenes import KINDS, make_scene
from wgpu_gi.measure.scenes.degenerate import CAMERAS, FLAWS
from wgpu_gi.measure.scenes.layers import LAYERED, SOLID, THIN
from wgpu_gi.measure.scenes.moving import LEAST_SECONDS, MOST_SECONDS
from wgpu_gi.measure.scenes.surfaces import SURFACES
from wgpu_gi.pictures.color import linear_from_srgb
from wgpu_gi.scene.check import check_camera, check_scene
from wgpu_gi.scene.deformation import is_deformed
from wgpu_gi.scene.load import has_light
from wgpu_gi.scene.mesh_cleaning import has_area
from wgpu_gi.scene.scene import DirectionalLight, PointLight, Scene, SpotLight

# The seed 0 of each kind. Another digest means that numpy's streams, or the platform's sines, changed all results.
DIGESTS = {
    "room": "f4302f22e1e33252",
    "street": "1bda102b6aacf959",
    "foliage": "9c937c9d52259a83",
    "glossy": "b3d189ae7f5a58ec",
    "textured": "58ef8dd5223920e7",
    "many": "a8b9dfd77e0321cd",
    "tiny": "903e8c8e0ebce05a",
    "huge": "12b19790b3caba5a",
    "far": "1f9f0f5d47790609",
    "degenerate": "25598e09eac485c2",
    "extreme": "47d4a5f308247826",
    "moving": "6bb0c513ed310f1d",
    "layered": "a8b5e959d3f48749",
    "glass": "39ca37bde2fbd163",
}


@cache
def first(kind: str, count: int = 20) -> list[Scene]:
    return [make_scene(kind, seed) for seed in range(count)]


def extent(scene: Scene) -> float:
    low, high = scene.bounds()
    return float((high - low).max())


@given(scenes())
@FIXED
def test_scenes_are_valid_and_finite(scene):
    check_scene(scene)
    assert len(scene.cameras) == 1
    check_camera(scene.cameras[0])
    assert has_light(scene)
    for mesh in scene.meshes:
        for values in (mesh.positions, mesh.normals, mesh.tangents, mesh.texcoords0, mesh.texcoords1, mesh.colors):
            assert values is None or (len(values) == len(mesh.positions) and np.isfinite(values).all())
        assert mesh.triangles.max() < len(mesh.positions)
    if scene.environment is not None and scene.environment.image is not None:
        assert np.isfinite(scene.environment.image).all() and scene.environment.image.min() >= 0


@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_gives_the_same_scene_everywhere(kind):
    assert digest(make_scene(kind, 3)) == digest(make_scene(kind, 3)) != digest(make_scene(kind, 4))
    assert digest(make_scene(kind, 0)) == DIGESTS[kind]
    assert make_scene(kind, 0).name == f"{kind}-0"


def test_unknown_kinds_and_negative_seeds_are_errors():
    with pytest.raises(GiError, match="no kind of scene 'rooms'; did you mean room"):
        make_scene("rooms", 0)
    with pytest.raises(GiError, match="at least 0, not -1"):
        make_scene("room", -1)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "extreme"])
def test_albedo_is_at_most_095(kind):
    for scene in first(kind):
        for material in scene.materials:
            texture = material.base_color_texture
            texels = 1.0 if texture is None else linear_from_srgb(texture.image.pixels[..., :3] / 255.0)
            assert (np.array(material.base_color[:3]) * texels).max() <= 0.950001


def test_rooms_have_all_materials_and_lights():
    rooms = first("room")
    assert {m.name for scene in rooms for m in scene.materials} >= set(SURFACES)
    assert {type(light) for scene in rooms for light in scene.lights} == {PointLight, SpotLight, DirectionalLight}
    emitters = {i.name for scene in rooms for i in scene.instances if max(i.mesh.materials[0].emission) > 0}
    assert emitters >= {"panel", "bulb", "tiny", "ring", "screen", "double-sided"}
    assert any(scene.environment is None for scene in rooms) and any(scene.environment for scene in rooms)


def test_streets_have_sun_sky_and_thin_walls():
    streets = first("street")
    assert all(scene.environment is not None for scene in streets)
    assert sum(any(isinstance(light, DirectionalLight) for light in scene.lights) for scene in streets) > 10
    assert all({"thin wall", "screen"} & {i.name for i in scene.instances} for scene in streets)


def test_foliage_has_alpha_masks_and_thin_strips():
    for scene in first("foliage"):
        assert any(m.alpha_mode == "mask" and m.base_color_texture is not None for m in scene.materials)
        assert any(i.name == "grass" and len(i.mesh.triangles) >= 100 for i in scene.instances)


def test_glossy_has_the_whole_range_of_roughness():
    materials = [m for scene in first("glossy") for m in scene.materials]
    assert min(m.roughness for m in materials) < 0.02 and max(m.roughness for m in materials) == 1.0
    assert any(m.metallic == 1.0 for m in materials) and any(m.normal_texture is not None for m in materials)


def test_textured_has_colors_emission_and_vertex_colors():
    textured = first("textured")
    materials = [m for scene in textured for m in scene.materials]
    dark = [
        np.mean(m.emission_texture.image.pixels[..., :3].max(-1) == 0)
        for m in materials
        if m.emission_texture is not None
    ]
    assert max(dark) > 0.9
    assert any(mesh.colors is not None for scene in textured for mesh in scene.meshes)
    assert any(mesh.texcoords1 is not None for scene in textured for mesh in scene.meshes)
    assert any(m.base_color_texture is not None and m.base_color_texture.rotation != 0 for m in materials)


def test_layered_has_every_layer_and_their_textures():
    materials = [m for scene in first("layered") for m in scene.materials]
    assert {m.name for m in materials} >= set(LAYERED)
    for field in ("clearcoat", "sheen_roughness", "anisotropy"):
        assert max(getattr(m, field) for m in materials) > 0.9
    assert any(m.ior > 2 for m in materials) and any(m.specular == 0 for m in materials)
    for name in ("specular", "specular_color", "clearcoat", "clearcoat_normal", "sheen_color", "anisotropy"):
        assert any(getattr(m, f"{name}_texture") is not None for m in materials), name


def test_glass_has_panes_sheets_stacks_and_closed_solids():
    scenes = first("glass")
    assert {m.name for scene in scenes for m in scene.materials} >= set(THIN) | set(SOLID)
    stacks = [sum(i.name.startswith("stacked") for i in scene.instances) for scene in scenes]
    assert max(stacks) == 5 and sorted(set(stacks))[:2] == [0, 2]
    for scene in scenes:
        for mesh in scene.meshes:
            is_open = mesh.name in ("plane", "curtain", "stacked")
            assert not is_open or mesh.materials[0].thickness == 0


def test_many_has_hundreds_of_lights_and_instances():
    for scene in first("many"):
        assert len(scene.lights) >= 100 and len(scene.instances) >= 200 and len(scene.meshes) < 30


@pytest.mark.parametrize("kind, low, high", [("tiny", 1e-6, 100), ("huge", 30, 2e8)])
def test_tiny_and_huge_span_many_sizes(kind, low, high):
    sizes = [extent(scene) for scene in first(kind)]
    assert low < min(sizes) and max(sizes) < high and max(sizes) / min(sizes) > 1e3


def test_far_reaches_ten_thousand_kilometres():
    distances = [float(np.abs(scene.cameras[0].position).max()) for scene in first("far")]
    assert min(distances) > 500 and 2e6 < max(distances) < 2e7


def test_degenerate_has_all_flaws_and_cameras():
    flawed = first("degenerate", 40)
    names = {i.name for scene in flawed for i in scene.instances}
    assert names >= set(FLAWS) - {"light in surface"} | {"emitter in the ceiling"}
    assert any(light.name.startswith("in ") for scene in flawed for light in scene.lights)
    assert {scene.cameras[0].name for scene in flawed} == set(CAMERAS)
    angles = [np.degrees(scene.cameras[0].yfov) for scene in flawed]
    assert min(angles) < 5 and max(angles) > 120
    assert any((~has_area(mesh.positions, mesh.triangles)).any() for scene in flawed for mesh in scene.meshes)
    assert any(np.linalg.det(i.world_from_local[:3, :3]) < 0 for scene in flawed for i in scene.instances)


def test_moving_has_skins_morph_targets_and_everything_else_that_moves():
    scenes = first("moving", 40)
    skins = [mesh.skin for scene in scenes for mesh in scene.meshes if mesh.skin is not None]
    assert {skin.joints.shape[1] for skin in skins} >= {1, 2, 4, 8}
    assert {skin.joints.dtype.name for skin in skins} == {"uint16", "uint32"}
    for skin in skins:
        np.testing.assert_allclose(skin.weights.sum(1), 1.0, atol=1e-6)
    targets = [target for scene in scenes for mesh in scene.meshes for target in mesh.morph_targets]
    assert any(target.normals is not None for target in targets) and any(target.normals is None for target in targets)
    assert any(mesh.skin is not None and mesh.morph_targets for scene in scenes for mesh in scene.meshes)
    channels = [channel for scene in scenes for channel in scene.animations[0].channels]
    paths = {"translation", "rotation", "scale", "morph_weights", "position", "direction", "intensity", "base_color"}
    assert {channel.path for channel in channels} >= paths | {"emission"}
    assert {channel.track.interpolation for channel in channels} == {"step", "linear", "cubic"}
    # Each scene deforms something, and stands at a time of its animation.
    for scene in scenes:
        assert any(is_deformed(instance) for instance in scene.instances)
        assert LEAST_SECONDS / 10 < scene.animations[0].duration < 2 * MOST_SECONDS


@pytest.mark.parametrize("seed", range(4))
def test_moving_scenes_move(seed):
    scene = make_scene("moving", seed)
    start, end = (scene.at(time) for time in (0.0, scene.animations[0].duration))
    assert digest([start.instances, start.lights]) != digest([end.instances, end.lights])


def test_extreme_spans_24_orders_of_brightness():
    extremes = first("extreme")
    intensities = [light.intensity for scene in extremes for light in scene.lights]
    intensities += [max(m.emission) for scene in extremes for m in scene.materials if max(m.emission) > 0]
    assert 1e-12 <= min(intensities) < 1e-9 and 1e9 < max(intensities) <= 1.001e12
    albedos = {value for scene in extremes for m in scene.materials for value in m.base_color[:3]}
    assert {0.0, 1.0} <= albedos
    assert any(s.environment and s.environment.image is not None and s.environment.image.max() == 1e6 for s in extremes)
