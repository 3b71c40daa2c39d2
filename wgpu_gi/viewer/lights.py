"""The part of the panel for the lights and the environment of the scene."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from imgui_bundle import imgui

from ..scene.scene import DirectionalLight
from .session import Session

DIMMEST, BRIGHTEST = 1e-3, 1e6  # candela or lux, ends of the slider: a candle has 1 cd, the sun 1e5 lx
UNITS = {"PointLight": "cd", "SpotLight": "cd", "DirectionalLight": "lx"}


class LightPanel:
    """Changes the lights of the session's scene in place."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def draw(self) -> None:
        """Draw this part of the panel with imgui."""
        scene = self._session.renderer.scene
        if not imgui.collapsing_header("lights"):
            return
        if not scene.lights and scene.environment is None:
            imgui.text_wrapped("Only the materials of the scene emit light.")
        changed = [self._light(i, light) for i, light in enumerate(scene.lights)]
        if scene.environment is not None:
            changed.append(self._environment(scene.environment))
        if any(changed):
            self._session.relit()

    def _light(self, number: int, light: Any) -> bool:
        kind = type(light).__name__
        imgui.push_id(number)
        imgui.text(f"{light.name or f'light {number}'} ({kind})")
        flags = imgui.SliderFlags_.logarithmic
        brighter, intensity = imgui.slider_float(
            f"intensity ({UNITS[kind]})", light.intensity, DIMMEST, BRIGHTEST, "%.4g", flags
        )
        recoloured, color = imgui.color_edit3("colour (linear)", list(light.color), imgui.ColorEditFlags_.float)
        if brighter:
            light.intensity = intensity
        if recoloured:
            light.color = tuple(color)
        turned = isinstance(light, DirectionalLight) and self._direction(light)
        imgui.pop_id()
        return brighter or recoloured or turned

    def _direction(self, light: DirectionalLight) -> bool:
        """Edit the direction to the sun; return whether it changed."""
        azimuth, elevation = angles_of(light)
        round_, azimuth = imgui.slider_float("azimuth (deg)", azimuth, -180.0, 180.0, "%.1f")
        up, elevation = imgui.slider_float("elevation (deg)", elevation, -90.0, 90.0, "%.1f")
        if round_ or up:
            light.direction = direction_from(azimuth, elevation)
        return bool(round_ or up)

    def _environment(self, environment: Any) -> bool:
        imgui.push_id("environment")
        imgui.text(f"environment {environment.name}")
        flags = imgui.ColorEditFlags_.float | imgui.ColorEditFlags_.hdr
        recoloured, color = imgui.color_edit3("radiance", list(environment.color), flags)
        turned, degrees = imgui.slider_float("rotation (deg)", math.degrees(environment.rotation), -180.0, 180.0)
        if recoloured:
            environment.color = tuple(color)
        if turned:
            environment.rotation = math.radians(degrees)
        imgui.pop_id()
        return recoloured or turned


def angles_of(light: DirectionalLight) -> tuple[float, float]:
    """Return azimuth (from -Z towards +X) and elevation of a sun in degrees."""
    x, y, z = -np.asarray(light.direction, np.float64)
    return math.degrees(math.atan2(x, -z)), math.degrees(math.atan2(y, math.hypot(x, z)))


def direction_from(azimuth: float, elevation: float) -> tuple[float, float, float]:
    """Return the unit vector along which the light of a sun at these degrees travels."""
    a, e = math.radians(azimuth), math.radians(elevation)
    return -math.sin(a) * math.cos(e), -math.sin(e), math.cos(a) * math.cos(e)
