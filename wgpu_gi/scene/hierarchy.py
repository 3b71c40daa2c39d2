"""The two-level hierarchy over a scene's instances, as arrays for the GPU.

A mesh with a single instance lies in the world's tree with its own nodes, so that no ray is transformed for it; a mesh
with several, or one that has moved, is entered through its instances' transforms. Only the small top level is rebuilt
when instances move. Top-level leaves are not whole meshes but subtrees, opened largest first, which undoes most of the
overlap between meshes (Benthin et al. 2017, "Improved Two-Level BVHs using Partial Re-Braiding").
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bvh import LEAF_COUNT_SHIFT, LEAF_FLAG, build_bvh
from .mesh_data import MASKED, MeshData, prepare_mesh, refit
from .scene import Instance, Mesh

NONE = 0xFFFFFFFF
INSTANCE_FLAG = 1 << 30
GRID_STEPS = 65533  # of the 65536; one step of margin on either side
PAD = 1 / 16  # grid steps that a box grows by before it is rounded outwards: 10 times the error of a ray in the grid
TOP_SAH_DEPTH = 12  # 12 + log2(8192) + 1 levels above 20 + log2(2^17 .. 2^21) + 1 fit the traversal's stack of 64
OPEN_UP_TO = 2048  # subtrees in the top level; more no longer shorten the paths of rays in Sponza


@dataclass
class Grid:
    """Integer coordinates of node boxes: q = (x - low) * scale, 0..65535."""

    low: NDArray[np.float64]
    scale: NDArray[np.float64]

    @classmethod
    def around(cls, bounds: NDArray) -> Grid:
        """Return a grid that spans `bounds` (2, 3)."""
        low, high = np.asarray(bounds, np.float64)
        # A flat box gets a thickness, far below what can be seen of it.
        extent = np.maximum(high - low, max(float((high - low).max()) * 1e-6, 1e-30))
        return cls(low - extent / GRID_STEPS, GRID_STEPS / extent)

    def quantize(self, nodes: NDArray[np.void], dtype: np.dtype, first_node: int, first_triangle: int) -> NDArray[np.void]:
        """Return `nodes` with boxes rounded outwards to the grid and references moved to where they will lie."""
        packed = np.zeros(len(nodes), dtype)
        lows = [np.floor((nodes[k] - self.low) * self.scale - PAD) for k in ("low0", "low1")]
        highs = [np.ceil((nodes[k] - self.low) * self.scale + PAD) for k in ("high0", "high1")]
        for name, (child0, child1) in (("low", lows), ("high", highs)):
            steps = [np.clip(c, 0, 65535).astype(np.uint32) for c in (child0, child1)]
            packed[name] = steps[0] | steps[1] << 16
        for name in ("child0", "child1"):
            packed[name] = move_reference(nodes[name], first_node, first_triangle)
        return packed


def move_reference(child: NDArray[np.uint32], first_node: int, first_triangle: int) -> NDArray[np.uint32]:
    """Return child references of a mesh's own tree as references into the buffers of the scene."""
    return np.where(child >= LEAF_FLAG, child + np.uint32(first_triangle), child + np.uint32(first_node)).astype(np.uint32)


@dataclass
class Placement:
    """A mesh's place in the buffers, and the one instance that it was put into the world for, or None."""

    data: MeshData
    nodes: slice
    triangles: slice
    vertices: slice
    baked: Instance | None = None
    tree: NDArray[np.void] | None = None  # nodes with float boxes in the world, if baked
    world_from_local: NDArray[np.float64] | None = None


class Hierarchy:
    """Nodes, triangles, indices, vertices and instance records of a scene, in coordinates relative to `origin`.

    `update` brings them up to date; `changed` then names the arrays with new contents.
    """

    def __init__(self, dtypes: dict[str, np.dtype]) -> None:
        self.dtypes = dtypes
        self.changed: set[str] = set()
        self.origin = np.zeros(3)
        self.root = NONE
        self.world = Grid.around(np.zeros((2, 3)))
        self.radius = 0.0  # metres, of the sphere around all instances
        self._prepared: dict[int, MeshData] = {}
        self._places: dict[int, Placement] = {}
        self._moved: set[int] = set()  # id(instance)
        self._layout: object = None
        self._state: object = None

    def update(self, instances: list[Instance], material_index: dict[int, int]) -> None:
        """Bring the arrays up to date with `instances`; `material_index` numbers materials by id."""
        self.changed = set()
        meshes = list({id(i.mesh): i.mesh for i in instances}.values())
        masks = [[m.alpha_mode == "mask" for m in mesh.materials] for mesh in meshes]
        numbers = [[material_index[id(m)] for m in mesh.materials] for mesh in meshes]
        # Ids are unique only among living objects; `_places` keeps these meshes alive.
        layout = ([id(m) for m in meshes], [id(i) for i in instances], masks, numbers)
        state = (layout, [np.asarray(i.world_from_local, np.float64).tobytes() for i in instances])
        if state == self._state:
            return
        if layout != self._layout:
            self._lay_out(instances, meshes, material_index)
            self._layout = layout
        else:
            self._unbake_moved(instances)
        self._place(instances)
        self._state = state

    def placement(self, mesh: Mesh) -> Placement:
        """Return where a mesh lies."""
        return self._places[id(mesh)]

    def _lay_out(self, instances: list[Instance], meshes: list[Mesh], material_index: dict[int, int]) -> None:
        """Give every mesh its place in fresh arrays, all of them in local coordinates."""
        self._prepared = {
            id(m): self._prepared.get(id(m)) or prepare_mesh(m, self.dtypes["vertices"]) for m in meshes
        }
        # The origin stays while the set of meshes does: moving one must not move the world under the others.
        bounds = _bounds(instances)
        self.origin = bounds.mean(0)
        self._top_capacity = 2 * OPEN_UP_TO + 2 * len(instances)
        node, triangle, vertex = self._top_capacity, 0, 0
        self._places = {}
        for mesh in meshes:
            d = self._prepared[id(mesh)]
            place = Placement(
                d,
                slice(node, node + len(d.bvh.nodes)),
                slice(triangle, triangle + len(d.corners)),
                slice(vertex, vertex + len(d.vertices)),
            )
            node, triangle, vertex = place.nodes.stop, place.triangles.stop, place.vertices.stop
            self._places[id(mesh)] = place
        self.nodes = np.zeros(max(node, 1), self.dtypes["nodes"])
        self.triangles = np.zeros(max(triangle, 1), self.dtypes["triangles"])
        self.indices = np.zeros((max(triangle, 1), 3), np.uint32)
        self.vertices = np.zeros(max(vertex, 1), self.dtypes["vertices"])
        for place in self._places.values():
            d = place.data
            numbers = np.array([material_index[id(m)] for m in d.mesh.materials], np.uint32)
            masked = np.array([MASKED if m.alpha_mode == "mask" else 0 for m in d.mesh.materials], np.uint32)
            self.triangles["material"][place.triangles] = numbers[d.material]
            self.triangles["flags"][place.triangles] = d.flags | masked[d.material]
            self.vertices[place.vertices] = d.vertices
        users: dict[int, list[Instance]] = {}
        for instance in instances:
            users.setdefault(id(instance.mesh), []).append(instance)
        self.world = Grid.around(bounds - self.origin)
        for key, place in self._places.items():
            only = users[key][0] if len(users[key]) == 1 and id(users[key][0]) not in self._moved else None
            if only is not None:
                self._bake(place, only, instances.index(only))
            else:
                self._write_local(place)
        self.changed = {"nodes", "triangles", "indices", "vertices"}

    def _bake(self, place: Placement, instance: Instance, number: int) -> None:
        """Put a mesh into the world's tree where its one instance stands."""
        d = place.data
        matrix = relative_matrix(instance, self.origin)
        corners = (d.corners.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)
        place.baked, place.tree, place.world_from_local = instance, refit(d.bvh, corners), matrix
        # A mirrored mesh keeps its counter-clockwise side if two corners change places (glTF 2.0, section 3.7.2.1).
        swap = [0, 2, 1] if np.linalg.det(matrix[:3, :3]) < 0 else [0, 1, 2]
        self._write_triangles(place, corners[:, swap], d.indices[:, swap], number)
        self.nodes[place.nodes] = self.world.quantize(
            place.tree, self.dtypes["nodes"], place.nodes.start, place.triangles.start
        )

    def _write_local(self, place: Placement) -> None:
        d = place.data
        place.baked, place.tree, place.world_from_local = None, None, None
        self._write_triangles(place, d.corners, d.indices, NONE)
        self.nodes[place.nodes] = Grid.around(d.bounds).quantize(
            d.bvh.nodes, self.dtypes["nodes"], place.nodes.start, place.triangles.start
        )

    def _write_triangles(self, place: Placement, corners: NDArray, indices: NDArray, instance: int) -> None:
        triangles = self.triangles[place.triangles]
        triangles["v0"] = corners[:, 0]
        triangles["edge1"] = corners[:, 1] - corners[:, 0]
        triangles["edge2"] = corners[:, 2] - corners[:, 0]
        triangles["instance"] = instance
        self.indices[place.triangles] = indices + np.uint32(place.vertices.start)

    def _unbake_moved(self, instances: list[Instance]) -> None:
        """Take meshes whose instance has moved out of the world's tree: moving them again then costs nothing."""
        for place in self._places.values():
            if place.baked is None:
                continue
            if not np.array_equal(relative_matrix(place.baked, self.origin), place.world_from_local):
                self._moved.add(id(place.baked))
                self._write_local(place)
                self.changed |= {"nodes", "triangles", "indices"}

    def _place(self, instances: list[Instance]) -> None:
        """Write the instance records and build the top level over subtrees and instances."""
        bounds = _bounds(instances) - self.origin
        self.radius = float(np.linalg.norm(bounds[1] - bounds[0]) / 2)
        self.instances = np.zeros(max(len(instances), 1), self.dtypes["instances"])
        low, high, references = self._open_baked()
        outside = False
        for number, instance in enumerate(instances):
            matrix = relative_matrix(instance, self.origin)
            inverse = np.linalg.inv(matrix)
            place = self._places[id(instance.mesh)]
            record = self.instances[number]
            record["world_from_local"][:, :3] = matrix[:3].T
            record["local_from_world"][:, :3] = inverse[:3].T
            if place.baked is not None:
                continue
            grid = Grid.around(place.data.bounds)
            record["frame_low"], record["frame_scale"] = grid.low, grid.scale
            root = np.array([place.data.bvh.root], np.uint32)
            record["root"] = move_reference(root, place.nodes.start, place.triangles.start)[0]
            box = _box(place.data.bounds, matrix)
            low.append(box[0]), high.append(box[1]), references.append(INSTANCE_FLAG | number)
            outside |= bool((box[0] < self.world.low).any() or (box[1] > self.world.low + 65535 / self.world.scale).any())
        if outside:  # Something moved off the grid: span a new one.
            self.world = Grid.around(bounds)
            for place in self._places.values():
                if place.tree is not None:
                    self.nodes[place.nodes] = self.world.quantize(
                        place.tree, self.dtypes["nodes"], place.nodes.start, place.triangles.start
                    )
        self.has_instances = any(r & INSTANCE_FLAG and r < int(LEAF_FLAG) for r in references)
        self._build_top(low, high, references)
        self.changed |= {"nodes", "instances"}

    def _open_baked(self) -> tuple[list, list, list]:
        """Return boxes and references of the subtrees of all baked meshes, the largest ones opened."""
        heap: list[tuple[float, int, NDArray, NDArray, int, Placement]] = []
        closed = []
        ties = 0  # heapq compares tuples: equal areas must not come to comparing arrays

        def add(box_low: NDArray, box_high: NDArray, reference: int, place: Placement) -> None:
            nonlocal ties
            ties += 1
            x, y, z = np.maximum(box_high - box_low, 0).tolist()
            if reference >= int(LEAF_FLAG):
                closed.append((box_low, box_high, reference, place))
            else:
                heapq.heappush(heap, (-(x * y + y * z + z * x), ties, box_low, box_high, reference, place))

        baked = [p for p in self._places.values() if p.baked is not None]
        for place in baked:
            assert place.world_from_local is not None
            box = _box(place.data.bounds, place.world_from_local)
            add(box[0], box[1], place.data.bvh.root, place)
        budget = OPEN_UP_TO if len(baked) > 1 else 0  # one tree alone overlaps nothing
        while heap and len(heap) + len(closed) < budget:
            *_, reference, place = heapq.heappop(heap)
            assert place.tree is not None
            node = place.tree[reference]
            for k in ("0", "1"):
                add(node["low" + k], node["high" + k], int(node["child" + k]), place)
        items = [*closed, *((h[2], h[3], h[4], h[5]) for h in heap)]
        references = [
            int(move_reference(np.array([r], np.uint32), p.nodes.start, p.triangles.start)[0]) for _, _, r, p in items
        ]
        return [i[0] for i in items], [i[1] for i in items], references

    def _build_top(self, low: list, high: list, references: list[int]) -> None:
        if not references:
            self.root = NONE
            return
        tree = build_bvh(np.asarray(low, np.float32), np.asarray(high, np.float32), 1, TOP_SAH_DEPTH)
        items = np.asarray(references, np.int64)[tree.order]
        if not len(tree.nodes):
            self.root = int(items[0])
            return
        self.root = 0
        top = self.world.quantize(tree.nodes, self.dtypes["nodes"], 0, 0)
        for name in ("child0", "child1"):
            child = tree.nodes[name].astype(np.int64)
            slot = child & ((1 << LEAF_COUNT_SHIFT) - 1)
            leaf = child >= int(LEAF_FLAG)
            top[name] = np.where(leaf, items[np.where(leaf, slot, 0)], child).astype(np.uint32)
        self.nodes[: len(top)] = top


def relative_matrix(instance: Instance, origin: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an instance's (4, 4) matrix with the scene's origin moved to zero, in float64."""
    matrix = np.array(instance.world_from_local, np.float64)
    matrix[:3, 3] -= origin
    return matrix


def _box(bounds: NDArray, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the box (2, 3) around a transformed box (Arvo 1990)."""
    centre, half = (bounds[1] + bounds[0]).astype(np.float64) / 2, (bounds[1] - bounds[0]).astype(np.float64) / 2
    middle = matrix[:3, :3] @ centre + matrix[:3, 3]
    reach = np.abs(matrix[:3, :3]) @ half
    return np.stack([middle - reach, middle + reach])


def _bounds(instances: list[Instance]) -> NDArray[np.float64]:
    boxes = [
        _box(np.stack([i.mesh.positions.min(0), i.mesh.positions.max(0)]), np.asarray(i.world_from_local, np.float64))
        for i in instances
    ]
    if not boxes:
        return np.zeros((2, 3))
    return np.stack([np.min([b[0] for b in boxes], 0), np.max([b[1] for b in boxes], 0)])


