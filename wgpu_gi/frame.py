"""Declares a frame: the light of one technique, its mean over frames, and the displayed picture. Read this first."""

from __future__ import annotations

from typing import Any

from .buffers import Source
from .gpu.graph import Graph
from .options import Settings, technique_of
from .techniques.deferred import declare_direct_light
from .techniques.many_light import declare_many_light
from .techniques.reference import declare_primary, declare_reference
from .techniques.shared.antialias import declare_antialias
from .techniques.shared.bounds import MOVES, scattered_more
from .techniques.shared.composite import (
    declare_display,
    declare_mean,
    declare_standard_error,
    declare_sum,
    declare_tinted,
)
from .techniques.shared.scene_inputs import declare_deformation
from .techniques.ssao import declare_ssao
from .techniques.ssdo import declare_ssdo
from .techniques.ssil import declare_ssil


def declare_frame(
    graph: Graph, settings: Settings, scene: Any, frames: int, aliased: str | None, exact: bool
) -> dict[str, Source]:
    """Declare the passes of a frame; return its buffers and views by name.

    `scene` is the return value of the technique's `inputs`; `frames`: number of frames of a still picture; `aliased`:
    why radiance is not anti-aliased over moving frames, None if it is, empty for a still picture; `exact`: all frames
    of a still picture are the same.
    """
    declare_deformation(graph, scene)
    # Light: each technique is a folder of techniques/.
    match settings.gi:
        case "path":
            light = declare_reference(graph, settings, scene)
        case "none":
            light = declare_direct_light(graph, settings, scene)
        case "many-light":
            light = declare_many_light(graph, settings, scene)
        case "ssdo":
            light = declare_ssdo(graph, settings, scene)
        case "ssao":
            light = declare_ssao(graph, settings, scene)
        case "ssil":
            light = declare_ssil(graph, settings, scene)
        case _:
            raise AssertionError(settings.gi)
    _skip_further_bounces(graph, settings, scene)
    # Glass in front of what a pixel shows tints it, after all filters.
    light = declare_tinted(graph, light)
    # Radiance is the sum of the layers, anti-aliased over moving frames; a still picture is the mean of its frames.
    radiance = light.radiance or declare_sum(graph, light.emission, light.direct, light.indirect)
    if aliased is None:
        radiance = declare_antialias(graph, settings.camera.antialias, radiance, light)
    elif aliased:
        graph.skip("antialias", aliased, MOVES)
    layers = {"radiance": radiance, "direct": light.direct, "indirect": light.indirect, "emission": light.emission}
    # Its noise: zero, or estimated from the frames, or of a single frame unknown, for which radiance itself stands.
    error = None if exact else light.standard_error or radiance
    if frames > 1:
        error = declare_standard_error(graph, radiance)
        layers = {name: declare_mean(graph, name, layer) if layer else None for name, layer in layers.items()}
    # For the screen: exposure and tone curve.
    assert layers["radiance"] is not None
    display = declare_display(graph, layers["radiance"], settings.exposure or 0.0)
    # The surfaces at the pixel centres. Only the passes of requested buffers run.
    primary = declare_primary(graph, scene)
    return {
        **{name: Source(layer) for name, layer in (layers | light.views).items()},
        "display": Source(display),
        "standard_error": Source(error),
        "alpha": Source(layers["radiance"], 3, 1),
        "albedo": Source(primary.albedo),
        "normal": Source(primary.normal),
        "depth": Source(primary.normal, 3, 1),
        "position": Source(primary.position),
        "instance": Source(primary.position, 3, 1),
    }


def _skip_further_bounces(graph: Graph, settings: Settings, scene: Any) -> None:
    """List the bounces that are not in the picture, and the light that they could add at most."""
    found = technique_of(settings.gi).bounces_found(settings)
    if found is not None:
        number = f"{found} bounce{'s' * (found != 1)}" if found else "no indirect light"
        reason = f"bounces is {found}" if found == settings.bounces else f"{settings.gi} finds {number}"
        graph.skip("bounces/further", reason, scattered_more(scene, found + 1))
