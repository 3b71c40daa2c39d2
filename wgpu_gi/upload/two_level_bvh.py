"""The two-level hierarchy over a scene's instances, as arrays for the GPU.

A mesh with a single instance lies in the world's tree with its own nodes, so that no ray is transformed for it; a mesh
with several, or one that has moved, is entered through its instances' transforms. Only the small top level is rebuilt
when instances move. Top-level leaves are not whole meshes but subtrees, opened largest first, which undoes most of the
overlap between meshes (Benthin et al. 2017, "Improved Two-Level BVHs using Partial Re-Braiding").
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Instance, Mesh
from .bvh import LEAF_COUNT_SHIFT, LEAF_FLAG, build_bvh, refit
from .mesh_data import MASKED, MeshData, prepare_meshes
from .node_quantization import QuantizationGrid

NONE = 0xFFFFFFFF
INSTANCE_FLAG = 1 << 30
TOP_DEPTH = 24  # with the 40 of a mesh's tree they fill the traversal's stack of 64
OPEN_UP_TO = 2048  # subtrees in the top level; chosen, not tuned
ROAM = 4.0  # radii that the scene's centre may be off the origin: coordinates are then 8 times as coarse, within PAD
FINE = 4.0  # steps of the world's grid across a triangle; with fewer, rounding makes boxes overlap; chosen
GROWTH = 1.5  # of a grid that something has left, so that what goes on moving outwards does not leave it each time


@dataclass
class Placement:
    """A mesh's place in the buffers; if it lies in the world's tree, its instance's number, nodes and box."""

    data: MeshData
    nodes: slice
    triangles: slice
    vertices: slice
    grid: QuantizationGrid  # of its own space
    baked: int | None = None
    tree: NDArray[np.void] | None = None
    box: NDArray[np.float32] | None = None  # (2, 3)

    def reference(self, child: int) -> int:
        """Return a child reference of the mesh's own tree as one into the buffers of the scene."""
        return child + (self.triangles.start if child >= int(LEAF_FLAG) else self.nodes.start)


Subtrees = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]  # low, high, references


class TwoLevelBvh:
    """Nodes, triangles, vertices and instance records of a scene, in coordinates relative to `origin`.

    `update` brings them up to date; `changed` then names the arrays with new contents.
    """

    def __init__(self, dtypes: dict[str, np.dtype]) -> None:
        self.dtypes = dtypes
        self.changed: set[str] = set()
        self.origin = np.zeros(3)
        self.root = NONE
        self.world = QuantizationGrid.around(np.zeros((2, 3)))
        self.centre = np.zeros(3)  # of a sphere around all instances, metres from the origin
        self.radius = 0.0  # and its radius
        self.box = np.zeros((2, 3))  # around all instances, metres from the origin
        self.has_instances = False  # some are entered through their transforms
        self._home = self.world  # the grid around the scene as it was laid out
        self._prepared: dict[int, MeshData] = {}
        self._places: dict[int, Placement] = {}
        self._subtrees: Subtrees | None = None
        self._moved: set[int] = set()  # id(instance)
        self._layout: object = None
        self._materials: object = None
        self._matrices = np.zeros((0, 4, 4))

    def update(self, instances: list[Instance], material_index: dict[int, int]) -> None:
        """Bring the arrays up to date with `instances`; `material_index` numbers materials by id.

        Raises GiError for a mesh whose arrays do not fit together.
        """
        self.changed = set()
        meshes = list({id(i.mesh): i.mesh for i in instances}.values())
        # Ids are unique only among living objects: `_places` keeps the meshes alive. Another instance with the id of a
        # dead one has its mesh and is like the same one moved.
        layout = ([id(m) for m in meshes], [(id(i), id(i.mesh)) for i in instances])
        matrices = np.array([i.world_from_local for i in instances], np.float64).reshape(-1, 4, 4)
        if layout != self._layout:
            new = [m for m in meshes if id(m) not in self._prepared]
            prepared = {id(d.mesh): d for d in prepare_meshes(new, self.dtypes["vertices"])} | self._prepared
            self._prepared = {id(m): prepared[id(m)] for m in meshes}
        if layout != self._layout or not np.array_equal(matrices, self._matrices):
            boxes = self._world_boxes(instances, matrices)
            bounds = np.stack([boxes[:, 0].min(0), boxes[:, 1].max(0)]) if len(boxes) else np.zeros((2, 3))
            self.radius = float(np.linalg.norm(bounds[1] - bounds[0]) / 2)
            roamed = np.abs(bounds.mean(0) - self.origin).max() > ROAM * self.radius
            if layout != self._layout or roamed:
                # The origin stays while it may: moving one instance must not move the world under the others.
                self.origin = bounds.mean(0)
                self._lay_out(meshes, instances, matrices, bounds)
            else:
                self._unbake_moved(instances, matrices)
            self.box = bounds - self.origin
            self.centre = self.box.mean(0)
            self._place(instances, matrices, bounds - self.origin, boxes - self.origin)
            self._layout, self._matrices = layout, matrices
        self._number_materials(meshes, material_index)

    def placement(self, mesh: Mesh) -> Placement:
        """Return where a mesh lies."""
        return self._places[id(mesh)]

    def placements(self) -> list[Placement]:
        """Return the places of all meshes."""
        return list(self._places.values())

    def _world_boxes(self, instances: list[Instance], matrices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the boxes of all instances in the world, (n, 2, 3)."""
        bounds = np.array([self._prepared[id(i.mesh)].bounds for i in instances], np.float64).reshape(-1, 2, 3)
        # Arvo 1990, "Transforming Axis-Aligned Bounding Boxes".
        centre, half = bounds.mean(1), (bounds[:, 1] - bounds[:, 0]) / 2
        middle = np.einsum("nij,nj->ni", matrices[:, :3, :3], centre) + matrices[:, :3, 3]
        reach = np.einsum("nij,nj->ni", np.abs(matrices[:, :3, :3]), half)
        return np.stack([middle - reach, middle + reach], 1)

    def _lay_out(
        self, meshes: list[Mesh], instances: list[Instance], matrices: NDArray[np.float64], bounds: NDArray[np.float64]
    ) -> None:
        """Give every mesh its place in fresh arrays and fill all but the top level."""
        # The top level is a binary tree over at most so many subtrees and instances.
        node, triangle, vertex = OPEN_UP_TO + len(instances), 0, 0
        self._places = {}
        for mesh in meshes:
            d = self._prepared[id(mesh)]
            place = Placement(
                d,
                slice(node, node + len(d.bvh.nodes)),
                slice(triangle, triangle + len(d.corners)),
                slice(vertex, vertex + len(d.vertices)),
                QuantizationGrid.around(d.bounds),
            )
            node, triangle, vertex = place.nodes.stop, place.triangles.stop, place.vertices.stop
            self._places[id(mesh)] = place
        self.nodes = np.zeros(node, self.dtypes["nodes"])
        self.triangles = np.zeros(max(triangle, 1), self.dtypes["triangles"])
        self.vertices = np.zeros(max(vertex, 1), self.dtypes["vertices"])
        self.world = self._home = QuantizationGrid.around(bounds - self.origin)
        self._subtrees = self._materials = None
        self._moved &= {id(i) for i in instances}
        users: dict[int, list[int]] = {}
        for number, instance in enumerate(instances):
            users.setdefault(id(instance.mesh), []).append(number)
        for key, place in self._places.items():
            self.vertices[place.vertices] = place.data.vertices
            first, *others = users[key]
            if others or id(instances[first]) in self._moved or self._is_too_fine(place, matrices[first]):
                self._write_local(place)
            else:
                self._bake(place, first, matrices[first])
        self.changed = {"nodes", "triangles", "vertices"}

    def _number_materials(self, meshes: list[Mesh], material_index: dict[int, int]) -> None:
        """Write the triangles' material numbers, and the flag of those that may be cut out."""
        materials = [[(material_index[id(m)], m.alpha_mode == "mask") for m in mesh.materials] for mesh in meshes]
        if materials == self._materials:
            return
        self._materials = materials
        for mesh, pairs in zip(meshes, materials, strict=True):
            place = self._places[id(mesh)]
            number, masked = np.array(pairs, np.uint32)[place.data.material].T
            self.triangles["material"][place.triangles] = number
            self.triangles["flags"][place.triangles] = place.data.flags | MASKED * masked
        self.changed |= {"triangles"}

    def _is_too_fine(self, place: Placement, world_from_local: NDArray[np.float64]) -> bool:
        """Tell whether the world's grid is too coarse for a mesh's triangles; its own may not be."""
        steps_per_unit = self.world.scale.min() * abs(np.linalg.det(world_from_local[:3, :3])) ** (1 / 3)
        size = float(np.median(np.ptp(place.data.corners, axis=1).max(-1)))
        return bool(size * steps_per_unit < FINE and steps_per_unit < place.grid.scale.min())

    def _bake(self, place: Placement, number: int, world_from_local: NDArray[np.float64]) -> None:
        """Put a mesh into the world's tree where its one instance stands."""
        d = place.data
        linear, translation = world_from_local[:3, :3], world_from_local[:3, 3] - self.origin
        corners = (d.corners.astype(np.float64) @ linear.T + translation).astype(np.float32)
        place.baked, place.tree = number, refit(d.bvh, corners.min(1), corners.max(1))
        place.box = np.stack([corners.min((0, 1)), corners.max((0, 1))])
        # A mirrored mesh keeps its counter-clockwise side if two corners change places (glTF 2.0, section 3.7.2.1).
        turn = [0, 2, 1] if np.linalg.det(linear) < 0 else [0, 1, 2]
        self._write_triangles(place, corners[:, turn], d.indices[:, turn], number)
        self._write_nodes(place, place.tree, self.world)

    def _write_local(self, place: Placement) -> None:
        """Put a mesh into the buffers in its own space."""
        place.baked = place.tree = place.box = None
        self._write_triangles(place, place.data.corners, place.data.indices, NONE)
        self._write_nodes(place, place.data.bvh.nodes, place.grid)

    def _write_triangles(self, place: Placement, corners: NDArray, indices: NDArray, instance: int) -> None:
        triangles = self.triangles[place.triangles]
        triangles["v0"] = corners[:, 0]
        triangles["edge1"] = corners[:, 1] - corners[:, 0]
        triangles["edge2"] = corners[:, 2] - corners[:, 0]
        triangles["instance"] = instance
        triangles["corners"] = indices + np.uint32(place.vertices.start)

    def _write_nodes(self, place: Placement, nodes: NDArray[np.void], grid: QuantizationGrid) -> None:
        self.nodes[place.nodes] = grid.quantize(nodes, self.dtypes["nodes"], place.nodes.start, place.triangles.start)

    def _unbake_moved(self, instances: list[Instance], matrices: NDArray[np.float64]) -> None:
        """Take meshes whose instance has moved out of the world's tree: moving them again then costs nothing."""
        for place in self._places.values():
            number = place.baked
            if number is not None and not np.array_equal(matrices[number], self._matrices[number]):
                self._moved.add(id(instances[number]))
                self._write_local(place)
                self._subtrees = None
                self.changed |= {"nodes", "triangles"}

    def _place(
        self,
        instances: list[Instance],
        matrices: NDArray[np.float64],
        bounds: NDArray[np.float64],
        boxes: NDArray[np.float64],
    ) -> None:
        """Write the instance records and build the top level over subtrees and instances."""
        relative = matrices.copy()
        relative[:, :3, 3] -= self.origin
        places = [self._places[id(i.mesh)] for i in instances]
        self.instances = np.zeros(max(len(instances), 1), self.dtypes["instances"])
        records = self.instances[: len(instances)]
        records["world_from_local"][..., :3] = relative[:, :3].transpose(0, 2, 1)
        records["local_from_world"][..., :3] = np.linalg.inv(relative)[:, :3].transpose(0, 2, 1)
        records["frame_low"] = np.reshape([p.grid.low for p in places], (-1, 3))
        records["frame_scale"] = np.reshape([p.grid.scale for p in places], (-1, 3))
        records["root"] = [p.reference(p.data.bvh.root) for p in places]
        self._fit_world(bounds)
        entered = np.flatnonzero([p.baked is None for p in places])
        self.has_instances = len(entered) > 0
        self._build_top(boxes, entered)
        self.changed |= {"nodes", "instances"}

    def _fit_world(self, bounds: NDArray[np.float64]) -> None:
        """Span a new grid if something has left the one there is; go back to the first one where that is enough."""
        if self._home.spans(bounds):
            wanted = self._home
        elif self.world.spans(bounds):
            wanted = self.world
        else:
            wanted = QuantizationGrid.around(bounds.mean(0) + GROWTH * (bounds - bounds.mean(0)))
        if wanted is self.world:
            return
        self.world = wanted
        for place in self._places.values():
            if place.tree is not None:
                self._write_nodes(place, place.tree, self.world)

    def _open_baked(self) -> Subtrees:
        """Return the subtrees of all baked meshes, the largest ones opened."""
        heap: list[tuple[float, int, NDArray, NDArray, int, Placement]] = []
        ties = itertools.count()  # heapq compares tuples: equal areas must not come to comparing arrays

        def add(low: NDArray, high: NDArray, reference: int, place: Placement) -> None:
            x, y, z = np.maximum(high - low, 0).astype(np.float64).tolist()
            # Leaves go last, for they cannot be opened.
            order = 1.0 if reference >= int(LEAF_FLAG) else -(x * y + y * z + z * x)
            heapq.heappush(heap, (order, next(ties), low, high, reference, place))

        for place in self._places.values():
            if place.box is not None:
                add(place.box[0], place.box[1], place.data.bvh.root, place)
        # One tree alone overlaps nothing.
        while 1 < len(heap) < OPEN_UP_TO and heap[0][0] <= 0:
            *_, reference, place = heapq.heappop(heap)
            assert place.tree is not None
            node = place.tree[reference]
            for k in ("0", "1"):
                add(node["low" + k], node["high" + k], int(node["child" + k]), place)
        low = np.array([h[2] for h in heap], np.float32).reshape(-1, 3)
        high = np.array([h[3] for h in heap], np.float32).reshape(-1, 3)
        return low, high, np.array([h[5].reference(h[4]) for h in heap], np.int64)

    def _build_top(self, boxes: NDArray[np.float64], entered: NDArray[np.int64]) -> None:
        """Build the top level over the subtrees and over the instances that are entered, given by their numbers."""
        if self._subtrees is None:
            self._subtrees = self._open_baked()
        low, high, references = self._subtrees
        low = np.concatenate([low, boxes[entered, 0].astype(np.float32)])
        high = np.concatenate([high, boxes[entered, 1].astype(np.float32)])
        references = np.concatenate([references, INSTANCE_FLAG | entered])
        if not len(references):
            self.root = NONE
            return
        tree = build_bvh(low, high, 1, TOP_DEPTH)
        references = references[tree.order]
        if not len(tree.nodes):
            self.root = int(references[0])
            return
        self.root = 0
        top = self.world.quantize(tree.nodes, self.dtypes["nodes"])
        for name in ("child0", "child1"):
            child = tree.nodes[name].astype(np.int64)
            slot = child & ((1 << LEAF_COUNT_SHIFT) - 1)
            leaf = child >= int(LEAF_FLAG)
            top[name] = np.where(leaf, references[np.where(leaf, slot, 0)], child).astype(np.uint32)
        self.nodes[: len(top)] = top
