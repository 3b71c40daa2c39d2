"""Updates the scene inputs of deferred techniques once per frame: lights, shadow views, camera, motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...gpu.graph import Graph
from ...gpu.wgsl.load import load
from ...scene.scene import Scene
from ...upload.direct_lights import DIRECT_SPOT, DIRECT_SUN
from ...upload.scene_upload import SceneUpload
from ..shared.sampling import CameraSettings, moving_offset, pixel_offset, sample_footprint
from ..shared.scene_inputs import share_raster
from ..shared.technique import Shot
from .direct import DirectSettings
from .environment import EnvironmentSettings
from .inputs import DeferredInputs, DirectInputs, EmitterInputs
from .shadow_casters import Receivers
from .shadow_draws import ShadowDraws
from .shadow_views import ShadowSettings, build_shadow_views

BEFORE = ("before_from_now", "before_positions")  # inputs of motion vectors
SEQUENCE = load("scene/sequence.wgsl").struct_dtype("Sequence")


class DeferredOptions(Protocol):
    """The settings that every deferred technique reads."""

    seed: int
    transparent: bool
    camera: CameraSettings
    direct: DirectSettings
    shadow: ShadowSettings
    environment: EnvironmentSettings


class DeferredState:
    """State kept from frame to frame: shadow views and their draws while lights are still, and the previous view."""

    def __init__(self) -> None:
        self.shadows = ShadowDraws()
        self._dtype = load("deferred/shadow/views.wgsl").struct_dtype("DirectLight")
        self._view_before: NDArray[np.void] | None = None
        self._origin_before = np.zeros(3)
        self.count = self.bounded = self.atlas_size = self.leaves = 0
        self.features: dict[str, bool] = {}
        self._records: NDArray = np.zeros(0)
        self._key: tuple[object, ...] = ()
        self._alive: tuple[object, ...] = ()  # objects that the key names by id, kept alive

    def update(
        self,
        upload: SceneUpload,
        scene: Scene,
        view: Callable[[], NDArray[np.void]],
        direct: DirectSettings,
        shadow: ShadowSettings,
        beyond_picture: bool,
    ) -> None:
        """Upload the changes; `upload` is up to date with `scene`. `view` returns the camera's View uniform."""
        draws = upload.update_draws(scene)
        # Emitters are drawn from a tree, or are among the lights as samples with maps.
        by_rays = direct.emitters == "rays"
        self.leaves = upload.update_emitters(scene) if by_rays else upload.without_emitters()
        lights = upload.direct_lights(scene, self._dtype, 0 if by_rays else direct.samples, direct.range)
        samples = upload.surface_samples(scene)
        # Only a sun's maps follow the camera.
        follows = bool((lights["kind"] == DIRECT_SUN).any())
        key = (id(lights), id(samples), upload.box.tobytes(), replace(shadow), view().tobytes() if follows else b"")
        if key != self._key:
            self._key, self._alive = key, (lights, samples)
            found = build_shadow_views(
                lights,
                shadow,
                centre=upload.box.mean(0),
                radius=float(np.linalg.norm(np.ptp(upload.box, axis=0))) / 2,
                view=view(),
                surface_samples=samples,
                box=upload.box,
            )
            suns = found.lights["kind"] == DIRECT_SUN
            ends = (found.lights["kind"] == DIRECT_SPOT) | (found.lights["inverse_range"] > 0)
            self.bounded = int(ends.sum())
            self.features = {"HAS_SUNS": bool(suns.any()), "HAS_LAMPS": not suns.all()}
            self.count, self.atlas_size = len(lights), found.atlas_size if len(found.records) else 0
            upload.resources.table("light_table", found.table())
            upload.resources.records("shadow_views", _at_least_one(found.records))
            self._records = found.records
        self.shadows.update(self._records, draws, None if beyond_picture else Receivers(view(), upload.box))

    def note_motion(self, upload: SceneUpload, scene: Scene, graph: Graph, view: NDArray[np.void]) -> None:
        """Upload the motion of instances and the view of the previous call."""
        upload.update_motion(scene)
        before, shift = self._view_before, upload.origin - self._origin_before
        # A picture of another size has no history to reproject.
        if before is None or before["size"].tobytes() != view["size"].tobytes():
            before = view
        elif shift.any():
            before = _about(before, shift)
        graph.uniform("view_before", before)
        self._view_before, self._origin_before = view, upload.origin.copy()


def deferred_inputs(shot: Shot, settings: DeferredOptions, *, beyond_picture: bool = False) -> DeferredInputs:
    """Update lights, shadow views, camera and motion for a frame; return the inputs of the passes.

    `beyond_picture`: shadow maps are looked up for points out of view, too.

    Sets the uniforms `scene`, `view`, `view_before`, `sequence` and `still_sequence`.
    """
    graph, upload, state = shot.graph, shot.upload, shot.kept(DeferredState)
    # Shadow maps follow the camera, but not the jitter of a still picture's frames.
    state.update(
        upload,
        shot.scene,
        lambda: upload.view(shot.camera, shot.size, False, window=shot.window),
        settings.direct,
        settings.shadow,
        beyond_picture,
    )
    if shot.moving is not None:
        offset = moving_offset(shot.moving)
    elif settings.camera.jitter and shot.frames > 1:
        offset = pixel_offset(max(shot.frame, 0), settings.seed)
    else:
        offset = 0.5, 0.5
    # The frames so far share the pixel.
    footprint = sample_footprint(settings.camera, max(shot.frame, 0) + 1)
    anisotropy = settings.camera.anisotropy
    view = upload.view(shot.camera, shot.size, False, offset, settings.transparent, footprint, anisotropy, shot.window)
    state.note_motion(upload, shot.scene, graph, view)
    number, ahead = max(shot.frame, 0), max(-shot.frame, 0)
    graph.uniform("sequence", np.array((shot.drawn + number, number, ahead), SEQUENCE))
    graph.uniform("still_sequence", np.array((number, number, ahead), SEQUENCE))
    graph.uniform("view", view)
    # Share the resources that passes bind.
    names = ("light_table", "emitters", *BEFORE)
    lights, emitters, *before = (graph.share(f"scene/{name}", *upload.resources[name]) for name in names)
    records, version = upload.resources["shadow_views"]
    views = graph.share("scene/shadow_views", records, (version, state.shadows.version))
    raster = share_raster(graph, upload)
    raster.features |= state.features
    raster.features["PASSES_GLASS"] = raster.features["HAS_TRANSMISSION"]
    direct = DirectInputs(lights, state.count, state.bounded, views, state.atlas_size)
    return DeferredInputs(
        **vars(raster),
        direct=direct,
        emitters=EmitterInputs(emitters, state.leaves),
        shadows=state.shadows,
        before=dict(zip(BEFORE, before, strict=True)),
        frames=1 if shot.preview else shot.frames,
        preview=shot.preview and shot.frames > 1,
    )


def _about(view: NDArray[np.void], shift: NDArray[np.float64]) -> NDArray[np.void]:
    """Return a view relative to an origin moved by `shift`, metres."""
    moved = view.copy()
    moved["position"] -= shift
    moved["clip_from_world"][3] += shift @ view["clip_from_world"][:3]
    return moved


def _at_least_one(records: NDArray[np.void]) -> NDArray[np.void]:
    """Return `records`, or one zero record if empty: WebGPU binds no empty buffers."""
    return records if len(records) else np.zeros(1, records.dtype)
