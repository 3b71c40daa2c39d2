"""Ambient light of the environment against quadrature of the same BRDF, brute-force sums and the path tracer."""

from __future__ import annotations

import numpy as np
import pytest
import wgpu
from helpers.gltf_brdf import gltf_brdf, reflectance
from helpers.pictures import looking, shoot
from helpers.skies import gradient_sky, radiance, sphere_grid

from wgpu_gi.gpu.device import open_device
from wgpu_gi.gpu.graph import Graph
from wgpu_gi.gpu.wgsl.load import refresh
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import quad, sphere
from wgpu_gi.scene.scene import Environment, Instance, Material, Scene
from wgpu_gi.techniques.deferred.environment import EnvironmentSettings, declare_environment
from wgpu_gi.techniques.shared.scene_inputs import share_scene
from wgpu_gi.upload.scene_upload import SceneUpload

MIN_ALPHA = 0.001
UP = np.array([0.0, 0.0, 1.0])
AXES = np.concatenate([np.eye(3), -np.eye(3)])
SHADER = """#import "deferred/environment/ambient.wgsl"
@group(1) @binding(40) var<storage, read> rows: array<mat4x4f>;
@group(1) @binding(41) var<storage, read_write> result: array<vec4f>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < arrayLength(&rows)) {
        let row = rows[id.x];
        let material = brdf_metallic_roughness(row[2].xyz, row[0].w, row[1].w);
        result[id.x] = vec4f(EXPRESSION, 1.0);
    }
}
"""


class Probe:
    """Looks up the ambient light of an environment for many surfaces at once."""

    def __init__(self, folder, environment, *, diffuse=False, ambient=True, height=2.0):
        self.folder, self.environment, self.settings = folder, environment, EnvironmentSettings(ambient)
        self.device = open_device(large_buffers=True)
        self.upload = SceneUpload(self.device, diffuse)
        self.graph = Graph(self.device, shader_root=folder)
        self.height = height

    def __call__(self, expression, normal, w_o=UP, base=(1.0, 1.0, 1.0), metallic=0.0, roughness=0.0):
        """Return a vec3f expression of `row` (normal, w_o) and `material` for each row, (n, 3)."""
        columns = [np.atleast_2d(np.asarray(a, np.float32)) for a in (normal, w_o, base)]
        factors = [np.atleast_1d(np.asarray(a, np.float32)) for a in (metallic, roughness)]
        count = max(len(a) for a in (*columns, *factors))
        rows = np.zeros((count, 4, 4), np.float32)
        for k, column in enumerate(columns):
            rows[:, k, :3] = column
        rows[:, 0, 3], rows[:, 1, 3] = factors
        (self.folder / "probe.wgsl").write_text(SHADER.replace("EXPRESSION", expression))
        refresh()
        floor = quad((-1, 0, 1), (self.height, 0, 0), (0, 0, -2), matte(0.5))
        self.upload.update(Scene([Instance(floor)], environment=self.environment))
        graph = self.graph
        graph.begin((1, 1))
        graph.uniform("scene", self.upload.info)
        scene = share_scene(graph, self.upload)
        ambient = declare_environment(graph, self.settings, scene)
        buffer = self.device.gpu.create_buffer_with_data(data=rows, usage=wgpu.BufferUsage.STORAGE)
        result = graph.buffer("result", dtype=np.dtype((np.float32, 4)), count=count)
        graph.compute(
            "probe",
            "probe.wgsl",
            over=count,
            reads={**ambient.reads, "rows": graph.share("rows", buffer, object())},
            writes={"result": result},
            constants={"HAS_ENVIRONMENT": False, "HAS_PICTURED_ENVIRONMENT": False} | ambient.features,
        )
        graph.compile([result, *(h for n, h in ambient.reads.items() if h.name.startswith("environment/"))])
        graph.run(check=True)
        return graph.read_back(result).reshape(count, 4)[:, :3].astype(np.float64)

    def irradiance(self, normal):
        return self("ambient_irradiance(row[0].xyz)", normal)

    def reflected(self, normal, w_o, base=(1.0, 1.0, 1.0), metallic=0.0, roughness=0.0):
        return self("ambient_radiance(material, row[0].xyz, row[1].xyz)", normal, w_o, base, metallic, roughness)

    def mean(self, direction, roughness):
        """Return the prefiltered lobe alone."""
        return self("ambient_lobe(row[0].xyz, material.alpha)", direction, roughness=roughness)

    def runs(self):
        return {p.name: p.state.runs for p in self.graph.passes.values()}


@pytest.fixture
def probe(tmp_path):
    return lambda environment, **options: Probe(tmp_path, environment, **options)


def view(cosine):
    cosine = np.asarray(cosine, np.float64)
    sine = np.sqrt(1 - cosine**2)
    return np.stack([0.6 * sine, 0.8 * sine, cosine], -1)


def unit(count, seed=0):
    d = np.random.default_rng(seed).normal(size=(count, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.0, 0.05, 0.12, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0])
def test_constant_environment_reflects_the_integral_of_the_brdf(probe, roughness):
    """L = Le times the integral of f_r cos: within 0.5 % for all kinds of materials and angles; Le is tinted."""
    color = np.array([0.5, 1.0, 2.0])
    lookup = probe(Environment(color=tuple(color)))
    cases = [
        (base, metallic, cosine)
        for base in ((1.0, 1.0, 1.0), (0.9, 0.5, 0.05), (0.02, 0.02, 0.02))
        for metallic in (0.0, 0.3, 1.0)
        for cosine in (0.03, 0.1, 0.27, 0.5, 0.77, 0.93, 1.0)
    ]
    base, metallic, cosine = (np.array(c) for c in zip(*cases, strict=True))
    got = lookup.reflected(UP, view(cosine), base, metallic, roughness)
    expected = color * reflectance(base, metallic, max(roughness**2, MIN_ALPHA), cosine)
    assert np.abs(got / expected - 1).max() < 0.005


@pytest.mark.parametrize("metallic", [0.0, 0.3, 1.0])
def test_white_surfaces_reflect_all_of_a_constant_environment(probe, metallic):
    """At random angles, and at those of about alpha, where the coat's shadowing changes fastest."""
    rng = np.random.default_rng(2)
    roughness = np.concatenate([rng.uniform(0.02, 1, 1000), np.linspace(0, 1, 1000)])
    near = np.minimum(np.maximum(roughness**2, MIN_ALPHA) * 10 ** rng.uniform(-0.7, 2, 2000), 1)
    cosine = np.where(np.arange(2000) % 2, near, rng.random(2000))
    got = probe(Environment()).reflected(UP, view(cosine), (1.0, 1.0, 1.0), metallic, roughness)
    assert np.abs(got - 1).max() < 0.005


def test_pure_lambert_reflects_its_albedo(probe):
    lookup = probe(Environment(color=(0.5, 1.0, 2.0)), diffuse=True)
    got = lookup("ambient_radiance(brdf_lambert(row[2].xyz), row[0].xyz, row[1].xyz)", UP, view(0.3), (0.2, 0.5, 0.8))
    assert np.allclose(got, (0.1, 0.5, 1.6), rtol=1e-6)
    assert not any(name.startswith("environment/") for name in lookup.runs())


def brute_irradiance(image, normals, rotation=0.0):
    d, solid_angle = sphere_grid()
    light = radiance(image, d, rotation) * solid_angle[:, None]
    return np.array([np.maximum(d @ n, 0) @ light for n in normals])


@pytest.mark.parametrize(("height", "sun", "rotation"), [(64, 0.0, 0.0), (16, 0.0, 1.0), (64, 2000.0, 2.5)])
def test_irradiance_equals_the_sum_over_the_picture(probe, height, sun, rotation):
    """Within 1 % of the brute-force sum, also with a sun of one pixel that gives most of the light."""
    image = gradient_sky(height, sun)
    normals = np.concatenate([AXES, unit(60)])
    got = probe(Environment(image=image, rotation=rotation), diffuse=True).irradiance(normals)
    expected = brute_irradiance(image, normals, rotation)
    # At the horizon of a normal, the sun's share falls to zero within a texel.
    assert (np.abs(got - expected) < 0.007 * expected + 0.003 * expected.max(0)).all()
    assert np.abs((got - expected).mean(0) / expected.mean(0)).max() < 0.002


def test_irradiance_of_one_bright_pixel_is_flux_times_cosine(probe):
    """E = Phi max(n.s, 0), Phi the integral over the pixel: no energy is lost, the sun stays in its place."""
    image = np.zeros((128, 256, 3), np.float32)
    image[31, 200] = (1e5, 2e5, 3e5)
    lookup = probe(Environment(color=(1.0, 0.5, 0.25), image=image), diffuse=True)
    theta, phi = 31.5 / 128 * np.pi, 200.5 / 256 * 2 * np.pi
    sun = np.array([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)])
    flux = np.array([1e5, 1e5, 0.75e5]) * (np.pi / 128) ** 2 * np.sin(theta)
    normals = np.concatenate([unit(200), [sun]])
    expected = flux * np.maximum(normals @ sun, 0)[:, None]
    assert np.abs(lookup.irradiance(normals) - expected).max() < 0.01 * flux.max()
    assert np.allclose(lookup.irradiance(sun), flux, rtol=0.003)


def test_rotation_changes_only_the_lookup(probe):
    """Turning the environment by 90 degrees equals turning the normals by -90; no prefiltering pass runs again."""
    image = gradient_sky(16, 50.0)
    normals, turned = unit(50), unit(50)[:, [2, 1, 0]] * [-1, 1, 1]
    lookup = probe(Environment(image=image))
    expected = lookup.irradiance(turned), lookup.mean(turned, 0.3)
    runs = lookup.runs()
    lookup.environment = Environment(image=image, rotation=np.pi / 2)
    got = lookup.irradiance(normals), lookup.mean(normals, 0.3)
    for a, b in zip(expected, got, strict=True):
        assert np.allclose(a, b, rtol=1e-3, atol=1e-4)
    assert all(lookup.runs()[name] == count for name, count in runs.items() if name != "probe")


def test_prefiltering_is_kept_until_the_picture_changes(probe):
    """Bounds, colour and rotation change the scene's uniform, which no prefiltering pass reads."""
    image = gradient_sky(8)
    lookup = probe(Environment(image=image))
    lookup.irradiance(UP)
    first = lookup.runs()
    assert {"environment/albedo", "environment/leaves", "environment/sum", "environment/prefilter"} <= set(first)
    lookup.height, lookup.environment = 5.0, Environment((2.0, 1.0, 1.0), image, 0.3)
    lookup.irradiance(UP)
    kept = [n for n in first if n.startswith("environment/")]
    assert all(lookup.runs()[n] == first[n] for n in kept)
    lookup.environment = Environment(image=image.copy())
    lookup.irradiance(UP)
    assert lookup.runs()["environment/prefilter"] == first["environment/prefilter"] + 1
    assert lookup.runs()["environment/albedo"] == first["environment/albedo"]


def test_only_needed_passes_are_declared(probe):
    constant = probe(Environment())
    constant.irradiance(UP)
    assert set(constant.runs()) == {"environment/albedo", "probe"}
    for nothing in (probe(None), probe(Environment((0.0, 0.0, 0.0))), probe(Environment(), ambient=False)):
        assert not nothing.irradiance(UP).any() and not nothing.reflected(UP, view(0.5)).any()
        assert set(nothing.runs()) == {"probe"}
    lambert = probe(Environment(image=gradient_sky(8)), diffuse=True)
    lambert.irradiance(UP)
    assert "environment/albedo" not in lambert.runs() and "environment/prefilter" in lambert.runs()


def test_twice_the_light_reflects_exactly_twice_as_much(probe):
    image = gradient_sky(32, 300.0)
    given = (unit(50), unit(50, 1), (0.9, 0.5, 0.1), np.linspace(0, 1, 50), np.linspace(0, 1, 50)[::-1])
    results = []
    for environment in (Environment(image=image), Environment(image=2 * image), Environment((2.0, 2.0, 2.0), image)):
        results.append(probe(environment).reflected(*given))
    assert np.array_equal(results[1], 2 * results[0]) and np.array_equal(results[2], 2 * results[0])


@pytest.mark.parametrize(
    ("size", "value"), [((1, 1), 1.0), ((5, 3), 1e-6), ((13, 17), 1e8), ((1, 700), 1.0), ((300, 1), 1.0), ((8, 16), 0)]
)
def test_picture_of_one_value_equals_a_constant_environment(probe, size, value):
    """Pictures of any size and value, in all directions and at every roughness."""
    lookup = probe(Environment(image=np.full((*size, 3), value, np.float32)))
    directions = np.concatenate([AXES, unit(100)])
    assert np.allclose(lookup.irradiance(directions), np.pi * value, rtol=1e-4)
    for roughness in (0.0, 0.1, 0.3, 0.6, 1.0):
        assert np.allclose(lookup.mean(directions, roughness), value, rtol=1e-4)


def test_grazing_and_hidden_views_are_finite(probe):
    """Views along the surface, from below it, and straight down, where the lobe's tilt has no direction."""
    lookup = probe(Environment(image=gradient_sky(16, 1e8)))
    w_o = np.array([(1.0, 0, 0), (0.6, 0.8, 1e-7), (0, 0, 1), (0, 0, -1), (0.6, 0, -0.8), (1e-5, 0, 1)])
    for roughness in (0.0, 0.5, 1.0):
        got = lookup.reflected(UP, w_o, (1.0, 1.0, 1.0), 0.5, roughness)
        assert np.isfinite(got).all() and (got >= 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.12, 0.25, 0.5, 1.0])
def test_prefiltering_keeps_the_mean(probe, roughness):
    """The mean over all directions is the picture's, with a sun of one pixel that gives half of the light."""
    image = gradient_sky(128, 4000.0)
    d, solid_angle = sphere_grid(256)
    got = solid_angle @ probe(Environment(image=image)).mean(d, roughness)
    fine, fine_angle = sphere_grid(1024)
    expected = fine_angle @ radiance(image, fine)
    assert np.allclose(got, expected, rtol=0.005)


def test_smooth_mirrors_show_the_picture(probe):
    """Roughness 0 returns the picture's value in the mirrored direction, at the picture's own resolution."""
    image = gradient_sky(256)
    lookup = probe(Environment(image=image, rotation=1.0))
    d = unit(200)
    expected = radiance(image, d, 1.0)
    assert np.allclose(lookup.mean(d, 0.0), expected, rtol=2e-4)
    w_o = 2 * d[:, 2:] * UP - d
    seen = d[:, 2] > 0.05
    got = lookup.reflected(UP, w_o, (1.0, 1.0, 1.0), 1.0, 0.0)
    assert np.allclose(got[seen], expected[seen], rtol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.1, 0.15, 0.21, 0.3, 0.42, 0.6, 0.85])
def test_prefiltered_lobe_equals_the_brute_force_sum(probe, roughness):
    """Against sums of D cos over the sphere, also at widths between two maps: within 2 % of the sky's mean."""
    image, directions = gradient_sky(64), np.concatenate([AXES, unit(60)])
    d, solid_angle = sphere_grid(512)
    light, a2 = radiance(image, d) * solid_angle[:, None], roughness**4
    got = probe(Environment(image=image)).mean(directions, roughness)
    expected = []
    for direction in directions:
        cosine = d @ direction
        t = 0.5 * (1 - cosine) + a2 * 0.5 * (1 + cosine)
        weight = np.maximum(cosine, 0) / t**2
        expected.append(weight @ light / (weight @ solid_angle))
    error = np.abs(got - expected)
    assert error.max() < 0.02 * np.mean(expected) and error.mean() < 0.01 * np.mean(expected)


def test_prefiltered_maps_have_no_seams(probe):
    """Along great circles across all edges and corners of the maps, neighbours differ no more than elsewhere."""
    lookup = probe(Environment(image=gradient_sky(64)))
    t = np.linspace(0, 2 * np.pi, 4000)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        circle = np.zeros((4000, 3))
        circle[:, a], circle[:, b] = np.cos(t), np.sin(t)
        for roughness in (0.25, 0.5, 1.0):
            values = lookup.mean(circle, roughness)
            step = np.abs(np.diff(values, axis=0))
            # The most that the sky itself changes over such a step.
            own = np.abs(np.diff(radiance(gradient_sky(64), circle), axis=0)).max()
            assert step.max() <= 1.5 * own


def ball(material):
    return Scene([Instance(sphere((0, 0, 0), 1.0, 4, material))])


@pytest.mark.parametrize("rotation", [0.0, 2.0])
def test_path_tracer_agrees_on_a_matte_ball(probe, rotation):
    """Direct light of the path tracer under a sky with a sun, and rho E / pi at the same normals: within 1 %."""
    environment = Environment((1.0, 0.8, 0.6), gradient_sky(32, 100.0), rotation)
    scene = ball(matte(0.7))
    scene.environment = environment
    got = shoot(
        scene, (24, 24), spp=256, bounces=0, show=("direct", "normal", "depth"), camera=looking((-1, -1, -1), (2, 2, 2))
    )
    seen = got["depth"] > 0
    expected = 0.7 / np.pi * probe(environment, diffuse=True).irradiance(got["normal"][seen])
    assert seen.sum() > 100
    assert np.abs((expected - got["direct"][seen]).mean(0) / got["direct"][seen].mean(0)).max() < 0.01


@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_path_tracer_agrees_on_a_coated_ball_in_a_constant_environment(probe, metallic):
    """The environment has no picture, so only BRDF samples find it: within 0.5 %."""
    color, environment = (0.9, 0.5, 0.2), Environment((0.5, 1.0, 2.0))
    scene = ball(Material("ball", (*color, 1.0), metallic=metallic, roughness=0.5))
    scene.environment = environment
    camera = looking((0, 0, -1), (0, 0, 4), height=2.5)
    got = shoot(scene, (24, 24), spp=512, bounces=0, show=("direct", "normal", "depth"), camera=camera, diffuse=False)
    seen = got["depth"] > 0
    expected = probe(environment).reflected(got["normal"][seen], UP, color, metallic, 0.5)
    assert np.abs((expected - got["direct"][seen]).mean(0) / got["direct"][seen].mean(0)).max() < 0.005


def split_sum_error(probe, roughness, metallic, sun):
    """Return bias and mean absolute error over mean, against quadrature, for random normals and views."""
    image = gradient_sky(64, sun)
    normals, w_o = unit(40, 3), unit(40, 4)
    w_o *= np.sign((normals * w_o).sum(1))[:, None]
    got = probe(Environment(image=image)).reflected(normals, w_o, (0.8, 0.8, 0.8), metallic, roughness)
    d, solid_angle = sphere_grid(256)
    light = radiance(image, d) * solid_angle[:, None]
    expected = []
    for n, w in zip(normals, w_o, strict=True):
        above = d @ n > 0
        f = gltf_brdf(np.full(3, 0.8), metallic, roughness**2, n, w, d[above])
        expected.append((f * (d[above] @ n)[:, None] * light[above]).sum(0))
    expected = np.array(expected)
    return (got - expected).mean() / expected.mean(), np.abs(got - expected).mean() / expected.mean()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("roughness", "metallic", "sun", "bias_bound", "error_bound"),
    [
        (0.3, 1.0, 0.0, 0.01, 0.05),
        (0.5, 1.0, 0.0, 0.01, 0.05),
        (1.0, 1.0, 0.0, 0.01, 0.05),
        (0.5, 0.0, 0.0, 0.01, 0.02),
        (0.5, 1.0, 1000.0, 0.05, 0.08),
        (0.5, 0.0, 1000.0, 0.01, 0.02),
    ],
)
def test_error_of_the_split_sum_is_bounded(probe, roughness, metallic, sun, bias_bound, error_bound):
    """The split sum takes lobes as isotropic and the Fresnel factor out of the integral over the light."""
    bias, error = split_sum_error(probe, roughness, metallic, sun)
    assert abs(bias) < bias_bound and error < error_bound
