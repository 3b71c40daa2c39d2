"""What screen space knows of the scene: the layers that the camera peels, and further cameras.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", section 4. Departure: the first
further camera stands where the camera does and sees more to all sides, since most of what is missed lies beside the
picture; the paper's looks at the same things from aside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...camera import Camera
from ...gpu.graph import Graph
from ...gpu.handles import Handle
from ...settings import setting
from ..shared.gbuffer import Gbuffer, declare_gbuffer
from .inputs import ScreenInputs, SsdoInputs

MAX_LAYERS = MAX_CAMERAS = 4
PLACES = {"wide": ("wide", "above", "behind", "left"), "aside": ("left", "right", "above", "behind")}
# Of the tangents of the camera's half angle, or of its height; and the most that half an angle may be. Chosen.
WIDER = 4.0
WIDEST = math.radians(65.0)


@dataclass
class SsdoSettings:
    """How light is found in screen space."""

    directions: int = setting(
        2, "Directions per pixel and frame.", "directions", range=(1, 64), presets={"low": 1, "high": 4}
    )
    steps: int = setting(16, "Points along each direction.", "points", range=(1, 64), presets={"low": 8, "high": 24})
    bounce: bool = setting(True, "Add the light that nearby surfaces reflect.")
    sampling: str = setting(
        "cosine",
        "Draw directions by the cosine and filter the environment, or draw every other one by the environment's picture"
        " and do not.",
        choices=("cosine", "picture"),
    )
    layers: int = setting(1, "Layers of depth peeling.", "layers", range=(1, MAX_LAYERS), presets={"high": 2})
    cameras: int | None = setting(
        None,
        "Further cameras, of ssdo.places; none for one, and for three where there is an environment, which roofs and"
        " walls behind the camera hide.",
        "cameras",
        range=(0, MAX_CAMERAS),
        presets={"low": 0},
    )
    places: str = setting(
        "wide",
        "Where they are, in order: wide (a wide lens at the camera, above, behind, left), or aside (left, right, above,"
        " behind).",
        choices=(*PLACES,),
    )
    reach: float = setting(
        10.0,
        "How far occluders are looked for, at most, in heights of the picture at the pixel; never beyond the scene.",
        "heights",
        range=(0.01, 100.0),
    )
    half: bool = setting(True, "Search for every other pixel of every other row only.", presets={"high": False})
    near: bool = setting(
        False,
        "With --gi many-light: take the light of what is near, and of what hides it, from the picture instead of from"
        " virtual point lights.",
    )
    near_reach: float = setting(
        0.1, "How far that goes, in heights of the picture at the pixel.", "heights", range=(0.001, 10.0)
    )
    blur: bool = setting(True, "Average over the squares of pixels that share directions among them, up to edges.")


@dataclass
class Sources:
    """G-buffers: the camera's layers, the nearest first, and of further cameras, the uniform `view_1` first."""

    layers: list[Gbuffer]
    cameras: list[Gbuffer]

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.layers) + len(self.cameras)

    @property
    def constants(self) -> dict[str, int]:
        """Those of `wgsl/ssdo/hit.wgsl`."""
        return {"LAYERS": len(self.layers), "CAMERAS": len(self.cameras)}

    def gbuffer(self, number: int) -> Gbuffer:
        """Return one of them, the layers first."""
        return [*self.layers, *self.cameras][number]

    def view_of(self, number: int) -> str:
        """Return the uniform with its view."""
        return view_name(max(number - len(self.layers) + 1, 0))

    def is_outward(self, number: int) -> bool:
        """Tell whether it may show insides of surfaces, whose outsides are lit: of layers but the first, that is so."""
        return 0 < number < len(self.layers)

    def reads(self, graph: Graph) -> dict[str, Handle]:
        """Return what passes read that import `wgsl/ssdo/hits.wgsl`."""
        found: dict[str, Handle] = {f"depth_{k}": graph.neutral("texture_depth_2d") for k in range(8)}
        found |= {f"depth_{k}": layer.depth for k, layer in enumerate(self.layers)}
        return found | {f"depth_{MAX_LAYERS + k}": camera.depth for k, camera in enumerate(self.cameras)}

    def uniforms(self) -> dict[str, str]:
        """Return the views that such passes bind; those that there are not stand for the camera's."""
        cameras = range(MAX_CAMERAS + 1)
        return {f"view_{k}": view_name(k) if k <= len(self.cameras) else "view" for k in cameras}


def view_name(number: int) -> str:
    """Return the uniform of a further camera, from 1 on, or of the camera itself, 0."""
    return f"view_{number}" if number else "view"


def screen_views(
    camera: Camera,
    box: NDArray[np.float64],
    size: tuple[int, int],
    triangles: int,
    settings: SsdoSettings,
    has_sky: bool,
) -> tuple[ScreenInputs, list[Camera]]:
    """Return what there is to see of a scene of so many triangles within a (2, 3) `box`, and the further cameras.

    Layers and cameras that add nothing are left out.
    """
    wanted = settings.cameras if settings.cameras is not None else 3 if has_sky else 1
    skipped: list[tuple[str, str]] = []
    crossed = 1 if (np.ptp(box, axis=0) == 0).any() else max(triangles, 1)
    layers = min(settings.layers, crossed)
    skipped += [
        (f"gbuffer/opaque_{k}", f"a ray meets {crossed} surfaces at most") for k in range(layers, settings.layers)
    ]
    cameras: list[Camera] = []
    for name in PLACES[settings.places][:wanted]:
        reason = _needless(name, camera, box, size)
        if reason:
            skipped.append((f"camera_{name}/opaque", reason))
        else:
            cameras.append(_place(name, camera, box, size))
    return ScreenInputs(layers, len(cameras), tuple(skipped)), cameras


def _needless(name: str, camera: Camera, box: NDArray[np.float64], size: tuple[int, int]) -> str:
    """Return why a camera would show nothing that the picture does not, or nothing at all; empty if it may."""
    corners = np.array(np.meshgrid(*box.T)).reshape(3, -1).T
    clip = np.column_stack([corners, np.ones(8)]) @ camera.clip_from_world(size, np.zeros(3), 1.0, 1.0).T
    depth = (corners - camera.position) @ -camera.world_from_view[:3, 2]
    if name == "wide" and (depth > 0).all() and (np.abs(clip[:, :2]) <= clip[:, 3:]).all():
        return "the picture holds the whole scene"
    if name == "behind" and (depth > 0).all():
        return "nothing lies behind the camera"
    return ""


def _place(name: str, camera: Camera, box: NDArray[np.float64], size: tuple[int, int]) -> Camera:
    pose = np.array(camera.world_from_view, np.float64)
    centre, half = box.mean(0), np.ptp(box, axis=0) / 2
    radius = max(float(np.linalg.norm(half)), 1e-30)
    right, up, back, eye = pose[:3].T
    if name in ("wide", "behind"):
        turned = pose if name == "wide" else pose @ np.diag([-1.0, 1.0, -1.0, 1.0])
        if camera.orthographic_height is not None:
            return Camera(turned, orthographic_height=WIDER * camera.orthographic_height)
        tangent = WIDER * math.tan(camera.yfov / 2) if name == "wide" else math.inf
        return Camera(turned, 2 * max(min(math.atan(tangent), WIDEST), camera.yfov / 2))
    if name == "above":
        over = centre + np.array((0.0, 1.01 * half[1] + 1e-3 * radius, 0.0))
        looking_down = Camera.look_at(over, centre, (0, 0, -1))
        looking_down.orthographic_height = 2.02 * max(float(half[2]), float(half[0]) * size[1] / size[0], 1e-3 * radius)
        return looking_down
    # Aside of the middle of what is in view, by the paper's displacement scaled with the bounding sphere.
    middle = eye - back * max(float((eye - centre) @ back), 0.5 * radius)
    aside = right * (radius if name == "right" else -radius)
    return Camera.look_at(middle + aside, middle, up, 90.0)


def declare_sources(graph: Graph, scene: SsdoInputs) -> Sources:
    """Declare the G-buffers of the layers and of the further cameras, whose uniforms `view_1` ... are there."""
    for name, reason in scene.screen.skipped:
        graph.skip(name, reason)
    numbers = range(1, scene.screen.cameras + 1)
    return Sources(
        declare_gbuffer(graph, scene, layers=scene.screen.layers),
        [declare_gbuffer(graph, scene, name=f"camera_{k}", view=view_name(k))[0] for k in numbers],
    )
