"""What a search for occluders is asked for, and its results.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", section 3. Departures: those of
`search.py`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...gpu.wgsl.load import load
from ..deferred.environment import Ambient
from ..deferred.inputs import DeferredInputs
from ..shared.radiance_cache import RadianceCache
from ..shared.upsample import Guide
from .settings import SsdoSettings
from .sources import Sources

SHADER = "ssdo/search.wgsl"
# The search for the sky occlusion of sources other than the first layer takes every second step along each direction.
# tools/README.md, "Constants".
SKY_STEP_SHARE = 2
INTERLEAVE = 4  # side of the squares of pixels that share a set of directions. tools/README.md, "Constants"
SLICE_LOOKUPS = int(load("ssdo/slices.wgsl").constants["LOOKUPS"])
LAST_MAP = int(load("deferred/environment/maps.wgsl").constants["LAST_MAP"])


@dataclass
class SearchResult:
    """Hits of the directions from a grid of pixels, every `stride`-th of every `stride`-th row.

    light: unoccluded share of the environment, (r, g, b, depth of `shared/denoise/plane.wgsl`). normals: packed by that
    file. hits: the surfaces found from the first layer, packed by `ssdo/hit_code.wgsl`. unoccluded: the environment's
    light without occlusion; after the blur of both the share is light / unoccluded. None: `light` is already the share.
    guide: for upsampling the grid. unrepresented_hits: hits of the directions from unrepresented pixels. directions,
    lobes: numbers of directions per pixel, drawn by the cosine and, after them, from the coat. by_rays: rays have
    decided what the pictures do not show. request: that of a search by slices, else None.
    """

    stride: int
    light: Buffer
    normals: Buffer
    hits: Buffer
    unoccluded: Buffer | None
    guide: Guide | None = None
    unrepresented_hits: Buffer | None = None
    directions: int = 0
    lobes: int = 0
    by_rays: bool = False
    request: SearchRequest | None = None


@dataclass
class SearchRequest:
    """A search from the pixels of source `number`.

    radius: largest r_max, in heights of the picture at the pixel; None: from the settings. directional: True: the share
    depends on the environment's colour by direction; False: ambient occlusion. coats: coated pixels also draw as many
    directions from their coat. base: False: only these. rays: True: trace the directions that no picture decides;
    reflects: find the light that their hits reflect. cache: has that light; None: a sample of the lights per hit.
    one_bounce: the cache has the light of sources only. sliced: by slices of the hemisphere (`slices.py`); its
    directions are then those of undecided sectors. prefix: of the names of passes.
    """

    graph: Graph
    settings: SsdoSettings
    scene: DeferredInputs
    sources: Sources
    ambient: Ambient
    seed: int
    number: int = 0
    radius: float | None = None
    directional: bool = True
    coats: bool = False
    base: bool = True
    rays: bool = False
    reflects: bool = True
    cache: RadianceCache | None = None
    one_bounce: bool = False
    sliced: bool = False
    prefix: str = "ssdo/"

    @property
    def lobes(self) -> int:
        """Directions per pixel that are drawn from its coat."""
        is_coated = self.coats and self.number == 0 and self.scene.features["HAS_COATS"]
        return self.settings.directions if is_coated and not self.sliced else 0

    @property
    def directions(self) -> int:
        """Directions per pixel."""
        if not self.base:
            return 0
        if self.sliced:
            return self.slices * self.rays_per_slice
        return self.settings.directions if self.number == 0 else 1

    @property
    def slices(self) -> int:
        """Slices per pixel; each has two sides."""
        return -(-self.settings.directions // 2)

    @property
    def rays_per_slice(self) -> int:
        """Rays of a slice whose sectors are all undecided."""
        return min(2 * self.settings.directions, 4) if self.rays else 1

    @property
    def name(self) -> str:
        """The name of the pass."""
        return f"{self.prefix}occlusion_{self.number}" if self.number else f"{self.prefix}occlusion"

    @property
    def samples_environment(self) -> bool:
        """Whether every other direction is drawn by importance sampling of the environment."""
        pictured = self.ambient.features["HAS_ENVIRONMENT"] and self.ambient.features["HAS_PICTURED_ENVIRONMENT"]
        by_importance = self.settings.sampling == "environment" and not self.sliced
        return self.number == 0 and pictured and self.directional and by_importance

    @property
    def needs_light(self) -> bool:
        """Whether the light that hits reflect matters."""
        return self.number == 0 and self.reflects

    @property
    def lobe(self) -> int:
        """The prefiltered map of the environment that is its radiance by direction."""
        return _lobe_of(self.slices * SLICE_LOOKUPS if self.sliced else max(self.directions, 1))

    def arguments(self, stride: int) -> dict[str, Any]:
        """Return the arguments common to all passes of SHADER; `reads` lacks the G-buffer."""
        settings, sources, number = self.settings, self.sources, self.number
        return {
            "shader": SHADER,
            "reads": {
                "environment_cdf": self.scene.lights["environment_cdf"],
                **self.ambient.reads,
                **sources.reads(self.graph),
            },
            "params": {
                "seed": self.seed,
                "lobe": self.lobe,
                "radius": settings.radius if self.radius is None else self.radius,
            },
            "constants": {
                **self.scene.constants(SHADER),
                **self.ambient.constants(SHADER),
                **sources.constants,
                "STEPS": settings.steps if number == 0 else -(-settings.steps // SKY_STEP_SHARE),
                "DIRECTIONS": self.directions,
                "LOBES": self.lobes,
                "STRIDE": stride,
                "MOVES": moves(stride, number),
                "INTERLEAVE": INTERLEAVE,
                "DIRECTIONAL": self.directional,
                "OUTWARD": sources.is_outward(number),
                "SAMPLE_ENVIRONMENT": self.samples_environment,
                "HITS": number == 0 or self.rays,
                "BY_RAYS": self.rays,
                "MARCHES": number == 0,
            },
            "uniforms": {**sources.uniforms(), "view": sources.view_of(number)},
        }


def moves(stride: int, number: int = 0) -> bool:
    """Return whether the grid of source `number` moves from frame to frame: `wgsl/shared/upsample/grid_pixel.wgsl`."""
    return number == 0 and stride == 2


def _lobe_of(directions: int) -> int:
    """Return the prefiltered map of the environment whose lobe has the solid angle of one of a square's directions.

    That angle is 4 pi alpha^2, with alpha = 2^-k for map k.
    """
    return min(round(0.5 * math.log2(2 * directions * INTERLEAVE**2)), LAST_MAP)
