"""The scene inputs of the deferred base, and the values that force its passes to be redeclared."""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.handles import Shared
from ..shared.scene_inputs import RasterInputs
from .shadow_draws import ShadowDraws


@dataclass
class DirectInputs:
    """The table of lights that deferred techniques loop over, and their shadow views.

    count: lights in the table. bounded: number of spots and lights with a range. atlas_size: side of the shadow atlas,
    texels; 0: no light casts shadows.
    """

    lights: Shared
    count: int
    bounded: int
    views: Shared
    atlas_size: int


@dataclass
class EmitterInputs:
    """The tree that emitters are drawn from, and its number of leaves; 0: nothing emits, or maps represent emitters."""

    table: Shared
    leaves: int


@dataclass
class DeferredInputs(RasterInputs):
    """The scene inputs of deferred techniques.

    before: how instances and vertices have moved since the previous frame, by WGSL name. frames: number of frames of a
    still picture; 1 in previews. preview: the still picture starts over without this frame.
    """

    direct: DirectInputs
    emitters: EmitterInputs
    shadows: ShadowDraws
    before: dict[str, Shared]
    frames: int
    preview: bool

    @property
    def tints_shadows(self) -> bool:
        """True if shadow rays may pass a surface and carry on with less light."""
        return self.features["HAS_SEE_THROUGH"] or self.features["PASSES_GLASS"]

    @property
    def is_preview(self) -> bool:
        """The field `preview`."""
        return self.preview

    def shape(self) -> tuple[object, ...]:
        """Return the values whose change forces the passes to be redeclared."""
        direct = self.direct
        return (
            *super().shape(),
            direct.count,
            direct.bounded,
            direct.atlas_size,
            self.emitters.leaves > 0,
            self.frames,
        )
