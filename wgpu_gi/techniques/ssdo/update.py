"""Updates the scene inputs of screen-space directional occlusion once per frame: its further cameras."""

from __future__ import annotations

from typing import Protocol

from ..deferred.update import DeferredOptions, deferred_inputs
from ..shared.denoise import DenoiseSettings
from ..shared.radiance_cache import note_changes
from ..shared.sampling import sample_footprint
from ..shared.technique import Shot
from ..shared.temporal import TemporalSettings
from .cameras import screen_views
from .inputs import SsdoInputs
from .settings import SsdoSettings
from .sources import view_name


class OcclusionOptions(DeferredOptions, Protocol):
    """The settings that directional and ambient occlusion read."""

    seed: int
    ssdo: SsdoSettings
    temporal: TemporalSettings


class SsdoOptions(OcclusionOptions, Protocol):
    """The settings that SSDO reads."""

    bounces: int | None
    denoise: DenoiseSettings


def ssdo_inputs(shot: Shot, settings: SsdoOptions) -> SsdoInputs:
    """Do what `occlusion_inputs` does, and tell the radiance cache of changes of the scene."""
    found = occlusion_inputs(shot, settings)
    note_changes(shot.graph, shot.kept, shot.upload, settings.bounces)
    return found


def occlusion_inputs(shot: Shot, settings: OcclusionOptions) -> SsdoInputs:
    """Place the further cameras and set their uniforms, `view_1` ...; return the inputs of the passes."""
    # Further cameras light their surfaces with the shadow maps.
    deferred = deferred_inputs(shot, settings, beyond_picture=True)
    upload = shot.upload
    sky = settings.environment.ambient and upload.features["HAS_ENVIRONMENT"]
    box, triangles = upload.box + upload.origin, shot.scene.triangle_count
    contacts = settings.direct.contacts > 0
    screen, cameras = screen_views(shot.camera, box, shot.size, triangles, settings.ssdo, sky, contacts=contacts)
    for number, camera in enumerate(cameras, 1):
        view = upload.view(camera, shot.size, False, footprint=sample_footprint(settings.camera))
        shot.graph.uniform(view_name(number), view)
    return SsdoInputs(**vars(deferred), screen=screen)
