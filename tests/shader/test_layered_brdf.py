"""common/brdf.wgsl with clear coat, sheen, anisotropy and transmission: formulas, densities, energy, reciprocity."""

from __future__ import annotations

import numpy as np
import pytest
from fit_sheen_albedo import shadowing
from helpers.statistics import chi_square_z

from wgpu_gi.measure.wgsl_evaluator import Evaluator

BRDF = "common/brdf.wgsl"
MIN_ALPHA = 0.001
UP = np.array([0.0, 0.0, 1.0])
TILTED = np.array([0.3, -0.2, np.sqrt(1 - 0.13)])
WHITE = (1.0, 1.0, 1.0)
DRAWS = """
fn drawn(b: Brdf, w_o: vec3f, u: vec3f) -> vec4f {
    let s = sample_brdf(b, w_o, u.xy, u.z);
    return vec4f(s.w_i, s.pdf);
}
fn weighed(b: Brdf, w_o: vec3f, u: vec3f) -> vec4f {
    let s = sample_brdf(b, w_o, u.xy, u.z);
    // Radiance that passes to another medium is scaled by the square of its index.
    let scale = select(1.0, b.eta * b.eta, s.w_i.z < 0.0 && b.eta > 0.0);
    return vec4f(s.weight * scale, s.pdf);
}
fn reweighed(b: Brdf, w_o: vec3f, u: vec3f) -> vec4f {
    let s = sample_brdf(b, w_o, u.xy, u.z);
    let f = evaluate_brdf(b, w_o, s.w_i);
    let scale = select(1.0, b.eta * b.eta, s.w_i.z < 0.0 && b.eta > 0.0);
    return vec4f(f.rgb * abs(s.w_i.z) * scale / max(f.w, 1e-37), f.w);
}
"""


class Layered:
    """A material as WGSL: `make(b: vec3f) -> Brdf` with fields of Layers set by name."""

    def __init__(self, base=WHITE, metallic=0.0, roughness=0.5, outside=True, **layers):
        self.base, self.metallic, self.roughness, self.outside, self.layers = base, metallic, roughness, outside, layers
        ior = layers.get("ior", 1.5)
        self.f0 = np.full(3, ((ior - 1) / (ior + 1)) ** 2)
        self.layers = {"f0": self.f0, **layers}
        self.eta = 0.0
        if layers.get("thickness", 0) > 0 and layers.get("transmission", 0) > 0 and abs(ior - 1) > 0.001:
            self.eta = ior if outside else 1 / ior

    @property
    def functions(self):
        def value(v):
            return f"{v:.9f}" if np.ndim(v) == 0 else f"vec3f({', '.join(f'{x:.9f}' for x in v)})"

        fields = "".join(f"    l.{name} = {value(v)};\n" for name, v in self.layers.items())
        call = f"{value(np.array(self.base))}, {self.metallic:.6f}, {self.roughness:.6f}"
        outside = "true" if self.outside else "false"
        return (
            f"fn made() -> Brdf {{\n    var l = no_layers();\n    l.clearcoat_normal = vec3f(0.0, 0.0, 1.0);\n{fields}"
            f"    return brdf_of({call}, l, vec3f(0.0, 0.0, 1.0), {outside});\n}}\n{DRAWS}"
        )


MATERIALS = {
    "ior 1.8": Layered((0.8, 0.2, 0.1), roughness=0.4, ior=1.8),
    "coloured specular": Layered((0.2, 0.5, 0.7), roughness=0.3, f0=np.array((0.3, 0.1, 0.02)), f90=0.8),
    "coat on plastic": Layered((0.8, 0.2, 0.1), roughness=0.6, clearcoat=1.0, clearcoat_roughness=0.3),
    "tilted coat on metal": Layered(
        (0.9, 0.6, 0.3), 1.0, 0.5, clearcoat=0.7, clearcoat_roughness=0.4, clearcoat_normal=TILTED
    ),
    "cloth": Layered((0.3, 0.1, 0.4), roughness=0.8, sheen=np.array((0.9, 0.8, 1.0)), sheen_roughness=0.4),
    "fine sheen": Layered((0.2, 0.2, 0.2), roughness=1.0, sheen=np.array(WHITE), sheen_roughness=0.15),
    "brushed metal": Layered((0.9, 0.7, 0.5), 1.0, 0.4, anisotropy=0.8, tangent=np.array((0.6, 0.8, 0.0))),
    "brushed plastic": Layered((0.5, 0.5, 0.5), 0.0, 0.5, anisotropy=0.6, tangent=np.array((1.0, 0.0, 0.0))),
    "frosted wall": Layered((0.9, 0.8, 0.7), roughness=0.5, transmission=0.8),
    "frosted wall, low ior": Layered((0.9, 0.8, 0.7), roughness=0.6, transmission=1.0, ior=1.2),
    "frosted glass": Layered(WHITE, roughness=0.5, transmission=1.0, thickness=1.0, ior=1.5),
    "frosted glass, inside": Layered(WHITE, roughness=0.5, transmission=1.0, thickness=1.0, ior=1.5, outside=False),
    "milky diamond": Layered((0.8, 0.8, 0.9), roughness=0.4, transmission=0.6, thickness=1.0, ior=2.4),
    "all layers": Layered(
        (0.8, 0.5, 0.3),
        0.3,
        0.5,
        anisotropy=0.5,
        clearcoat=0.6,
        clearcoat_roughness=0.35,
        clearcoat_normal=TILTED,
        sheen=np.array((0.2, 0.4, 0.3)),
        sheen_roughness=0.5,
        transmission=0.5,
        tangent=np.array((0.0, 1.0, 0.0)),
    ),
    "all layers, solid, inside": Layered(
        (0.8, 0.5, 0.3),
        0.2,
        0.5,
        False,
        anisotropy=0.5,
        clearcoat=0.6,
        clearcoat_roughness=0.35,
        sheen=np.array((0.2, 0.4, 0.3)),
        sheen_roughness=0.5,
        transmission=0.7,
        thickness=0.1,
        ior=1.4,
    ),
}


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


def view(cosine):
    """A direction to the eye, off the axes."""
    sine = np.sqrt(1 - cosine**2)
    return np.array([sine * 0.8, sine * 0.6, cosine], np.float32)


def vector(v):
    return f"vec3f({', '.join(f'{x:.9f}' for x in v)})"


def sphere(rows, columns):
    """Directions at the centres of cells in polar angle and azimuth, (n, 3), and their solid angles, (n,)."""
    edges = np.linspace(0, np.pi, rows + 1)
    theta = ((edges[1:] + edges[:-1]) / 2)[:, None] * np.ones(columns)
    phi = ((np.arange(columns) + 0.5) / columns * 2 * np.pi)[None] * np.ones((rows, 1))
    directions = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    return directions.reshape(-1, 3), np.repeat(-np.diff(np.cos(edges)) * 2 * np.pi / columns, columns)


def random_directions(count, seed, lower=False):
    rng = np.random.default_rng(seed)
    z = rng.random(count) ** 2
    phi = rng.uniform(0, 2 * np.pi, count)
    sine = np.sqrt(1 - z * z)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), -z if lower else z], -1).astype(np.float32)


@pytest.mark.slow
@pytest.mark.parametrize("cosine", [0.9, 0.3])
@pytest.mark.parametrize("name", MATERIALS)
def test_samples_follow_the_density(evaluate, name, cosine):
    """Chi-square over the sphere; the density integrates to the share of samples that are not lost."""
    functions, w_o = MATERIALS[name].functions, vector(view(cosine))
    directions, solid_angle = sphere(768, 1024)
    pdf = evaluate(BRDF, f"evaluate_brdf(made(), {w_o}, w(i)).w", "f32", functions=functions, w=directions)
    u = np.random.default_rng(1).random((200_000, 3)).astype(np.float32).clip(0, 1 - 2**-24)
    got = evaluate(BRDF, f"drawn(made(), {w_o}, u(i))", "vec4f", functions=functions, u=u).astype(np.float64)
    w, valid = got[:, :3], got[:, 3] > 0
    assert np.allclose(np.linalg.norm(w[valid], axis=1), 1, atol=1e-5)
    mass = pdf.astype(np.float64) * solid_angle
    assert mass.sum() <= 1.003 and mass.sum() == pytest.approx(valid.mean(), abs=0.004)
    # 48 x 32 cells, each with the sum over 16 x 32 of the grid.
    expected = mass.reshape(48, 16, 32, 32).sum((1, 3)).ravel()
    theta = np.arctan2(np.hypot(w[valid, 0], w[valid, 1]), w[valid, 2])
    rows = np.minimum((theta / np.pi * 48).astype(int), 47)
    columns = ((np.arctan2(w[valid, 1], w[valid, 0]) / (2 * np.pi) % 1) * 32).astype(int) % 32
    observed = np.bincount(rows * 32 + columns, minlength=1536)
    assert chi_square_z(observed, expected * observed.sum() / expected.sum()) < 5


@pytest.mark.slow
@pytest.mark.parametrize("name", MATERIALS)
def test_weight_is_f_cos_over_pdf(evaluate, name):
    """At all angles, finite and not negative."""
    rng = np.random.default_rng(4)
    u = rng.random((4000, 3)).astype(np.float32).clip(0, 1 - 2**-24)
    w_o = random_directions(4000, 5)
    functions = MATERIALS[name].functions
    a, b = (
        evaluate(BRDF, f"{call}(made(), w_o(i), u(i))", "vec4f", functions=functions, w_o=w_o, u=u)
        for call in ("weighed", "reweighed")
    )
    assert np.allclose(a, b, rtol=1e-4, atol=1e-6) and np.isfinite(a).all() and (a >= 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, m in MATERIALS.items() if "clearcoat_normal" not in m.layers])
def test_layers_are_reciprocal(evaluate, name):
    """f(a, b) = f(b, a) on one side, f(a, b) eta^2 = f(b, a) through a surface.

    A clear coat with a normal of its own is not reciprocal, like any shading normal.
    """
    material = MATERIALS[name]
    a, b = random_directions(2000, 6), random_directions(2000, 7)
    there, back = (
        evaluate(BRDF, f"evaluate_brdf(made(), {x}(i), {y}(i))", "vec4f", functions=material.functions, a=a, b=b)
        for x, y in (("a", "b"), ("b", "a"))
    )
    assert np.allclose(there[:, :3], back[:, :3], rtol=2e-4, atol=1e-6)
    behind = Layered(
        material.base, material.metallic, material.roughness, material.outside != (material.eta > 0), **material.layers
    )
    below = b * [1, 1, -1]
    there = evaluate(BRDF, "evaluate_brdf(made(), a(i), b(i))", "vec4f", functions=material.functions, a=a, b=below)
    # Seen from behind, both directions are mirrored in the surface.
    back = evaluate(
        BRDF, "evaluate_brdf(made(), b(i), a(i))", "vec4f", functions=behind.functions, a=a * [1, 1, -1], b=b
    )
    scale = material.eta**2 if material.eta else 1.0
    # Rounding counts most beside the critical angle.
    assert np.allclose(there[:, :3] * scale, back[:, :3], rtol=0.05, atol=1e-6)


FURNACE = """
// Returns the mean weight of samples, by the sequence R2 (Roberts 2018).
fn furnace(b: Brdf, w_o: vec3f) -> vec3f {
    var sum = vec3f(0.0);
    for (var k = 0u; k < 8192u; k += 1u) {
        let u = vec2f((vec2u(3242174889u, 2447445414u) * k) >> vec2u(8u)) / 16777216.0;
        let z = f32((k * 2654435769u) >> 8u) / 16777216.0;
        sum += weighed(b, w_o, vec3f(u, z)).rgb;
    }
    return sum / 8192.0;
}
// A material of random layers.
fn any(r: vec4f, s: vec4f, t: vec4f, outside: bool) -> Brdf {
    var l = no_layers();
    l.f0 = vec3f(r.x * r.x);
    l.f90 = mix(r.x * r.x, 1.0, r.y);
    l.ior = (1.0 + r.x) / max(1.0 - r.x, 0.1);
    l.clearcoat = select(0.0, r.z, KIND == 0u || KIND == 3u);
    l.clearcoat_roughness = r.w;
    l.clearcoat_normal = vec3f(0.0, 0.0, 1.0);
    l.sheen = vec3f(select(0.0, s.x, KIND == 1u || KIND == 3u));
    l.sheen_roughness = s.y;
    l.anisotropy = select(0.0, s.z, KIND == 2u || KIND == 3u);
    l.transmission = select(0.0, s.w, KIND >= 3u);
    l.thickness = select(0.0, 1.0, KIND == 5u);
    return brdf_of(vec3f(1.0), select(0.0, t.x, KIND < 4u), t.y, l, vec3f(0.0, 0.0, 1.0), outside);
}
"""
KINDS = {"clearcoat": 0, "sheen": 1, "anisotropy": 2, "all thin": 3, "wall": 4, "solid": 5}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_layer_gains_light(evaluate, kind):
    """White materials of random layers, from random directions; noise of the means is below 0.5 %."""
    n, rng = 400, np.random.default_rng(8)
    functions = Layered().functions + FURNACE.replace("KIND", f"{KINDS[kind]}u")
    given = {"r": rng.random((n, 4)), "s": rng.random((n, 4)), "t": rng.random((n, 4)), "w_o": random_directions(n, 9)}
    given["t"][:, 0] = given["t"][:, 0].round()
    for outside in ("true", "false") if kind == "solid" else ("true",):
        call = f"furnace(any(r(i), s(i), t(i), {outside}), w_o(i))"
        got = evaluate(BRDF, call, "vec3f", functions=functions, **given)[:, 0].astype(np.float64)
        worst = got.argmax()
        assert got.max() < 1.0075, (outside, {k: v[worst] for k, v in given.items()}, got[worst])
        assert got.mean() < 1 and np.isfinite(got).all() and (got > 0).all()


@pytest.mark.parametrize("thickness", [0.0, 1.0])
@pytest.mark.parametrize("outside", [True, False])
def test_clear_glass_reflects_or_passes_all_light(evaluate, thickness, outside):
    """Smooth, at all angles, from both sides; a thin wall also if it is rough."""
    for roughness in (0.0,) if thickness else (0.0, 0.3, 0.7, 1.0):
        material = Layered(WHITE, 0.0, roughness, outside, ior=1.5, transmission=1.0, thickness=thickness)
        w_o = np.stack([view(c) for c in (0.02, 0.1, 0.3, 0.6, 0.74, 0.76, 0.9, 1.0)])
        functions = material.functions + FURNACE.replace("KIND", "0u")
        got = evaluate(BRDF, "furnace(made(), w_o(i))", "vec3f", functions=functions, w_o=w_o)
        # Rounding of refraction at grazing angles and at the critical angle loses a little.
        assert np.abs(got - 1).max() < 0.006


EXTREMES = [
    Layered((0, 0, 0), 0.0, 0.0, transmission=1.0, thickness=1.0),
    Layered(WHITE, 0.0, 0.0, ior=1.0, transmission=1.0, thickness=1.0),
    Layered(WHITE, 0.0, 1.0, ior=1.002, transmission=1.0, thickness=1.0),
    Layered(WHITE, 0.0, 0.0, False, ior=1.002, transmission=1.0, thickness=1.0),
    Layered(WHITE, 0.0, 0.5, ior=0.7, transmission=1.0, thickness=1.0),
    Layered(WHITE, 0.0, 0.0, ior=50.0, transmission=1.0, thickness=1.0),
    Layered(WHITE, 0.0, 1.0, False, ior=50.0, transmission=1.0, thickness=1.0),
    Layered(WHITE, 0.5, 1.0, f0=np.zeros(3), f90=0.0, transmission=1.0),
    Layered(WHITE, 1.0, 0.0, anisotropy=1.0, tangent=np.array((0.0, 0.0, 1.0))),
    Layered(WHITE, 0.0, 1.0, sheen=np.array(WHITE), sheen_roughness=0.0),
    Layered(WHITE, 0.0, 0.0, clearcoat=1.0, clearcoat_roughness=0.0, clearcoat_normal=np.array((0.8, 0.0, -0.6))),
    Layered((0, 0, 0), 0.0, 0.0, f0=np.zeros(3), f90=0.0, clearcoat=1.0, clearcoat_normal=np.array((0.0, 0.0, -1.0))),
]


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(EXTREMES)))
def test_extreme_materials_are_finite(evaluate, number):
    """At grazing angles and everywhere: no NaN, nothing negative, no gain."""
    cosines = np.repeat([1e-30, 1e-12, 1e-6, 1e-3, 0.03, 0.5, 1.0], 200)
    w_o = np.stack([view(c) for c in cosines])
    w_i = np.tile(np.concatenate([random_directions(100, 10), random_directions(100, 11, True)]), (7, 1))
    w_i[::5] = -w_o[::5]
    w_i[1::5] = w_o[1::5] * [-1, -1, 1]
    u = np.random.default_rng(12).random((len(w_o), 3)).astype(np.float32).clip(0, 1 - 2**-24)
    functions = EXTREMES[number].functions + FURNACE.replace("KIND", "0u")
    given = {"functions": functions, "w_o": w_o, "w_i": w_i, "u": u}
    for call in ("evaluate_brdf(made(), w_o(i), w_i(i))", "weighed(made(), w_o(i), u(i))"):
        got = evaluate(BRDF, call, "vec4f", **given)
        assert np.isfinite(got).all() and (got >= 0).all()
    drawn = evaluate(BRDF, "drawn(made(), w_o(i), u(i))", "vec4f", **given)
    assert np.isfinite(drawn).all()
    some = w_o[600::100]
    reflected = evaluate(BRDF, "furnace(made(), w_o(i))", "vec3f", functions=functions, w_o=some)
    assert np.isfinite(reflected).all() and reflected.max() < 1.006


def test_equal_media_let_light_pass_straight(evaluate):
    """An index of refraction of 1 has no interface: all samples leave within a few MIN_ALPHA of -w_o."""
    u = np.random.default_rng(13).random((500, 3)).astype(np.float32)
    for roughness in (0.0, 1.0):
        material = Layered(WHITE, 0.0, roughness, ior=1.0, transmission=1.0, thickness=1.0)
        w_o = view(0.4)
        got = evaluate(BRDF, f"drawn(made(), {vector(w_o)}, u(i))", "vec4f", functions=material.functions, u=u)
        assert np.quantile(np.linalg.norm(got[:, :3] + w_o, axis=1), 0.95) < 0.03


def half(a, b):
    h = a + b
    return h / np.linalg.norm(h, axis=-1, keepdims=True)


def ggx(axes, h, w_i, w_o):
    """D V of directions in the lobe's axes."""
    lengths = [np.sqrt((axes[0] * w[:, 0]) ** 2 + (axes[1] * w[:, 1]) ** 2 + w[:, 2] ** 2) for w in (w_i, w_o)]
    slope = (h[:, 0] / axes[0]) ** 2 + (h[:, 1] / axes[1]) ** 2 + h[:, 2] ** 2
    below = 2 * (w_i[:, 2] * lengths[1] + w_o[:, 2] * lengths[0])
    return 1 / (np.pi * axes[0] * axes[1] * slope**2) / below


def schlick(f0, cosine):
    return f0 + (1 - f0) * (1 - cosine) ** 5


def lobe_values(name, w_o, w_i):
    """Return f of single lobes by their papers' formulas."""
    if name == "refraction":
        eta, alpha = 1.5, 0.25
        h = half(-w_o, -eta * w_i)
        h *= np.sign(h[:, 2:])
        o_h, i_h = (w_o * h).sum(1), (w_i * h).sum(1)
        d = alpha**2 / (np.pi * (h[:, 2] ** 2 * (alpha**2 - 1) + 1) ** 2)
        masks = [2 / (1 + np.sqrt(1 + alpha**2 * (1 / w[:, 2] ** 2 - 1))) for w in (w_o, w_i)]
        f = np.abs(o_h * i_h / (w_o[:, 2] * w_i[:, 2])) * (1 - schlick(0.04, o_h)) * masks[0] * masks[1] * d
        return np.where((o_h > 0) & (i_h < 0), f / (eta * i_h + o_h) ** 2, 0)
    h = half(w_o, w_i)
    v_h = (w_i * h).sum(1)
    if name == "mirror coat":
        return schlick(0.04, v_h) * ggx((0.09, 0.09), h, w_i, w_o)
    if name == "brushed":
        return schlick(0.5, v_h) * ggx((0.16 + 0.84 * 0.36, 0.16), h, w_i, w_o)
    a = 0.36
    distribution = (2 + 1 / a) * (1 - h[:, 2] ** 2) ** (0.5 / a) / (2 * np.pi)
    shadowed = 1 + sum(shadowing(w[:, 2], a) for w in (w_i, w_o))
    return distribution / (shadowed * 4 * w_i[:, 2] * w_o[:, 2])


LOBES = {
    "refraction": Layered(WHITE, 0.0, 0.5, transmission=1.0, thickness=1.0, ior=1.5),
    "mirror coat": Layered((0, 0, 0), 0.0, 0.5, f0=np.zeros(3), f90=0.0, clearcoat=1.0, clearcoat_roughness=0.3),
    "brushed": Layered((0, 0, 0), 0.0, 0.4, f0=np.full(3, 0.5), anisotropy=0.6, tangent=np.array((1.0, 0.0, 0.0))),
    "sheen": Layered((0, 0, 0), 0.0, 0.5, f0=np.zeros(3), f90=0.0, sheen=np.array(WHITE), sheen_roughness=0.6),
}


@pytest.mark.parametrize("name", LOBES)
def test_lobes_are_those_of_their_papers(evaluate, name):
    """Walter et al. 2007, Estevez and Kulla 2017, and GGX of one and two widths."""
    w_o, w_i = random_directions(2000, 14), random_directions(2000, 15, lower=name == "refraction")
    keep = (w_o[:, 2] > 0.02) & (np.abs(w_i[:, 2]) > 0.02)
    functions = LOBES[name].functions
    got = evaluate(
        BRDF, "evaluate_brdf(made(), w_o(i), w_i(i))", "vec4f", functions=functions, w_o=w_o[keep], w_i=w_i[keep]
    )
    expected = lobe_values(name, w_o[keep].astype(np.float64), w_i[keep].astype(np.float64))
    assert np.allclose(got[:, 1], expected, rtol=2e-3, atol=2e-5) and expected.max() > 0.1
