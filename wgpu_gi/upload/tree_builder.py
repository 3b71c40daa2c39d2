"""Builds and refits the hierarchies of meshes on the device.

Meister and Bittner 2018, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction": triangles
are sorted along a Morton curve; then, round by round, clusters merge that are each other's nearest among their
neighbours on the curve. The binary trees become trees of four children a node, those of the least cost
(`collapse.wgsl`). Departure: the trees of several meshes are built together, and a cluster never merges with one of
another mesh.

The same meshes give the same trees, bit for bit: no result depends on the order in which threads run.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import wgpu
from numpy.typing import NDArray

from ..gpu.device import Device
from ..gpu.kernels import Kernels, round_up
from ..gpu.wgsl.load import load
from .tree_frames import CELL_BITS, frames_of, needed_bits
from .tree_nodes import NODE, boxes_of, split_trees
from .wide_bvh import WIDTH, WideBvh

# Fewer triangles are built by `bvh.build_forest`: a process's first build takes 0.25 s more than later ones, for its 16
# pipelines; numpy builds 65,536 triangles in 0.2 s (llvmpipe).
SMALLEST = 1 << 16
FOLDER = "scene/hierarchy/"
GROUP = 256  # threads of a workgroup
TILE = 2048  # pairs that a workgroup sorts
DIGIT = 4  # bits of a key that a pass sorts by
KEY_BITS = 32
ROUNDS = 24  # submitted at a time; a million triangles take about 70
MOST_ROUNDS = 1024  # never reached: pairing halves the clusters in two rounds
UNIFORM_STRIDE = 256  # bytes, WebGPU's alignment of uniform buffers' offsets

LARGEST = 65535 * 128  # triangles built at once: as many as a dispatch of `nearest.wgsl` takes
BYTES = 32  # of the largest buffer, per triangle; the others depend on vertices and nodes
VERTEX_BYTES = 12
NODE_BYTES = WIDTH * NODE.itemsize

MeshArrays = tuple[NDArray[np.float32], NDArray[np.uint32]]  # positions (v, 3), triangles (n, 3)


class TreeBuilder:
    """Builds trees over the triangles of meshes on a device."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.limit = int(device.limits["max-storage-buffer-binding-size"])
        self.largest = min(LARGEST, self.limit // BYTES)  # triangles that `build` takes

    def suits(self, count: int) -> bool:
        """Tell whether so many triangles are worth the device, and fit into its buffers."""
        return SMALLEST <= count <= self.largest

    def fits(self, triangles: int, vertices: int, nodes: int = 0) -> bool:
        """Tell whether meshes fit into the device's buffers; `nodes`: of the tree to refit."""
        return triangles <= self.largest and max(VERTEX_BYTES * vertices, NODE_BYTES * nodes) <= self.limit

    def build(self, meshes: Sequence[MeshArrays]) -> list[WideBvh]:
        """Return the hierarchies of meshes that fit, with finite positions and at least one triangle each."""
        work = _Work(self.device)
        try:
            return _Build(work, meshes, self.limit // NODE_BYTES).run()
        finally:
            work.release()

    def refit(self, tree: WideBvh, positions: NDArray[np.float32], triangles: NDArray[np.uint32]) -> WideBvh:
        """Return `tree` with its boxes refitted to moved vertices; `triangles` (n, 3) are in leaf order."""
        if not len(tree.child):
            return tree
        work = _Work(self.device)
        try:
            # Fill in the children's references; the boxes come level by level, from the last one up.
            records = np.zeros((len(tree.child), WIDTH), NODE)
            records["child"] = tree.child
            buffers = {
                "positions": work.upload(positions, np.float32),
                "corners": work.upload(triangles, np.uint32),
                "nodes": work.upload(records, NODE),
            }
            levels = np.array(tree.levels)
            uniform = work.uniforms(np.stack([levels[:-1], np.diff(levels)], 1))
            for level in reversed(range(tree.depth)):
                groups = round_up(tree.levels[level + 1] - tree.levels[level], GROUP)
                work.run("refit", groups, buffers | {"params": uniform(level)})
            records = work.read(buffers["nodes"], NODE).reshape(-1, WIDTH)
        finally:
            work.release()
        low, high = boxes_of(records, tree.child, 1.0)
        return WideBvh(low, high, tree.child, tree.order, tree.levels)


class _Work:
    """The buffers of one piece of work, and its dispatches."""

    def __init__(self, device: Device) -> None:
        self.gpu = device.gpu
        self.kernels = Kernels(device)
        self._buffers: list[Any] = []

    def buffer(self, words: int, usage: int = 0) -> Any:
        """Return a buffer of 32-bit words, zeros."""
        usage |= wgpu.BufferUsage.STORAGE | wgpu.BufferUsage.COPY_DST | wgpu.BufferUsage.COPY_SRC
        self._buffers.append(self.gpu.create_buffer(label="hierarchy", size=4 * max(words, 1), usage=usage))
        return self._buffers[-1]

    def upload(self, array: NDArray, dtype: Any, usage: int = 0) -> Any:
        """Return a buffer with the contents of an array."""
        array = np.ascontiguousarray(array, dtype)
        found = self.buffer(array.nbytes // 4, usage)
        self.gpu.queue.write_buffer(found, 0, array)
        return found

    def uniforms(self, rows: NDArray) -> Any:
        """Return a function that binds a row of 32-bit words, by its number."""
        padded = np.zeros((len(rows), UNIFORM_STRIDE // 4), np.uint32)
        padded[:, : rows.shape[1]] = rows
        found = self.upload(padded, np.uint32, wgpu.BufferUsage.UNIFORM)
        return lambda row: (found, UNIFORM_STRIDE * row, 4 * rows.shape[1])

    def run(self, name: str, groups: Any, buffers: dict[str, Any], constants: dict[str, float] | None = None) -> None:
        """Record a dispatch of a shader of the folder; see `Kernels.dispatch`."""
        self.kernels.dispatch(FOLDER + name + ".wgsl", groups, buffers, constants)

    def read(self, buffer: Any, dtype: Any, first: int = 0, size: int | None = None) -> NDArray:
        """Run what was recorded, and return the contents of a buffer, or `size` bytes from `first` on."""
        self.kernels.submit()
        return np.frombuffer(self.gpu.queue.read_buffer(buffer, first, size), dtype)

    def release(self) -> None:
        """Free the buffers."""
        for buffer in self._buffers:
            buffer.destroy()


class _Build:
    """The trees of several meshes, from triangles to wide nodes; a buffer holds up to `most_nodes` of these."""

    def __init__(self, work: _Work, meshes: Sequence[MeshArrays], most_nodes: int) -> None:
        self.work, self.most_nodes = work, most_nodes
        self.counts = np.array([len(triangles) for _, triangles in meshes])
        self.firsts = np.cumsum(self.counts) - self.counts
        self.count = n = int(self.counts.sum())
        # Join the meshes.
        vertices = np.array([len(positions) for positions, _ in meshes])
        starts = np.cumsum(vertices) - vertices
        positions = np.concatenate([np.asarray(p, np.float32) for p, _ in meshes])
        triangles = np.concatenate(
            [np.asarray(t, np.uint32) + np.uint32(s) for (_, t), s in zip(meshes, starts, strict=True)]
        )
        trees = np.repeat(np.arange(len(meshes)), self.counts)
        frames = frames_of(positions, starts)
        self.scale = frames.scale
        self.bits = needed_bits(positions, triangles, trees, frames)
        self.constants = {"SEVERAL_TREES": float(len(meshes) > 1)}
        self.mesh = {
            "positions": work.upload(positions, np.float32),
            "corners": work.upload(triangles, np.uint32),
            "frames": work.upload(frames.records(), None),
            "trees": work.upload(trees if len(meshes) > 1 else np.zeros(1), np.uint32),
        }
        self.groups = round_up(n, GROUP)

    def run(self) -> list[WideBvh]:
        """Build the trees."""
        pairs = self._sort()
        nodes, rounds = self._merge(pairs)
        records, order = self._collapse(nodes, pairs, rounds)
        return split_trees(records, order, self.counts, self.scale)

    def _sort(self) -> Any:
        """Return the triangles in Morton order, mesh by mesh: pairs of a key and a triangle."""
        work, n = self.work, self.count
        pairs, moved, high_keys = work.buffer(2 * n), work.buffer(2 * n), work.buffer(n)
        tiles = round_up(n, TILE)
        counts = work.buffer(tiles << DIGIT)
        shifts = work.uniforms(np.arange(0, KEY_BITS, DIGIT)[:, None])
        half = CELL_BITS // 2  # of the bits are in the upper key, the others in the lower one
        work.run("keys", self.groups, self.mesh | {"pairs": pairs, "high_keys": high_keys}, self.constants)
        # Radix sort, least significant digit first; of several keys, the least significant first.
        last = KEY_BITS // DIGIT
        tree_digits = round_up(int(len(self.counts) - 1).bit_length(), DIGIT)
        keys = [
            (None, _top_digits(self.bits - half), last),
            (high_keys, _top_digits(min(self.bits, half)), last),
            (self.mesh["trees"], tree_digits, tree_digits),
        ]
        for key, digits, end in keys:
            if digits and key is not None:
                work.run("rekey", self.groups, {"keys": key, "pairs": pairs})
            for digit in range(end - digits, end):
                buffers = {"params": shifts(digit), "pairs": pairs, "counts": counts, "moved": moved}
                work.run("sort_count", tiles, buffers)
                work.run("scan", 1, buffers)
                work.run("sort_scatter", tiles, buffers)
                pairs, moved = moved, pairs
        return pairs

    def _merge(self, pairs: Any) -> tuple[dict[str, Any], NDArray[np.int64]]:
        """Merge clusters until each tree is one; return the nodes, and how many there were after each round."""
        work, n = self.work, self.count
        nodes = {name: work.buffer(8 * n) for name in ("lows", "highs")}
        nodes |= {name: work.buffer(2 * n) for name in ("children", "costs")}
        nodes["roots"] = work.buffer(len(self.counts))
        buffers = nodes | {
            "clusters": work.buffer(4 * n),
            "nearest": work.buffer(n),
            "blocks": work.buffer(2 * self.groups),
            "ends": work.buffer(MOST_ROUNDS + 1),
        }
        work.run("leaves", self.groups, self.mesh | buffers | {"pairs": pairs}, self.constants)
        dtype = load(FOLDER + "clusters.wgsl").struct_dtype("State")
        first = np.zeros(1, dtype)
        first["count"] = first["nodes"] = n
        first["search"], first["merge"] = (round_up(n, 128), 1, 1, 0), (round_up(n, 1024), 1, 1, 0)
        states = [
            work.upload(first, dtype, wgpu.BufferUsage.INDIRECT),
            work.buffer(dtype.itemsize // 4, wgpu.BufferUsage.INDIRECT),
        ]
        search, merge = (int(dtype.fields[name][1]) for name in ("search", "merge"))  # type: ignore[index]
        while True:
            for _ in range(ROUNDS):
                now, following = states
                buffers |= {"state": now, "next": following}
                work.run("nearest", (now, search), buffers, self.constants)
                work.run("merge_count", (now, merge), buffers)
                work.run("merge_scan", 1, buffers)
                work.run("merge", (now, merge), buffers)
                states.reverse()
            state = work.read(states[0], dtype)[0]
            if state["count"] == 0:
                ends = work.read(buffers["ends"], np.uint32)[: int(state["round"]) + 1].astype(np.int64)
                return nodes, np.concatenate([[n], ends[1:]])
            assert state["round"] < MOST_ROUNDS, "clusters do not merge"

    def _collapse(
        self, nodes: dict[str, Any], pairs: Any, ends: NDArray[np.int64]
    ) -> tuple[NDArray[np.void], NDArray[np.int64]]:
        """Return all wide nodes, parents before children, and the order of triangles; references count from 0."""
        work, n = self.work, self.count
        wide, kids, order = work.buffer(2 * n), work.buffer(4 * n), work.buffer(n)
        buffers = nodes | {"pairs": pairs, "wide": wide, "kids": kids, "order": order}
        # Choose the children of the roots, then of their children, ...
        firsts = {"firsts": work.upload(self.firsts, np.uint32)}
        work.run("roots", round_up(len(self.counts), GROUP), buffers | firsts)
        ranges = np.stack([ends[:-1] - n, np.diff(ends)], 1)
        uniform = work.uniforms(ranges)
        for row in reversed(range(len(ranges))):
            if ranges[row, 1]:
                work.run("collapse", round_up(int(ranges[row, 1]), GROUP), buffers | {"params": uniform(row)})
        # Number the wide nodes, and write them.
        blocks = work.buffer(self.groups + 1)
        work.run("number_count", self.groups, {"wide": wide, "blocks": blocks})
        work.run("scan", 1, {"counts": blocks})
        work.run("number_write", self.groups, {"wide": wide, "blocks": blocks})
        count = int(work.read(blocks, np.uint32, 4 * self.groups)[0])
        part = max(min(count, self.most_nodes), 1)
        records = work.buffer(part * NODE_BYTES // 4)
        firsts_of_parts = work.uniforms(np.arange(0, max(count, 1), part)[:, None])
        found = np.empty((count, WIDTH), NODE)
        for number, first in enumerate(range(0, count, part)):
            work.run("emit", round_up(n, GROUP), buffers | {"nodes": records, "params": firsts_of_parts(number)})
            found[first : first + part] = work.read(records, NODE).reshape(part, WIDTH)[: count - first]
        return found, work.read(order, np.uint32).astype(np.int64)


def _top_digits(bits: int) -> int:
    """Return how many digits of a key, from the top one down, hold `bits` bits per axis; its top two bits are zero."""
    unused = KEY_BITS - 3 * (CELL_BITS // 2)
    return round_up(3 * bits + unused, DIGIT) if bits > 0 else 0
