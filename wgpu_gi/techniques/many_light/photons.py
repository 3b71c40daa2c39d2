"""Photons: they carry the light that coats throw on other surfaces, each along the lobe of the surface that it leaves.

Image-space photon mapping (McGuire and Luebke 2009, "Hardware-Accelerated Global Illumination by Image Space Photon
Mapping") with kernels that shrink over the frames of a still picture (Knaus and Zwicker 2011, "Progressive Photon
Mapping: A Probabilistic Approach"). Departures: photons carry only what is brighter than virtual point lights can carry
without dots (`wgsl/many_light/vpl/lobe.wgsl`); they start at the candidates for virtual point lights and end at the
next surface. A departure from Linke 2016, too, whose surfaces are matte.
"""

from __future__ import annotations

import math
from math import ceil

from ...gpu.graph import Graph
from ...gpu.wgsl.load import load
from ..shared.bounds import NOTHING
from ..shared.denoise import grid_size
from ..shared.gbuffer import Gbuffer, whole_size
from .gather import Gathered, GatherSettings, near_radius
from .inputs import ManyLightInputs
from .vpl import Candidates, VplSettings, declare_resampled, declare_weights

SHADER = "many_light/photons/trace.wgsl"
MOST_PHOTONS = 1 << 20
LEAST_WEIGHT = float(load("many_light/vpl/weights.wgsl").constants["PHOTON_FLOOR"])


def declare_photons(
    graph: Graph,
    settings: VplSettings,
    gather: GatherSettings,
    scene: ManyLightInputs,
    gbuffer: Gbuffer,
    candidates: Candidates,
    gathered: Gathered,
    seed: int,
) -> None:
    """Declare the passes that add the light of lobes to the irradiance and to the coats' light."""
    if not candidates.lobes.some or gathered.glossy is None:
        graph.skip("photons", "no surface throws light by a lobe", NOTHING)
        return
    # Draw the photons from the candidates.
    width, height = graph.size
    count = min(ceil(settings.photons * math.prod(whole_size(graph))), MOST_PHOTONS)
    weights = declare_weights(graph, settings, candidates, "photons", lobes=True)
    table = declare_resampled(graph, candidates, weights, "photons", count, seed)
    # Trace them.
    layers = {
        name: graph.buffer(f"photons/{name}", count=3 * width * height) for name in ("deposits", "glossy_deposits")
    }
    read = {"surfaces": gbuffer.surfaces, "distance": gbuffer.distance, "totals": weights.totals}
    shared = {"count": count, "least_weight": LEAST_WEIGHT}
    graph.compute(
        "photons/trace",
        SHADER,
        over=count,
        reads={**scene.surfaces, **read, "vpl_table": table},
        writes=layers,
        params={
            **shared,
            "seed": seed,
            "widest": gather.reflections**2,
            "near_radius": near_radius(gathered.near_field),
        },
        constants={
            **scene.constants(SHADER),
            **candidates.lobes.constants,
            "NEAR_FIELD": gathered.near_field is not None,
        },
        clear=list(layers.values()),
    )
    # Add their light.
    graph.compute(
        "photons/resolve",
        "many_light/photons/resolve.wgsl",
        over=grid_size(graph, gathered.stride),
        reads={**read, **layers},
        writes={"irradiance": gathered.irradiance, "glossy": gathered.glossy},
        params=shared,
        constants={**gbuffer.constants("many_light/photons/resolve.wgsl"), **gathered.grid},
    )
