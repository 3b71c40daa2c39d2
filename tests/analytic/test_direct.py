"""Deferred direct light: closed forms, agreement with rays by pixel, no acne, no gaps at contacts, no leaks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.medley import medley, smooth
from helpers.pictures import shoot

from wgpu_gi.camera import Camera
from wgpu_gi.gpu.wgsl.load import load
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, grid, quad, sphere
from wgpu_gi.scene.scene import DirectionalLight, Instance, Material, PointLight, Scene, SpotLight
from wgpu_gi.techniques.deferred.direct import DirectSettings
from wgpu_gi.techniques.deferred.shadow_views import ShadowSettings
from wgpu_gi.techniques.deferred.update import DeferredState

DIRECT_LIGHT = load("deferred/shadow/views.wgsl").struct_dtype("DirectLight")
ALBEDO = (700 / 1023) ** 2  # exact in the G-buffer, which stores square roots in 10 bits
EXACT = 1e-5  # relative: float32 rounding of a few operations
# The G-buffer stores square roots of colours in 10 bits and coordinates of normals in 16 bits. On the medley 0.06 % of
# the pixels are off by more than 0.3 %, 0.01 % by more than 0.5 %: along edges, which rays and rasterisation place
# differently.
PACKED = 5e-3
EDGES = 6e-4
SIZE = (160, 90)


def rendered(scene, size=SIZE, show="direct", **settings):
    return shoot(scene, size, show=(show,), gi="none", **settings)[show]


def traced(scene, size=SIZE, spp=1, **settings):
    """Return the path tracer's direct light, exact for one punctual light: every sample is the same."""
    return shoot(scene, size, show=("direct",), gi="path", bounces=0, spp=spp, **settings)["direct"]


def differing(a, b, bound=PACKED):
    """Return the share of pixels that differ by more than `bound` times the sum of their value and 2 % of the mean."""
    return (np.abs(a - b).max(-1) > bound * (b.max(-1) + 0.02 * b.mean())).mean()


# ------------------------------------------------------------------------------------------------ Closed forms


def floor_points(size, height=4.0):
    """World points of the pixel centres of `plane_point`'s camera, (h, w, 3)."""
    x = (np.arange(size[0]) + 0.5) / size[0] * height * size[0] / size[1]
    z = (np.arange(size[1]) + 0.5) / size[1] * height
    x, z = np.meshgrid(x - height * size[0] / size[1] / 2, z - height / 2)
    return np.stack([x, np.zeros_like(x), z], -1)


@pytest.mark.parametrize("edges", [True, False])
def test_plane_under_punctual_lights_has_its_closed_form(edges):
    """E = I cos/d2 of a point at d, 2d and 4d, E = lux cos of a sun, the spot's fall-off of glTF; L = rho E/pi."""
    size, settings = (33, 17), {"direct": DirectSettings(edges=edges)}
    points = floor_points(size)
    for distance in (1.0, 2.0, 4.0):
        squared = distance**2 + (points**2).sum(-1)
        expected = ALBEDO / math.pi * 10.0 * distance / squared**1.5
        got = rendered(builtin.plane_point(distance, 10.0, ALBEDO), size, **settings)
        assert np.allclose(got, expected[..., None], rtol=EXACT)
    for zenith in (0.0, 60.0, 89.0):
        expected = ALBEDO * 3.0 * math.cos(math.radians(zenith)) / math.pi
        assert np.allclose(rendered(builtin.plane_sun(3.0, zenith, ALBEDO), size, **settings), expected, rtol=2e-5)
    scene = builtin.plane_point(albedo=ALBEDO)
    inner, outer, position = math.radians(15), math.radians(40), np.array([0.0, 2.0, 0.0])
    scene.lights = [SpotLight(position.tolist(), (0.6, -2.0, -0.3), inner, outer, 10.0)]
    travel = points - position
    distance = np.linalg.norm(travel, axis=-1)
    cosine = travel @ (np.array((0.6, -2.0, -0.3)) / np.linalg.norm((0.6, -2.0, -0.3))) / distance
    falloff = np.clip((cosine - math.cos(outer)) / (math.cos(inner) - math.cos(outer)), 0, 1) ** 2
    expected = ALBEDO / math.pi * 10.0 * 2.0 / distance**3 * falloff
    assert (falloff == 0).any() and (falloff == 1).any()
    assert np.allclose(rendered(scene, size, **settings), expected[..., None], rtol=EXACT, atol=EXACT * expected.max())


def test_lights_below_the_floor_do_not_shine_on_it():
    scene = builtin.plane_sun(3.0, 91.0)
    scene.lights += [DirectionalLight((0.0, 1.0, 0.0)), PointLight((0.5, -1.0, 0.0), 100.0)]
    assert not rendered(scene, (8, 8)).any()


@pytest.mark.parametrize(("distance", "bound"), [(0.5, 0.031), (1.0, 0.0095), (2.0, 0.0028)])
def test_plates_reflect_their_form_factor(distance, bound):
    """L = rho Le F; errs dark by about A / (pi d2), A being the area of one of 32 samples."""
    expected = ALBEDO * builtin.plates_form_factor(distance)
    got = rendered(builtin.plates(distance, 1.0, ALBEDO), (32, 32), direct=DirectSettings(samples=32, emitters="maps"))
    assert got.mean() == pytest.approx(expected, rel=bound)


def test_error_falls_with_the_number_of_samples():
    expected = ALBEDO * builtin.plates_form_factor(1.0)
    scene = builtin.plates(1.0, 1.0, ALBEDO)
    made = [rendered(scene, (32, 32), direct=DirectSettings(n, "maps")).mean() for n in (8, 32, 128)]
    errors = [abs(mean / expected - 1) for mean in made]
    assert errors[1] < errors[0] / 2 and errors[2] < errors[1] / 4


def test_double_sided_emitter_shines_both_ways():
    """A double-sided lamp half-way between two plates lights each like a single-sided lamp that faces it."""
    lamp = matte(0.0, "lamp", 1.0, double_sided=True)
    corners = [((-0.5, 0, 0.5), (0, 0, -1), matte(ALBEDO)), ((-0.5, 1, -0.5), (0, 0, 1), lamp)]
    corners.append(((-0.5, 2, -0.5), (0, 0, 1), matte(ALBEDO)))
    scene = Scene([Instance(quad(corner, (1, 0, 0), edge, material)) for corner, edge, material in corners])
    for up in (-1, 1):
        camera = Camera.look_at((0, 1 + up / 2, 0), (0, 1 + up, 0), up=(0, 0, -1))
        camera.orthographic_height = 1.0
        scene.cameras = [camera]
        expected = ALBEDO * builtin.plates_form_factor(1.0)
        got = rendered(scene, (32, 32), direct=DirectSettings(samples=32, emitters="maps"))
        assert got.mean() == pytest.approx(expected, rel=0.0095)


def test_convex_body_reflects_the_unoccluded_environment():
    """A matte ball has exactly L = rho Le; a coated one agrees with the path tracer."""
    scene = builtin.furnace(ALBEDO)
    scene.environment.color = (1.0, 0.5, 0.25)
    got = shoot(scene, (32, 32), show=("direct", "emission"), gi="none")
    seen = got["direct"].any(-1)
    assert 0.2 < seen.mean() < 0.8
    assert np.allclose(got["direct"][seen], ALBEDO * np.array(scene.environment.color), rtol=EXACT)
    assert np.allclose(got["emission"][~seen], scene.environment.color, rtol=EXACT) and not got["emission"][seen].any()
    for material in (Material(roughness=0.4), Material(base_color=(0.9, 0.6, 0.3, 1.0), metallic=1.0, roughness=0.3)):
        scene.instances = [Instance(smooth(sphere(subdivisions=3, material=material)))]
        got, expected = rendered(scene, (32, 32), diffuse=False), traced(scene, (32, 32), 128, diffuse=False)
        assert np.allclose(got.mean((0, 1)), expected.mean((0, 1)), rtol=3e-3)


# ------------------------------------------------------------------------------------------------ Agreement

LIGHTS = {
    "point": PointLight((1, 4, 3), 30.0, (1.0, 0.8, 0.6)),
    "point among things": PointLight((0.5, 0.8, 0.4), 3.0),
    "spot": SpotLight((-3, 4, 2), (3, -3.5, -2), 0.3, 0.6, 60.0),
    "wide spot": SpotLight((-1, 4, 2), (1, -3.5, -2), 0.3, 1.4, 60.0),
    "all-round spot": SpotLight((0.5, 2.5, 1.5), (1, -0.2, -1), 0.3, 1.57, 10.0),
    "sun": DirectionalLight((-0.5, -1, -0.4), 3.0),
    "low sun": DirectionalLight((-1, -0.2, 0.3), 3.0),
}


def dark_medley(lights):
    """Return the medley with `lights` as its only sources."""
    scene = medley()
    for material in scene.materials:
        material.emission = (0.0, 0.0, 0.0)
    scene.environment, scene.lights = None, lights
    return scene


@pytest.fixture(scope="module")
def by_light():
    """Return the path tracer's direct light of each light alone."""
    return {name: traced(dark_medley([light]), diffuse=False) for name, light in LIGHTS.items()}


@pytest.mark.parametrize("name", LIGHTS)
def test_every_pixel_agrees_with_the_path_tracer(name, by_light):
    """All materials and shadows: where shadow maps leave visibility open, rays decide."""
    got = rendered(dark_medley([LIGHTS[name]]), diffuse=False)
    expected = by_light[name]
    assert differing(got, expected) <= EDGES
    assert got.mean() == pytest.approx(expected.mean(), rel=2e-3)


@pytest.mark.parametrize(("name", "share"), [("point", 0.014), ("wide spot", 0.018), ("sun", 0.005)])
def test_without_rays_only_shadow_edges_differ(name, share, by_light):
    sides = ShadowSettings(sun=2048, spot=1024, point=512)
    got = rendered(dark_medley([LIGHTS[name]]), diffuse=False, direct=DirectSettings(edges=False), shadow=sides)
    expected = by_light[name]
    off = np.abs(got - expected).max(-1) > PACKED * (expected.max(-1) + 0.02 * expected.mean())
    assert off.mean() <= share
    assert got.mean() == pytest.approx(expected.mean(), rel=2e-3)


def test_lights_add_up(by_light):
    got = rendered(dark_medley(list(LIGHTS.values())), diffuse=False)
    assert differing(got, sum(by_light.values())) <= 2 * EDGES


def test_scene_without_light_is_black():
    for scene in (
        dark_medley([]),
        dark_medley([PointLight((0, 3, 0), 0.0), DirectionalLight((0, -1, 0), 1.0, (0, 0, 0))]),
    ):
        assert not rendered(scene, (32, 18)).any()


# ------------------------------------------------------------------------------------------------ Acne


def lights_at(inclination, azimuth):
    t = math.radians(inclination)
    d = np.array([math.sin(t) * math.cos(azimuth), math.cos(t), math.sin(t) * math.sin(azimuth)])
    yield DirectionalLight((-d).tolist(), 3.0)
    yield PointLight((3 * d).tolist(), 30.0)
    yield SpotLight((3 * d).tolist(), (-d).tolist(), 0.4, 0.7, 30.0)
    yield SpotLight((3 * d).tolist(), (0.3 - d[0], -d[1], 0.2 - d[2]), 0.4, 1.4, 30.0)


def lit_shares(scene, inclinations, edges, shadow):
    """Yield, for many lights, the ratio of rendered to path-traced direct light where the light reaches."""
    size = (64, 64)
    camera = CameraSettings(jitter=False)
    settings = [
        Settings(gi="none", diffuse=True, camera=camera, direct=DirectSettings(edges=edges), shadow=shadow),
        Settings(gi="path", diffuse=True, camera=camera, spp=1, bounces=0),
    ]
    renderers = [Renderer(scene, size=size, settings=s) for s in settings]
    for inclination in inclinations:
        for azimuth in (0.0, 0.4):
            for light in lights_at(inclination, azimuth):
                scene.lights = [light]
                for renderer in renderers:
                    renderer.run(show=("direct",))
                got, expected = (r.read_back("direct")[..., 0].astype(np.float64) for r in renderers)
                lit = expected > 1e-3 * expected.max()
                if lit.any():
                    yield got[lit] / expected[lit]


FINE, TINY = ShadowSettings(), ShadowSettings(sun=128, spot=64, point=32)


@pytest.mark.parametrize("shadow", [FINE, TINY], ids=["fine", "tiny"])
@pytest.mark.parametrize("edges", [True, False])
def test_planes_at_all_inclinations_have_no_acne(edges, shadow):
    """In no pixel: with rays or with the shadow filter alone, in maps of any size."""
    camera = Camera.look_at((0, 6, 0), (0, 0, 0))
    camera.orthographic_height = 4.0
    scene = Scene([Instance(grid(8.0, material=matte(ALBEDO)))], cameras=[camera])
    for shares in lit_shares(scene, (0, 45, 75, 88, 89.5), edges, shadow):
        assert shares.min() > 0.999 and shares.max() < 1.001


@pytest.mark.parametrize("edges", [True, False])
@pytest.mark.parametrize("shading", ["smooth", "flat"])
def test_balls_have_no_acne(shading, edges):
    ball = sphere(subdivisions=3, material=matte(ALBEDO))
    if shading == "smooth":
        smooth(ball)
    scene = Scene([Instance(ball)], cameras=[Camera.look_at((1.2, 2.5, 1.5), (0, 0, 0), yfov_deg=45)])
    for shares in lit_shares(scene, (0, 45, 85, 120), edges, FINE):
        # Along the edges of facets a pixel may show the neighbouring facet.
        assert (shares < 0.98).mean() <= (0 if shading == "smooth" else 3e-3)
        assert (shares > 1.02).mean() <= (1e-3 if shading == "smooth" else 3e-3)


def test_no_acne_under_an_emitter():
    """32 small shadow maps; the picture equals the unshadowed sum over the sample lights."""
    lamp = quad((-0.5, 2, -0.5), (1, 0, 0), (0.3, 0.4, 1), matte(0.0, "lamp", 10.0, double_sided=False))
    scene = Scene([Instance(grid(8.0, material=matte(ALBEDO))), Instance(lamp)])
    camera = Camera.look_at((0, 1.9, 0), (0, 0, 0), up=(0, 0, -1))
    camera.orthographic_height = 4.0
    scene.cameras = [camera]
    for edges in (True, False):
        direct = DirectSettings(samples=32, emitters="maps", edges=edges)
        settings = Settings(gi="none", diffuse=True, camera=CameraSettings(jitter=False), direct=direct)
        renderer = Renderer(scene, size=(64, 64), settings=settings)
        renderer.run(show=("direct", "position"))
        lights = renderer._gpu.upload.direct_lights(scene, DIRECT_LIGHT, 32, False)
        to_light = lights["position"].astype(np.float64) + renderer._gpu.upload.origin
        to_light = to_light - renderer.read_back("position")[..., None, :]
        squared = (to_light**2).sum(-1)
        cosines = to_light[..., 1] * -(to_light * lights["direction"]).sum(-1) / squared
        form = lights["area"] * np.maximum(cosines, 0) / (squared + lights["area"] / math.pi)
        expected = ALBEDO / math.pi * (form * lights["color"][:, 0]).sum(-1)
        assert np.allclose(renderer.read_back("direct")[..., 0], expected, rtol=1e-4)


# ------------------------------------------------------------------------------------------------ Contacts


def block_on_a_floor(height, light):
    """A block from x = -0.5 to 0 seen from above; its shadow falls on the floor right of it."""
    camera = Camera.look_at((0.6, 6, 0.0), (0.6, 0, 0), up=(0, 0, -1))
    camera.orthographic_height = 1.0
    block = box((-0.5, 0, -0.5), (0.0, height, 0.5), matte(0.2))
    return Scene([Instance(grid(8.0, material=matte(ALBEDO))), Instance(block)], [light], None, [camera])


SLANTED = {
    "sun": DirectionalLight((1, -1, 0), 3.0),
    "low sun": DirectionalLight((1, -0.5, 0.03), 3.0),
    "spot": SpotLight((-2, 2, 0), (1, -0.8, 0), 0.4, 0.6, 30.0),
    "point": PointLight((-2, 2, 0), 30.0),
}
COARSE = ShadowSettings(sun=256, spot=256, point=128)  # texels of 1 to 7 cm


@pytest.mark.parametrize("name", SLANTED)
def test_shadows_begin_at_the_contact(name):
    """With rays the shadow is exact, also of a block that is lower than a texel is wide."""
    for height in (0.6, 0.01):
        scene = block_on_a_floor(height, SLANTED[name])
        got, expected = rendered(scene, (200, 100), shadow=COARSE), traced(scene, (200, 100))
        assert differing(got, expected) <= 1e-3


@pytest.mark.parametrize("name", SLANTED)
def test_filtered_shadows_begin_at_the_contact(name):
    """Without rays, shadows begin at the contact; offset and filter move their end by at most 3.1 texels."""
    scene = block_on_a_floor(0.6, SLANTED[name])
    settings = Settings(
        gi="none", diffuse=True, camera=CameraSettings(jitter=False), direct=DirectSettings(edges=False), shadow=COARSE
    )
    renderer = Renderer(scene, size=(200, 100), settings=settings)
    renderer.run(show=("direct", "position"))
    got, expected = (p[50, :, 0] for p in (renderer.read_back("direct"), traced(scene, (200, 100))))
    x, y, _ = renderer.read_back("position")[50].T
    light, shadow = SLANTED[name], (expected == 0) & (y < 0.005)
    end = x[shadow].max()
    # The length of a texel projected onto the floor at the shadow's end.
    travel = np.array([end, 0, 0]) - light.position if hasattr(light, "position") else np.array(light.direction)
    distance = np.linalg.norm(travel)
    texel = float(renderer._gpu.kept(DeferredState)._records["texel"].max()) * (1 if "sun" in name else distance)
    texel *= distance / -travel[1]
    assert 0 < x[shadow].min() < 0.006 and texel < 0.1
    deep = shadow & (x < end - 3.1 * texel)
    assert deep.sum() > 20 and not got[deep].any()
    beyond = (x > end + texel) & (y < 0.005)
    assert np.allclose(got[beyond], expected[beyond], rtol=1e-3) and beyond.any()


@pytest.mark.parametrize("camera", [0, 1])
@pytest.mark.parametrize("edges", [True, False])
def test_nothing_leaks_out_of_a_sealed_chamber(camera, edges):
    """Only the lamp behind 10 cm walls is on: no pixel of the corridor is lit."""
    scene = builtin.corridor(lamp=0.0)
    scene.cameras = [scene.cameras[camera]]
    for side in (512, 64) if edges else (512,):
        direct, shadow = DirectSettings(edges=edges), ShadowSettings(point=side)
        assert not rendered(scene, direct=direct, shadow=shadow).any()


def test_a_sealed_lamp_changes_no_other_light():
    """Its shadow maps take texels from those of other lights; with rays the picture does not change."""
    on, off = (rendered(builtin.corridor(sealed_lamp=lamp)) for lamp in (1200.0, 0.0))
    assert differing(on, off) == 0 and off.any()


# ------------------------------------------------------------------------------------------------ Many lights


def crowd(count=120):
    """The medley under its emitters, points and spots of all sizes with and without ranges, and a sun."""
    rng = np.random.default_rng(0)
    scene = medley()
    scene.lights = [DirectionalLight((-0.3, -1, -0.2), 0.3)]
    for k in range(count):
        position, direction = rng.uniform((-4, 0.3, -4), (4, 3, 4)).tolist(), rng.normal(size=3).tolist()
        color, reach = tuple(rng.uniform(0.2, 1, 3).tolist()), float(rng.uniform(0.5, 4)) if k % 3 else None
        if k % 2:
            scene.lights.append(PointLight(position, 1.0, color, reach))
        else:
            cones = float(rng.uniform(0, 0.3)), float(rng.uniform(0.3, 1.5))
            scene.lights.append(SpotLight(position, direction, *cones, 3.0, color, reach))
    return scene


@pytest.mark.parametrize("range_", [True, False])
def test_light_tiles_do_not_change_the_picture(range_):
    """Bit for bit, at a size that is no multiple of the tile's; the lists are shorter than that of all lights."""
    scene = crowd()
    pictures = []
    for tiles in (True, False):
        direct = DirectSettings(tiles=tiles, samples=64, emitters="maps", range=range_)
        renderer = Renderer(
            scene, size=(170, 95), settings=Settings(gi="none", camera=CameraSettings(jitter=False), direct=direct)
        )
        renderer.run(show=("direct",))
        pictures.append(renderer.read_back("direct"))
        if tiles:
            bits = renderer.graph.read_back("direct/tiles")
            filled = np.unpackbits(bits.view(np.uint8)).sum() / (11 * 6 * renderer._gpu.kept(DeferredState).count)
            assert 0.02 < filled < (0.6 if range_ else 0.95)
    assert np.array_equal(*pictures) and pictures[0].any()


def test_range_has_an_effect_only_when_enabled():
    """KHR_lights_punctual: the window clamp(1 - (d/range)^4) multiplies 1/d2."""
    scene, size = builtin.plane_point(albedo=ALBEDO), (33, 17)
    free = rendered(scene, size)
    scene.lights[0].range = 2.5
    assert np.array_equal(rendered(scene, size), free)
    squared = 4.0 + (floor_points(size) ** 2).sum(-1)
    window = np.clip(1 - (squared / 2.5**2) ** 2, 0, 1)
    got = rendered(scene, size, direct=DirectSettings(range=True))
    assert np.allclose(got, free * window[..., None], rtol=1e-4, atol=1e-6) and (window == 0).any()


# ------------------------------------------------------------------------------------------------ Unlit, sky, ambient


def test_unlit_surfaces_and_the_sky_have_no_direct_light():
    scene = medley()
    got = shoot(
        scene, SIZE, show=("direct", "emission", "radiance", "albedo", "depth", "indirect"), gi="none", diffuse=False
    )
    unlit = (np.abs(got["albedo"] - (0.1, 0.9, 0.4)) < 1e-5).all(-1)
    sky = got["depth"] == 0
    assert unlit.sum() > 50 and sky.sum() > 1000
    assert not got["direct"][unlit].any() and not got["direct"][sky].any() and not got["indirect"].any()
    assert (np.abs(got["emission"][unlit] - (0.1, 0.9, 0.4)).max(-1) < 1e-5).mean() > 0.95
    assert np.allclose(got["emission"][sky], scene.environment.color)
    assert np.allclose(got["radiance"], got["direct"] + got["emission"], rtol=1e-6)


def test_ambient_light_can_be_turned_off():
    scene = medley()
    scene.lights = []
    for material in scene.materials:
        material.emission = (0.0, 0.0, 0.0)
    settings = Settings(gi="none", camera=CameraSettings(jitter=False))
    settings.environment.ambient = False
    renderer = Renderer(scene, size=(32, 18), settings=settings)
    renderer.run()
    assert not renderer.read_back("direct").any() and renderer.read_back("emission").max() > 0.3
    assert rendered(scene, (32, 18), diffuse=False).any()
