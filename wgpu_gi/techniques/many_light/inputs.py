"""The scene inputs of virtual point lights: areas to place points on, and the layout of reflective shadow maps."""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.handles import Shared
from ..deferred.inputs import DeferredInputs


@dataclass
class VplInputs:
    """Cumulative areas by instance and triangle; the lights' parts of all `rsm_texels` of reflective shadow maps."""

    area_instances: Shared
    area_cdf: Shared
    rsm_lights: Shared
    rsm_texels: int


@dataclass
class ManyLightInputs(DeferredInputs):
    """The scene inputs of many-light.

    gather_stride: picture pixels between those that gather, along rows and columns.
    """

    vpl: VplInputs
    gather_stride: int

    def shape(self) -> tuple[object, ...]:
        """Return the values whose change forces the passes to be redeclared."""
        return (*super().shape(), self.vpl.rsm_texels, self.gather_stride)
