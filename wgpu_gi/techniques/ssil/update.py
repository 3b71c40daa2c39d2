"""Updates the scene inputs of screen-space indirect light once per frame: the triangles that bound solids."""

from __future__ import annotations

from typing import Protocol

from ..deferred.update import DeferredOptions, deferred_inputs
from ..shared.denoise import DenoiseSettings
from ..shared.radiance_cache import note_changes
from ..shared.technique import Shot
from ..shared.temporal import TemporalSettings
from .inputs import SolidInputs, SsilInputs
from .ssil import SsilSettings
from .voxels import VoxelSettings


class SsilOptions(DeferredOptions, Protocol):
    """The settings that SSIL reads."""

    bounces: int | None
    seed: int
    ssil: SsilSettings
    voxels: VoxelSettings
    temporal: TemporalSettings
    denoise: DenoiseSettings


def ssil_inputs(shot: Shot, settings: SsilOptions) -> SsilInputs:
    """Find the triangles that bound solids; return the inputs of the passes."""
    deferred = deferred_inputs(shot, settings)
    upload = shot.upload
    upload.update_solids(settings.voxels.solids)
    triangles = shot.graph.share("scene/solid_triangles", *upload.resources["solid_triangles"])
    note_changes(shot.graph, shot.kept, upload, settings.bounces)
    solids = SolidInputs(triangles, upload.solids.has_solids, upload.solids.has_shells)
    return SsilInputs(**vars(deferred), solids=solids)
