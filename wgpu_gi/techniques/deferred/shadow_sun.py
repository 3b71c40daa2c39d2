"""Fits the shadow maps of a sun: one covers the whole scene, finer cascades cover the view near the camera.

All are parallel projections whose texels keep their world positions while the camera moves (Valient 2008, "Stable
Rendering of Cascaded Shadow Maps").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MARGIN = 2.5  # texels at each edge: two for the filter, half a one for snapping
RATIO = 4.0  # of successive cascades' depths, and of texels to pixels: tools/README.md, "Constants"
MOST_CASCADES = 4
FLAT = 0.45  # a scene with at most this ratio of height to width, seen from the sun, gets a map of half height
# Steps per doubling of a scene's extent: texels move only past a step, and are at most 2^(1/8) = 9 % too wide.
STEPS = 8


@dataclass
class SunMap:
    """A rectangle perpendicular to the light: centre and half extent along the axes, metres; `flat`: of half height."""

    centre: NDArray[np.float64]  # (2,)
    half: NDArray[np.float64]  # (2,)
    flat: bool = False

    def texel(self, side: int) -> float:
        """Return the width of a texel of a map of `side` texels, metres."""
        inner = np.array([side, side / 2 if self.flat else side]) - 2 * MARGIN
        return float((2 * self.half / inner).max())


def sun_axes(direction: NDArray[np.float64], box: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Return right, up and the direction of travel as rows; right follows the edge of `box` that looks longest."""
    direction = direction / np.linalg.norm(direction)
    across = np.eye(3) - direction[:, None] * direction
    edges = np.ones(3) if box is None else box[1] - box[0]
    # Prefer the first of edges of similar length, so that rounding cannot swap them.
    length = (edges + 1e-3 * edges.max()) * np.linalg.norm(across, axis=1) * (1.0, 0.99, 0.98)
    right = across[np.argmax(length)]
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(right, direction), direction])


def fit_scene(axes: NDArray[np.float64], box: NDArray[np.float64]) -> SunMap:
    """Return the map that shows all of `box` (2, 3)."""
    edges = box[1] - box[0]
    reach = np.maximum(np.abs(axes[:2]) @ edges / 2, 1e-6 * np.linalg.norm(edges))  # above 0 for flat scenes, too
    half = 2.0 ** (np.ceil(np.log2(reach) * STEPS) / STEPS)
    return SunMap(axes[:2] @ box.mean(0), half, bool(half[1] <= FLAT * half[0]))


def fit_view(
    axes: NDArray[np.float64],
    whole: SunMap,
    side: int,
    view: NDArray[np.void],
    surface_samples: NDArray[np.float64],
    cascades: int | None,
) -> list[SunMap]:
    """Return all maps of a sun, the finest first: cascades near the camera, then `whole`.

    There are `cascades` maps, or enough that no texel looks wider than RATIO pixels. There are fewer if a cascade of
    `side` texels would not be finer than `whole`, or if no surface sample (n, 3) is in view.
    """
    spheres = _view_spheres(view, surface_samples, whole.texel(side), cascades)
    maps = [SunMap(axes[:2] @ centre, np.full(2, radius)) for centre, radius in spheres]
    return [m for m in maps if m.texel(side) < whole.texel(side)] + [whole]


def sun_matrix(
    axes: NDArray[np.float64], map: SunMap, side: int, nearest: float, farthest: float
) -> tuple[NDArray[np.float64], float]:
    """Return clip_from_world of a map of `side` texels, and the width of a texel in metres.

    Depth is 1 at `nearest` metres along the light, 0 at `farthest`.
    """
    texel = map.texel(side)
    centre = np.round(map.centre / texel) * texel
    half = texel * np.array([side, side / 2 if map.flat else side]) / 2
    matrix = np.eye(4)
    matrix[:2, :3] = axes[:2] / half[:, None]
    matrix[:2, 3] = -centre / half
    matrix[2, :3] = -axes[2] / (farthest - nearest)
    matrix[2, 3] = farthest / (farthest - nearest)
    return matrix, texel


def _view_spheres(
    view: NDArray[np.void], surface_samples: NDArray[np.float64], texel: float, cascades: int | None
) -> list[tuple[NDArray[np.float64], float]]:
    """Return spheres around the near parts of the view, the nearest first: centre and radius, metres.

    `texel`: a texel's width in the map of the whole scene, metres.
    """
    eye, forward = (np.asarray(view[name], np.float64) for name in ("position", "forward"))
    right, up = (np.asarray(view[name], np.float64) for name in ("right", "up"))
    pixel = 2 * float(np.linalg.norm(up)) / float(view["whole"][1])  # at unit depth, unless parallel
    corner = float(np.hypot(np.linalg.norm(right), np.linalg.norm(up)))  # off the axis, at unit depth, unless parallel
    parallel = bool(view["orthographic"])
    depths = _visible_depths(surface_samples - eye, right, up, forward, parallel)
    if not len(depths) or cascades == 1:
        return []
    if parallel:
        if cascades is None and texel <= RATIO * pixel:
            return []
        # Pixels have one width at all depths: one map covers the view, in steps, so that it does not follow every move.
        step = 2.0 ** np.ceil(np.log2(max(float(np.ptp(depths)), corner)))
        near, far = np.floor(depths.min() / step) * step, np.ceil(depths.max() / step) * step
        return [(eye + forward * (near + far) / 2, float(np.hypot(corner, (far - near) / 2)))]
    # From this depth on, the map of the whole scene suffices.
    enough = max(texel / (RATIO * pixel), float(depths.min()))
    count = cascades or min(1 + int(np.ceil(np.log(enough / depths.min()) / np.log(RATIO) - 1e-9)), MOST_CASCADES)
    # Use steps, so that the maps keep their extents while the camera moves a little.
    nearest = 2.0 ** np.floor(np.log2(depths.min()))
    ratio = max(RATIO, (enough / nearest) ** (1 / max(count - 1, 1)))
    spheres = []
    for far in nearest * ratio ** np.arange(1, count):
        # Find the smallest sphere around the view pyramid from the eye to that depth.
        middle = min(1.0, (1 + corner**2) / 2) * far
        spheres.append((eye + forward * middle, float(max(middle, np.hypot(far - middle, corner * far)))))
    return spheres


def _visible_depths(
    offset: NDArray[np.float64],
    right: NDArray[np.float64],
    up: NDArray[np.float64],
    forward: NDArray[np.float64],
    parallel: bool,
) -> NDArray[np.float64]:
    """Return the view depths of the points that the picture shows; `offset`: points relative to the eye, metres."""
    depth = offset @ forward
    scale = np.ones_like(depth) if parallel else depth
    inside = depth > 0
    for axis in (right, up):
        inside &= np.abs(offset @ axis) <= scale * float(axis @ axis)
    return depth[inside]
