"""The G-buffers of the screen-space search: layers of depth peeling, and further cameras.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", section 4.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.graph import Graph
from ...gpu.handles import Handle
from ..shared.bounds import NOTHING
from ..shared.gbuffer import Gbuffer, declare_gbuffer
from .inputs import SsdoInputs
from .settings import MAX_CAMERAS, MAX_LAYERS


@dataclass
class Sources:
    """G-buffers by number: the layers of the main camera, the nearest first, then further cameras, `view_1` first."""

    layers: list[Gbuffer]
    cameras: list[Gbuffer]
    widens: bool = False  # the first camera stands at the main one, with a wider lens

    @property
    def count(self) -> int:
        """The number of sources."""
        return len(self.layers) + len(self.cameras)

    @property
    def constants(self) -> dict[str, int]:
        """The constants of `wgsl/ssdo/hit_code.wgsl`."""
        return {"LAYERS": len(self.layers), "CAMERAS": len(self.cameras)}

    def gbuffer(self, number: int) -> Gbuffer:
        """Return the G-buffer of a source."""
        return [*self.layers, *self.cameras][number]

    def view_of(self, number: int) -> str:
        """Return the uniform with the view of a source."""
        return view_name(max(number - len(self.layers) + 1, 0))

    def is_outward(self, number: int) -> bool:
        """Return True for deeper layers: they may show back faces, whose front is lit instead."""
        return 0 < number < len(self.layers)

    def reads(self, graph: Graph) -> dict[str, Handle]:
        """Return the bindings of passes that import `wgsl/ssdo/hit_position.wgsl`."""
        depths: dict[str, Handle] = {f"depth_{k}": graph.neutral("texture_depth_2d") for k in range(8)}
        depths |= {f"depth_{k}": layer.depth for k, layer in enumerate(self.layers)}
        return depths | {f"depth_{MAX_LAYERS + k}": camera.depth for k, camera in enumerate(self.cameras)}

    def uniforms(self) -> dict[str, str]:
        """Return the views that these passes bind; the main camera's view replaces missing cameras."""
        cameras = range(MAX_CAMERAS + 1)
        return {f"view_{k}": view_name(k) if k <= len(self.cameras) else "view" for k in cameras}


def view_name(number: int) -> str:
    """Return the uniform of the main camera (0) or of a further camera (1 and up)."""
    return f"view_{number}" if number else "view"


def declare_sources(graph: Graph, scene: SsdoInputs) -> Sources:
    """Declare the G-buffers of layers and further cameras; the uniforms `view_1` ... must exist."""
    for name, reason in scene.screen.skipped:
        graph.skip(name, reason, NOTHING)
    numbers = range(1, scene.screen.cameras + 1)
    return Sources(
        declare_gbuffer(graph, scene, layers=scene.screen.layers),
        [declare_gbuffer(graph, scene, name=f"camera_{k}", view=view_name(k))[0] for k in numbers],
        scene.screen.widens,
    )
