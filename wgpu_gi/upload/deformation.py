"""Deforms figures on the device: poses their vertices, writes their triangles, and refits their hierarchies in place.

Wald et al. 2007, "Ray Tracing Deformable Scenes Using Dynamic Bounding Volume Hierarchies", section 4. Departure: boxes
are quantised to 8 bits in the same step (`wgsl/scene/deform/refit.wgsl`).

In a frame the host sends joint matrices, morph weights and the grids of node boxes, and nothing comes back. The tables
of figures lie in buffers, which are copied into the scene's textures: on CPU drivers, a copied texel takes a quarter of
the time of one that a shader writes.

A figure of 50,380 vertices with 60 joints takes 2.8 ms, 1.0 ms of it for the pose, and 2.4 ms more for its hierarchy:
2 % of a many-light frame at 640x360 (`walk`, llvmpipe, CPU time over two cores).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import wgpu
from numpy.typing import NDArray

from ..errors import GiError
from ..gpu.device import Device
from ..gpu.kernels import Kernels, round_up
from ..gpu.schedule import Work
from ..gpu.wgsl.load import load
from .draw_list import DrawList
from .figures import Figure
from .mesh_data import Placement
from .resources import TABLE_WIDTH, GpuResources
from .rest_pose import RestPose
from .two_level_bvh import TEXELS, TwoLevelBvh

FOLDER = "scene/deform/"
GROUP = 256  # threads of a workgroup
UNIFORM_STRIDE = 256  # bytes, WebGPU's alignment of uniform buffers' offsets
POSITION = 16  # bytes of a posed vertex
TABLES = ("nodes", "triangles", "vertices")


class Deformation(Work):
    """The device's part of figures. `load` after each change of the tables, `pose` after each new pose, then `run`.

    `due` says why `run` must run; empty if everything is up to date. It is work of a graph (`Graph.outside`).
    """

    def __init__(self, device: Device, resources: GpuResources) -> None:
        self.due = ""
        self._gpu, self._resources = device.gpu, resources
        self._kernels = Kernels(device)
        self._limit = int(device.limits["max-storage-buffer-binding-size"])
        self._places: list[Placement] = []
        self._firsts = (0, 0, 0)
        self._tables: dict[str, Any] = {}
        self._rest: dict[RestPose, dict[str, Any]] = {}
        self._vertices: object = None  # the figures, and where their vertices are posed
        self._posed: Any = None
        self._pose: dict[str, Any] = {}  # matrices, weights and params
        self._first_matrix: NDArray[np.int64] = np.zeros(1, np.int64)
        self._first_weight: NDArray[np.int64] = np.zeros(1, np.int64)
        self._moves = False  # the poses are new
        self._fresh = True  # these figures were not posed yet
        self._draws: DrawList | None = None

    @property
    def has_before(self) -> bool:
        """True if the figures have positions from before the last new pose."""
        return not self._fresh

    def load(self, hierarchy: TwoLevelBvh) -> None:
        """Take over the tables of the figures as the host has sent them."""
        self._places = [place for place in hierarchy.placements() if place.figure is not None]
        self._firsts = hierarchy.first_figures
        # The tables, in whole rows as in the textures.
        for name, first, texels in zip(TABLES, self._firsts, TEXELS, strict=True):
            table = getattr(hierarchy, name)[first:]
            rows = round_up(texels * len(table), TABLE_WIDTH)
            padded = np.zeros(rows * TABLE_WIDTH * 4, np.uint32)
            padded.view(np.uint8)[: table.nbytes] = np.ascontiguousarray(table).view(np.uint8).ravel()
            self._tables[name] = self._sent(self._tables.get(name), padded)
        count = self._tables["nodes"].size // (16 * TEXELS[0]) + 1
        self._tables["unions"] = self._room(self._tables.get("unions"), 32 * count)
        # The posed vertices; they stay if the same figures have them.
        vertices = [(place.figure, place.vertices.start - self._firsts[2]) for place in self._places]
        if vertices != self._vertices:
            self._vertices, self._fresh = vertices, True
            size = POSITION * (self._places[-1].vertices.stop - self._firsts[2]) if self._places else 0
            self._posed = self._room(self._posed, size)
            self.reserve(0)
        # The bind poses.
        used = {place.figure.rest for place in self._places if place.figure is not None}
        for rest in used - set(self._rest):
            self._rest[rest] = {name: self._sent(None, array) for name, array in rest.records.items()}
        for rest in set(self._rest) - used:
            for buffer in self._rest.pop(rest).values():
                buffer.destroy()
        self._kernels.forget()
        self.due = "the scene has been sent"

    def pose(self, moves: bool) -> None:
        """Send the poses and grids of the figures; `moves`: the poses are new."""
        figures = self._figures()
        matrices = [figure.matrices for figure in figures]
        weights = [figure.weights for figure in figures]
        rows = np.concatenate(matrices).astype(np.float32)
        values = np.append(np.concatenate(weights), 0).astype(np.float32)
        self._first_matrix = 3 * np.cumsum([0, *map(len, matrices)])
        self._first_weight = np.cumsum([0, *map(len, weights)])
        for name, array in (("matrices", rows), ("morph_weights", values)):
            self._pose[name] = self._sent(self._pose.get(name), array)
        self._moves |= moves
        self.due = "new pose" if moves else self.due or "another grid"
        for name in TABLES:
            self._resources.touch(name)

    def reserve(self, count: int) -> int:
        """Make room in `before_positions` for `count` vertices behind those of figures; return the first's number.

        The buffer keeps what it holds of figures.
        """
        posed = 0 if self._posed is None else self._posed.size
        name, size = "before_positions", posed + POSITION * count
        if name in self._resources and self._resources[name][0].size >= size:
            return posed // POSITION
        new = self._room(None, size)
        if name in self._resources:
            old = self._resources[name][0]
            encoder = self._gpu.create_command_encoder(label="deform")
            encoder.copy_buffer_to_buffer(old, 0, new, 0, min(old.size, new.size))
            self._gpu.queue.submit([encoder.finish()])
        self._resources.set(name, new)
        return posed // POSITION

    def send_before(self, first: int, positions: NDArray[np.float32]) -> None:
        """Send earlier positions to `before_positions`, from vertex `first` on."""
        buffer, _ = self._resources["before_positions"]
        padded = np.zeros((len(positions), 4), np.float32)
        padded[:, :3] = positions
        self._gpu.queue.write_buffer(buffer, POSITION * first, padded)
        self._resources.touch("before_positions")

    def draw(self, draws: DrawList) -> None:
        """Write the vertices of raster passes, too; call after each change of `draws` and each new pose."""
        if self.due or draws is not self._draws:
            self.due = self.due or "new vertices of raster passes"
            self._resources.touch("raster_vertices")
        self._draws = draws

    def run(self) -> None:
        """Pose the vertices, and write all that derives from them."""
        kernels = self._kernels
        # Keep the last positions, for motion vectors.
        if self._moves and not self._fresh:
            kernels.copy(self._posed, self._resources["before_positions"][0])
        dispatches = list(self._dispatches())
        uniform = self._uniforms([record for _, _, _, record, _ in dispatches])
        for number, (name, count, buffers, record, constants) in enumerate(dispatches):
            bound = buffers | {"params": uniform(number, record.nbytes)}
            kernels.dispatch(f"{FOLDER}{name}.wgsl", round_up(count, GROUP), bound, constants)
        if self._fresh:
            kernels.copy(self._posed, self._resources["before_positions"][0])
        for name, first, texels in zip(TABLES, self._firsts, TEXELS, strict=True):
            # Meshes of a single leaf have no nodes.
            if self._tables[name].size >= 16 * TABLE_WIDTH:
                texture, _ = self._resources[name]
                kernels.copy_rows(self._tables[name], texture, first * texels // TABLE_WIDTH, TABLE_WIDTH)
        kernels.submit()
        self.due, self._moves, self._fresh = "", False, False

    def release(self) -> None:
        """Free the buffers. `load` makes new ones."""
        buffers = [*self._tables.values(), *self._pose.values(), self._posed]
        buffers += [buffer for rest in self._rest.values() for buffer in rest.values()]
        for buffer in buffers:
            if buffer is not None:
                buffer.destroy()
        self._tables, self._pose, self._rest, self._places = {}, {}, {}, []
        self._posed = self._vertices = self._draws = None
        self._kernels.forget()
        self.due, self._moves, self._fresh = "", False, True

    def _figures(self) -> list[Figure]:
        return [place.figure for place in self._places if place.figure is not None]

    def _dispatches(self) -> Any:
        """Yield shader, threads, buffers, params and constants of all dispatches, in order."""
        mesh = {"posed": self._posed, "triangles": self._tables["triangles"]}
        node, triangle, vertex = self._firsts
        pose = load(FOLDER + "pose.wgsl").struct_dtype("Params")
        part = load(FOLDER + "mesh.wgsl").struct_dtype("Range")
        for number, (place, figure) in enumerate(zip(self._places, self._figures(), strict=True)):
            rest = figure.rest
            # The vertices.
            record = np.zeros((), pose)
            record["count"], record["first_vertex"] = rest.count, place.vertices.start - vertex
            record["first_matrix"] = self._first_matrix[number]
            record["first_weight"] = self._first_weight[number]
            bound = {**self._rest[rest], **self._pose, "posed": self._posed, "vertices": self._tables["vertices"]}
            yield "pose", rest.count, bound, record, rest.parts

            def a_range(first: int, count: int, place: Placement = place) -> NDArray[np.void]:
                record = np.zeros((), part)
                record["first"], record["count"] = first, count
                record["first_node"], record["first_triangle"], record["first_vertex"] = node, triangle, vertex
                record["grid_low"], record["grid_scale"] = place.grid.low, place.grid.scale
                return record

            # The triangles; the nodes, level by level from the last one up; the vertices of raster passes.
            count = place.triangles.stop - place.triangles.start
            yield "triangles", count, mesh, a_range(place.triangles.start - triangle, count), {}
            levels = place.data.bvh.levels
            tree = mesh | {"nodes": self._tables["nodes"], "unions": self._tables["unions"]}
            for first, end in reversed(list(pairwise(levels))):
                yield "refit", end - first, tree, a_range(place.nodes.start - node + first, end - first), {}
            drawn = None if self._draws is None else self._draws.parts.get(figure.stand_in.mesh)
            if drawn is not None:
                names = ("raster_sources", "raster_vertices")
                buffers = {"posed": self._posed, **{name: self._resources[name][0] for name in names}}
                yield "raster", drawn.stop - drawn.start, buffers, a_range(drawn.start, drawn.stop - drawn.start), {}

    def _uniforms(self, records: list[NDArray[np.void]]) -> Callable[[int, int], tuple[Any, int, int]]:
        """Send the params of all dispatches; return a function that binds one by number and size."""
        padded = np.zeros((len(records), UNIFORM_STRIDE), np.uint8)
        for row, record in zip(padded, records, strict=True):
            row[: record.nbytes] = np.frombuffer(record.tobytes(), np.uint8)
        buffer = self._pose["params"] = self._sent(self._pose.get("params"), padded, wgpu.BufferUsage.UNIFORM)
        return lambda number, size: (buffer, UNIFORM_STRIDE * number, size)

    def _sent(self, old: Any, array: NDArray, usage: int = wgpu.BufferUsage.STORAGE) -> Any:
        """Return a buffer with the contents of an array: `old` if it has the size, else a new one."""
        buffer = self._room(old, array.nbytes, usage)
        if array.nbytes:
            self._gpu.queue.write_buffer(buffer, 0, np.ascontiguousarray(array))
        return buffer

    def _room(self, old: Any, size: int, usage: int = wgpu.BufferUsage.STORAGE) -> Any:
        """Return a buffer of a size in bytes, `old` if it has that. Raises GiError if the device cannot bind it."""
        size = max(math.ceil(size / 4) * 4, 16)
        if size > self._limit:
            sizes = f"{size / 2**20:.0f} MiB; this device binds at most {self._limit / 2**20:.0f} MiB"
            raise GiError(f"the scene's skinned and morphed meshes take {sizes}: use fewer vertices")
        if old is not None and old.size == size:
            return old
        if old is not None:
            old.destroy()
        usage |= wgpu.BufferUsage.COPY_DST | wgpu.BufferUsage.COPY_SRC
        return self._gpu.create_buffer(label="deform", size=size, usage=usage)
