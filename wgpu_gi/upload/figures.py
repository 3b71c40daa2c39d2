"""Figures: instances whose mesh has a skin or morph targets in use, each with a mesh of its own in the scene's tables.

A stand-in takes the place of the instance: it has the triangles and materials of the mesh, and the positions of the
pose in which its hierarchy was built. The device poses the vertices and refits the hierarchy (`deformation.py`).
As in `mesh_trees`, the hierarchy is built anew in another pose when it costs REBUILD times as much. That cost is
estimated from runs of triangles that follow each other in the hierarchy: the sum of the surface areas of their boxes
over that of all. The estimate is made after CHECK_AFTER poses, or when the box has grown much; each new
hierarchy doubles the wait.
"""

from __future__ import annotations

from collections.abc import Iterable
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..scene.deformation import is_deformed
from ..scene.mesh_check import are_same, arrays_of
from ..scene.scene import Instance, Mesh
from .mesh_trees import REBUILD
from .rest_pose import RestPose

CHECK_AFTER = 16
LONGEST_WAIT = 1 << 12
RUNS, PER_RUN = 256, 16  # runs of triangles, and triangles of each, that the estimate poses: 2 ms
AREA_CHANGE = 4.0  # points on surfaces are drawn by the areas of the first pose: a larger change makes them noisy


class Figure:
    """One deformed instance. `stand_in` replaces it; `box` (2, 3) surrounds its pose in local space.

    `version` grows with each new pose.
    """

    def __init__(self, instance: Instance, rest: RestPose) -> None:
        self.source, self.rest, self.mesh = instance, rest, instance.mesh
        self.version = 0
        self._key: tuple[object, ...] = ()
        self.matrices = np.zeros((0, 3, 4))
        self.weights = np.zeros(0)
        self.box = np.zeros((2, 3))
        self.stand_in = Instance(instance.mesh)
        self.pose(instance)
        self._wait = self._due = CHECK_AFTER
        self._corners: NDArray[np.uint32] | None = None
        self._built = (0.0, 0.0)  # cost and area in the pose of the hierarchy, and the extent there
        self._size = 0.0
        self.renew()

    def serves(self, instance: Instance) -> bool:
        """Tell whether this figure shows the mesh of an instance, with the same arrays."""
        return instance.mesh is self.mesh and are_same(self.rest.arrays, arrays_of(self.mesh))

    def pose(self, instance: Instance) -> bool:
        """Take over the pose and the place of an instance; return whether the pose is new."""
        self.source = instance
        self.stand_in.world_from_local, self.stand_in.name = instance.world_from_local, instance.name
        key = pose_key(instance)
        if key == self._key:
            return False
        self._key = key
        self.matrices = self.rest.matrices(instance.joint_matrices)
        self.weights = self.rest.weights(instance.morph_weights)
        self.box = self.rest.box(self.matrices, self.weights)
        self.version += 1
        return True

    def positions(self, vertices: NDArray[np.integer]) -> NDArray[np.float64]:
        """Return the posed positions of some vertices, (..., 3) for indices (...)."""
        return self.rest.positions(self.matrices, self.weights, vertices)

    def renew(self) -> None:
        """Give the stand-in a mesh in the current pose, whose hierarchy is then built."""
        mesh = self.mesh
        self.stand_in.mesh = Mesh(
            self.positions(np.arange(self.rest.count)).astype(np.float32),
            mesh.triangles,
            mesh.materials,
            mesh.material_of_triangle,
            mesh.normals,
            mesh.tangents,
            mesh.texcoords0,
            mesh.texcoords1,
            mesh.colors,
            mesh.name,
        )
        self._corners = None

    def note_order(self, corners: NDArray[np.uint32]) -> None:
        """Note the triangles (n, 3) in the order of the hierarchy, when it has been built in the current pose."""
        if self._corners is None:
            self._corners = corners
            self._built = self._cost(corners)
            self._size = self._extent()

    def review(self) -> None:
        """Renew the stand-in if the pose makes its hierarchy costly."""
        if self._corners is None or (self.version < self._due and self._extent() <= AREA_CHANGE**0.5 * self._size):
            return
        (cost, area), (cost_before, area_before) = self._cost(self._corners), self._built
        self._due = self.version + self._wait
        if cost > REBUILD * cost_before or not 1 / AREA_CHANGE <= area / max(area_before, 1e-300) <= AREA_CHANGE:
            self._wait = min(2 * self._wait, LONGEST_WAIT)
            self.renew()

    def _extent(self) -> float:
        """Return the diagonal of the box."""
        return float(np.linalg.norm(self.box[1] - self.box[0]))

    def _cost(self, corners: NDArray[np.uint32]) -> tuple[float, float]:
        """Return an estimate of the hierarchy's cost, and the area of the triangles that it is made of."""
        each = max(-(-len(corners) // RUNS), 1)
        runs = corners[: len(corners) // each * each].reshape(-1, each, 3)[:, :: -(-each // PER_RUN)]
        points = self.positions(runs)
        low, high = points.min((1, 2)), points.max((1, 2))
        area = np.linalg.norm(np.cross(points[:, :, 1] - points[:, :, 0], points[:, :, 2] - points[:, :, 0]), axis=-1)
        whole = max(float(_box_areas(low.min(0), high.max(0))), 1e-300)
        return float(_box_areas(low, high).sum()) / whole, float(area.sum())


class Figures:
    """The figures of a scene, kept while their instances stay.

    A new scene whose instances have the same meshes in the same order, such as the scene at another time, keeps them,
    too: then each of its instances stands for the one before it in its place.
    """

    def __init__(self) -> None:
        self._instances: list[Instance] = []
        self._shown: list[Instance] = []  # what stands for each instance: itself, a figure's stand-in, or a copy
        self._figures: list[Figure | None] = []
        self._rest: WeakKeyDictionary[Mesh, RestPose] = WeakKeyDictionary()
        self.changed = False  # the last update has new figures or new poses

    @property
    def known(self) -> list[Figure]:
        """All figures, in the order of their instances."""
        return [figure for figure in self._figures if figure is not None]

    def update(self, instances: list[Instance]) -> None:
        """Find the figures among instances, and take over their poses."""
        place = {id(i): number for number, i in enumerate(self._instances)}
        continues = (
            bool(instances)
            and not any(id(i) in place for i in instances)
            and [i.mesh for i in instances] == [i.mesh for i in self._instances]
        )
        self.changed = False
        found: list[Figure | None] = []
        shown: list[Instance] = []
        for number, instance in enumerate(instances):
            before = number if continues else place.get(id(instance))
            figure = None if before is None else self._figures[before]
            if figure is None or not figure.serves(instance):
                figure = self._new(instance)
                self.changed |= figure is not None
            else:
                self.changed |= figure.pose(instance)
                figure.review()
            found.append(figure)
            if figure is not None:
                figure.stand_in.mesh.materials = instance.mesh.materials
                shown.append(figure.stand_in)
            else:
                shown.append(instance if before is None else self._rigid(instance, before))
        self._instances, self._figures, self._shown = list(instances), found, shown

    def shown(self, instances: list[Instance]) -> list[Instance]:
        """Return what stands for the instances, which are those of the last update."""
        return instances if self._shown == instances else self._shown

    def _rigid(self, instance: Instance, before: int) -> Instance:
        """Return what stands for an instance that is not deformed, and was in place `before`."""
        if instance is self._instances[before] and self._shown[before] is instance:
            return instance
        # The instance of an earlier scene may still be in use, so a copy stands for both.
        copy = self._shown[before]
        if self._figures[before] is not None or copy is self._instances[before]:
            copy = Instance(instance.mesh)
        copy.mesh, copy.world_from_local, copy.name = instance.mesh, instance.world_from_local, instance.name
        return copy

    def _new(self, instance: Instance) -> Figure | None:
        """Return a figure of an instance, None if it is not deformed."""
        if not is_deformed(instance):
            return None
        mesh = instance.mesh
        rest = self._rest.get(mesh)
        if rest is None or not are_same(rest.arrays, arrays_of(mesh)):
            rest = self._rest[mesh] = RestPose(mesh)
        return Figure(instance, rest)


def pose_key(instance: Instance) -> tuple[object, ...]:
    """Return the pose of an instance in comparable form."""
    matrices = instance.joint_matrices
    return None if matrices is None else np.asarray(matrices).tobytes(), tuple(instance.morph_weights)


def _box_areas(low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return half the surface areas of boxes (..., 3)."""
    x, y, z = np.moveaxis(high - low, -1, 0)
    areas: NDArray[np.float64] = x * y + y * z + z * x
    return areas


def figures_by_mesh(figures: Iterable[Figure]) -> dict[int, Figure]:
    """Return figures by the id of their stand-in's mesh."""
    return {id(figure.stand_in.mesh): figure for figure in figures}
