"""What passes of the deferred base read of a scene, and what calls for another declaration of them."""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.handles import Shared
from ..shared.scene_inputs import RasterInputs
from .shadow_draws import ShadowDraws


@dataclass
class DirectInputs:
    """The table of the lights that deferred techniques loop over, and their shadow views.

    count: lights in the table; `bounded` of them have an end: spots, and lights with a range. atlas_size:
    texels on a side of the shadow atlas; 0: no light casts shadows.
    """

    lights: Shared
    count: int
    bounded: int
    views: Shared
    atlas_size: int


@dataclass
class DeferredInputs(RasterInputs):
    """What deferred techniques need of a scene.

    before_from_now: the motion of each instance since the frame before. frames: how many make a still picture.
    """

    direct: DirectInputs
    shadows: ShadowDraws
    before_from_now: Shared
    frames: int

    def shape(self) -> tuple[object, ...]:
        """Return all that calls for another declaration of the passes."""
        direct = self.direct
        return (*super().shape(), direct.count, direct.bounded, direct.atlas_size, self.frames)
