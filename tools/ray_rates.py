"""Measure how many rays a second the shaders trace in a scene, and Embree on the same rays and cores.

python tools/ray_rates.py [SCENE ...] [--size 640x360] [--rounds 5] [--position X,Y,Z --target X,Y,Z]

Three sets of rays, one of each a pixel:
  camera   first hits from the camera
  bounce   first hits in directions drawn by the cosine from the camera's hits
  shadow   whether anything lies between a pixel's hit and the bounce ray's hit of another, random pixel
Rates are rays per second of CPU time, times the number of cores: the rate of a machine with nothing else to do. On a
GPU they are of wall time. Embree needs the package embreex; it traces single rays, on one thread, and its rate is
multiplied by the number of cores as well. Shares of hits tell whether both trace the same.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import wgpu
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # also where the package is not installed

import wgpu_gi as gi
from wgpu_gi.camera import Camera
from wgpu_gi.cli.argument_types import parse_size
from wgpu_gi.errors import GiError
from wgpu_gi.gpu.device import open_device
from wgpu_gi.gpu.graph import Graph
from wgpu_gi.gpu.wgsl.load import load, refresh
from wgpu_gi.techniques.shared.scene_inputs import share_scene
from wgpu_gi.upload.scene_upload import SceneUpload

FAR = 3.0e38
SHADER = """#import "scene/trace.wgsl"
@group(1) @binding(20) var<storage, read> rays: array<vec4f>;  // origin, limit; direction, unused
@group(1) @binding(21) var<storage, read_write> result: array<u32>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let i = id.x;
    if (2u * i >= arrayLength(&rays)) {
        return;
    }
    let origin = rays[2u * i];
    let ray = Ray(origin.xyz, rays[2u * i + 1u].xyz);
    TRACE
}
"""
TRACES = {
    "closest": "let hit = trace(ray, origin.w);"
    " result[2u * i] = bitcast<u32>(hit.distance); result[2u * i + 1u] = hit.triangle;",
    "any": "result[2u * i] = select(0u, 1u, trace_shadow(ray, origin.w).occluded_a);",
}


class Rays:
    """Origins relative to the scene's origin and directions, (n, 3) float32, and limits, (n,)."""

    def __init__(self, origins: NDArray, directions: NDArray, limits: NDArray | float) -> None:
        self.origins, self.directions = np.asarray(origins, np.float32), np.asarray(directions, np.float32)
        self.limits = np.broadcast_to(np.asarray(limits, np.float32), len(origins))

    def words(self) -> NDArray[np.float32]:
        """Return the shader's input, (n, 2, 4)."""
        words = np.zeros((len(self.origins), 2, 4), np.float32)
        words[:, 0, :3], words[:, 0, 3], words[:, 1, :3] = self.origins, self.limits, self.directions
        return words


class Tracer:
    """Traces rays in a scene by `wgsl/scene/trace.wgsl`."""

    def __init__(self, scene: gi.Scene, folder: Path) -> None:
        self.device, self.folder = open_device(large_buffers=True), folder
        started = time.process_time()
        self.upload = SceneUpload(self.device)
        self.upload.update(scene)
        print(f"  scene on the device after {time.process_time() - started:.1f} s of CPU time")

    def __call__(self, kind: str, rays: Rays, rounds: int = 0) -> tuple[NDArray[np.uint32], float]:
        """Return the results, (n, 2), and the median seconds of `rounds` runs after the first."""
        (self.folder / "rates.wgsl").write_text(SHADER.replace("TRACE", TRACES[kind]))
        refresh()
        graph = Graph(self.device, shader_root=self.folder)
        graph.begin()
        data = rays.words()
        buffer = self.device.gpu.create_buffer_with_data(data=data, usage=wgpu.BufferUsage.STORAGE)
        source = load("rates.wgsl", self.folder)
        graph.uniform("scene", self.upload.info)
        graph.uniform("view", self.upload.view(Camera(), (1, 1), False))
        inputs = share_scene(graph, self.upload)
        used = source.entry_points["main"].uses
        reads: dict[str, Any] = {k: h for k, h in inputs.surfaces.items() if k in used}
        reads["rays"] = graph.share("rays", buffer)
        constants = {k: v for k, v in inputs.features.items() if k in source.overrides}
        output = graph.buffer("result", dtype=np.uint32, count=2 * len(data))
        graph.compute(kind, "rates.wgsl", over=len(data), reads=reads, writes={"result": output}, constants=constants)
        graph.compile([output])
        seconds = []
        for _ in range(rounds + 1):
            seconds.append(measured(lambda: run(graph, self.device), self.device))
        result = graph.read_back(output).reshape(-1, 2)
        graph.release()
        buffer.destroy()
        return result, median(seconds[1:] or seconds)


def run(graph: Graph, device: Any) -> None:
    """Run all passes of a graph and wait for them."""
    graph.run(force=True)
    device.wait()


def measured(work: Callable[[], Any], device: Any = None) -> float:
    """Return the seconds that work takes: wall time on a GPU, else CPU time over the number of cores."""
    if device is not None and not device.is_cpu:
        started = time.perf_counter()
        work()
        return time.perf_counter() - started
    started = time.process_time()
    work()
    return (time.process_time() - started) / (os.cpu_count() or 1)


def camera_rays(camera: Camera, size: tuple[int, int], origin: NDArray[np.float64]) -> Rays:
    """Return rays through the centres of the pixels of a perspective camera's picture."""
    matrix = np.asarray(camera.world_from_view, np.float64)
    x, y = np.meshgrid((np.arange(size[0]) + 0.5) / size[0] * 2 - 1, 1 - (np.arange(size[1]) + 0.5) / size[1] * 2)
    height = np.tan(camera.yfov / 2)
    width = height * size[0] / size[1]
    local = np.stack([x.ravel() * width, y.ravel() * height, -np.ones(x.size)], 1)
    local /= np.linalg.norm(local, axis=1, keepdims=True)
    return Rays(np.repeat((matrix[:3, 3] - origin)[None], x.size, 0), local @ matrix[:3, :3].T, FAR)


def triangles_of(upload: SceneUpload, scene: gi.Scene) -> NDArray[np.float64]:
    """Return the corners of all triangles relative to the scene's origin, (m, 3, 3)."""
    parts = []
    for instance in scene.instances:
        corners = instance.mesh.positions.astype(np.float64)[instance.mesh.triangles]
        matrix = np.asarray(instance.world_from_local, np.float64)
        parts.append(corners @ matrix[:3, :3].T + matrix[:3, 3] - upload.origin)
    return np.concatenate(parts)


def bounce_rays(rays: Rays, hits: NDArray[np.uint32], normals: NDArray[np.float64], length: float) -> Rays:
    """Return a ray in a direction drawn by the cosine from each hit."""
    rng = np.random.default_rng(1)
    distance = hits[:, 0].view(np.float32).astype(np.float64)[:, None]
    points = rays.origins + rays.directions * distance
    direction = normals + (lambda v: v / np.linalg.norm(v, axis=1, keepdims=True))(rng.normal(size=points.shape))
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-6)
    return Rays(points + 1e-5 * length * normals, direction, FAR)


def facing_normals(tracer: Tracer, rays: Rays) -> NDArray[np.float64]:
    """Return the normals of the surfaces that rays hit, on the side of the rays, by tracing two more beside each."""
    hits = []
    side = np.cross(rays.directions, [0.36, 0.48, 0.8])
    for shift in (0 * side, side, np.cross(rays.directions, side)):
        beside = Rays(rays.origins, rays.directions + 1e-4 * shift, FAR)
        distance = tracer("closest", beside)[0][:, 0].view(np.float32).astype(np.float64)[:, None]
        hits.append(beside.origins + beside.directions * np.minimum(distance, 1e6))
    normal = np.cross(hits[1] - hits[0], hits[2] - hits[0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    return normal * np.where((normal * rays.directions).sum(1, keepdims=True) > 0, -1, 1)


def all_rays(tracer: Tracer, camera: Camera, size: tuple[int, int], length: float) -> dict[str, tuple[str, Rays]]:
    """Return each set of rays with its kind of trace."""
    first = camera_rays(camera, size, tracer.upload.origin)
    hits = tracer("closest", first)[0]
    seen = hits[:, 1] != 0xFFFFFFFF
    kept = Rays(first.origins[seen], first.directions[seen], first.limits[seen])
    bounce = bounce_rays(kept, hits[seen], facing_normals(tracer, kept), length)
    ends = tracer("closest", bounce)[0]
    distance = np.minimum(ends[:, 0].view(np.float32), length)[:, None]
    targets = (bounce.origins + bounce.directions * distance)[np.random.default_rng(2).permutation(len(ends))]
    shadow = Rays(bounce.origins, targets - bounce.origins, 0.9999)
    return {"camera": ("closest", first), "bounce": ("closest", bounce), "shadow": ("any", shadow)}


def embree_scene(corners: NDArray[np.float64]) -> Any:
    """Return an Embree scene of triangles, or None if embreex is not installed."""
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError:
        return None
    scene = EmbreeScene()
    TriangleMesh(scene, np.ascontiguousarray(corners, np.float32))
    return scene


def embree(scene: Any, kind: str, rays: Rays, rounds: int) -> tuple[NDArray[np.bool_], float]:
    """Return which rays hit something, and the seconds of all cores."""
    query = {"closest": "INTERSECT", "any": "OCCLUDED"}[kind]
    limits = np.ascontiguousarray(rays.limits)
    results: list[Any] = []

    def work() -> None:
        results.append(scene.run(rays.origins, rays.directions, limits.copy(), query=query))

    seconds = [measured(work) for _ in range(rounds + 1)]
    return results[0] >= 0, median(seconds[1:])


def point(text: str) -> tuple[float, float, float]:
    """Return the point that "x,y,z" names. Raises ValueError for other texts."""
    x, y, z = (float(n) for n in text.split(","))
    return x, y, z


def main() -> None:
    """Print a table of each scene. Raises GiError for a scene that cannot be read."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=["cornell"])
    parser.add_argument("--size", type=parse_size, default=(640, 360))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--position", type=point)
    parser.add_argument("--target", type=point)
    options = parser.parse_args()
    size = options.size
    if options.rounds < 1 or min(size) < 1:
        parser.error("--rounds and both sides of --size must be at least 1")
    if (options.position is None) != (options.target is None):
        parser.error("--position and --target belong together")
    for name in options.scenes:
        scene = gi.load(name)
        camera = scene.cameras[0] if scene.cameras else gi.Camera.look_at((0, 0, 1), (0, 0, 0))
        if options.position is not None:
            camera = gi.Camera.look_at(options.position, options.target, (0, 1, 0), 60)
        print(f"{name}: {sum(len(i.mesh.triangles) for i in scene.instances)} triangles, {size[0]}x{size[1]}")
        with tempfile.TemporaryDirectory() as folder:
            tracer = Tracer(scene, Path(folder))
            low, high = scene.bounds()
            sets = all_rays(tracer, camera, size, float(np.linalg.norm(high - low)))
            other = embree_scene(triangles_of(tracer.upload, scene))
            for label, (kind, rays) in sets.items():
                result, seconds = tracer(kind, rays, options.rounds)
                hit = result[:, 1] != 0xFFFFFFFF if kind == "closest" else result[:, 0] > 0
                line = f"  {label:7} {len(hit) / seconds / 1e6:7.3f} million/s, {hit.mean():.4f} hit"
                if other is not None:
                    hit, seconds_there = embree(other, kind, rays, options.rounds)
                    rate = len(hit) / seconds_there / 1e6
                    line += f"; Embree {rate:7.3f} million/s, {hit.mean():.4f} hit: {seconds / seconds_there:.1f} times"
                print(line)
        sys.stdout.flush()


if __name__ == "__main__":
    try:
        main()
    except GiError as error:
        print(f"ray_rates.py: error: {error}", file=sys.stderr)
        sys.exit(2)
