"""The scene inputs of screen-space indirect light: the triangles that bound solids, for the voxels."""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.handles import Shared
from ..deferred.inputs import DeferredInputs


@dataclass
class SolidInputs:
    """triangles: one bit each, set if it bounds a solid. has_solids, has_shells: whether any is set, and any is not."""

    triangles: Shared
    has_solids: bool
    has_shells: bool


@dataclass
class SsilInputs(DeferredInputs):
    """The scene inputs of SSIL."""

    solids: SolidInputs

    def shape(self) -> tuple[object, ...]:
        """Return the values whose change forces the passes to be redeclared."""
        return (*super().shape(), self.solids.has_solids, self.solids.has_shells)
