"""Times how a scene gets to the device: images, tables of triangles, the hierarchy."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from ...gpu.device import Device
from ...scene.scene import Instance, Mesh, Scene
from ...upload.scene_upload import SceneUpload
from .clock import clock_for
from .results import Build

STEP = 1e-3  # of the scene's diagonal: how far the instance moves


def measure_build(name: str, scene: Scene, device: Device) -> tuple[Build, SceneUpload]:
    """Return the times of a scene, and its upload, which the caller releases."""
    upload, clock = SceneUpload(device), clock_for(device.is_cpu)

    def updated(scene: Scene) -> float:
        started = clock()
        upload.update(scene)
        device.wait()
        return (clock() - started) * 1e3

    try:
        ms = updated(scene)
        again = _with_new_meshes(scene)
        geometry_ms = updated(again)
        # The first move takes an instance out of the world's tree; a later one only updates.
        updated(_moved(again, 1))
        moved_ms = updated(_moved(again, 2))
        # Put it back, as the rays expect it.
        updated(scene)
        allocated = sum(_bytes(upload.resources[name][0]) for name in upload.resources.versions())
    except BaseException:
        upload.release()
        raise
    return Build(name, scene.triangle_count, ms, geometry_ms, moved_ms, allocated), upload


def _with_new_meshes(scene: Scene) -> Scene:
    """Return the scene with copies of its meshes, which count as changed; materials stay."""
    meshes: dict[int, Mesh] = {}
    instances = []
    for instance in scene.instances:
        mesh = meshes.setdefault(id(instance.mesh), copy(instance.mesh))
        instances.append(Instance(mesh, instance.world_from_local, instance.name))
    return replace(scene, instances=instances)


def _moved(scene: Scene, times: int) -> Scene:
    """Move the first instance of a scene in place by a small step, and return the scene."""
    diagonal = float(np.linalg.norm(np.ptp(scene.bounds(), axis=0))) or 1.0
    matrix = np.array(scene.instances[0].world_from_local, np.float64)
    matrix[:3, 3] += times * STEP * diagonal
    scene.instances[0].world_from_local = matrix
    return scene


def _bytes(resource: Any) -> int:
    """Return the size of a buffer, or of a texture: 4 bytes a texel, 16 for formats of 32-bit channels."""
    if hasattr(resource, "format"):
        width, height, layers = resource.size
        texel = {"rgba32uint": 16, "rgba32float": 16, "rg32float": 8, "rgba16float": 8}.get(resource.format, 4)
        mips = resource.mip_level_count
        return sum(max(width >> m, 1) * max(height >> m, 1) * layers * texel for m in range(mips))
    return int(resource.size)
