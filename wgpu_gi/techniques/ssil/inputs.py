"""What screen-space indirect light needs of a scene: which triangles bound solids, for the voxels."""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.handles import Shared
from ..deferred.inputs import DeferredInputs


@dataclass
class SolidInputs:
    """Which triangles bound solids, a bit each, and whether there are any, and any others (shells)."""

    triangles: Shared
    has_solids: bool
    has_shells: bool


@dataclass
class SsilInputs(DeferredInputs):
    """What SSIL needs of a scene."""

    solids: SolidInputs

    def shape(self) -> tuple[object, ...]:
        """Return all that calls for another declaration of the passes."""
        return (*super().shape(), self.solids.has_solids, self.solids.has_shells)
