"""The shadow views of all lights: their number, matrices and places in one atlas.

A point light has the six faces of a cube, a sample of an emitter the half cube over its surface (Cohen and Greenberg
1985, "The Hemi-Cube"), a spot one view or, if it is wide, a half cube; for suns see `shadow_sun`. Departures: depth is
reversed and infinite; a margin widens every view, so that filters stay inside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...gpu.wgsl.load import load
from ...pictures.color import REC709_LUMINANCE
from ...records import KnownAttributes
from ...settings import setting
from ...upload.direct_lights import DIRECT_AREA, DIRECT_POINT, DIRECT_SPOT, DIRECT_SUN
from ...webgpu_limits import MAX_TEXTURE_SIDE
from .shadow_atlas import SMALLEST, fit_sides, place
from .shadow_sun import SunMap, fit_scene, fit_view, sun_axes, sun_matrix

MARGIN = 2  # texels around a perspective view's face, for the filter
HALF_CUBE, CUBE = 5, 6  # views
# Near planes over the scene's radius. Nothing nearer casts shadows; with reversed float depth, a small value costs no
# precision. A sample of an emitter must not see its own surface, so it needs more than the rounding of positions: with
# 1e-6 the Cornell lamp shadows itself, with 1e-5 it does not.
NEAR = 1e-9
NEAR_EMITTER = 1e-5
# Spots with a half angle above 60 degrees, this cosine, get several views: texels of one view would be 4 times as dense
# at its edge as at its centre.
WIDEST_COSINE = 0.5
DIMMEST_SIDE = 1 / 8  # least side over that of the most important light of its kind: tools/README.md, "Constants"
# Greatest automatic side of a sun's maps, texels; the least is the power of two that the picture's longer side reaches.
LARGEST_SUN = 2048
PROBES = 64  # surface points at which lights are compared: tools/README.md, "Constants"
ROUNDING = 1e-6  # of cosines and versines: 17 roundings of float32

# Forward and up of a cube's faces, in the order of deferred/shadow/views.wgsl: world, then light frame.
WORLD_FACES = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], float)
WORLD_UPS = np.array([(0, 1, 0), (0, 1, 0), (0, 0, 1), (0, 0, 1), (0, 1, 0), (0, 1, 0)], float)
OWN_FACES = np.array([(0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, -1)], float)
OWN_UPS = np.array([(0, 1, 0), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 1, 0)], float)


@dataclass(repr=False, slots=True)
class ShadowSettings(KnownAttributes):
    """Resolution of shadow maps; sides are rounded down to powers of two."""

    atlas: int = setting(
        4096,
        "Largest side of the texture that all shadow maps share.",
        "texels",
        range=(256, MAX_TEXTURE_SIDE),
        presets={"low": 2048, "high": MAX_TEXTURE_SIDE},
    )
    sun: int | None = setting(
        None,
        "Side of each map of a sun; none: automatic, by the size of the picture.",
        "texels",
        range=(16, MAX_TEXTURE_SIDE),
        presets={"low": 1024, "high": 4096},
    )
    spot: int = setting(
        512, "Side of the map of a spot.", "texels", range=(16, MAX_TEXTURE_SIDE), presets={"low": 256, "high": 2048}
    )
    point: int = setting(
        256,
        "Side of each of the six maps of a point light.",
        "texels",
        range=(16, 4096),
        presets={"low": 128, "high": 1024},
    )
    area: int = setting(
        128,
        "Side of the front map of each sample of an emitter, with direct.emitters `maps`.",
        "texels",
        range=(16, 4096),
        presets={"low": 64, "high": 256},
    )
    cascades: int | None = setting(
        None,
        "Shadow maps of a sun, from near the camera to the whole scene; none: automatic, by the view.",
        range=(1, 4),
    )


@dataclass
class _Sun:
    """A sun's axes, from `sun_axes`, and its maps, the finest first."""

    axes: NDArray[np.float64]
    maps: list[SunMap]

    def fill(self, records: NDArray[np.void], centre: NDArray[np.float64], radius: float) -> None:
        """Write the matrices of records whose sizes are set; `centre` and `radius`: of the scene, metres."""
        # Cover all depths of the scene: surfaces out of view cast shadows, too.
        along, reach = float(self.axes[2] @ centre), 1.001 * radius
        for record, sun_map in zip(records, self.maps, strict=True):
            matrix, texel = sun_matrix(self.axes, sun_map, int(record["size"][0]), along - reach, along + reach)
            record["clip_from_world"], record["texel"] = matrix.T, texel
            record["right"], record["up"], record["forward"] = self.axes
            record["depth_scale"], record["depth_offset"] = -1 / (2 * reach), matrix[2, 3]
            # Find the place of the scene's origin in the atlas.
            record["centre"] = record["corner"] + record["size"] * (1 + matrix[:2, 3] * (1, -1)) / 2


@dataclass
class ShadowViews:
    """Records of ShadowView; the lights with their views; the side of the atlas, texels."""

    records: NDArray[np.void]
    lights: NDArray[np.void]
    atlas_size: int

    def table(self) -> NDArray[np.uint32]:
        """Return lights and views in the layout of `wgsl/deferred/shadow/table.wgsl`: texels (n, 4)."""
        header = np.array([len(self.lights), 0, 0, 0], np.uint32).tobytes()
        assert self.records.dtype.fields is not None
        first = self.records.dtype.fields["right"][1]
        views = self.records.view(np.uint8).reshape(len(self.records), self.records.dtype.itemsize)[:, first:]
        data = header + self.lights.tobytes() + views.tobytes()
        return np.frombuffer(data, np.uint32).reshape(-1, 4)


def build_shadow_views(
    lights: NDArray[np.void],
    settings: ShadowSettings,
    *,
    centre: NDArray[np.float64],
    radius: float,
    view: NDArray[np.void],
    surface_samples: NDArray[np.float64],
    box: NDArray[np.float64] | None = None,
) -> ShadowViews:
    """Lay out the shadow maps of `lights` (DirectLight records).

    centre, radius: of a sphere around the scene. box: the scene's bounds (2, 3), if known. surface_samples: points on
    surfaces, (n, 3). All are in metres relative to the scene's origin. view: the camera's View uniform; only a sun's
    cascades follow it. Raises GiError for more lights than the largest atlas holds.
    """
    if radius <= 0:
        radius, box = 1.0, None
    centre = np.asarray(centre, np.float64)
    samples = np.asarray(surface_samples, np.float64).reshape(-1, 3)
    suns, sun_side = _fit_suns(lights, settings, centre, radius, view, samples, box)
    counts = _view_counts(lights, suns)
    first = np.cumsum(counts) - counts
    light = np.repeat(np.arange(len(lights)), counts)
    face = np.arange(len(light)) - first[light]
    # The side faces of a half cube have half height.
    flat = (counts[light] == HALF_CUBE) & (face > 0)
    for k, sun in suns.items():
        flat[first[k] + counts[k] - 1] = sun.maps[-1].flat

    importance = _importance(lights, samples if len(samples) else centre[None], radius)
    sides = _wanted_sides(lights["kind"], counts, importance, settings, sun_side)
    # Distribute half of the atlas by importance, half equally.
    share = 0.5 * importance / importance.sum() + 0.5 / len(lights) if len(lights) else importance
    weights = np.bincount(light, np.where(flat, 0.5, 1.0), len(lights)).astype(np.float64)
    side = fit_sides(sides, weights, share, _power_of_two(settings.atlas))[light]
    size = np.stack([side, np.where(flat, side // 2, side)], 1)
    corners, atlas_size = place(*size.T)

    records = np.zeros(len(light), load("deferred/shadow/views.wgsl").struct_dtype("ShadowView"))
    records["corner"], records["size"] = corners, size
    for k, sun in suns.items():
        sun.fill(records[first[k] : first[k] + counts[k]], centre, radius)
    cubes = np.flatnonzero(lights["kind"][light] != DIRECT_SUN)
    near = np.where(lights["kind"][light[cubes]] == DIRECT_AREA, NEAR_EMITTER, NEAR) * radius
    records[cubes] = _perspective(records[cubes], lights[light[cubes]], face[cubes], near)
    lights = lights.copy()
    lights["first_view"], lights["view_count"] = first, counts
    return ShadowViews(records, lights, atlas_size)


def frames_from_normals(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the frames (n, 3, 3) of unit normals, axes in rows: `frame_from_normal` of wgsl/common/math.wgsl."""
    x, y, z = normals.T
    s = np.where(z >= 0, 1.0, -1.0)
    a = -1 / (s + z)
    b = x * y * a
    tangent = np.stack([1 + s * x * x * a, s * b, -s * x], 1)
    return np.stack([tangent, np.stack([b, s + y * y * a, -y], 1), normals], 1)


def _fit_suns(
    lights: NDArray[np.void],
    settings: ShadowSettings,
    centre: NDArray[np.float64],
    radius: float,
    view: NDArray[np.void],
    samples: NDArray[np.float64],
    box: NDArray[np.float64] | None,
) -> tuple[dict[int, _Sun], int]:
    """Return the maps of each sun by its number among the lights, and their side; arguments as `build_shadow_views`."""

    def fit(side: int) -> dict[int, _Sun]:
        suns = {}
        for k in np.flatnonzero(lights["kind"] == DIRECT_SUN).tolist():
            axes = sun_axes(lights["direction"][k].astype(np.float64), box)
            whole = SunMap(axes[:2] @ centre, np.full(2, radius)) if box is None else fit_scene(axes, box)
            suns[k] = _Sun(axes, fit_view(axes, whole, side, view, samples, settings.cascades))
        return suns

    largest = _power_of_two(settings.sun or LARGEST_SUN)
    suns = fit(largest)
    if settings.sun is not None or not suns:
        return suns, largest
    # Use the least side that needs as few maps: a map costs more than its texels.
    side = min(largest, max(_power_of_two(2 * int(view["whole"].max()) - 1), SMALLEST))
    while side < largest:
        fewer_texels = fit(side)
        if sum(len(sun.maps) for sun in fewer_texels.values()) <= sum(len(sun.maps) for sun in suns.values()):
            return fewer_texels, side
        side *= 2
    return suns, largest


def _power_of_two(side: int) -> int:
    return 1 << (int(side).bit_length() - 1)


def _outer_versine(lights: NDArray[np.void]) -> NDArray[np.float64]:
    """Return 1 - cosine of spots' half angle, 1 for other lights."""
    scale = np.where(lights["cone_scale"] > 0, lights["cone_scale"], 1.0).astype(np.float64)
    return np.where(lights["kind"] == DIRECT_SPOT, np.clip(lights["cone_offset"] / scale, 0, 2), 1.0)


def _view_counts(lights: NDArray[np.void], suns: dict[int, _Sun]) -> NDArray[np.int64]:
    kind, cosine = lights["kind"], 1 - _outer_versine(lights)
    spot = np.select([cosine > WIDEST_COSINE - ROUNDING, cosine > -ROUNDING], [1, HALF_CUBE], CUBE)
    area = np.where(lights["both_sides"] > 0, CUBE, HALF_CUBE)
    counts = np.select([kind == DIRECT_SPOT, kind == DIRECT_AREA], [spot, area], CUBE)
    for k, sun in suns.items():
        counts[k] = len(sun.maps)
    return counts


def _importance(lights: NDArray[np.void], probes: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """Return each light's mean unshadowed irradiance at points (n, 3) of the scene, W/m2."""
    probes = probes[:: -(-len(probes) // PROBES)]
    offset = probes - lights["position"][:, None].astype(np.float64)
    # Bound the light of a lamp that touches a probe.
    squared = np.maximum((offset**2).sum(2), (0.01 * radius) ** 2)
    cosine = np.einsum("lpc,lc->lp", offset, lights["direction"].astype(np.float64)) / np.sqrt(squared)
    cone = np.clip(lights["cone_offset"][:, None] - (1 - cosine) * lights["cone_scale"][:, None], 0, 1) ** 2
    disc = np.where(lights["both_sides"][:, None] > 0, np.abs(cosine), np.maximum(cosine, 0)) * lights["area"][:, None]
    kind = lights["kind"][:, None]
    intensity = np.select([kind == DIRECT_SPOT, kind == DIRECT_AREA], [cone, disc], 1.0)
    in_range = squared * lights["inverse_range"][:, None].astype(np.float64) ** 2 < 1
    arriving = np.where(kind == DIRECT_SUN, 1.0, intensity * in_range / squared).mean(1)
    irradiance = arriving * (lights["color"] @ REC709_LUMINANCE)
    return np.maximum(irradiance, 1e-9 * irradiance.max(initial=0.0) + 1e-300)


def _wanted_sides(
    kind: NDArray[np.uint32],
    counts: NDArray[np.int64],
    importance: NDArray[np.float64],
    settings: ShadowSettings,
    sun_side: int,
) -> NDArray[np.int64]:
    """Return the sides of each light's maps: the full side for the most important of its kind, texels by importance."""
    full = np.zeros(len(kind), np.int64)
    relative = np.ones(len(kind))
    for which, side in (
        (DIRECT_SUN, sun_side),
        (DIRECT_SPOT, settings.spot),
        (DIRECT_POINT, settings.point),
        (DIRECT_AREA, settings.area),
    ):
        mine = kind == which
        full[mine] = _power_of_two(side)
        relative[mine] = importance[mine] / importance[mine].max(initial=0.0)
    # The half cube of a wide spot takes about as many texels as a single view.
    full[(kind == DIRECT_SPOT) & (counts > 1)] //= 2
    scale = 2.0 ** np.round(np.log2(np.maximum(relative**0.5, DIMMEST_SIDE)))
    return np.maximum(full * scale, SMALLEST).astype(np.int64)


def _perspective(
    records: NDArray[np.void], lights: NDArray[np.void], face: NDArray[np.int64], near: NDArray[np.float64]
) -> NDArray[np.void]:
    """Return `records`, whose place and size are set, filled for the lights and faces of the same index."""
    size = records["size"].astype(np.float64)
    of_world = (lights["kind"] == DIRECT_POINT)[:, None]
    frames = frames_from_normals(lights["direction"].astype(np.float64))
    forward = np.where(of_world, WORLD_FACES[face], np.einsum("nk,nkc->nc", OWN_FACES[face], frames))
    up = np.where(of_world, WORLD_UPS[face], np.einsum("nk,nkc->nc", OWN_UPS[face], frames))
    right = np.cross(forward, up)

    # Extent to show at 1 m, to either side: the cone of a narrow spot, else a whole face or its upper half.
    versine = np.minimum(_outer_versine(lights) * (1 + ROUNDING), 1 - WIDEST_COSINE + 2 * ROUNDING)
    single = (lights["kind"] == DIRECT_SPOT) & (_outer_versine(lights) < 1 - WIDEST_COSINE + ROUNDING)
    reach = np.where(single, np.sqrt(versine * (2 - versine)) / (1 - versine), 1.0)
    flat = size[:, 1] < size[:, 0]
    texel = reach / (size[:, 1] / np.where(flat, 1, 2) - np.where(flat, 2 * MARGIN, MARGIN))
    half = texel[:, None] * size / 2
    middle = np.where(flat, half[:, 1] - MARGIN * texel, 0.0)

    rows = np.zeros((len(lights), 4, 4))
    rows[:, 0, :3] = right / half[:, :1]
    rows[:, 1, :3] = (up - middle[:, None] * forward) / half[:, 1:]
    rows[:, 3, :3] = forward
    rows[:, :, 3] = -np.einsum("nrc,nc->nr", rows[..., :3], lights["position"].astype(np.float64))
    rows[:, 2, 3] = near
    filled = records.copy()
    filled["clip_from_world"], filled["texel"], filled["depth_scale"] = rows.transpose(0, 2, 1), texel, near
    filled["right"], filled["up"], filled["forward"] = right, up, forward
    filled["centre"] = records["corner"] + size / 2
    filled["centre"][:, 1] += middle / texel
    return filled
