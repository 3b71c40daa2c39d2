"""Layered materials against Mitsuba 3: a ball in a studio, by both path tracers.

Mitsuba has Fresnel's equations where glTF has Schlick's formula, and no second scattering in conductors.
"""

from __future__ import annotations

from dataclasses import replace

import mitsuba_scene
import numpy as np
import pytest
from make_references import _rays, import_mitsuba

import wgpu_gi as gi
from wgpu_gi.errors import GiError
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import Environment, Image, Instance, Material, Mesh, Scene, Texture

pytestmark = pytest.mark.slow

try:
    mitsuba = import_mitsuba()
except GiError as error:
    pytest.skip(str(error), allow_module_level=True)

SIZE, SAMPLES = (24, 24), 512
GOLD = (0.9, 0.6, 0.2)
ALONG = 0.16 + 0.84 * 0.3**2  # alpha along the tangent at roughness 0.4, anisotropy 0.3


def glass(ior, alpha):
    kind = {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha} if alpha else {"type": "dielectric"}
    return kind | {"int_ior": ior, "ext_ior": 1.0}


def solid(roughness, ior=1.5):
    return Material(metallic=0.0, roughness=roughness, transmission=1.0, thickness=1.0, ior=ior)


MIRROR = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha_u": 0.142, "alpha_v": 0.0225}
GOLD_BSDF = {
    "type": "principled",
    "base_color": {"type": "rgb", "value": GOLD},
    "metallic": 1.0,
    "roughness": (0.16 * ALONG) ** 0.25,
    "anisotropic": (1 - 0.16 / ALONG) / 0.9,
}
# Material, Mitsuba's BSDF, and the bounds of the difference of the means and of the relMSE.
CASES = {
    "smooth glass": (solid(0.0), glass(1.5, 0.0), 0.025, 0.006),
    "frosted glass": (solid(0.5), glass(1.5, 0.25), 0.025, 0.008),
    "rough diamond": (solid(0.4, 2.4), glass(2.4, 0.16), 0.015, 0.010),
    "brushed mirror": (
        Material(metallic=1.0, roughness=0.15, anisotropy=((0.142 - 0.0225) / (1 - 0.0225)) ** 0.5),
        {"type": "twosided", "bsdf": MIRROR},
        0.015,
        0.010,
    ),
    "brushed gold": (
        Material(base_color=(*GOLD, 1.0), metallic=1.0, roughness=0.4, anisotropy=0.3),
        GOLD_BSDF,
        0.02,
        0.004,
    ),
}


def ball(material, rows=48, columns=96):
    """A unit sphere with texture coordinates, whose u goes around it."""
    v, u = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    theta, phi = (np.pi * v).clip(1e-3, np.pi - 1e-3), 2 * np.pi * u
    points = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], -1).reshape(-1, 3)
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    below, right = corner + columns + 1, corner + 1
    triangles = np.concatenate([np.stack([corner, below, right], 1), np.stack([right, below, below + 1], 1)])
    return Mesh(
        positions=points.astype(np.float32),
        triangles=triangles.astype(np.uint32),
        normals=points.astype(np.float32),
        texcoords0=np.stack([u, v], -1).reshape(-1, 2).astype(np.float32),
        materials=[material],
    )


def studio():
    """Two lamps and a floor."""
    image = np.full((32, 64, 3), 0.15, np.float32)
    image[4:12, 8:20], image[6:18, 38:44], image[10:14, 52:60] = (3.0, 2.6, 2.2), (1.0, 2.0, 4.0), 2.0
    image[20:] = (0.3, 0.25, 0.2)
    return Environment((1.0, 1.0, 1.0), image)


def by_mitsuba(scene, camera, samples=SAMPLES):
    origin = np.asarray(scene.bounds().mean(0))
    world = mitsuba_scene.mitsuba_scene(mitsuba, scene, origin)
    integrator = mitsuba.load_dict({"type": "path", "max_depth": 40, "rr_depth": 1000})
    points = mitsuba_scene.pixel_centres(SIZE).repeat(samples, 0)
    points = points + np.random.default_rng(1).random(points.shape) - 0.5
    sampler = mitsuba.load_dict({"type": "independent"})
    sampler.seed(3, len(points))
    found = integrator.sample(world, sampler, _rays(mitsuba, camera, SIZE, points, origin))[0]
    return np.array(found).reshape(3, -1).T.reshape(SIZE[1], SIZE[0], samples, 3).mean(2)


@pytest.mark.parametrize("name", CASES)
def test_ball_in_a_studio(monkeypatch, name):
    material, bsdf, most_bias, most_error = CASES[name]
    # A texture makes the tool hand over texture coordinates, which give the tangent.
    material = replace(material, base_color_texture=Texture(Image(np.full((1, 1, 4), 255, np.uint8))))
    camera = gi.Camera.look_at((0, 0.6, 3), (0, 0, 0), yfov_deg=45)
    scene = Scene([Instance(ball(material))], [], studio(), cameras=[camera])
    monkeypatch.setattr(mitsuba_scene, "_bsdf", lambda mi, surface: bsdf)
    truth = by_mitsuba(scene, camera)
    found = np.asarray(gi.render(scene, gi="path", size=SIZE, spp=SAMPLES, bounces=40))
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    on_ball = np.hypot(x + 0.5 - SIZE[0] / 2, y + 0.5 - SIZE[1] / 2) < 0.31 * SIZE[1]
    bias = found[on_ball].mean() / truth[on_ball].mean() - 1
    error = ((found - truth) ** 2 / (truth**2 + 1e-3))[on_ball].mean()
    print(f"{name}: bias {100 * bias:+.2f} %, relMSE {error:.5f}")
    assert abs(bias) < most_bias and error < most_error


def test_frosted_ball_under_a_lamp(monkeypatch):
    """A lamp lights a floor beside and through a frosted ball: all strategies of the path tracer, and their weights."""
    lamp = quad((-0.5, 2.0, -0.5), (1, 0, 0), (0, 0, 1), Material(emission=(8.0, 8.0, 8.0), double_sided=True))
    floor = quad((-3, -1, -3), (0, 0, 6), (6, 0, 0), Material(base_color=(0.6, 0.5, 0.4, 1.0), specular=0.0))
    glassy = replace(solid(0.5), attenuation_distance=1.0)
    scene = Scene([Instance(ball(glassy)), Instance(floor), Instance(lamp)], [], Environment((0.1, 0.1, 0.1)))
    camera = gi.Camera.look_at((0, 1.5, 5), (0, -0.2, 0), yfov_deg=45)
    plain = mitsuba_scene._bsdf

    def bsdf(mi, surface):
        return glass(1.5, 0.25) if surface.material.transmission > 0 else plain(mi, surface)

    monkeypatch.setattr(mitsuba_scene, "_bsdf", bsdf)
    truth = by_mitsuba(scene, camera, 2048)
    found = np.asarray(gi.render(scene, camera=camera, gi="path", size=SIZE, spp=1024, bounces=40))
    for rows in (slice(6, 16), slice(16, 24)):
        bias = found[rows].mean() / truth[rows].mean() - 1
        print(f"bias {100 * bias:+.2f} %")
        assert abs(bias) < 0.015
