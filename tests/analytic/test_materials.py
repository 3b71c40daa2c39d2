"""What materials do to light: masks, unlit, normal maps, vertex colours, texture transforms, the coat."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.gltf_brdf import gltf_brdf
from helpers.pictures import assert_mean, looking, shoot

from wgpu_gi.pictures.color import linear_from_srgb
from wgpu_gi.scene.built_in.scenes import matte, plates, plates_form_factor
from wgpu_gi.scene.built_in.shapes import grid, sphere
from wgpu_gi.scene.scene import DirectionalLight, Environment, Image, Instance, Material, Mesh, Scene, Texture

SUN = DirectionalLight((0.0, -1.0, 0.0), math.pi)  # E = pi, so a matte floor shows its albedo
BUFFERS = ("radiance", "albedo", "normal", "depth", "emission", "direct", "indirect")


def floor(material, cells=1, height=0.0, size=2.0):
    """A square floor about the origin, its texture as seen from above with -Z on top."""
    mesh = grid(size, cells, material, (0.0, height, 0.0))
    mesh.texcoords0 = (mesh.positions[:, [0, 2]] / size + 0.5).astype(np.float32)
    return mesh


def from_above(height=5.0, width=2.0):
    camera = looking((0, -1, 0), (0, height, 0), width)
    assert np.allclose(camera.world_from_view[:3, 1], (0, 0, -1))
    return camera


def pixel_points(n, width=2.0):
    """x and z of the pixel centres of `from_above`, (n, n) each."""
    steps = (np.arange(n) + 0.5) / n * width - width / 2
    return np.meshgrid(steps, steps)


def picture_of(values):
    return Image(np.asarray(values, np.uint8))


def random_alpha(n=4, seed=0):
    """Opaque white where `holes` is False; (n, n, 4) and (n, n)."""
    alpha = np.where(np.random.default_rng(seed).random((n, n)) < 0.5, 100, 200).astype(np.uint8)
    return np.concatenate([np.full((n, n, 3), 255, np.uint8), alpha[..., None]], -1), alpha < 128


def masked(cutoff=0.5):
    pixels, holes = random_alpha()
    texture = Texture(picture_of(pixels), filter="nearest")
    return Material("mask", base_color_texture=texture, alpha_mode="mask", alpha_cutoff=cutoff), holes


def test_mask_casts_its_shadow():
    """The sun shines through the holes of a sheet and nowhere else; the camera is below the sheet."""
    material, holes = masked()
    scene = Scene([Instance(floor(matte(0.5))), Instance(floor(material, height=1.0))], [SUN])
    got = shoot(scene, (16, 16), camera=from_above(0.5), spp=1, show=BUFFERS)
    expected = np.repeat(np.repeat(np.where(holes, 0.5, 0.0), 4, 0), 4, 1)
    assert np.allclose(got["direct"], expected[..., None], rtol=1e-5)


def test_camera_sees_through_the_holes_of_a_mask():
    material, holes = masked()
    scene = Scene([Instance(floor(matte(0.5))), Instance(floor(material, height=1.0))], [SUN])
    got = shoot(scene, (16, 16), camera=from_above(), spp=1, show=BUFFERS)
    through = np.repeat(np.repeat(holes, 4, 0), 4, 1)
    assert np.allclose(got["depth"], np.where(through, 5.0, 4.0), rtol=1e-5)
    assert np.allclose(got["direct"][~through], 1.0, rtol=1e-5)


def test_cutoff_above_all_alphas_removes_the_surface_and_below_keeps_it():
    for cutoff, lit in ((0.9, 0.5), (0.2, 0.0)):
        material, _ = masked(cutoff)
        scene = Scene([Instance(floor(matte(0.5))), Instance(floor(material, height=1.0))], [SUN])
        got = shoot(scene, (8, 8), camera=from_above(0.5), spp=1, show=("direct",))["direct"]
        assert np.allclose(got, lit, rtol=1e-5)


def test_alpha_is_ignored_where_the_material_is_opaque():
    material, _ = masked()
    material.alpha_mode = "opaque"
    scene = Scene([Instance(floor(matte(0.5))), Instance(floor(material, height=1.0))], [SUN])
    assert not shoot(scene, (8, 8), camera=from_above(0.5), spp=1)["radiance"].any()


def test_mask_works_in_instances_of_a_shared_mesh():
    """The same sheet twice, once mirrored: the sun reaches the floor only through holes of both."""
    material, holes = masked()
    sheet = floor(material)
    lower, upper = np.eye(4), np.eye(4)
    lower[1, 3], upper[1, 3] = 1.0, 2.0
    upper[0, 0] = -1.0  # mirrored
    scene = Scene([Instance(floor(matte(0.5))), Instance(sheet, lower), Instance(sheet, upper)], [SUN])
    got = shoot(scene, (16, 16), camera=from_above(0.5), spp=1, show=("direct",))["direct"]
    both = holes & holes[:, ::-1]
    assert np.allclose(got, np.repeat(np.repeat(np.where(both, 0.5, 0.0), 4, 0), 4, 1)[..., None], rtol=1e-5)


def test_unlit_shows_its_colour_and_neither_shines_nor_reflects():
    unlit = Material("sign", (0.2, 0.4, 0.6, 1.0), emission=(3.0, 3.0, 3.0), unlit=True)
    sign, ground = floor(unlit, height=0.5, size=1.0), floor(matte(0.5))
    dark = shoot(Scene([Instance(sign), Instance(ground)]), (8, 8), camera=from_above(), spp=16, show=BUFFERS)
    lit = shoot(Scene([Instance(sign), Instance(ground)], [SUN]), (8, 8), camera=from_above(), spp=16, show=BUFFERS)
    is_sign = dark["depth"] < 4.9
    for got in (dark, lit):
        assert np.allclose(got["radiance"][is_sign], (0.2, 0.4, 0.6), rtol=1e-6)
        assert np.allclose(got["emission"][is_sign], got["radiance"][is_sign])
        assert not got["direct"][is_sign].any() and not got["indirect"].any()
    assert not dark["radiance"][~is_sign].any()
    assert np.allclose(lit["radiance"][~is_sign], 0.5, rtol=1e-5)


def test_unlit_casts_shadows():
    sign = floor(Material(unlit=True), height=1.0, size=1.0)
    scene = Scene([Instance(sign), Instance(floor(matte(0.5)))], [SUN])
    got = shoot(scene, (8, 8), camera=from_above(0.5), spp=1)["radiance"]
    x, z = pixel_points(8)
    shadow = (np.abs(x) < 0.5) & (np.abs(z) < 0.5)
    assert not got[shadow].any() and np.allclose(got[~shadow], 0.5, rtol=1e-5)


TILTS = [(0.6, 0.0, 0.8), (0.0, 0.6, 0.8), (-0.3, -0.4, 0.866)]


def normal_mapped(tilt, flip_u=False, flip_v=False, tangents=False, scale=1.0):
    """A floor with a constant normal map of a tangent-space vector."""
    rgb = np.round((np.array(tilt) * 0.5 + 0.5) * 255)
    image = picture_of(np.broadcast_to([*rgb, 255], (2, 2, 4)))
    mesh = floor(Material(normal_texture=Texture(image), normal_scale=scale, roughness=1.0))
    if flip_u:
        mesh.texcoords0[:, 0] = 1 - mesh.texcoords0[:, 0]
    if flip_v:
        mesh.texcoords0[:, 1] = 1 - mesh.texcoords0[:, 1]
    if tangents:
        # Along u; w = +1 where cross(normal, tangent) is up in the picture.
        side = -1.0 if flip_u != flip_v else 1.0
        mesh.tangents = np.array([[-1.0 if flip_u else 1.0, 0, 0, side]] * 4, np.float32)
    v = rgb / 255 * 2 - 1
    v[:2] *= scale
    right, up = -1 if flip_u else 1, -1 if flip_v else 1
    normal = np.array([right * v[0], v[2], -up * v[1]])
    return mesh, normal / np.linalg.norm(normal)


@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("flips", [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize("tangents", [False, True])
def test_normal_map_tilts_the_normal(tilt, flips, tangents):
    """+X is right and +Y up in the picture (glTF 2.0, section 3.9.3), as the texture coordinates orient it."""
    mesh, normal = normal_mapped(tilt, *flips, tangents=tangents)
    got = shoot(Scene([Instance(mesh)], [SUN]), (4, 4), camera=from_above(), spp=1, diffuse=False, show=BUFFERS)
    assert np.allclose(got["normal"], normal, atol=1e-3)
    up = np.array([0.0, 1.0, 0.0])
    expected = math.pi * normal[1] * gltf_brdf(np.ones(3), 0.0, 1.0, normal, up, up)
    assert np.allclose(got["direct"], expected, rtol=2e-3)


@pytest.mark.parametrize("tangents", [False, True])
@pytest.mark.parametrize("shared", [False, True])
def test_normal_map_follows_a_mirrored_and_rotated_instance(tangents, shared):
    """Tangent space turns with the instance, whether the mesh is shared or in the world-space hierarchy."""
    mesh, normal = normal_mapped((0.3, 0.5, 0.8), tangents=tangents)
    turn = np.array([[0.0, 0, -2, 0], [0, 1, 0, 0], [-2, 0, 0, 0], [0, 0, 0, 1]])  # swaps x and z: a mirror image
    expected = turn[:3, :3] @ normal * [0.5, 1, 0.5]
    instances = [Instance(mesh, turn)] + [Instance(mesh, np.diag([1e-3, 1, 1e-3, 1]))] * shared
    got = shoot(Scene(instances, [SUN]), (4, 4), camera=from_above(), spp=1, diffuse=False, show=BUFFERS)
    assert np.allclose(got["normal"][0, 0], expected, atol=1e-3)


TRANSFORMS = {
    "turned": dict(rotation=0.7, offset=(0.3, 0.1)),
    "turned by a right angle": dict(rotation=math.pi / 2),
    "turned by half": dict(rotation=math.pi, offset=(1.0, 1.0)),
    "mirrored in u": dict(scale=(-2.0, 2.0)),
    "mirrored in v, turned": dict(scale=(3.0, -3.0), rotation=-1.9),
    "scaled unevenly": dict(scale=(0.5, -3.0), rotation=2.4),
}


@pytest.mark.parametrize("name", TRANSFORMS)
@pytest.mark.parametrize("tangents", [False, True])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("second", [False, True])
def test_normal_map_turns_with_its_texture(name, tangents, mirrored, second):
    """Its +X points along the u of the transformed picture, its +Y away from v, in a mirrored instance, too."""
    mesh, _ = normal_mapped((0.3, 0.5, 0.8), tangents=tangents)
    texture = mesh.materials[0].normal_texture
    for field, value in TRANSFORMS[name].items():
        setattr(texture, field, value)
    if second:
        texture.texcoord = 1
        mesh.texcoords1, mesh.texcoords0 = mesh.texcoords0, np.zeros_like(mesh.texcoords0)
    # u of the mesh is +X, v is +Z. Invert uv' = R S uv.
    c, s = math.cos(texture.rotation), math.sin(texture.rotation)
    along_u, along_v = np.linalg.inv(np.array([[c, s], [-s, c]]) @ np.diag(texture.scale)).T
    right = along_u / np.linalg.norm(along_u)
    up = np.array([right[1], -right[0]])
    up *= -np.sign(up @ along_v)
    x, y, z = texture.image.pixels[0, 0, :3] / 255 * 2 - 1
    flat = right * x + up * y
    normal = np.array([-flat[0] if mirrored else flat[0], z, flat[1]]) / np.linalg.norm([x, y, z])
    instance = Instance(mesh, np.diag([-1.0 if mirrored else 1.0, 1, 1, 1]))
    got = shoot(Scene([instance], [SUN]), (4, 4), camera=from_above(), spp=1, diffuse=False, show=("normal",))
    assert np.allclose(got["normal"], normal, atol=1e-3)


def test_normal_scale_multiplies_x_and_y():
    mesh, normal = normal_mapped((0.6, 0.2, 0.77), scale=0.5)
    got = shoot(Scene([Instance(mesh)], [SUN]), (2, 2), camera=from_above(), spp=1, diffuse=False, show=("normal",))
    assert np.allclose(got["normal"], normal, atol=1e-3)


def test_vertex_colours_are_interpolated_and_multiply():
    mesh = floor(matte((1.0, 0.5, 0.5)))
    colors = np.array([[0, 0, 1, 1], [1, 0, 1, 1], [0, 1, 0, 1], [1, 1, 0, 1]], np.float32)
    mesh.colors = colors[(mesh.positions[:, 0] > 0).astype(int) + 2 * (mesh.positions[:, 2] > 0)]
    got = shoot(Scene([Instance(mesh)], [SUN]), (8, 8), camera=from_above(), spp=1, show=BUFFERS)
    x, z = (p / 2 + 0.5 for p in pixel_points(8))
    expected = np.stack([x, z, 1 - z], -1) * [1.0, 0.5, 0.5]
    assert np.allclose(got["albedo"], expected, atol=2e-5)
    assert np.allclose(got["radiance"], expected, atol=2e-5)


@pytest.mark.parametrize(
    ("offset", "scale", "rotation"),
    [((0.0, 0.0), (1.0, 1.0), 0.0), ((0.25, -0.5), (2.0, 3.0), 0.0), ((0.1, 0.2), (1.5, 0.5), 0.7)],
)
def test_texture_transform_follows_its_specification(offset, scale, rotation):
    """KHR_texture_transform: uv' = T R S uv, rotation counter-clockwise with v down."""
    pixels = np.random.default_rng(0).integers(0, 256, (8, 8, 4)).astype(np.uint8)
    pixels[..., 3] = 255
    texture = Texture(picture_of(pixels), filter="nearest", offset=offset, scale=scale, rotation=rotation)
    mesh = floor(Material(base_color_texture=texture))
    got = shoot(Scene([Instance(mesh)], [SUN]), (32, 32), camera=from_above(), spp=1, show=BUFFERS)
    u, v = (p / 2 + 0.5 for p in pixel_points(32))
    s, c = math.sin(rotation), math.cos(rotation)
    # The matrices of the extension's specification, column-major there.
    m = (
        np.array([[1, 0, offset[0]], [0, 1, offset[1]], [0, 0, 1]])
        @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        @ np.diag([*scale, 1])
    )
    uv = np.stack([u, v, np.ones_like(u)], -1) @ m.T
    cell = np.floor(uv[..., :2] * 8)
    expected = linear_from_srgb(pixels[..., :3] / 255)[cell[..., 1].astype(int) % 8, cell[..., 0].astype(int) % 8]
    inside = (np.abs(uv[..., :2] * 8 - np.round(uv[..., :2] * 8)) > 1e-3).all(-1)
    assert inside.mean() > 0.5
    assert np.allclose(got["albedo"][inside], expected[inside], atol=2e-3)
    assert np.allclose(got["radiance"], got["albedo"], atol=1e-5)


@pytest.mark.parametrize("metallic", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("roughness", [0.3, 1.0])
def test_sunlight_is_reflected_by_the_gltf_brdf(metallic, roughness):
    """L = f_r lux cos for one direction of light and view, with textures that halve metallic and roughness."""
    texel = [0, 128, 128, 255]
    texture = Texture(picture_of(np.broadcast_to(texel, (1, 1, 4))))
    base = (0.9, 0.5, 0.1)
    material = Material("m", (*base, 1.0), metallic, roughness, metallic_roughness_texture=texture)
    w_i, w_o = np.array([-0.48, 0.8, 0.36]), np.array([0.6, 0.8, 0.0])
    scene = Scene([Instance(floor(material))], [DirectionalLight((-w_i).tolist(), 2.0)])
    got = shoot(scene, (3, 3), camera=looking(-w_o, 3 * w_o, 0.1), spp=1, diffuse=False)["radiance"]
    half = 128 / 255
    f = gltf_brdf(np.array(base), metallic * half, (roughness * half) ** 2, np.array([0, 1.0, 0]), w_o, w_i)
    assert np.allclose(got, 2.0 * 0.8 * f, rtol=4e-3)  # the fits of the coat's albedo


def test_diffuse_ignores_coats_and_normal_maps():
    mesh, _ = normal_mapped(TILTS[0])
    mesh.materials[0].base_color, mesh.materials[0].metallic = (0.5, 0.25, 1.0, 1.0), 1.0
    got = shoot(Scene([Instance(mesh)], [SUN]), (4, 4), camera=from_above(), spp=1)["radiance"]
    assert np.allclose(got, (0.5, 0.25, 1.0), rtol=1e-5)


def test_smooth_normals_are_interpolated_and_zero_normals_are_flat():
    """A sphere with the normals of a sphere, against the formula; a zero normal makes its triangles flat."""
    ball = sphere(subdivisions=2, material=matte(1.0))
    ball.normals = ball.positions / np.linalg.norm(ball.positions, axis=1, keepdims=True).astype(np.float32)
    got = shoot(Scene([Instance(ball)], [SUN]), (16, 16), camera=from_above(), spp=1, show=(*BUFFERS, "position"))
    seen = (got["depth"] > 0) & (got["position"][..., 1] > 0.3)
    exact = got["position"][seen] / np.linalg.norm(got["position"][seen], axis=1, keepdims=True)
    assert np.abs(got["normal"][seen] - exact).max() < 0.02  # Phong interpolation over an eighth of the circle
    assert np.allclose(got["radiance"][seen][:, 0], got["normal"][seen][:, 1], rtol=1e-4)
    ball.normals = np.zeros_like(ball.normals)
    flat = Mesh(ball.positions, ball.triangles, ball.materials, normals=ball.normals)
    got = shoot(Scene([Instance(flat)], [SUN]), (16, 16), camera=from_above(), spp=1, show=BUFFERS)
    assert len(np.unique(got["normal"][got["depth"] > 0].round(4), axis=0)) <= len(flat.triangles)


def test_normals_of_a_scaled_instance_use_the_inverse_transpose():
    """A sphere scaled to an ellipsoid."""
    ball = sphere(subdivisions=4, material=matte(1.0))
    ball.normals = ball.positions / np.linalg.norm(ball.positions, axis=1, keepdims=True).astype(np.float32)
    for scale in ((0.9, 0.3, 0.6), (-0.9, 0.3, 0.6)):
        scene = Scene([Instance(ball, np.diag([*scale, 1.0]))], [SUN])
        got = shoot(scene, (16, 16), camera=from_above(), spp=1, show=(*BUFFERS, "position"))
        seen = (got["depth"] > 0) & (got["position"][..., 1] > 0.1)
        exact = got["position"][seen] / np.square(scale)
        exact /= np.linalg.norm(exact, axis=1, keepdims=True)
        assert np.abs(got["normal"][seen] - exact).max() < 0.01


def test_both_sides_reflect():
    """A floor seen and lit from below shows its albedo, single-sided or not."""
    below = looking((0, 1, 0), (0, -5, 0), 2.0)
    for double_sided in (False, True):
        scene = Scene([Instance(floor(matte(0.5, double_sided=double_sided)))], [DirectionalLight((0, 1, 0), math.pi)])
        assert np.allclose(shoot(scene, (2, 2), camera=below, spp=1)["radiance"], 0.5, rtol=1e-5)


def test_emission_texture_multiplies_the_factor():
    """Le is texture times factor; other surfaces get the light of its mean."""
    pixels = np.full((1, 2, 4), 255, np.uint8)
    pixels[0, 1, :3] = 0
    lamp = matte(0.0, "lamp", double_sided=False)
    lamp.emission = (4.0, 2.0, 1.0)
    lamp.emission_texture = Texture(picture_of(pixels), filter="nearest", wrap_u="clamp")
    seen = shoot(Scene([Instance(floor(lamp))]), (4, 4), camera=from_above(), spp=1, show=("emission",))["emission"]
    assert np.allclose(seen[:, :2], (4.0, 2.0, 1.0), rtol=1e-5) and not seen[:, 2:].any()
    # Half of a lamp above a plate gives it half of the light in the mean, by symmetry.
    scene = plates()
    scene.instances[1].mesh.materials = [lamp]
    scene.instances[1].mesh.texcoords0 = scene.instances[1].mesh.positions[:, [0, 2]] + np.float32(0.5)
    got = shoot(scene, jitter=True, spp=2048)
    assert_mean(got, 0.5 * np.array([4.0, 2.0, 1.0]) / 2 * plates_form_factor())


def white_ball():
    """A sphere seen along -Z: roughness by the angle about its middle, metalness from cell to cell of a fine grid."""
    x, y = np.meshgrid(np.arange(64) - 31.5, np.arange(64) - 31.5)
    roughness = (np.arctan2(y, x) / (2 * np.pi) % 1) ** 2
    metallic = np.random.default_rng(0).choice([0.0, 0.3, 1.0], (64, 64))
    pixels = np.stack([0 * x, roughness * 255, metallic * 255, 255 + 0 * x], -1).round()
    ball = sphere(subdivisions=4)
    ball.texcoords0 = (ball.positions[:, :2] / 2 + 0.5).astype(np.float32)
    texture = Texture(picture_of(pixels), filter="nearest", wrap_u="clamp", wrap_v="clamp")
    ball.materials = [Material("white", metallic=1.0, roughness=1.0, metallic_roughness_texture=texture)]
    return Scene([Instance(ball)], environment=Environment())


@pytest.mark.parametrize("gi", ["none", "many-light", "ssil"])
def test_white_ball_in_a_white_sky_is_white(gi):
    """1.000 +- 0.5 % at every roughness, metalness and angle: at every pixel."""
    got = shoot_ball(gi, diffuse=False)
    assert np.abs(got[got > 0] - 1).max() < 0.005


def test_ssdo_shows_a_white_ball_as_it_shows_a_matte_one():
    """SSDO takes some neighbouring pixels of a ball for occluders, whatever its material."""
    matte, coated = shoot_ball("ssdo", diffuse=True), shoot_ball("ssdo", diffuse=False)
    assert np.abs(coated - matte).max() < 0.005


def shoot_ball(gi, diffuse):
    camera, show = looking((0, 0, -1), (0, 0, 4), 2.0), ("radiance", "depth")
    got = shoot(white_ball(), (48, 48), camera=camera, gi=gi, diffuse=diffuse, show=show)
    return np.where(got["depth"] > 0, got["radiance"][..., 0], 0.0)


def test_path_tracer_keeps_a_white_ball_white():
    """The mean over parts of the picture, which differ in roughness, is 1 within 0.5 %."""
    got = shoot(white_ball(), (32, 32), spp=1024, camera=looking((0, 0, -1), (0, 0, 4), 1.9), diffuse=False)
    for rows in (slice(0, 16), slice(16, 32)):
        for columns in (slice(0, 16), slice(16, 32)):
            assert_mean({k: v[rows, columns] for k, v in got.items()}, 1.0)
