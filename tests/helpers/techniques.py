"""Renders any technique with checks of every buffer, and compares pictures relative to the technique's noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from wgpu_gi.camera import Camera
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.built_in.scenes import BUILTIN_SCENES, matte
from wgpu_gi.scene.built_in.shapes import grid, quad, sphere
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, PointLight, Scene, SpotLight
from wgpu_gi.techniques.deferred.shadow_views import ShadowSettings
from wgpu_gi.techniques.many_light.ism import IsmSettings
from wgpu_gi.techniques.many_light.rsm import RsmSettings
from wgpu_gi.techniques.many_light.vpl import VplSettings
from wgpu_gi.techniques.ssil.ssil import SsilSettings

from .medley import medley
from .pictures import moved, scaling
from .skies import gradient_sky

Layers = dict[str, np.ndarray]

LAYERS = ("radiance", "direct", "indirect", "emission")
SIZE = (32, 18)
SPP = 16  # of the path tracer
# Small pictures need no large maps, whose checks would take most of the time.
SHADOWS = ShadowSettings(atlas=2048, sun=1024, spot=256, point=256, area=64)
# Few virtual point lights, for the same reason, but enough that no interleaved subset is empty.
VPLS = VplSettings(count=128, paths=1024)
RSM = RsmSettings(texels=1024)
MAPS = IsmSettings(resolution=32)
# Half the resolution of so small a picture would show too little of a scene.
LEVELS = SsilSettings(start="full")
# Bounds for deterministic layers, over the mean radiance. A pixel whose ray or shadow ray passes an edge within the
# rounding of float32 may see either side; all others are equal but for rounding.
SAME_PIXEL = 2e-3
SAME_MEAN = 1e-3
EDGE_SHARE = 0.02  # of pixels at such edges
SIGMAS = 5.0  # bound for the means of noisy layers; normal noise exceeds it once in two million
# Numbers of seeds for techniques whose pixels share random lights, so that noise does not average out in a picture.
# SSDO and SSAO have a known fault that these seeds' noise covers: from 1e-4 m they find up to 4 % less light than from
# 1e-2 m (tests/truth/README.md, "SSDO close to a surface").
OTHER_SEEDS = {"many-light": 4, "ssdo": 4, "ssao": 4, "ssil": 4}


def make_settings(technique: str, frames: int = 1, **fields: object) -> Settings:
    """Return settings of a technique, with rays through pixel centres, or jittered ones for several frames."""
    camera = CameraSettings(jitter=frames > 1, frames=frames)
    small = {
        "shadow": replace(SHADOWS),
        "vpl": replace(VPLS),
        "rsm": replace(RSM),
        "ism": replace(MAPS),
        "ssil": replace(LEVELS),
    }
    return Settings(gi=technique, camera=camera, **{"spp": SPP, **small, **fields})


def picture(
    technique: str,
    scene: Scene,
    size: tuple[int, int] = SIZE,
    *,
    camera: Camera | None = None,
    frames: int = 1,
    **fields: object,
) -> Layers:
    """Render a scene to the end and return all buffers of the technique, as float64, by name.

    The buffers of every pass are checked. `fields` are those of Settings.
    """
    renderer = Renderer(scene, size=size, camera=camera, settings=make_settings(technique, frames, **fields))
    renderer.run(check=True)
    return read_all(renderer)


def read_all(renderer: Renderer) -> Layers:
    """Read all buffers back and assert that they are finite and within their ranges."""
    got = {name: renderer.read_back(name).astype(np.float64) for name in renderer.buffers}
    for name, values in got.items():
        assert np.isfinite(values).all(), name
        assert name in ("normal", "position", "motion") or (values >= 0).all(), name
    lengths = np.linalg.norm(got["normal"], axis=-1)[got["depth"] > 0]
    assert np.allclose(lengths, 1, atol=1e-5)
    return got


def noise_of(technique: str, layers: Layers, scene: Scene, size: tuple[int, int] = SIZE, **arguments: object) -> Layers:
    """Return the change of each layer by other seeds, (seeds, height, width, 3); zero for deterministic techniques."""
    if not is_noisy(technique):
        return {name: np.zeros_like(layers[name])[None] for name in LAYERS}
    seeds = range(1, 1 + OTHER_SEEDS.get(technique, 1))
    others = [picture(technique, scene, size, seed=seed, **arguments) for seed in seeds]
    return {name: np.stack([other[name] - layers[name] for other in others]) for name in LAYERS}


def sigma_of(noise: np.ndarray) -> np.ndarray:
    """Return the standard deviation, per channel, of the difference between a layer's means in two pictures.

    It is estimated from differences between seeds, which have the same variance as that of two pictures.
    """
    independent = np.sqrt((noise**2).sum((1, 2)).mean(0)) / noise[0, ..., 0].size
    # Noise that all pixels share needs several seeds to be estimated.
    common = np.sqrt((noise.mean((1, 2)) ** 2).mean(0)) if len(noise) > 1 else 0.0
    return np.maximum(independent, common)


@cache
def is_noisy(technique: str) -> bool:
    """Tell whether the seed changes a picture of the medley."""
    pictures = [picture(technique, medley_under_a_sky(), (24, 16), seed=seed)["radiance"] for seed in (0, 1)]
    return not np.array_equal(*pictures)


@cache
def reference(technique: str, name: str) -> tuple[Layers, Layers]:
    """Return the picture of one of SCENES and its noise."""
    layers = picture(technique, SCENES[name]())
    return layers, noise_of(technique, layers, SCENES[name]())


def assert_same(
    got: Layers, expected: Layers, noise: Layers, *, pixel: float = SAME_PIXEL, mean: float = SAME_MEAN
) -> None:
    """Assert that two pictures agree: pixel by pixel for deterministic layers, else in the mean.

    `pixel` and `mean` are bounds of rounding, relative to the mean radiance.
    """
    scale = max(float(expected["radiance"].mean()), 1e-300)
    for name in LAYERS:
        off = (got[name] - expected[name]) / scale
        sigma = sigma_of(noise[name]) / scale
        assert (np.abs(off.mean((0, 1))) <= mean + SIGMAS * sigma).all(), (name, off.mean((0, 1)), sigma)
        if not noise[name].any():
            differing = (np.abs(off).max(-1) > pixel).mean()
            assert differing <= EDGE_SHARE, (name, differing, np.abs(off).max())


# ------------------------------------------------------------------------------------------------ Scenes


def medley_under_a_sky() -> Scene:
    """Return the medley under a sky with a sun, a spot and a point light.

    It has no unlit surfaces, whose radiance would not depend on the light.
    """
    scene = medley()
    scene.instances = [i for i in scene.instances if not any(m.unlit for m in i.mesh.materials)]
    scene.environment = Environment((0.3, 0.3, 0.4), gradient_sky(16, 50.0), 0.5)
    scene.lights += [
        DirectionalLight((0.3, -1.0, -0.4), 2.0, (1.0, 0.9, 0.7)),
        SpotLight((-3.0, 4.0, 3.0), (0.6, -1.0, -0.5), 0.2, 0.5, 60.0, (0.5, 0.7, 1.0)),
    ]
    return scene


# Scenes at rest; `walk` moves and has tests of its own, and `materials` is noisy.
SCENES: dict[str, Callable[[], Scene]] = {**BUILTIN_SCENES, "medley": medley_under_a_sky}
del SCENES["walk"], SCENES["materials"]


def ball_on_a_floor(lights: object = (), environment: Environment | None = None, emission: float = 0.0) -> Scene:
    """Return a ball and a lamp of radiance `emission` over a floor: mostly direct light, shadows of all sources."""
    ball = sphere((0.0, 0.5, 0.0), 0.5, material=matte((0.8, 0.6, 0.4)))
    lamp = quad((-1, 1.5, -1), (0.6, 0, 0), (0, 0, 0.6), matte(0.0, "lamp", emission, double_sided=False))
    scene = Scene([Instance(grid(4.0, material=matte(0.5))), Instance(ball), Instance(lamp)], list(lights), environment)
    scene.cameras = [Camera.look_at((0, 2, 3), (0, 0.3, 0))]
    return scene


def scaled(scene: Scene, factor: float) -> Scene:
    """Return the scene `factor` times as large, with intensities scaled so that it looks the same."""
    large = moved(scene, scaling(factor))
    for light in large.lights:
        if not isinstance(light, DirectionalLight):
            light.intensity *= factor**2
    return large


def brighten(scene: Scene, factor: float) -> Scene:
    """Multiply all light in a scene, in place; return it."""
    for light in scene.lights:
        light.intensity *= factor
    for material in scene.materials:
        material.emission = tuple(factor * e for e in material.emission)
    if scene.environment is not None:
        scene.environment.color = tuple(factor * c for c in scene.environment.color)
    return scene


def swap_channels(scene: Scene) -> Scene:
    """Permute red, green and blue to green, blue and red in a scene, in place; return it."""

    def swapped(rgb: object) -> tuple[float, ...]:
        r, g, b, *rest = rgb
        return (g, b, r, *rest)

    for light in scene.lights:
        light.color = swapped(light.color)
    images = {}
    for material in scene.materials:
        material.base_color, material.emission = swapped(material.base_color), swapped(material.emission)
        for texture in (material.base_color_texture, material.emission_texture):
            if texture is not None:
                images[id(texture.image)] = texture.image
    for image in images.values():
        image.pixels = image.pixels[..., [1, 2, 0, 3]].copy()
    for mesh in scene.meshes:
        if mesh.colors is not None:
            mesh.colors = mesh.colors[:, [1, 2, 0, 3]].copy()
    if scene.environment is not None:
        scene.environment.color = swapped(scene.environment.color)
        if scene.environment.image is not None:
            scene.environment.image = scene.environment.image[..., [1, 2, 0]].copy()
    return scene


def thousand_lights(kind: type[PointLight] | type[SpotLight] = PointLight) -> list[PointLight | SpotLight]:
    """Return a thousand lights of all colours, spread over a dome."""
    rng = np.random.default_rng(0)
    places = rng.normal(size=(1000, 3)) * (1.0, 0.3, 1.0) + (0.0, 2.5, 0.0)
    colors = rng.uniform(0.2, 1.0, (1000, 3))
    pairs = zip(places.tolist(), colors.tolist(), strict=True)
    if kind is SpotLight:
        return [SpotLight(p, (-p[0], -p[1], -p[2]), 0.1, 0.6, 0.02, tuple(c)) for p, c in pairs]
    return [PointLight(p, 0.01, tuple(c)) for p, c in pairs]
