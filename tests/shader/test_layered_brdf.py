"""common/brdf.wgsl with clear coat, sheen, anisotropy and transmission: formulas, densities, energy, reciprocity."""

from __future__ import annotations

import numpy as np
import pytest
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
