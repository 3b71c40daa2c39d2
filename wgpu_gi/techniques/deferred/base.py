"""The first stages of every deferred technique: G-buffer, motion, environment and shadow maps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.gbuffer import Gbuffer, declare_gbuffer, declare_motion, declare_tint
from .environment import Ambient, EnvironmentSettings, declare_environment
from .inputs import DeferredInputs
from .shadow import ShadowMaps, declare_shadow_maps


class BaseOptions(Protocol):
    """The settings that the stages read."""

    environment: EnvironmentSettings


@dataclass
class Base:
    """G-buffer, motion vectors, prefiltered environment, and shadow maps (None: no light casts shadows).

    tint: factor on each pixel's light, of glass; None: there is no glass.
    """

    gbuffer: Gbuffer
    motion: Buffer
    ambient: Ambient
    shadow_maps: ShadowMaps | None
    tint: Buffer | None


def declare_base(
    graph: Graph,
    settings: BaseOptions,
    scene: DeferredInputs,
    *,
    gbuffer: Gbuffer | None = None,
    lobes: bool = False,
    albedo: bool = False,
) -> Base:
    """Declare the stages; `gbuffer`: the technique's own G-buffer, if it has already declared one.

    `lobes` and `albedo` ask for tables of the environment: see `declare_environment`.
    """
    if gbuffer is None:
        gbuffer = declare_gbuffer(graph, scene)[0]
    motion = declare_motion(graph, scene, gbuffer, scene.before)
    ambient = declare_environment(graph, settings.environment, scene, lobes=lobes, albedo=albedo)
    shadows = declare_shadow_maps(graph, scene)
    return Base(gbuffer, motion, ambient, shadows, declare_tint(graph, scene, gbuffer))
