"""common/brdf.wgsl against its formula in numpy; samples against their density; a white furnace stays white."""

from __future__ import annotations

import numpy as np
import pytest
from fit_coat_albedo import coat_losses
from fit_coat_albedo import hemisphere as cosines_and_weights
from helpers.gltf_brdf import gltf_brdf, losses, mean_losses
from helpers.statistics import chi_square_z

from wgpu_gi.measure.wgsl_evaluator import Evaluator

BRDF = "common/brdf.wgsl"
MIN_ALPHA = 0.001
FIT_ERROR = 0.0023  # of M and T in common/coat_albedo.wgsl
BASES = np.array([(1.0, 1.0, 1.0), (0.9, 0.5, 0.05), (0.0, 0.0, 0.0)], np.float32)
ROUGHNESS = [0.0, 0.1, 0.25, 0.5, 0.75, 1.0]
METALLIC = [0.0, 0.5, 1.0]
COSINES = [1.0, 0.7, 0.3, 0.1]


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


LOSS = """
fn loss_of(alpha: f32, cosine: f32) -> vec2f {
    let loss = coat_loss(fit_coat(alpha), alpha, cosine);
    return vec2f(loss.missing, loss.transmitted);
}
fn means_of(alpha: f32) -> vec2f {
    let fit = fit_coat(alpha);
    return vec2f(fit.mean_missing, fit.mean_transmitted);
}
"""


def hemisphere(count, seed, grazing=True):
    """Unit vectors with positive z; some near the horizon."""
    rng = np.random.default_rng(seed)
    z = rng.random(count) ** (3 if grazing else 1)
    phi = rng.uniform(0, 2 * np.pi, count)
    sine = np.sqrt(1 - z * z)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), z], -1).astype(np.float32)


def view(cosine):
    """A direction to the eye, off the axes."""
    sine = np.sqrt(1 - cosine**2)
    return np.array([sine * 0.8, sine * 0.6, cosine], np.float32)


def brdf(base, metallic, roughness):
    rgb = ", ".join(f"{c:.6f}" for c in base)
    return f"brdf_metallic_roughness(vec3f({rgb}), {metallic:.6f}, {roughness:.6f})"


def vector(v):
    return f"vec3f({', '.join(f'{x:.9f}' for x in v)})"


@pytest.mark.parametrize("metallic", METALLIC)
def test_value_agrees_with_the_gltf_formula(evaluate, metallic):
    n = 1000
    rng = np.random.default_rng(0)
    base, roughness = rng.random((n, 3)).astype(np.float32), rng.random(n).astype(np.float32)
    w_o, w_i = hemisphere(n, 1), hemisphere(n, 2)
    call = f"evaluate_brdf(brdf_metallic_roughness(base(i), {metallic}, roughness(i)), w_o(i), w_i(i))"
    got = evaluate(BRDF, call, "vec4f", base=base, roughness=roughness, w_o=w_o, w_i=w_i)
    up = np.array([0.0, 0.0, 1.0])
    alpha = np.maximum(roughness.astype(np.float64) ** 2, MIN_ALPHA)[:, None]
    expected = gltf_brdf(base, metallic, alpha, up, w_o, w_i)
    # The fits of M and T err by FIT_ERROR at both cosines, their means by 3 % and 0.2 %.
    at_i, at_o, means = (
        np.stack(v) for v in (losses(w_i[:, 2:], alpha), losses(w_o[:, 2:], alpha), mean_losses(alpha))
    )
    most = (at_i + FIT_ERROR) * (at_o + FIT_ERROR) * np.array([1.03, 1.002])[:, None, None]
    off = (most - at_i * at_o) / means / np.pi
    bound = 5e-4 * expected + 1e-6 + metallic * off[0] + (1 - metallic) * base * off[1]
    assert (np.abs(got[:, :3] - expected) < bound).all()


def test_fits_of_the_coats_albedo_agree_with_quadrature(evaluate):
    """M and T at random angles, and at those of about alpha, where both change fastest."""
    rng = np.random.default_rng(1)
    roughness = rng.random(1000)
    alpha = np.maximum(roughness**2, MIN_ALPHA)
    cosine = np.where(np.arange(1000) % 2, rng.random(1000), alpha * 10 ** rng.uniform(-1, 1, 1000)).clip(0, 0.9999)
    call = "loss_of(alpha(i), cosine(i))"
    got = evaluate(BRDF, call, "vec2f", functions=LOSS, alpha=alpha, cosine=cosine)
    expected = np.stack(coat_losses(cosine, alpha, 96, 32), -1)
    assert np.abs(got - expected).max() < FIT_ERROR
    assert (got >= 0).all() and (got <= 1).all()


def test_means_of_the_coats_albedo_are_those_of_the_fits(evaluate):
    """Over the hemisphere, to 0.1 %: their error enters a white furnace."""
    mu, weights = cosines_and_weights(100)
    alpha = np.linspace(MIN_ALPHA**0.25, 1, 50) ** 4
    given = {"alpha": np.repeat(alpha, 100), "cosine": np.tile(mu, 50)}
    got = evaluate(BRDF, "loss_of(alpha(i), cosine(i))", "vec2f", functions=LOSS, **given).reshape(50, 100, 2)
    means = evaluate(BRDF, "means_of(alpha(i))", "vec2f", functions=LOSS, alpha=alpha)
    assert np.allclose(means, np.einsum("amk,m->ak", got, weights), rtol=1e-3)


def test_mirror_peak_is_accurate(evaluate):
    """The narrowest lobe at and near its peak, where cos2 (alpha2 - 1) + 1 would have no digits left."""
    w_o = view(0.8).astype(np.float64)
    angles = np.linspace(0, 4e-3, 100)
    mirror = np.array([-w_o[0], -w_o[1], w_o[2]])
    side = np.cross(mirror, [0, 0, 1.0])
    side /= np.linalg.norm(side)
    w_i = np.cos(angles)[:, None] * mirror + np.sin(angles)[:, None] * side
    got = evaluate(BRDF, f"evaluate_brdf({brdf((1, 1, 1), 1, 0)}, {vector(w_o)}, w_i(i))", "vec4f", w_i=w_i)
    expected = gltf_brdf(np.ones(3), 1.0, MIN_ALPHA, np.array([0, 0, 1.0]), w_o, w_i)
    # Float32 directions resolve 6e-8 of 2e-7 = alpha2 / 5 at the flanks.
    assert np.allclose(got[:5, :3], expected[:5], rtol=0.2)
    assert np.allclose(got[:, :3].sum(), expected.sum(), rtol=0.2)


def test_brdf_is_reciprocal(evaluate):
    """f(a, b) = f(b, a)."""
    a, b = hemisphere(3000, 3), hemisphere(3000, 4)
    for metallic, roughness in ((0.0, 0.2), (0.5, 0.6), (1.0, 0.05), (1.0, 1.0)):
        material = brdf((0.9, 0.5, 0.1), metallic, roughness)
        there, back = (
            evaluate(BRDF, f"evaluate_brdf({material}, {x}(i), {y}(i))", "vec4f", a=a, b=b)[:, :3]
            for x, y in (("a", "b"), ("b", "a"))
        )
        assert np.allclose(there, back, rtol=1e-4, atol=1e-7)


SHINE = """
// Returns f_r as gathering passes put it together, for a source without area.
fn by_parts(b: Brdf, w_o: vec3f, w_i: vec3f) -> vec3f {
    let up = vec3f(0.0, 0.0, 1.0);
    let shine = shine_of(b, loss_to_eye(b, up, w_o), up, w_o, 3.0 * w_i, 9.0, 0.0);
    return shine.coat + b.diffuse * (INV_PI * shine.transmitted);
}
fn transmitted(b: Brdf, w_o: vec3f, w_i: vec3f) -> vec3f {
    let up = vec3f(0.0, 0.0, 1.0);
    return b.diffuse * (INV_PI * transmitted_from(b, up, 3.0 * w_i, w_o));
}
"""


@pytest.mark.parametrize("metallic", METALLIC)
def test_coat_and_base_of_a_small_source_make_up_the_brdf(evaluate, metallic):
    """common/coat.wgsl splits evaluate_brdf into what the blur demodulates and what the base gets."""
    n, rng = 2000, np.random.default_rng(6)
    given = {"roughness": rng.random(n), "w_o": hemisphere(n, 7, False), "w_i": hemisphere(n, 8, False)}
    material = f"brdf_metallic_roughness(vec3f(0.9, 0.5, 0.05), {metallic}, roughness(i))"
    parts = evaluate("common/coat.wgsl", f"by_parts({material}, w_o(i), w_i(i))", "vec3f", functions=SHINE, **given)
    whole = evaluate(BRDF, f"evaluate_brdf({material}, w_o(i), w_i(i))", "vec4f", **given)[:, :3]
    assert np.allclose(parts, whole, rtol=2e-3, atol=1e-6)
    base = evaluate("common/coat.wgsl", f"transmitted({material}, w_o(i), w_i(i))", "vec3f", functions=SHINE, **given)
    assert (base <= whole * 1.001 + 1e-6).all()


def test_brdf_is_zero_below_the_surface(evaluate):
    w = hemisphere(500, 5)
    below = w * np.array([1, 1, -1], np.float32)
    for material in (brdf((1, 1, 1), 0.5, 0.5), "brdf_lambert(vec3f(1.0))"):
        for a, b in (("w", "below"), ("below", "w"), ("below", "below")):
            got = evaluate(BRDF, f"evaluate_brdf({material}, {a}(i), {b}(i))", "vec4f", w=w, below=below)
            assert not got.any()


def test_values_are_finite_at_the_horizon(evaluate):
    z = np.repeat([0.0, 1e-30, 1e-12, 1e-6, 1e-3], 5)
    w_o = np.stack([np.sqrt(1 - z * z), 0 * z, z], -1)
    w_i = np.tile(w_o[::5], (5, 1)) * [-1, 1, 1]
    for roughness in (0.0, 0.5, 1.0):
        for sign in (1, -1):
            got = evaluate(
                BRDF,
                f"evaluate_brdf({brdf((1, 1, 1), 1, roughness)}, w_o(i), w_i(i))",
                "vec4f",
                w_o=w_o,
                w_i=w_i * [sign, 1, 1],
            )
            assert np.isfinite(got).all() and (got >= 0).all()


def grid(rows, columns):
    """Directions at the centres of cells in polar angle and azimuth, (n, 3), and their solid angles, (n,)."""
    edges = np.linspace(0, np.pi / 2, rows + 1)
    theta = ((edges[1:] + edges[:-1]) / 2)[:, None] * np.ones(columns)
    phi = ((np.arange(columns) + 0.5) / columns * 2 * np.pi)[None] * np.ones((rows, 1))
    directions = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    return directions.reshape(-1, 3), np.repeat(-np.diff(np.cos(edges)) * 2 * np.pi / columns, columns)


SAMPLE = """
fn drawn(b: Brdf, w_o: vec3f, u: vec3f) -> vec4f {
    let s = sample_brdf(b, w_o, u.xy, u.z);
    return vec4f(s.w_i, s.pdf);
}
fn weighed(b: Brdf, w_o: vec3f, u: vec3f) -> vec4f {
    let s = sample_brdf(b, w_o, u.xy, u.z);
    return vec4f(s.weight, s.pdf);
}
fn reweighed(b: Brdf, w_o: vec3f, u: vec3f) -> vec4f {
    let s = sample_brdf(b, w_o, u.xy, u.z);
    let f = evaluate_brdf(b, w_o, s.w_i);
    return vec4f(f.rgb * s.w_i.z / max(f.w, 1e-37), f.w);
}
"""


def stratified(count=2**17, seed=0):
    """Random triples; the first two stratified, so that means converge fast."""
    rng = np.random.default_rng(seed)
    side = int(np.sqrt(count))
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    xy = (np.stack([x.ravel(), y.ravel()], -1) + rng.random((side * side, 2))) / side
    return np.concatenate([xy, rng.permutation(side * side)[:, None] / (side * side)], 1).astype(np.float32)


MATERIALS = {
    "lambert": "brdf_lambert(vec3f(0.9, 0.5, 0.05))",
    "rough metal": brdf((0.9, 0.5, 0.05), 1, 1.0),
    "half rough metal": brdf((1, 1, 1), 1, 0.5),
    "polished metal": brdf((1, 1, 1), 1, 0.25),
    "plastic": brdf((0.8, 0.2, 0.1), 0, 0.4),
    "black plastic": brdf((0, 0, 0), 0, 0.5),
    "mixture": brdf((0.9, 0.5, 0.05), 0.5, 0.7),
}


@pytest.mark.parametrize("cosine", COSINES)
@pytest.mark.parametrize("name", MATERIALS)
def test_samples_follow_the_density(evaluate, name, cosine):
    """Chi-square over the hemisphere; the density integrates to the share of samples that stay above the surface."""
    material, w_o = MATERIALS[name], vector(view(cosine))
    directions, solid_angle = grid(512, 2048)
    pdf = evaluate(BRDF, f"evaluate_brdf({material}, {w_o}, w(i)).w", "f32", w=directions).astype(np.float64)
    u = np.random.default_rng(1).random((200_000, 3)).astype(np.float32).clip(0, 1 - 2**-24)
    got = evaluate(BRDF, f"drawn({material}, {w_o}, u(i))", "vec4f", functions=SAMPLE, u=u).astype(np.float64)
    w, drawn_pdf = got[:, :3], got[:, 3]
    valid = drawn_pdf > 0
    assert np.allclose(np.linalg.norm(w[valid], axis=1), 1, atol=1e-5) and (w[valid, 2] > 0).all()
    total = (pdf * solid_angle).sum()
    assert total <= 1.003 and total == pytest.approx(valid.mean(), abs=0.004)
    # 32 x 64 cells, each with the sum over 16 x 32 of the grid.
    expected = (pdf * solid_angle).reshape(32, 16, 64, 32).sum((1, 3))
    theta = np.arctan2(np.hypot(w[valid, 0], w[valid, 1]), w[valid, 2])
    rows = np.minimum((theta / (np.pi / 2) * 32).astype(int), 31)
    columns = ((np.arctan2(w[valid, 1], w[valid, 0]) / (2 * np.pi) % 1) * 64).astype(int) % 64
    observed = np.bincount(rows * 64 + columns, minlength=2048)
    assert chi_square_z(observed, expected * observed.sum() / expected.sum()) < 5


def test_lambert_loses_no_samples(evaluate):
    for cosine in COSINES:
        call = f"drawn({MATERIALS['lambert']}, {vector(view(cosine))}, u(i))"
        assert (evaluate(BRDF, call, "vec4f", functions=SAMPLE, u=stratified(2**12))[:, 3] > 0).all()


def test_weight_is_f_cos_over_pdf(evaluate):
    """Weights are at most 2.5, so the BRDF alone makes no fireflies."""
    rows = [(r, m, c) for r in ROUGHNESS for m in METALLIC for c in COSINES]
    roughness, metallic, cosine = np.repeat(np.array(rows, np.float32), 1024, 0).T
    given = {"roughness": roughness, "metallic": metallic, "u": np.tile(stratified(1024), (len(rows), 1))}
    given["w_o"] = np.stack([view(c) for c in cosine])
    material = "brdf_metallic_roughness(vec3f(0.9, 0.5, 0.05), metallic(i), roughness(i))"
    a, b = (
        evaluate(BRDF, f"{function}({material}, w_o(i), u(i))", "vec4f", functions=SAMPLE, **given)
        for function in ("weighed", "reweighed")
    )
    assert np.allclose(a, b, rtol=1e-4, atol=1e-6) and np.isfinite(a).all() and (a >= 0).all()
    assert a[:, :3].max() <= 2.5


def reflectance(evaluate, material, cosine, functions=SAMPLE):
    """Return the mean weight, (3,): the share of light from w_o that leaves again, by sampling."""
    u = stratified()
    got = evaluate(BRDF, f"weighed({material}, {vector(view(cosine))}, u(i))", "vec4f", functions=functions, u=u)
    return got[:, :3].astype(np.float64).mean(0)


@pytest.mark.parametrize("cosine", COSINES)
def test_lambert_reflects_its_albedo(evaluate, cosine):
    assert np.allclose(reflectance(evaluate, MATERIALS["lambert"], cosine), (0.9, 0.5, 0.05), rtol=1e-5)


FURNACE = """
// Returns the mean weight of samples, by the sequence R2 (Roberts 2018).
fn furnace(b: Brdf, cosine: f32) -> vec3f {
    let w_o = vec3f(0.8 * sqrt(1.0 - cosine * cosine), 0.6 * sqrt(1.0 - cosine * cosine), cosine);
    var sum = vec3f(0.0);
    for (var k = 0u; k < 20000u; k += 1u) {
        let u = vec2f((vec2u(3242174889u, 2447445414u) * k) >> vec2u(8u)) / 16777216.0;
        sum += sample_brdf(b, w_o, u, (f32(k) + 0.5) / 20000.0).weight;
    }
    return sum / 20000.0;
}
"""


def furnace(evaluate, base, metallic, roughness, cosine):
    """Return the reflectances of all materials at all angles, (n, 3)."""
    call = "furnace(brdf_metallic_roughness(base(i), metallic(i), roughness(i)), cosine(i))"
    given = {"base": base, "metallic": metallic, "roughness": roughness, "cosine": cosine}
    return evaluate(BRDF, call, "vec3f", functions=FURNACE, **given).astype(np.float64)


def test_white_surfaces_reflect_all_light(evaluate):
    """White furnace: 1.000 +- 0.5 % at every roughness, metalness and angle."""
    axes = ([0, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1], [0, 0.25, 0.5, 1], [0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 0.9, 1])
    roughness, metallic, cosine = (a.ravel() for a in np.meshgrid(*axes))
    got = furnace(evaluate, np.ones((len(cosine), 3)), metallic, roughness, cosine)
    worst = np.abs(got - 1).max(1).argmax()
    assert np.abs(got - 1).max() < 0.005, (roughness[worst], metallic[worst], cosine[worst], got[worst])


def test_no_colour_gains_light(evaluate):
    rng = np.random.default_rng(3)
    base, metallic, roughness = rng.random((300, 3)), rng.random(300), rng.random(300)
    got = furnace(evaluate, base, metallic, roughness, rng.random(300).clip(0.01))
    assert (got < 1.004).all() and (got > 0).all()


@pytest.mark.parametrize("roughness", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("metallic", [0.0, 0.5])
def test_reflectance_agrees_with_quadrature(evaluate, metallic, roughness):
    """Sampling and quadrature of the glTF formula agree."""
    base, up = np.array([0.9, 0.5, 0.05]), np.array([0.0, 0.0, 1.0])
    w, solid_angle = grid(256, 512)
    for cosine in (1.0, 0.3):
        f = gltf_brdf(base, metallic, roughness**2, up, view(cosine), w)
        expected = (f * (w[:, 2] * solid_angle)[:, None]).sum(0)
        got = reflectance(evaluate, brdf(base, metallic, roughness), cosine)
        assert np.allclose(got, expected, rtol=0.01)


def test_fresnel_is_schlicks_formula(evaluate):
    cosine = np.array([1.0, 0.5, 0.1, 0.0, 1.0000001, -1e-8], np.float32)
    got = evaluate(BRDF, "fresnel_schlick(vec3f(0.04, 0.5, 1.0), cosine(i))", "vec3f", cosine=cosine)
    f0 = np.array([0.04, 0.5, 1.0])
    assert np.allclose(got, f0 + (1 - f0) * np.clip(1 - cosine[:, None].astype(np.float64), 0, 1) ** 5, atol=1e-6)


def test_roughness_zero_is_a_mirror(evaluate):
    """Samples lie within a few alphas of the mirror direction."""
    u = stratified(2**12)
    for cosine in COSINES[:3]:
        w_o = view(cosine)
        got = evaluate(BRDF, f"drawn({brdf((1, 1, 1), 1, 0)}, {vector(w_o)}, u(i))", "vec4f", functions=SAMPLE, u=u)
        assert np.quantile(np.linalg.norm(got[:, :3] - w_o * [-1, -1, 1], axis=1), 0.99) < 0.05
