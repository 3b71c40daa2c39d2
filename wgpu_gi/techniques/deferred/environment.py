"""The environment's light, unoccluded: prefiltered once, then looked up by every pixel.

Karis 2013, "Real Shading in Unreal Engine 4" (split sum). Departures: lookups use the lobe's mean direction instead of
the mirror direction; sums cover the whole picture instead of samples, so suns of a few pixels keep their energy.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.graph import Graph
from ...gpu.handles import Handle, Shared
from ...gpu.wgsl.load import load
from ...records import KnownAttributes
from ...settings import setting
from ..shared.bounds import NOTHING, sky_at_most
from ..shared.scene_inputs import SceneInputs

# Entries of the table of albedos along the view's cosine and the roughness. Bilinear lookups differ by at most 0.4 %
# from a table of 512 x 512 at 20,000 random angles and roughnesses; with 48 x 48 entries, by 0.7 %.
TABLE_SIZE = (64, 64)


@dataclass(repr=False, slots=True)
class EnvironmentSettings(KnownAttributes):
    """Lighting by the environment."""

    ambient: bool = setting(True, "Light surfaces by the environment.")
    rays: int = setting(
        1,
        "Rays per pixel and frame for the environment's occlusion; 0: none. Only many-light and ssil use it.",
        "rays",
        range=(0, 64),
        presets={"high": 4},
    )


@dataclass
class Ambient:
    """Bindings and features of `deferred/environment/ambient.wgsl`; passes that import it need both."""

    reads: dict[str, Handle]
    features: dict[str, bool]

    def constants(self, shader: str) -> dict[str, bool]:
        """Return the HAS_ constants of the environment that `shader` declares."""
        declared = load(shader).overrides
        return {name: value for name, value in self.features.items() if name in declared}


def declare_environment(
    graph: Graph, settings: EnvironmentSettings, scene: SceneInputs, *, lobes: bool = False, albedo: bool = False
) -> Ambient:
    """Declare the passes that prefilter the environment; they rerun only when its picture changes.

    `albedo`: make the reflectance table of coated surfaces even without an environment. `lobes`: make the maps of all
    lobes even without coats.
    """
    shines = settings.ambient and scene.features["HAS_ENVIRONMENT"]
    pictured, coated = scene.features["HAS_PICTURED_ENVIRONMENT"], scene.features["HAS_COATS"]
    absent = "there is no environment" if settings.ambient else "environment.ambient is off"
    # Without an environment there is no light; with environment.ambient off, as much as it could shed.
    bound = sky_at_most(scene)
    neutral: Shared = graph.neutral("texture_2d")
    reads: dict[str, Handle] = {
        "environment": scene.lights["environment"],
        "ambient_albedo": neutral,
        "ambient_maps": neutral,
    }
    if coated and (shines or albedo):
        reads["ambient_albedo"] = _declare_albedo(graph)
    else:
        graph.skip("environment/albedo", absent if coated else "no material is coated", bound if coated else NOTHING)
    if shines and pictured:
        reads["ambient_maps"] = _declare_maps(graph, scene.lights["environment"], coated or lobes)
    else:
        for name in ("leaves", "sum", "prefilter"):
            graph.skip(
                f"environment/{name}", "the environment is constant" if shines else absent, NOTHING if shines else bound
            )
    return Ambient(reads, {"HAS_ENVIRONMENT": shines, "HAS_PICTURED_ENVIRONMENT": pictured})


def _declare_albedo(graph: Graph) -> Handle:
    table = graph.texture("environment/albedo", "rgba32float", size=TABLE_SIZE, nonnegative=True)
    graph.compute("environment/albedo", "deferred/environment/albedo.wgsl", over=table, writes={"table": table})
    return table


def _declare_maps(graph: Graph, picture: Handle, coated: bool) -> Handle:
    """Declare the sums over the picture: into quadtree cells, then for each direction and lobe of the maps."""
    shader = load("deferred/environment/prefilter.wgsl")
    known = {name: int(value) for name, value in shader.constants.items()}
    cells = graph.buffer("environment/cells", dtype=shader.struct_dtype("Cell"), count=known["CELLS"])
    # Without coats, only the first map, of the cosine lobe, is needed.
    size = (known["LAST_SIDE"], known["MAPS_HEIGHT"]) if coated else (known["SMALL_SIDE"], known["SMALL_SIDE"])
    maps = graph.texture("environment/maps", "rgba32float", size=size, nonnegative=True)
    graph.compute(
        "environment/leaves",
        "deferred/environment/leaves.wgsl",
        over=(known["LEAVES_X"], known["LEAVES_Y"]),
        reads={"environment": picture},
        writes={"cells": cells},
    )
    graph.compute(
        "environment/sum",
        "deferred/environment/sum.wgsl",
        over=known["LEAVES"] // 3,  # all upper levels together
        writes={"cells": cells},
    )
    graph.compute(
        "environment/prefilter",
        "deferred/environment/prefilter.wgsl",
        over=(size[0] // 2, size[1] // 2),
        reads={"cells": cells},
        writes={"maps": maps},
    )
    return maps
