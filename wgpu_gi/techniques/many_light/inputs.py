"""The inputs of virtual point lights from a scene: areas to place points on, the layout of reflective shadow maps."""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.handles import Shared
from ..deferred.inputs import DeferredInputs


@dataclass
class VplInputs:
    """Cumulative areas by instance and triangle; how lights share the `rsm_texels` of all reflective shadow maps."""

    area_instances: Shared
    area_cdf: Shared
    rsm_lights: Shared
    rsm_texels: int


@dataclass
class ManyLightInputs(DeferredInputs):
    """The inputs of many-light from a scene."""

    vpl: VplInputs

    def shape(self) -> tuple[object, ...]:
        """Return all that calls for another declaration of the passes."""
        return (*super().shape(), self.vpl.rsm_texels)
