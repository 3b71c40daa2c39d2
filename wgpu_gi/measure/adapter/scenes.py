"""The scenes, views and settings of the report: the same on every adapter, so that reports can be set side by side."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...camera import Camera
from ...options import TECHNIQUES, Settings
from ...scene.built_in.shapes import sphere
from ...scene.files.camera_files import camera_of
from ...scene.load import read_scene
from ...scene.scene import DirectionalLight, Environment, Instance, Light, Material, Scene, SpotLight
from ...settings import assign

# The view, the sun and the sky in which README.md and tools/README.md measure Crytek's Sponza.
SPONZA_CAMERA = ((5.5, 2.95, -0.35), (4.38, 3.0, -0.35), 60.0)  # position, target, vertical angle in degrees
SPONZA_SUN = DirectionalLight((0.19518, -0.9759, 0.09759), 1.0, (100.0, 95.0, 85.0), name="sun")
SPONZA_SKY = (3.0, 4.0, 6.0)
# Linke 2016: 1024 virtual lights, imperfect shadow maps of 64 x 64, one bounce, one light that is no sky.
LINKE = ("gather.visibility=ism", "vpl.count=1024", "ism.resolution=64", "bounces=1")
PEBBLE_SUBDIVISIONS = 6  # 81,920 triangles
PEBBLE_BUMPS = 0.15  # of the radius


@dataclass(frozen=True)
class Variant:
    """A technique with settings. `single_light`: only the first punctual light, and no sky, if the scene has one."""

    title: str
    gi: str
    set: tuple[str, ...] = ()
    single_light: bool = False

    def settings(self) -> Settings:
        """Return its settings; a frame of the path tracer is one sample per pixel."""
        settings = Settings(gi=self.gi, spp=1, exposure=0.0)
        for text in self.set:
            assign(settings, text)
        return settings

    def scene(self, scene: Scene) -> Scene:
        """Return the scene that it lights."""
        if not self.single_light:
            return scene
        lights: list[Light] = []
        lights += [light for light in scene.lights if isinstance(light, DirectionalLight | SpotLight)][:1]
        return replace(scene, lights=lights, environment=None) if lights else scene


def variants() -> tuple[Variant, ...]:
    """Return every technique at its defaults, and many-light as Linke 2016 measured it; the path tracer last."""
    names = sorted(TECHNIQUES, key=lambda gi: TECHNIQUES[gi].averages_samples)
    found = [Variant(gi, gi) for gi in names]
    found.insert(names.index("many-light") + 1, Variant("many-light, maps", "many-light", LINKE, single_light=True))
    return tuple(found)


VARIANTS = variants()


def cornell() -> tuple[Scene, Camera]:
    """Return the Cornell box under a spot, and its camera."""
    scene = read_scene("cornell-spot")
    return scene, scene.cameras[0]


def sponza(path: str) -> tuple[Scene, Camera]:
    """Return the file of Crytek's Sponza under the sun and the sky of the tables, and their camera.

    Raises GiError for a file that cannot be read.
    """
    scene = read_scene(path)
    scene.lights, scene.environment = [SPONZA_SUN], Environment(SPONZA_SKY)
    position, target, angle = SPONZA_CAMERA
    return scene, Camera.look_at(position, target, yfov_deg=angle)


def pebble() -> tuple[Scene, Camera]:
    """Return a bumpy ball of 81,920 triangles under a sky, and a camera that it nearly fills."""
    ball = sphere(subdivisions=PEBBLE_SUBDIVISIONS, material=Material("stone", (0.5, 0.5, 0.5, 1.0)), name="pebble")
    x, y, z = np.asarray(ball.positions, np.float64).T
    bumps = np.sin(9 * x + 2 * np.sin(7 * y)) * np.sin(8 * y + 2 * np.sin(6 * z)) * np.sin(10 * z + 2 * np.sin(5 * x))
    ball.positions = (ball.positions * (1 + PEBBLE_BUMPS * bumps[:, None])).astype(np.float32)
    scene = Scene([Instance(ball)], [SPONZA_SUN], Environment((1.0, 1.0, 1.0)))
    return scene, camera_of(scene, "auto")
