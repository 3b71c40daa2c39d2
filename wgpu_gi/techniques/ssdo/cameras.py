"""The placement of further cameras, and the layers and cameras that add nothing.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", section 4. Departure: the first
further camera stands at the main one with a wider lens, since most missing occluders lie beside the picture; the
paper's cameras view the same geometry from aside.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...camera import Camera
from .inputs import ScreenInputs
from .settings import PLACEMENTS, SsdoSettings

# Wide lenses: factor on the tangent of the half angle (or on the height of parallel rays), and the largest half angle.
# tools/README.md, "Constants".
WIDENING = 4.0
WIDEST = math.radians(65.0)
MARGIN = 0.01  # of the scene's size: a camera above it sees its border and stands clear of its top


def screen_views(
    camera: Camera,
    box: NDArray[np.float64],
    size: tuple[int, int],
    triangles: int,
    settings: SsdoSettings,
    has_sky: bool,
    *,
    contacts: bool = False,
) -> tuple[ScreenInputs, list[Camera]]:
    """Return the layers and further cameras that show a scene of `triangles` triangles in a (2, 3) `box`, metres.

    Layers and cameras that would add nothing are left out. `size`: pixels of the picture. contacts: contact shadows
    march through the layers.
    """
    # Layers: a ray hits each triangle once, and a flat scene once; rays need no layer but the first.
    most_layers, reason = max(triangles, 1), f"a ray meets {triangles} surfaces at most"
    if (np.ptp(box, axis=0) == 0).any():
        most_layers, reason = 1, "a ray meets 1 surfaces at most"
    if settings.undecided == "rays" and not contacts:
        most_layers, reason = 1, "rays decide what lies behind the first layer"
    layers = min(settings.layers, most_layers)
    skipped = [(f"gbuffer/opaque_{k}", reason) for k in range(layers, settings.layers)]
    # Cameras: one suffices without a sky; with a sky, occluders above and behind count, too.
    # Rays need none, but slices go on in the wide one, which saves most rays.
    automatic = (3 if has_sky else 1) if settings.undecided == "cameras" else int(settings.sampling == "slices")
    count = settings.cameras if settings.cameras is not None else automatic
    cameras: list[Camera] = []
    names: list[str] = []
    for name in PLACEMENTS[settings.camera_placement][:count]:
        reason = _redundancy(name, camera, box, size)
        if reason:
            skipped.append((f"camera_{name}/opaque", reason))
        else:
            cameras.append(_place(name, camera, box, size))
            names.append(name)
    return ScreenInputs(layers, len(cameras), tuple(skipped), names[:1] == ["wide"]), cameras


def _redundancy(name: str, camera: Camera, box: NDArray[np.float64], size: tuple[int, int]) -> str:
    """Return the reason why a camera would show nothing new; empty if it may show something."""
    corners = np.array(np.meshgrid(*box.T)).reshape(3, -1).T
    clip = np.column_stack([corners, np.ones(8)]) @ camera.clip_from_world(size, np.zeros(3), 1.0, 1.0).T
    depth = (corners - camera.position) @ -camera.world_from_view[:3, 2]
    if name == "wide" and (depth > 0).all() and (np.abs(clip[:, :2]) <= clip[:, 3:]).all():
        return "the picture holds the whole scene"
    if name == "behind" and (depth > 0).all():
        return "nothing lies behind the camera"
    return ""


def _place(name: str, camera: Camera, box: NDArray[np.float64], size: tuple[int, int]) -> Camera:
    """Return the further camera `name` for the main `camera` in a scene within `box`, metres."""
    pose = np.array(camera.world_from_view, np.float64)
    centre, half = box.mean(0), np.ptp(box, axis=0) / 2
    radius = max(float(np.linalg.norm(half)), 1e-30)
    right, up, back, eye = pose[:3].T
    # Place it at the camera, facing forward or backward, with a wide lens.
    if name in ("wide", "behind"):
        turned = pose if name == "wide" else pose @ np.diag([-1.0, 1.0, -1.0, 1.0])
        if camera.orthographic_height is not None:
            return Camera(turned, orthographic_height=WIDENING * camera.orthographic_height)
        tangent = WIDENING * math.tan(camera.yfov / 2) if name == "wide" else math.inf
        return Camera(turned, 2 * max(min(math.atan(tangent), WIDEST), camera.yfov / 2))
    # Place it above the whole scene, with parallel rays.
    if name == "above":
        over = centre + np.array((0.0, (1 + MARGIN) * half[1] + 1e-3 * radius, 0.0))
        looking_down = Camera.look_at(over, centre, (0, 0, -1))
        height = max(float(half[2]), float(half[0]) * size[1] / size[0], 1e-3 * radius)
        looking_down.orthographic_height = 2 * (1 + MARGIN) * height
        return looking_down
    # Place it beside the middle of the view, by the paper's displacement scaled with the bounding sphere.
    middle = eye - back * max(float((eye - centre) @ back), 0.5 * radius)
    aside = right * (radius if name == "right" else -radius)
    return Camera.look_at(middle + aside, middle, up, 90.0)
