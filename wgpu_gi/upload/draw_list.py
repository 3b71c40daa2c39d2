"""The draw list of raster passes: vertex (with a triangle number) and index buffers, draw calls, and clusters.

Fragments need the number of their triangle, and WebGPU has no primitive index without an optional feature. So every
triangle gets a provoking (first) vertex of its own, whose number reaches the fragments by flat interpolation. Few
vertices need a duplicate: most triangles find one that no other triangle has claimed. Clusters are runs of consecutive
triangles; passes cull them against their views.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, MutableMapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Instance, Mesh
from .mesh_data import MASKED, NONE, MeshData, Placement, Topology
from .split_triangles import split_triangles
from .two_level_bvh import TwoLevelBvh

CLUSTER = 512  # triangles that are culled together; tools/README.md, "Constants"
MANY_INSTANCES = 8  # meshes with more instances are culled as a whole; tools/README.md, "Constants"
ROUNDING = 5e-7  # twice the relative error of a sum of four products in float32, 4 * 2^-24
SMALL_GAP = 64  # culled triangles that take as long to draw as another draw call; measured 70 on llvmpipe

DrawCall = tuple[int, int, int, int]  # first index, indices, first instance slot, instances


@dataclass
class RasterMesh:
    """A mesh whose triangles have provoking vertices of their own."""

    source: NDArray[np.int64]  # (n,) vertex of the mesh that each vertex copies
    owner: NDArray[np.int64]  # (n,) triangle that the vertex provokes, or -1
    corners: NDArray[np.int64]  # (m, 3) vertices of each triangle, the provoking one first


@dataclass
class DrawList:
    """The buffers, and the draw calls that draw everything, opaque and alpha-masked.

    vertices (n, 4) uint32: position as float bits (world space if baked, else local) and triangle number. sources (n,)
    uint32: index of each vertex in the scene's vertex table. slots (k,) uint32: the scene's instance for each instance
    index of the draw calls; slot 0 is for vertices in world space. parts: the vertices of each mesh; of figures,
    `vertices` has the pose that their hierarchies were built in.
    """

    vertices: NDArray[np.uint32]
    sources: NDArray[np.uint32]
    indices: NDArray[np.uint32]
    slots: NDArray[np.uint32]
    opaque: tuple[DrawCall, ...] = ()
    masked: tuple[DrawCall, ...] = ()
    clusters: Clusters = field(default_factory=lambda: Clusters())
    parts: dict[Mesh, slice] = field(default_factory=dict)

    def move(self, place: Placement, numbers: list[int]) -> slice:
        """Take over new positions of a mesh in local space, whose instances have the `numbers`.

        Return the range of vertices that have changed. Call `clusters.place` afterwards.
        """
        part = self.parts[place.data.mesh]
        positions = np.asarray(place.data.mesh.positions, np.float32)
        moved = positions[self.sources[part].astype(np.int64) - place.vertices.start]
        self.vertices[part, :3] = moved.view(np.uint32)
        # Box the clusters anew; those of several instances have the same indices.
        boxes: dict[int, NDArray[np.float32]] = {}
        indices = self.indices.ravel()
        for row in np.flatnonzero(np.isin(self.clusters.instances, numbers)).tolist():
            first, count = self.clusters.runs[row, :2].tolist()
            if first not in boxes:
                corners = moved[indices[first : first + count].astype(np.int64) - part.start]
                boxes[first] = np.stack([corners.min(0), corners.max(0)])
            self.clusters.local[row] = boxes[first]
        return part

    def visible(self, shown: NDArray[np.bool_], masked: bool) -> list[DrawCall]:
        """Return draw calls for the clusters that `shown` (c,) selects; see `Clusters.visible`."""
        if shown.all():
            return list(self.masked if masked else self.opaque)
        return self.clusters.visible(shown, masked)


@dataclass
class Clusters:
    """Parts of the draw calls that are culled separately, opaque ones first.

    `local` (c, 2, 3) are their boxes in the space of their vertices, `runs` (c, 4) their draw calls, `instances` (c,)
    the scene's instances that place them, -1 in world space. `place` updates `boxes`, relative to the origin.
    """

    local: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 2, 3), np.float32))
    runs: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 4), np.int64))
    instances: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    opaque_count: int = 0
    boxes: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 2, 3), np.float32))

    def place(self, world_from_local: NDArray[np.float32], posed: Mapping[int, NDArray] | None = None) -> None:
        """Place the boxes by the matrices (n, 4, 3 or 4) of all instances, column by column as on the GPU.

        `posed`: new boxes (2, 3) of the deformed instances, by number.
        """
        for number, box in (posed or {}).items():
            self.local[self.instances == number] = box
        placed = self.instances >= 0
        self.boxes = self.local.copy()
        # Arvo 1990, "Transforming Axis-Aligned Bounding Boxes"; each row of `m` is the image of an axis.
        m = world_from_local[self.instances[placed], :, :3].astype(np.float64)
        low, high = self.local[placed, 0], self.local[placed, 1]
        middle = np.einsum("ci,cij->cj", (low + high) / 2, m[:, :3]) + m[:, 3]
        reach = np.einsum("ci,cij->cj", (high - low) / 2, np.abs(m[:, :3]))
        # Widen by the rounding error of shaders, which is relative to the terms of the sum, not to the sum.
        largest = np.maximum(np.abs(low), np.abs(high))
        reach += ROUNDING * (np.einsum("ci,cij->cj", largest, np.abs(m[:, :3])) + np.abs(m[:, 3]))
        self.boxes[placed] = np.stack([middle - reach, middle + reach], 1)

    def visible(self, shown: NDArray[np.bool_], masked: bool) -> list[DrawCall]:
        """Return draw calls for the clusters that `shown` (c,) selects, merged, with small gaps between them filled."""
        part = slice(self.opaque_count, None) if masked else slice(self.opaque_count)
        return merge_draw_calls(self.runs[part][fill_gaps(shown[part], self.runs[part, 1])])


def fill_gaps(shown: NDArray[np.bool_], indices: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Add to `shown` (c,) the culled clusters in gaps that are too small to be worth another draw call.

    `indices` (c,) has the number of indices of each cluster.
    """
    at = np.flatnonzero(shown)
    ends = np.cumsum(indices)
    gaps = ends[at[1:] - 1] - ends[at[:-1]]
    small = np.flatnonzero((gaps > 0) & (gaps <= 3 * SMALL_GAP))
    if not len(small):
        return shown
    change = np.zeros(len(shown), np.int8)
    change[at[small] + 1], change[at[small + 1]] = 1, -1
    return shown | (np.cumsum(change) > 0)


def merge_draw_calls(runs: NDArray[np.int64]) -> list[DrawCall]:
    """Merge draw calls of adjacent indices of one instance, then those of the same indices of adjacent instances."""
    if not len(runs):
        return []
    # Adjacent indices.
    first, count, slot, instances = runs.T
    same = (slot[1:] == slot[:-1]) & (instances[1:] == instances[:-1])
    starts = _starts(same & (first[1:] == first[:-1] + count[:-1]))
    first, slot, instances = first[starts], slot[starts], instances[starts]
    count = np.add.reduceat(count, starts)
    # Adjacent instances.
    same = (first[1:] == first[:-1]) & (count[1:] == count[:-1])
    starts = _starts(same & (slot[1:] == slot[:-1] + instances[:-1]))
    joined = [first[starts], count[starts], slot[starts], np.add.reduceat(instances, starts)]
    return list(zip(*(column.tolist() for column in joined), strict=True))


def _starts(continues: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return where groups begin; `continues` tells for each element but the first if it continues the previous one."""
    return np.concatenate([[0], np.flatnonzero(~continues) + 1])


def assign_provoking_vertices(triangles: NDArray[np.uint32], vertex_count: int) -> RasterMesh:
    """Give each triangle (m, 3) a provoking vertex that no other triangle has."""
    # Let triangles claim their corners: in each round those without a vertex claim their next corner.
    triangles = triangles.astype(np.int64)
    owner = np.full(vertex_count, -1, np.int64)
    chosen = np.full(len(triangles), -1, np.int64)
    for corner in range(3):
        open_ = np.flatnonzero(chosen < 0)
        wanted = triangles[open_, corner]
        open_, wanted = open_[owner[wanted] < 0], wanted[owner[wanted] < 0]
        owner[wanted] = open_  # if several triangles claim a vertex, one of them gets it
        won = open_[owner[wanted] == open_]
        chosen[won] = corner
    # Duplicate the first corner of triangles without a vertex, and rotate each triangle to begin with its vertex.
    without = np.flatnonzero(chosen < 0)
    chosen[without] = 0
    rows = np.arange(len(triangles))[:, None]
    corners = triangles[rows, (chosen[:, None] + np.arange(3)) % 3]
    source = np.concatenate([np.arange(vertex_count), corners[without, 0]])
    corners[without, 0] = vertex_count + np.arange(len(without))
    return RasterMesh(source, np.concatenate([owner, without]), corners)


def build_draw_list(
    instances: list[Instance], hierarchy: TwoLevelBvh, known: MutableMapping[Topology, RasterMesh]
) -> DrawList:
    """Return the draw list of a scene; `known` caches the RasterMesh of each topology."""
    parts = [_Part(place, known) for place in hierarchy.placements()]
    slots = _assign_slots(parts, instances)
    vertices, sources = _lay_out_vertices(parts, hierarchy, instances)
    indices, runs, clusters = _lay_out_indices(parts, hierarchy, slots)
    clusters.place(hierarchy.instances["world_from_local"])
    opaque, masked = (tuple(merge_draw_calls(np.array(runs[key], np.int64).reshape(-1, 4))) for key in (False, True))
    ranges = {p.data.mesh: slice(p.first_vertex, p.first_vertex + len(p.raster.source)) for p in parts}
    return DrawList(vertices, sources, indices, slots.astype(np.uint32), opaque, masked, clusters, ranges)


def _assign_slots(parts: list[_Part], instances: list[Instance]) -> NDArray[np.int64]:
    """Give each part in local space a slot for each of its instances; return the scene's instance of each slot."""
    users: dict[int, list[int]] = {}
    for number, instance in enumerate(instances):
        users.setdefault(id(instance.mesh), []).append(number)
    slots = [NONE]
    for part in parts:
        if part.place.baked is None:
            part.first_slot, part.users = len(slots), users[id(part.place.data.mesh)]
            slots += part.users
    return np.array(slots, np.int64)


def _lay_out_vertices(
    parts: list[_Part], hierarchy: TwoLevelBvh, instances: list[Instance]
) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Give each part its place among the vertices; return the vertices and sources of all."""
    if not parts:
        return np.zeros((1, 4), np.uint32), np.zeros(1, np.uint32)
    vertices: list[NDArray[np.uint32]] = []
    sources: list[NDArray[np.uint32]] = []
    first_vertex = 0
    for part in parts:
        part.first_vertex = first_vertex
        vertices.append(part.vertices(hierarchy, instances))
        # Pieces of split triangles are opaque, so their attributes do not matter.
        source = np.concatenate([part.raster.source, np.zeros(len(vertices[-1]) - len(part.raster.source), np.int64)])
        sources.append((source + part.place.vertices.start).astype(np.uint32))
        first_vertex += len(vertices[-1])
    return np.concatenate(vertices), np.concatenate(sources)


def _lay_out_indices(
    parts: list[_Part], hierarchy: TwoLevelBvh, slots: NDArray[np.int64]
) -> tuple[NDArray[np.uint32], dict[bool, list[DrawCall]], Clusters]:
    """Return the index buffer, its draw calls by alpha mask (False, True), and their clusters, not placed yet."""
    # Lay out opaque, then masked triangles, each part by part.
    indices: list[NDArray[np.int64]] = []
    runs: dict[bool, list[DrawCall]] = {False: [], True: []}
    boxes = [np.zeros((0, 2, 3), np.float32)]
    cluster_runs = [np.zeros((0, 4), np.int64)]
    first = opaque_clusters = 0
    for masked in (False, True):
        # Parts in world space come first, so that their draw calls merge into one.
        for part in sorted(parts, key=lambda p: p.place.baked is None):
            for drawn, corners in part.triangles(hierarchy, masked):
                indices.append(drawn + part.first_vertex)
                count = max(len(part.users), 1)
                runs[masked].append((3 * first, 3 * len(drawn), part.first_slot, count))
                new_boxes, new_runs = part.clusters(corners, 3 * first)
                boxes.append(new_boxes)
                cluster_runs.append(new_runs)
                first += len(drawn)
        if not masked:
            opaque_clusters = sum(map(len, cluster_runs))
    # Join the parts.
    all_indices = (np.concatenate(indices) if indices else np.zeros((1, 3))).astype(np.uint32)
    all_runs = np.concatenate(cluster_runs)
    placed_by = np.where(all_runs[:, 2] > 0, slots[all_runs[:, 2]], -1)
    return all_indices, runs, Clusters(np.concatenate(boxes), all_runs, placed_by, opaque_clusters)


class _Part:
    """One mesh's share of the draw list."""

    def __init__(self, place: Placement, known: MutableMapping[Topology, RasterMesh]) -> None:
        self.place = place
        self.data: MeshData = place.data
        topology = self.data.topology
        if topology not in known:
            known[topology] = assign_provoking_vertices(self.data.indices, len(self.data.vertices))
        self.raster = known[topology]
        self.first_slot = self.first_vertex = 0
        self.users: list[int] = []
        self.corners = self.data.corners  # (m, 3, 3) float32, of the triangles as they are drawn
        self.split = np.zeros(len(self.data.corners), np.bool_)  # triangles that are drawn as pieces
        self.pieces = np.zeros((0, 3, 3))

    def masked(self, hierarchy: TwoLevelBvh) -> NDArray[np.bool_]:
        """Tell for each triangle whether it has an alpha mask."""
        return (hierarchy.triangles["flags"][self.place.triangles] & MASKED) != 0

    def vertices(self, hierarchy: TwoLevelBvh, instances: list[Instance]) -> NDArray[np.uint32]:
        """Return the vertices, (n, 4) uint32: positions and triangle numbers."""
        positions = np.asarray(self.data.mesh.positions, np.float64)
        if self.place.baked is not None:
            matrix = np.asarray(instances[self.place.baked].world_from_local, np.float64)
            positions = positions @ matrix[:3, :3].T + (matrix[:3, 3] - hierarchy.origin)
        rounded = positions.astype(np.float32)
        if self.place.baked is not None:
            self.corners = rounded[self.data.indices]
        packed = np.empty((len(self.raster.source), 4), np.uint32)
        packed[:, :3] = rounded.view(np.uint32)[self.raster.source]
        packed[:, 3] = np.where(self.raster.owner < 0, 0, self.raster.owner + self.place.triangles.start)
        if self.place.baked is None or not hierarchy.has_details:
            return packed
        # Add the pieces of large triangles, with vertices of their own.
        corners = positions[self.data.indices.astype(np.int64)]
        self.split, self.pieces, owners = split_triangles(corners, 2 * hierarchy.radius)
        kept = ~self.masked(hierarchy)[owners]
        self.split &= ~self.masked(hierarchy)
        self.pieces = self.pieces[kept]
        added = np.empty((3 * len(self.pieces), 4), np.uint32)
        added[:, :3] = self.pieces.reshape(-1, 3).astype(np.float32).view(np.uint32)
        added[:, 3] = np.repeat(owners[kept], 3) + self.place.triangles.start
        return np.concatenate([packed, added])

    def triangles(
        self, hierarchy: TwoLevelBvh, masked: bool
    ) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float32]]]:
        """Yield vertices (k, 3) and corners (k, 3, 3) of the triangles to draw, with alpha mask or without."""
        chosen = (self.masked(hierarchy) == masked) & ~self.split
        if chosen.all():
            yield self.raster.corners, self.corners
        elif chosen.any():
            yield self.raster.corners[chosen], self.corners[chosen]
        if len(self.pieces) and not masked:
            numbers = np.arange(3 * len(self.pieces)).reshape(-1, 3)
            yield len(self.raster.source) + numbers, self.pieces.astype(np.float32)

    def clusters(self, corners: NDArray[np.float32], first_index: int) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Return local boxes (c, 2, 3) and draw calls (c, 4) of triangles (k, 3, 3), drawn from `first_index` on."""
        whole = len(self.users) > MANY_INSTANCES or self.place.figure is not None
        # Box each cluster.
        starts = np.arange(0, len(corners), len(corners) if whole else CLUSTER)
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]  # four times as fast as `corners.min(1)`
        low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        boxes = np.stack([np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)], axis=1)
        counts = 3 * np.diff(np.append(starts, len(corners)))
        runs = np.stack([first_index + 3 * starts, counts, np.zeros_like(starts), np.ones_like(starts)], 1)
        # Repeat each cluster for each instance.
        times = max(len(self.users), 1)
        runs = np.tile(runs, (times, 1))
        runs[:, 2] = np.repeat(self.first_slot + np.arange(times), len(starts))
        return np.tile(boxes, (times, 1, 1)), runs
