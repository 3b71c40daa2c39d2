"""Virtual point lights (VPLs): resampled from all candidates by their contribution to the view.

Keller 1997, "Instant Radiosity"; Linke 2016, sections 3.2 and 4.3; importance resampling after Talbot et al. 2005.
Departures:

* VPLs are drawn by flux and by an estimate of their contribution to the view instead of on a regular grid of the
  reflective shadow map, so none falls on an empty texel.
* Light paths add candidates for the light of emitters and of the environment, and for further bounces.
* Each VPL stores the area that it represents, which bounds its light; Linke's bound is a constant.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle, Texture
from ...gpu.wgsl.load import load
from ...records import KnownAttributes
from ...settings import setting
from ..shared.bounds import NOTHING
from ..shared.gbuffer import Gbuffer, whole_size
from ..shared.sampling import STILL_SEQUENCE, pixels_of_sequence
from .inputs import ManyLightInputs
from .lobes import Lobes
from .points import declare_sky_points
from .rsm import CANDIDATE, Rsm

VIEW_SAMPLES = 64  # pixels that represent the view; tools/README.md, "Constants"
DENSITY_VPLS = 512  # most VPLs from which the area of each is estimated; tools/README.md, "Constants"
# Most candidates of a light path; the last stands for all further bounces. Twelve bounces hold 98 % of the light at an
# albedo of 0.7, 93 % at 0.8.
PATH_CANDIDATES = 12
TABLE_WIDTH = int(load("many_light/vpl/table.wgsl").constants["VPL_TABLE_WIDTH"])
BLOCK = int(load("many_light/vpl/candidates.wgsl").constants["BLOCK"])


@dataclass(repr=False, slots=True)
class VplSettings(KnownAttributes):
    """Virtual point lights."""

    count: int = setting(2048, "Virtual point lights.", "lights", range=(64, 16384), presets={"low": 512, "high": 4096})
    importance: str = setting(
        "view",
        "Draw lights by flux and contribution to the view (view), by flux alone, so that they stay in place while the"
        " camera moves (flux), or evenly (grid).",
        choices=("view", "flux", "grid"),
    )
    paths: int = setting(
        8192,
        "Light paths, for emitters, the environment and more than one bounce; at least 32,768 on a GPU, whose threads"
        " fewer would leave idle.",
        "paths",
        range=(64, 1 << 16),
        presets={"low": 2048, "high": 32768},
    )
    lobes: str = setting(
        "metals",
        "Surfaces that throw light along the lobe of their coat: metals, or all (coats), for half again as much time in"
        " scenes without metals.",
        choices=("metals", "coats"),
        presets={"high": "coats"},
    )
    photons: float = setting(
        0.5,
        "Photons per pixel and frame, which carry the bright part of lobes.",
        range=(0.01, 4),
        presets={"low": 0.25, "high": 1.0},
    )
    max_bounces: int = setting(128, "Most bounces of a light path.", "bounces", range=(1, 128))


@dataclass
class LightPaths:
    """Buffer of `count` candidates, the vertices of light paths, packed as in `wgsl/many_light/vpl/vpl.wgsl`."""

    buffer: Buffer
    count: int


@dataclass
class Vpls:
    """The table of VPLs, in the layout of `wgsl/many_light/vpl/table.wgsl`, and its number of slots.

    lobes: whether they have lobes.
    """

    table: Texture
    count: int
    lobes: bool = False

    @property
    def constants(self) -> dict[str, bool]:
        """The constants of shaders that load VPLs."""
        return {"HAS_LOBES": self.lobes}


@dataclass
class Candidates:
    """Candidates for VPLs and photons: first the texels of reflective shadow maps, then the vertices of light paths."""

    buffers: dict[str, Handle]  # by the names in `wgsl/many_light/vpl/candidates.wgsl`
    view_samples: Handle  # surfaces that the camera sees, which weigh them
    texels: int
    count: int  # of texels and vertices
    lobes: Lobes


@dataclass
class Weights:
    """Weights of candidates, cumulative within blocks, and the blocks' cumulative sums."""

    cumulative: Buffer
    totals: Buffer


def declare_light_paths(
    graph: Graph,
    settings: VplSettings,
    scene: ManyLightInputs,
    lobes: Lobes,
    albedo: Handle,
    bounces: int | None,
    seed: int,
) -> LightPaths | None:
    """Declare the light paths for at most `bounces` bounces; return None if reflective shadow maps hold all light.

    `albedo`: reflectance table of coated surfaces, for `wgsl/deferred/environment/reflectance.wgsl`.
    """
    most = min(settings.max_bounces, bounces or settings.max_bounces)
    vertices = min(most, PATH_CANDIDATES)
    has_sky, has_emitters = scene.features["HAS_ENVIRONMENT"], scene.features["HAS_EMITTERS"]
    if not has_sky and not has_emitters and vertices == 1:
        graph.skip("vpl/light_paths", "the reflective shadow maps hold all light of one bounce", NOTHING)
        return None
    # Half of the paths carry the environment's light, or all paths if there is no other light.
    others = has_emitters or (scene.vpl.rsm_texels > 0 and vertices > 1)
    paths = max(settings.paths, graph.device.capabilities.least_walks)
    sky_paths = (paths // 2 if others else paths) if has_sky else 0
    count = paths * vertices
    points = declare_sky_points(graph, scene, sky_paths, albedo, seed).buffer if sky_paths else graph.neutral("buffer")
    light_paths = graph.buffer("vpl/light_paths", dtype=CANDIDATE, count=lobes.words * count)
    shader = "many_light/vpl/light_paths.wgsl"
    graph.compute(
        "vpl/light_paths",
        shader,
        over=paths,
        reads={**scene.surfaces, **scene.lights, "points": points, "ambient_albedo": albedo},
        writes={"light_paths": light_paths},
        params={
            "paths": paths,
            "sky_paths": sky_paths,
            "bounces": most,
            "seed": seed,
        },
        constants={**scene.constants(shader), **lobes.reflecting},
        uniforms=STILL_SEQUENCE,
    )
    return LightPaths(light_paths, count)


def pixels_beside(graph: Graph, settings: VplSettings) -> tuple[tuple[int, int], ...]:
    """Return the pixels of the whole picture that represent the view of a window; none for a whole picture."""
    whole = whole_size(graph)
    if settings.importance != "view" or whole == tuple(graph.size):
        return ()
    return pixels_of_sequence(VIEW_SAMPLES, whole)


def declare_candidates(
    graph: Graph,
    settings: VplSettings,
    lobes: Lobes,
    rsm: Rsm | None,
    light_paths: LightPaths | None,
    scene: ManyLightInputs,
    gbuffer: Gbuffer,
) -> Candidates:
    """Return the candidates of all maps and paths; declare the surfaces that weigh them."""
    view_samples: Handle = graph.neutral("buffer")
    if settings.importance == "view":
        dtype = load("many_light/vpl/view_samples.wgsl").struct_dtype("ViewSample")
        view_samples = graph.buffer("vpl/view_samples", dtype=dtype, count=VIEW_SAMPLES)
        # The G-buffer of a window has not all of the pixels.
        is_window = whole_size(graph) != tuple(graph.size)
        shader = f"many_light/vpl/view_samples{'_of_window' if is_window else ''}.wgsl"
        graph.compute(
            "vpl/view_samples",
            shader,
            over=VIEW_SAMPLES,
            reads={**scene.surfaces, "visibility": gbuffer.visibility}
            if is_window
            else {"surfaces": gbuffer.surfaces, "distance": gbuffer.distance},
            writes={"view_samples": view_samples},
            constants=scene.constants(shader),
        )
    else:
        graph.skip("vpl/view_samples", f"vpl.importance is {settings.importance}", NOTHING)
    texels = rsm.count if rsm is not None else 0
    buffers: dict[str, Handle] = {
        "rsm": rsm.buffer if rsm is not None else graph.neutral("buffer"),
        "light_paths": light_paths.buffer if light_paths is not None else graph.neutral("buffer"),
    }
    count = texels + (light_paths.count if light_paths is not None else 0)
    return Candidates(buffers, view_samples, texels, count, lobes)


def declare_vpls(graph: Graph, settings: VplSettings, candidates: Candidates, seed: int) -> Vpls:
    """Declare the resampling of `settings.count` VPLs from the candidates."""
    count = settings.count
    weights = declare_weights(graph, settings, candidates, "vpl")
    resampled = declare_resampled(graph, candidates, weights, "vpl", count, seed)
    table = graph.texture("vpl/table", "rgba32uint", size=_table_size(candidates, count))
    graph.compute(
        "vpl/areas",
        "many_light/vpl/areas.wgsl",
        over=count,
        reads={"resampled": resampled},
        writes={"vpls": table},
        params={"count": count, "stride": -(-count // DENSITY_VPLS)},
        constants=candidates.lobes.constants,
    )
    return Vpls(table, count, candidates.lobes.some)


def _table_size(candidates: Candidates, count: int) -> tuple[int, int]:
    return (TABLE_WIDTH, -(-candidates.lobes.words * count // TABLE_WIDTH))


def declare_resampled(
    graph: Graph, candidates: Candidates, weights: Weights, name: str, count: int, seed: int
) -> Texture:
    """Declare the drawing of `count` candidates by their weights; return their table."""
    drawn = graph.texture(f"{name}/resampled", "rgba32uint", size=_table_size(candidates, count))
    graph.compute(
        f"{name}/resample",
        "many_light/vpl/resample.wgsl",
        over=count,
        reads={**candidates.buffers, "cumulative": weights.cumulative, "totals": weights.totals},
        writes={"vpls": drawn},
        params={"texels": candidates.texels, "candidates": candidates.count, "count": count, "seed": seed},
        constants=candidates.lobes.constants,
        uniforms=STILL_SEQUENCE,
    )
    return drawn


def declare_weights(
    graph: Graph, settings: VplSettings, candidates: Candidates, name: str, lobes: bool = False
) -> Weights:
    """Declare the weights of all candidates as VPLs or, with `lobes`, as photons."""
    cumulative = graph.buffer(f"{name}/cumulative", count=candidates.count)
    block_sums = graph.buffer(f"{name}/block_sums", count=-(-candidates.count // BLOCK))
    graph.compute(
        f"{name}/weights",
        "many_light/vpl/weights.wgsl",
        over=candidates.count,
        reads={**candidates.buffers, "view_samples": candidates.view_samples},
        writes={"cumulative": cumulative, "block_sums": block_sums},
        params={"texels": candidates.texels, "candidates": candidates.count},
        constants={
            "VIEW": settings.importance == "view",
            "GRID": settings.importance == "grid",
            **candidates.lobes.constants,
            "LOBES": lobes,
        },
    )
    totals = graph.buffer(f"{name}/totals", count=block_sums.count)
    graph.compute(
        f"{name}/prefix_sum",
        "many_light/vpl/prefix_sum.wgsl",
        over=1,
        reads={"block_sums": block_sums},
        writes={"totals": totals},
    )
    return Weights(cumulative, totals)
