"""The two-level bounding volume hierarchy over a scene's instances, as arrays for the GPU.

A mesh with one instance that has not moved is baked: its triangles and nodes are stored in world space, so that rays
need no transform. A mesh with several instances, with one that has moved, or with other positions than at first is
stored in local space, and rays enter it through its instances' transforms. Only the top level (`top_level`) changes
when instances move. Node boxes are quantised (`node_quantization`).

Figures, meshes that the device deforms (`deformation`), are stored in local space, behind all others and from the start
of a table's row; the host has their boxes, and their nodes and triangles in the pose they were built in.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..scene.mesh_check import are_same, arrays_of
from ..scene.scene import Instance, Mesh
from .anchors import FLAG_BITS, anchor_triangles
from .figures import Figure
from .mesh_data import MASKED, NONE, MeshData, Placement, prepare_meshes
from .mesh_trees import refit_tree
from .node_quantization import QuantizationGrid
from .resources import TABLE_WIDTH
from .scene_origin import scene_origin
from .see_through import has_openings
from .top_level import OPEN_UP_TO, Subtrees, TopLevel, open_subtrees
from .tree_builder import TreeBuilder
from .wide_bvh import EMPTY, STACK_LEVELS, WideBvh

INSTANCE_FLAG = 1 << 30  # in a child reference: the other bits are the number of an instance
# If the scene's centre is more than this many radii from the origin, everything is laid out again. At 4 radii, float32
# coordinates are 8 times as coarse as near the origin; the padding of quantised boxes still covers that.
MAX_DRIFT = 4.0
# A mesh keeps a grid of its own if the world's grid has fewer steps than this across a triangle. At 4 steps, outward
# rounding adds 2 * (1 + 1/16) / 4, about half, to the extent of a triangle's box.
MIN_STEPS = 4.0
GROWTH = (
    1.5  # enlarges a grid that an instance has left, so that steady outward motion does not leave it in every frame
)


TEXELS = (3, 4, 2)  # of a node, a triangle and a vertex (wgsl/scene/geometry.wgsl)


def start_of_row(count: int, texels: int) -> int:
    """Return the first record from number `count` on that begins a row of its table."""
    step = TABLE_WIDTH // int(np.gcd(TABLE_WIDTH, texels))
    return -(-count // step) * step


class TwoLevelBvh:
    """Nodes, triangles, vertices and instance records of a scene, in metres relative to `origin`.

    After `update`, `changed` names the arrays with new contents.
    """

    def __init__(self, dtypes: dict[str, np.dtype], builder: TreeBuilder | None = None) -> None:
        """Use the structs of the shaders; without `builder`, numpy builds the trees of all meshes."""
        self.dtypes = dtypes
        self.builder = builder
        self.changed: set[str] = set()
        self.origin = np.zeros(3)
        self.has_details = False  # small things lie together around the origin (`scene_origin`)
        self.root = EMPTY
        self.world = QuantizationGrid.around(np.zeros((2, 3)))  # grid of the top level and of baked meshes
        self.centre = np.zeros(3)  # centre of a sphere around all instances, relative to the origin
        self.radius = 0.0  # radius of that sphere
        self.box = np.zeros((2, 3))  # around all instances, relative to the origin
        self.has_instances = False  # whether rays enter any mesh through a transform
        self._first_grid = self.world  # around the scene when it was laid out
        self._prepared: dict[int, MeshData] = {}  # by id(mesh)
        self._places: dict[int, Placement] = {}  # by id(mesh)
        self._subtrees: Subtrees | None = None  # subtrees of the baked meshes; None: to be opened
        self._repeats = False  # what `update` stores does not depend on earlier updates
        self._top = TopLevel()
        self.changes_draws = False  # the last update changed more of the draws than positions of `moved_meshes`
        self.moved_meshes: set[int] = set()  # ids of those with other positions since the last update
        self.moved_vertices: dict[int, NDArray[np.float32]] = {}  # positions before the last update, by id(mesh)
        self.figures: dict[int, Figure] = {}  # by id(mesh)
        self.first_figures = (0, 0, 0)  # node, triangle and vertex that figures begin at
        self._moved: set[int] = set()  # ids of instances that have moved since they were first seen
        self._layout: object = None
        self._materials: object = None
        self._renumber: set[int] = set()  # ids of meshes whose flags and materials must be written
        self._matrices = np.zeros((0, 4, 4))

    def update(
        self,
        instances: list[Instance],
        material_index: dict[int, int],
        figures: dict[int, Figure] | None = None,
        posed: bool = False,
    ) -> None:
        """Update the arrays to `instances`; `material_index` numbers materials by id.

        `figures`: those among the meshes, by id(mesh); `posed`: any of them has a new pose.

        Raises GiError for a mesh whose arrays do not fit together.
        """
        self.changed, self.changes_draws, self.moved_meshes, self.moved_vertices = set(), False, set(), {}
        meshes = list({id(i.mesh): i.mesh for i in instances}.values())
        # Ids are unique among living objects only; `_prepared` keeps the meshes alive. A new instance may have the id
        # of a deleted one; if their meshes are the same, it counts as the old instance after a move.
        layout = ([id(m) for m in meshes], [(id(i), id(i.mesh)) for i in instances])
        matrices = np.array([i.world_from_local for i in instances], np.float64).reshape(-1, 4, 4)
        self.figures = figures or {}
        deformed = self._prepare(meshes)
        fit = all(self._places[key].holds(self._prepared[key]) for key in deformed)
        new_layout = layout != self._layout or not fit
        if new_layout or deformed or posed or not np.array_equal(matrices, self._matrices):
            boxes = self._world_boxes(instances, matrices)
            bounds = np.stack([boxes[:, 0].min(0), boxes[:, 1].max(0)]) if len(boxes) else np.zeros((2, 3))
            self.radius = float(np.linalg.norm(bounds[1] - bounds[0]) / 2)
            drifted = np.abs(bounds.mean(0) - self.origin).max() > MAX_DRIFT * self.radius
            if new_layout or drifted:
                # Otherwise the origin stays, so that moving one instance does not move all others relative to it.
                used = [self._prepared[id(i.mesh)] for i in instances]
                self.origin, self.has_details = scene_origin(used, matrices, bounds)
                self._lay_out(meshes, instances, matrices, bounds)
            else:
                self._replace(deformed, instances)
                self._unbake_moved(instances, matrices)
            for place in self._places.values():
                if place.figure is not None:
                    place.grid = QuantizationGrid.around(place.figure.box)
            self.box = bounds - self.origin
            self.centre = self.box.mean(0)
            self._write_instances(instances, matrices)
            self._fit_world(self.box)
            self._build_top(boxes - self.origin, instances)
            self._layout, self._matrices = layout, matrices
        self._number_materials(meshes, material_index)

    def expect_motion(self, instances: Iterable[Instance]) -> None:
        """Make what `update` stores independent of earlier updates but the first; call before that.

        The meshes of these instances are in local space from the start, as if they had moved before.
        """
        self._moved |= {id(i) for i in instances}
        self._repeats = True

    def forget_layout(self) -> None:
        """Make what the next `update` stores independent of earlier ones; the trees of meshes stay."""
        self._layout, self._moved = None, set()

    def placement(self, mesh: Mesh) -> Placement:
        """Return the place of a mesh in the buffers."""
        return self._places[id(mesh)]

    def placements(self) -> list[Placement]:
        """Return the places of all meshes."""
        return list(self._places.values())

    def _prepare(self, meshes: list[Mesh]) -> list[int]:
        """Build the bottom level of new meshes, and drop that of meshes no longer in use.

        Return the ids of the other meshes that have new arrays.
        """
        kept = {
            id(m): self._prepared[id(m)]
            for m in meshes
            if id(m) in self._prepared and are_same(self._prepared[id(m)].arrays, arrays_of(m))
        }
        new = [m for m in meshes if id(m) not in kept]
        former = [d for key, d in self._prepared.items() if key not in kept]
        data = prepare_meshes(new, self.dtypes["vertices"], self.builder, former) if new else []
        prepared = {id(d.mesh): d for d in data} | kept
        self._prepared = {id(m): prepared[id(m)] for m in meshes}
        # Compare with what is stored: an earlier update may have failed.
        known = [key for key in self._prepared if key in self._places]
        return [key for key in known if self._places[key].data is not self._prepared[key]]

    def _replace(self, deformed: list[int], instances: list[Instance]) -> None:
        """Store the new data of deformed meshes, given by id, in the places that they have."""
        if not deformed:
            return
        self._moved |= {id(i) for i in instances if id(i.mesh) in deformed}
        for key in deformed:
            place, data = self._places[key], self._prepared[key]
            if place.data.arrays[1] is data.arrays[1]:
                self.moved_vertices[key] = np.asarray(place.data.arrays[0], np.float32)
            if place.data.vertices is not data.vertices:
                self.vertices[place.vertices] = data.vertices
                self.changed |= {"vertices"}
            same_draws = place.data.topology is data.topology and place.data.arrays[2] is data.arrays[2]
            if place.baked is None and same_draws:
                self.moved_meshes.add(key)
            else:
                self._subtrees, self.changes_draws = None, True
            place.data, place.grid = data, QuantizationGrid.around(data.bounds)
            self._write_local(place)
        # Flags and materials of triangles may have changed.
        self._renumber |= set(deformed)
        self.changed |= {"nodes", "triangles"}

    def _world_boxes(self, instances: list[Instance], matrices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the boxes of all instances in the world, (n, 2, 3)."""
        meshes = [id(i.mesh) for i in instances]
        boxes = [self.figures[m].box if m in self.figures else self._prepared[m].bounds for m in meshes]
        bounds = np.array(boxes, np.float64).reshape(-1, 2, 3)
        # Arvo 1990, "Transforming Axis-Aligned Bounding Boxes".
        centre, half = bounds.mean(1), (bounds[:, 1] - bounds[:, 0]) / 2
        middle = np.einsum("nij,nj->ni", matrices[:, :3, :3], centre) + matrices[:, :3, 3]
        reach = np.einsum("nij,nj->ni", np.abs(matrices[:, :3, :3]), half)
        return np.stack([middle - reach, middle + reach], 1)

    def _lay_out(
        self, meshes: list[Mesh], instances: list[Instance], matrices: NDArray[np.float64], bounds: NDArray[np.float64]
    ) -> None:
        """Give every mesh its place in fresh arrays and fill all but the top level."""
        # Reserve the first nodes for the top level: a tree over at most so many subtrees and instances.
        node, triangle, vertex = OPEN_UP_TO + len(instances), 0, 0
        self._places = {}
        rigid = len(meshes) - len(self.figures)
        for number, mesh in enumerate(sorted(meshes, key=lambda m: id(m) in self.figures)):
            d, figure = self._prepared[id(mesh)], self.figures.get(id(mesh))
            if number == rigid:
                # Begin rows of the tables.
                node, triangle = start_of_row(node, TEXELS[0]), start_of_row(triangle, TEXELS[1])
                vertex = start_of_row(vertex, TEXELS[2])
                self.first_figures = node, triangle, vertex
            place = Placement(
                d,
                slice(node, node + len(d.bvh.child)),
                slice(triangle, triangle + len(d.corners)),
                slice(vertex, vertex + len(d.vertices)),
                QuantizationGrid.around(d.bounds if figure is None else figure.box),
                figure=figure,
            )
            node, triangle, vertex = place.nodes.stop, place.triangles.stop, place.vertices.stop
            self._places[id(mesh)] = place
            if figure is not None:
                figure.note_order(d.indices)
        # Allocate the arrays.
        self.nodes = np.zeros(node, self.dtypes["nodes"])
        self.triangles = np.zeros(max(triangle, 1), self.dtypes["triangles"])
        self.vertices = np.zeros(max(vertex, 1), self.dtypes["vertices"])
        self.world = self._first_grid = QuantizationGrid.around(bounds - self.origin)
        self._subtrees = self._materials = None
        self._moved &= {id(i) for i in instances}
        # Bake meshes with one instance that has not moved; store the others in local space.
        users: dict[int, list[int]] = {}
        for number, instance in enumerate(instances):
            users.setdefault(id(instance.mesh), []).append(number)
        for key, place in self._places.items():
            self.vertices[place.vertices] = place.data.vertices
            first, *others = users[key]
            local = others or id(instances[first]) in self._moved or place.figure is not None
            if local or self._needs_own_grid(place, matrices[first]):
                self._write_local(place)
            else:
                self._bake(place, first, matrices[first])
        self.changed, self.changes_draws = {"nodes", "triangles", "vertices"}, True

    def _number_materials(self, meshes: list[Mesh], material_index: dict[int, int]) -> None:
        """Write the triangles' material numbers, and the flag of those that rays may pass."""
        materials = [[(material_index[id(m)], has_openings(m)) for m in mesh.materials] for mesh in meshes]
        if materials == self._materials and not self._renumber:
            return
        others = materials != self._materials
        for mesh, pairs in zip(meshes, materials, strict=True):
            if not others and id(mesh) not in self._renumber:
                continue
            place = self._places[id(mesh)]
            number, masked = np.array(pairs, np.uint32)[place.data.material].T
            self.triangles["material"][place.triangles] = number
            flags = self.triangles["flags"][place.triangles]
            flags[:] = flags >> FLAG_BITS << FLAG_BITS | place.data.flags | MASKED * masked
        self._materials, self._renumber = materials, set()
        self.changes_draws |= others
        self.changed |= {"triangles"}

    def _needs_own_grid(self, place: Placement, world_from_local: NDArray[np.float64]) -> bool:
        """Tell whether the world's grid is too coarse for a mesh's triangles while its own grid is finer."""
        steps_per_unit = self.world.scale.min() * abs(np.linalg.det(world_from_local[:3, :3])) ** (1 / 3)
        size = float(np.median(np.ptp(place.data.corners, axis=1).max(-1)))
        return bool(size * steps_per_unit < MIN_STEPS and steps_per_unit < place.grid.scale.min())

    def _bake(self, place: Placement, number: int, world_from_local: NDArray[np.float64]) -> None:
        """Store a mesh in world space, placed by its only instance, `number`."""
        d = place.data
        linear, translation = world_from_local[:3, :3], world_from_local[:3, 3] - self.origin
        exact = np.asarray(d.mesh.positions, np.float64) @ linear.T + translation
        positions = exact.astype(np.float32)
        place.baked, place.tree = number, refit_tree(d.bvh, positions, d.indices, self.builder)
        used = positions[d.indices].reshape(-1, 3)
        place.box = np.stack([used.min(0), used.max(0)])
        # A mirrored mesh keeps its counter-clockwise side if two corners change places (glTF 2.0, section 3.7.2.1).
        turn = [0, 2, 1] if np.linalg.det(linear) < 0 else [0, 1, 2]
        indices = d.indices[:, turn]
        self._write_triangles(place, exact[indices], indices, number)
        self._write_nodes(place, place.tree, self.world)

    def _write_local(self, place: Placement) -> None:
        """Store a mesh in its local space."""
        place.baked = place.tree = place.box = None
        self._write_triangles(place, place.data.corners, place.data.indices, NONE)
        self._write_nodes(place, place.data.bvh, place.grid)

    def _write_triangles(
        self, place: Placement, corners: NDArray[np.floating], indices: NDArray, instance: int
    ) -> None:
        triangles = self.triangles[place.triangles]
        anchor_triangles(triangles, corners)
        triangles["instance"] = instance
        triangles["corners"] = indices + np.uint32(place.vertices.start)

    def _write_nodes(self, place: Placement, bvh: WideBvh, grid: QuantizationGrid) -> None:
        self.nodes[place.nodes] = grid.quantize(bvh, self.dtypes["nodes"], place.nodes.start, place.triangles.start)

    def _unbake_moved(self, instances: list[Instance], matrices: NDArray[np.float64]) -> None:
        """Store baked meshes whose instance has moved in local space, so that further motion costs nothing."""
        moved = (matrices != self._matrices).any((1, 2))
        for place in self._places.values():
            if place.baked is not None and moved[place.baked]:
                self._moved.add(id(instances[place.baked]))
                self._write_local(place)
                self._subtrees, self.changes_draws = None, True
                self.changed |= {"nodes", "triangles"}

    def _write_instances(self, instances: list[Instance], matrices: NDArray[np.float64]) -> None:
        """Write a record for each instance: its transforms, and the grid and root of its mesh."""
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
        self.changed |= {"instances"}

    def _fit_world(self, bounds: NDArray[np.float64]) -> None:
        """Use a larger grid if `bounds` have left the current one; return to the first grid if it is large enough."""
        if self._first_grid.spans(bounds):
            wanted = self._first_grid
        elif self._repeats:
            wanted = self._first_grid.grown(bounds, GROWTH)
        elif self.world.spans(bounds):
            wanted = self.world
        else:
            wanted = QuantizationGrid.around(bounds.mean(0) + GROWTH * (bounds - bounds.mean(0)))
        if np.array_equal([wanted.low, wanted.scale], [self.world.low, self.world.scale]):
            return
        self.world = wanted
        for place in self._places.values():
            if place.tree is not None:
                self._write_nodes(place, place.tree, self.world)

    def _build_top(self, boxes: NDArray[np.float64], instances: list[Instance]) -> None:
        """Build or refit the top level over the subtrees of baked meshes and over the instances of the others.

        `boxes` (n, 2, 3) are those of all instances, relative to the origin.
        """
        entered = np.flatnonzero([self._places[id(i.mesh)].baked is None for i in instances])
        self.has_instances = len(entered) > 0
        if self._subtrees is None:
            self._subtrees, self._top = open_subtrees(self._places.values()), TopLevel(self._repeats)
        low, high, references = self._subtrees
        low = np.concatenate([low, boxes[entered, 0].astype(np.float32)])
        high = np.concatenate([high, boxes[entered, 1].astype(np.float32)])
        references = np.concatenate([references, INSTANCE_FLAG | entered])
        levels = STACK_LEVELS - max((place.data.bvh.depth for place in self._places.values()), default=0)
        self.root, top = self._top.build(low, high, references, self.world, self.dtypes["nodes"], levels)
        self.nodes[: len(top)] = top
        self.changed |= {"nodes"}
