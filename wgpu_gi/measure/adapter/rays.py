"""Measures how many rays per second an adapter traces in a scene: rays from the camera, bounces, and shadow rays.

camera: the first hit of a ray through each pixel. bounce: the first hit of a ray from each visible point, in a
direction drawn by the cosine. shadow: whether anything lies between two visible points. Camera rays are coherent,
the others are not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import wgpu
from numpy.typing import NDArray

from ...camera import Camera
from ...gpu.device import Device
from ...gpu.graph import Graph
from ...gpu.handles import Handle
from ...gpu.wgsl.load import load
from ...options import Settings
from ...renderer import Renderer
from ...scene.scene import Scene
from ...techniques.shared.scene_inputs import share_scene
from ...upload.scene_upload import SceneUpload
from .clock import clock_for
from .results import RayRate

SHADER = "measure/rays.wgsl"
SIZES = ((640, 360), (2560, 1440))  # pixels; the larger one where the smaller takes less than LONG_MS
LONG_MS = 4.0
ROUNDS = 5
FAR = 3.0e38
LIFT = 1e-5  # of the scene's diagonal: rays start this far off their surface
STOP_SHORT = 0.9999  # of the way to the other point
NONE = 0xFFFFFFFF


@dataclass(frozen=True)
class Rays:
    """Rays for one of the shader's entry points: origin and limit, direction; (n, 2, 4) float32."""

    kind: str
    entry: str
    values: NDArray[np.float32]


def measure_rays(
    name: str, scene: Scene, camera: Camera, device: Device, upload: SceneUpload, adapter: str | None = None
) -> list[RayRate]:
    """Return the rate of each kind of ray in a scene whose upload is up to date."""
    found: list[RayRate] = []
    for size in SIZES:
        found, shortest = [], np.inf
        for rays in draw_rays(scene, camera, size, upload.origin, adapter):
            results, ms = trace(device, upload, rays)
            missed = NONE if rays.entry == "closest" else 0
            rate = len(rays.values) / max(ms, 1e-6) * 1e3
            hits = float((results != missed).mean())
            found.append(RayRate(name, scene.triangle_count, rays.kind, rate, hits))
            shortest = min(shortest, ms)
        if shortest >= LONG_MS:
            break
    return found


def draw_rays(
    scene: Scene, camera: Camera, size: tuple[int, int], origin: NDArray[np.float64], adapter: str | None = None
) -> list[Rays]:
    """Return the three kinds of rays from a camera that sees a surface; `origin` is that of the upload."""
    # Take the visible points and their normals from a picture.
    settings = Settings(gi="none", exposure=0.0)
    settings.camera.jitter, settings.camera.frames = False, 1
    renderer = Renderer(scene, size=size, camera=camera, settings=settings, adapter=adapter)
    try:
        renderer.step(show=("position", "normal", "depth"))
        seen = np.asarray(renderer.read_back("depth")).ravel() > 0
        points = np.asarray(renderer.read_back("position"), np.float64).reshape(-1, 3)[seen] - origin
        normals = np.asarray(renderer.read_back("normal"), np.float64).reshape(-1, 3)[seen]
    finally:
        renderer.close()
    if not len(points):
        return []

    # From the camera to the points; from the points by the cosine, and to points in another order.
    rng = np.random.default_rng(1)
    eye = np.asarray(camera.world_from_view, np.float64)[:3, 3] - origin
    lift = LIFT * float(np.linalg.norm(np.ptp(scene.bounds(), axis=0)))
    starts = points + lift * normals
    sphere = rng.normal(size=points.shape)
    bounces = normals + sphere / np.linalg.norm(sphere, axis=1, keepdims=True)
    targets = starts[rng.permutation(len(starts))]
    return [
        Rays("camera", "closest", _packed(np.broadcast_to(eye, points.shape), points - eye, FAR)),
        Rays("bounce", "closest", _packed(starts, bounces, FAR)),
        Rays("shadow", "any", _packed(starts, targets - starts, STOP_SHORT)),
    ]


def _packed(origins: NDArray, directions: NDArray, limit: float) -> NDArray[np.float32]:
    values = np.zeros((len(origins), 2, 4), np.float32)
    values[:, 0, :3], values[:, 0, 3], values[:, 1, :3] = origins, limit, directions
    return values


def trace(device: Device, upload: SceneUpload, rays: Rays) -> tuple[NDArray[np.uint32], float]:
    """Return the result of each ray, (n,) as in the shader, and the median milliseconds of tracing all."""
    buffer = device.gpu.create_buffer_with_data(data=rays.values, usage=wgpu.BufferUsage.STORAGE)
    graph = Graph(device)
    graph.timing.clock = clock_for(device.is_cpu)
    graph.begin()
    try:
        source = load(SHADER)
        graph.uniform("view", upload.view(Camera(), (1, 1), False))
        inputs = share_scene(graph, upload)
        used = source.entry_points[rays.entry].uses
        reads: dict[str, Handle] = {k: h for k, h in inputs.surfaces.items() if k in used}
        reads["rays"] = graph.share("rays", buffer)
        result = graph.buffer("result", dtype=np.uint32, count=len(rays.values))
        constants: dict[str, Any] = inputs.constants(SHADER)
        graph.compute(
            "trace",
            SHADER,
            over=result,
            reads=reads,
            writes={"result": result},
            constants=constants,
            entry=rays.entry,
        )
        graph.compile([result])
        for number in range(ROUNDS + 1):
            graph.run(force=True, timings=True)
            if number == 0:
                graph.timing.clear()  # the first run compiles
        return graph.read_back(result), graph.timing.median("trace") or 0.0
    finally:
        graph.release()
        buffer.destroy()
