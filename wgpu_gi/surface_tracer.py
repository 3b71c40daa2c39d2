"""Asks a scene's surfaces by rays, beside the picture: what pixels show, what instances cover alone, what rays reach.

It has a render graph of its own, so that the picture of the frame's graph and its average stay, and its own copy on the
GPU of scenes other than the picture's.
"""

from __future__ import annotations

import numpy as np
import wgpu
from numpy.typing import ArrayLike, NDArray

from .errors import GiError
from .gpu.device import Device
from .gpu.graph import Graph
from .gpu.handles import Buffer
from .scene.scene import Scene
from .techniques.reference import declare_primary
from .techniques.reference.surfaces import WORDS, declare_amodal, declare_corners, declare_reach, rows_of_band
from .techniques.shared.scene_inputs import SceneInputs, declare_deformation, share_scene
from .upload.scene_upload import SceneUpload

Array = NDArray[np.float64]
MOST_RAYS = 1 << 20  # of a pass
FAR = 3e38  # of rays without a limit
# A ray to a point ends this far before it: of its length, and of the distance of both ends from the scene's origin, by
# which float32 rounds (`wgsl/scene/ray_offset.wgsl`). Surfaces nearer to a point than that do not hide it.
SHORT_OF_LENGTH, SHORT_OF_PLACE = 1e-4, 12e-6


class SurfaceTracer:
    """Traces rays through the GPU's copy of a scene."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self.graph = Graph(device)
        self._other: SceneUpload | None = None

    def release(self) -> None:
        """Free all GPU memory."""
        self.graph.release()
        if self._other is not None:
            self._other.release()
            self._other = None

    def upload_of(self, scene: Scene, diffuse: bool) -> SceneUpload:
        """Return a copy on the GPU of a scene other than the picture's; rays do not depend on the scenes before it."""
        if self._other is None or self._other.diffuse != diffuse:
            self.release()
            self._other = SceneUpload(self._device, diffuse)
        self._other.forget_layout()
        self._other.update(scene)
        return self._other

    def surfaces(self, upload: SceneUpload, view: NDArray[np.void]) -> dict[str, NDArray[np.float32]]:
        """Return the buffers albedo, normal, depth and instance; the latter counts instances on the GPU from 1."""
        width, height = int(view["size"][0]), int(view["size"][1])
        found = declare_primary(self.graph, self._begin(upload, view))
        buffers = {"albedo": found.albedo, "normal": found.normal, "position": found.position}
        self._run(*buffers.values())
        albedo, normal, position = (self.graph.read_back(b).reshape(height, width, 4) for b in buffers.values())
        values = albedo[..., :3], normal[..., :3], normal[..., 3], position[..., 3]
        return dict(zip(("albedo", "normal", "depth", "instance"), map(np.ascontiguousarray, values), strict=True))

    def amodal(self, upload: SceneUpload, view: NDArray[np.void], instances: int) -> NDArray[np.int64]:
        """Return for each instance on the GPU how many pixels it would cover alone, and their box: (n, 5).

        Columns: pixels, x, y, width, height; the box of no pixels is 0.
        """
        width, height = size = int(view["size"][0]), int(view["size"][1])
        found = np.zeros((instances, WORDS), np.int64)
        if not instances:
            return found
        rows = rows_of_band(size, instances)
        for first in range(0, height, rows):
            scene = self._begin(upload, view)
            boxes = declare_amodal(self.graph, scene, instances, first, rows)
            self._run(boxes)
            band = self.graph.read_back(boxes).reshape(instances, WORDS).astype(np.int64)
            found[:, 0] += band[:, 0]
            found[:, 1:] = np.maximum(found[:, 1:], band[:, 1:])
        low = np.where(found[:, :1] > 0, (width, height) - found[:, 1:3], 0)
        return np.concatenate([found[:, :1], low, found[:, 3:] - low], axis=1)

    def corners(self, upload: SceneUpload, view: NDArray[np.void]) -> tuple[NDArray[np.int64], Array]:
        """Return the vertices (h, w, 3) of the triangle in each pixel, by place in its mesh, and weights (h, w, 3)."""
        width, height = int(view["size"][0]), int(view["size"][1])
        scene = self._begin(upload, view)
        corners = declare_corners(self.graph, scene)
        self._run(corners)
        words = self.graph.read_back(corners).reshape(height, width, 2, 4)
        firsts = np.array([0, *upload.first_vertices()])
        vertices = words[..., 0, :3].astype(np.int64) - firsts[words[..., 0, 3]][..., None]
        weights = np.ascontiguousarray(words[..., 1, :2]).view(np.float32).astype(np.float64)
        return vertices, np.concatenate([1 - weights.sum(-1, keepdims=True), weights], -1)

    def reaches(
        self, upload: SceneUpload, view: NDArray[np.void], starts: Array, directions: Array, limits: Array
    ) -> NDArray[np.bool_]:
        """Return whether rays (n, 3), (n, 3), in world space, get as far as `limits` (n,) times their directions."""
        ends = starts + directions * np.where(np.isfinite(limits), limits, 0.0)[:, None]
        lengths = np.linalg.norm(directions, axis=1)
        place = np.maximum(*(np.linalg.norm(points - upload.origin, axis=1) for points in (starts, ends)))
        short = limits * (1 - SHORT_OF_LENGTH) - SHORT_OF_PLACE * place / lengths
        rays = np.zeros((len(starts), 2, 4), np.float32)
        rays[:, 0, :3], rays[:, 1, :3] = starts - upload.origin, directions
        rays[:, 0, 3] = np.clip(short, 0, FAR)
        parts = [rays[first : first + MOST_RAYS] for first in range(0, len(rays), MOST_RAYS)]
        found = [self._reaches(upload, view, part) for part in parts]
        return np.concatenate([np.zeros(0, bool), *found])

    def _reaches(self, upload: SceneUpload, view: NDArray[np.void], rays: NDArray[np.float32]) -> NDArray[np.bool_]:
        buffer = self._device.gpu.create_buffer_with_data(data=rays, usage=wgpu.BufferUsage.STORAGE)
        try:
            scene = self._begin(upload, view)
            reached = declare_reach(self.graph, scene, self.graph.share("rays", buffer), len(rays))
            self._run(reached)
        finally:
            buffer.destroy()
        found: NDArray[np.bool_] = self.graph.read_back(reached).ravel() != 0
        return found

    def _begin(self, upload: SceneUpload, view: NDArray[np.void]) -> SceneInputs:
        """Begin a declaration for a view of the scene."""
        self.graph.uniform("view", view)
        scene = share_scene(self.graph, upload)
        self.graph.begin((int(view["size"][0]), int(view["size"][1])))
        declare_deformation(self.graph, scene)
        return scene

    def _run(self, *results: Buffer) -> None:
        """Run the passes that these buffers need."""
        self.graph.compile(list(results))
        self.graph.run(force=True)


def checked_rays(starts: ArrayLike, directions: ArrayLike, limits: ArrayLike) -> tuple[Array, Array, Array]:
    """Return rays in float64. Raises GiError unless they are (n, 3), (n, 3) and (n,) numbers, directions not zero."""
    try:
        begin, way, most = (np.asarray(values, np.float64) for values in (starts, directions, limits))
    except (TypeError, ValueError):
        raise GiError("rays are three arrays of numbers: starts (n, 3), directions (n, 3) and limits (n,)") from None
    if begin.ndim != 2 or begin.shape[1] != 3 or way.shape != begin.shape or most.shape != begin.shape[:1]:
        shapes = f"{begin.shape}, {way.shape} and {most.shape}"
        raise GiError(f"rays have starts (n, 3), directions (n, 3) and limits (n,), not {shapes}")
    if not np.isfinite(begin).all() or not np.isfinite(way).all() or not (most > 0).all() or not way.any(1).all():
        raise GiError("rays start at finite points, in directions other than 0, with limits above 0")
    return begin, way, most
