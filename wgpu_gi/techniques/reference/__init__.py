"""The truth: a progressive path tracer over the same scene buffers, lights and BRDF as every other technique.

Kajiya 1986, "The Rendering Equation"; next-event estimation with multiple importance sampling after Veach 1997,
chapter 9; Owen-scrambled Sobol points after Burley 2020.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...gpu.passes import Pass
from ...gpu.wgsl.load import load
from ...records import KnownAttributes
from ...settings import setting
from ..shared.sampling import CameraSettings
from ..shared.scene_inputs import SceneInputs, share_scene
from ..shared.technique import Kept, Light, Reach, Shot, Technique
from .adaptive import adaptive_runs, declare_learned, mean_paths, missing_paths

UNLIMITED = 0x7FFFFFFF
MOST_LISTED = 4096  # pixels that one list holds: `reference/pixel_list.wgsl`, 64 KiB, the largest uniform buffer
OUTSIDE = 0xFFFFFFFF  # coordinate of a pixel that no picture has
FEATURES = ("features/albedo", "features/normal")  # views that the denoiser of finished pictures reads
DENOISER_INPUTS = (*FEATURES, "standard_error")  # ... besides radiance
FEATURE_SIDE = 4  # points along a side of a pixel, for `FEATURES` of a jittered picture


@dataclass(repr=False, slots=True)
class PathSettings(KnownAttributes):
    """How the path tracer divides its work, and which light it counts."""

    samples_per_run: int = setting(
        16, "Paths per pixel in one run of the pass; fewer paths refine in smaller steps.", "paths", range=(1, 64)
    )
    visible_only: bool = setting(
        False, "Only surfaces that the camera sees send light: the best result that screen-space techniques can reach."
    )
    adaptive: bool = setting(
        False,
        "More paths where the error is larger, and light rays to where they help; `spp` is the mean of the paths.",
    )


@dataclass
class Primary:
    """Surfaces at the pixel centres: base colour; shading normal and distance; position. Four floats each."""

    albedo: Buffer
    normal: Buffer
    position: Buffer


class PathOptions(Protocol):
    """The settings that the path tracer reads."""

    spp: int
    bounces: int | None
    seed: int
    transparent: bool
    camera: CameraSettings
    path: PathSettings


@dataclass
class PathInputs(SceneInputs):
    """The scene inputs of the path tracer, and the number of graph runs over which it traces its samples."""

    runs: int

    def shape(self) -> tuple[object, ...]:
        """Return the values whose change forces the passes to be redeclared."""
        return (*super().shape(), self.runs)


class LongPaths:
    """Runs added to the planned ones, for pixels whose paths are exceptionally long."""

    def __init__(self) -> None:
        self.extra_runs = 0


def path_inputs(shot: Shot, settings: PathOptions) -> PathInputs:
    """Set the uniforms `scene` and `view`; return the inputs of the passes."""
    jitter, transparent = settings.camera.jitter, settings.transparent
    view = shot.upload.view(shot.camera, shot.size, jitter, transparent=transparent, window=shot.window)
    shot.graph.uniform("view", view)
    return PathInputs(**vars(share_scene(shot.graph, shot.upload)), runs=_runs(settings, shot.kept))


def _runs(settings: PathOptions, kept: Kept) -> int:
    path = settings.path
    planned = adaptive_runs if path.adaptive else _even_runs
    return planned(settings.spp, path.samples_per_run) + kept(LongPaths).extra_runs


def _even_runs(spp: int, samples_per_run: int) -> int:
    return -(-spp // samples_per_run)


def _refine(graph: Graph, kept: Kept, settings: PathOptions) -> bool:
    """Plan more runs if a pixel lacks samples because its paths took too many steps; return whether it did."""
    if settings.path.adaptive:
        missing = missing_paths(graph)
        samples = max(settings.spp - missing, settings.path.samples_per_run)
    else:
        samples = int(graph.read_back("path/emission").reshape(-1, 4)[:, 3].min())
        missing = settings.spp - samples
    # Add as many runs as the slowest pixel needs at its pace so far.
    kept(LongPaths).extra_runs += -(-missing * _runs(settings, kept) // max(samples, 1))
    return missing > 0


TECHNIQUE = Technique(
    sentence="progressive path tracer, the truth",
    bounces=None,
    is_random=True,
    options=PathOptions,
    inputs=path_inputs,
    extra=(),
    views=dict.fromkeys(FEATURES, "the denoiser reads it"),
    averages_samples=True,
    refine=_refine,
    reach=lambda settings: Reach(2),  # of the noise estimate: `wgsl/reference/standard_error.wgsl`
    refined=frozenset({"radiance", "direct", "indirect", "emission", "standard_error"}),
)


def declare_reference(graph: Graph, settings: PathOptions, scene: PathInputs) -> Light:
    """Declare the path tracer: `spp` paths per pixel, with at most `bounces` indirect bounces (None: unlimited).

    Each of `scene.runs` runs of the graph adds up to `path.samples_per_run` samples to a pixel, until it has `spp`;
    with `path.adaptive`, both are means over the pixels. `emission`'s fourth value counts them: pixels with very long
    paths get fewer per run and need more runs.
    """
    width, height = graph.size

    def buffers(*names: str, nonnegative: bool = True) -> dict[str, Buffer]:
        count = width * height
        return {
            name: graph.buffer(f"path/{name}", dtype=FOUR_FLOATS, count=count, width=width, nonnegative=nonnegative)
            for name in names
        }

    layers = buffers("emission", "direct", "indirect", "deviation")
    # Halves have -1 for what is not known yet.
    results = buffers("radiance", "standard_error") | buffers("halves", nonnegative=False)
    tiles = -(-width // 8) * -(-height // 8)
    learned = declare_learned(graph, scene, layers, tiles, settings.path.adaptive)
    trace = graph.compute(
        "path/trace",
        "reference/path.wgsl",
        over=tiles * 64,
        reads={**scene.surfaces, **scene.lights},
        writes={**layers, "learned": learned},
        params={
            "samples": settings.path.samples_per_run,
            "spp": settings.spp,
            "bounces": UNLIMITED if settings.bounces is None else settings.bounces,
            "seed": settings.seed,
            "row_stride": _row_stride(-(-height // 8)),
        },
        constants={
            **scene.constants("reference/path.wgsl"),
            "VISIBLE_ONLY": settings.path.visible_only,
            "ADAPTIVE": settings.path.adaptive,
            "STEP_BUDGET": graph.device.capabilities.path_steps,
        },
        settle=scene.runs,
        split=True,
    )
    _keep_full_runs(trace, settings)
    first = settings.path.samples_per_run
    _declare_results(graph, layers, results, mean_paths(0, first) if settings.path.adaptive else first)
    return Light(
        layers["emission"],
        layers["direct"],
        layers["indirect"],
        results["radiance"],
        views=_declare_features(graph, settings, scene),
        standard_error=results["standard_error"],
    )


def _declare_results(graph: Graph, layers: dict[str, Buffer], results: dict[str, Buffer], first: int) -> None:
    """Declare radiance, and its standard error by the halves of the samples; the first run takes at most `first`."""
    graph.compute(
        "path/resolve",
        "reference/resolve.wgsl",
        over=graph.size,
        reads=layers,
        writes={name: results[name] for name in ("radiance", "halves")},
        params={"size": graph.size, "first_samples": first},
    )
    graph.compute(
        "path/standard_error",
        "reference/standard_error.wgsl",
        over=graph.size,
        reads={
            "emission": layers["emission"],
            "deviation": layers["deviation"],
            "radiance": results["radiance"],
            "halves": results["halves"],
        },
        writes={"standard_error": results["standard_error"]},
        params={"size": graph.size},
    )


def declare_pixel_list(
    graph: Graph, settings: PathOptions, scene: SceneInputs, entries: NDArray[np.uint32], spp: int
) -> tuple[Buffer, ...]:
    """Declare the path tracer for a list of pixels: rows of `entries` are x, y, seed, -; at most MOST_LISTED.

    Return the layers emission, direct and indirect, an element an entry. `emission`'s fourth value counts the samples,
    of which each run of the graph adds up to `path.samples_per_run` until there are `spp`.
    """
    shader = "reference/pixel_list.wgsl"
    listed = np.zeros((), load(shader).struct_dtype("PixelList"))
    listed["entries"][: len(entries)] = entries
    listed["entries"][len(entries) :] = OUTSIDE
    graph.uniform("pixel_list", listed)
    layers = {
        name: graph.buffer(f"pixels/{name}", dtype=FOUR_FLOATS, count=MOST_LISTED, nonnegative=True)
        for name in ("emission", "direct", "indirect", "deviation")
    }
    graph.compute(
        "pixels/trace",
        shader,
        entry="main_listed",
        over=len(entries),
        reads={**scene.surfaces, **scene.lights},
        writes={**layers, "learned": graph.buffer("pixels/learned", dtype=np.uint32, count=1)},
        params={
            "samples": settings.path.samples_per_run,
            "spp": spp,
            "bounces": UNLIMITED if settings.bounces is None else settings.bounces,
            "seed": 0,
            "row_stride": 1,
        },
        constants={**scene.constants(shader), "STEP_BUDGET": graph.device.capabilities.path_steps},
        settle=UNLIMITED,
        split=True,
    )
    return layers["emission"], layers["direct"], layers["indirect"]


def _declare_features(graph: Graph, settings: PathOptions, scene: SceneInputs) -> dict[str, Buffer]:
    """Declare the pass that averages albedo and normal of the first hits over each pixel; return its buffers."""
    width, height = graph.size
    features = {
        name: graph.buffer(f"path/{name}", dtype=FOUR_FLOATS, count=width * height, width=width) for name in FEATURES
    }
    graph.compute(
        "path/features",
        "reference/features.wgsl",
        over=(width, height),
        reads=scene.surfaces,
        writes=dict(zip(("albedo", "normal"), features.values(), strict=True)),
        constants={
            **scene.constants("reference/features.wgsl"),
            "SIDE": FEATURE_SIDE if settings.camera.jitter else 1,
        },
    )
    return features


def _row_stride(rows: int) -> int:
    """Return a stride whose multiples, modulo `rows`, visit all rows and spread evenly: near the golden section."""
    return next(k for k in range(max(round(0.618 * rows), 1), rows + 2) if math.gcd(k, rows) == 1)


def _keep_full_runs(trace: Pass, settings: PathOptions) -> None:
    """Keep the existing samples if only `spp` changes and no run took fewer samples because of it.

    Then the picture equals, bit for bit, one that had this `spp` from the start.
    """
    before = trace.params_before
    if before is None:
        return
    run, samples = trace.state.settle_index, int(before["samples"])
    taken = mean_paths(run, samples) if settings.path.adaptive else (run + 1) * samples
    if taken <= min(settings.spp, int(before["spp"])):
        trace.ignore_change_of("spp")


def declare_primary(graph: Graph, scene: SceneInputs) -> Primary:
    """Declare the pass that finds the surface at each pixel's centre, unlit."""
    width, height = graph.size
    buffers = {
        name: graph.buffer(f"primary/{name}", dtype=FOUR_FLOATS, count=width * height, width=width)
        for name in ("albedo", "normal", "position")
    }
    graph.compute(
        "primary",
        "reference/primary.wgsl",
        over=(width, height),
        reads=scene.surfaces,
        writes=buffers,
        constants=scene.constants("reference/primary.wgsl"),
    )
    return Primary(**buffers)
