"""The motion of instances, and of vertices within them, since the last frame, for motion vectors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..gpu.wgsl.load import load
from ..scene.scene import Instance
from .deformation import Deformation
from .mesh_data import NONE
from .two_level_bvh import TwoLevelBvh


class InstanceMotion:
    """Remembers the transform of each instance, and the pose of each figure, at the last call."""

    def __init__(self) -> None:
        self._instances: list[Instance] = []
        self._matrices = np.zeros((0, 4, 4))
        self._poses: dict[int, int] = {}  # version of the figure of each stand-in, by id
        self._vertices: dict[int, NDArray[np.float32]] = {}  # positions at the last call, by id(mesh), if other now
        self.has_moved_vertices = False  # a mesh had new positions at some time
        self._dtype = load("shared/gbuffer/motion.wgsl").struct_dtype("Motion")

    def forget(self) -> None:
        """Forget the last call: in the next one nothing has moved."""
        self._instances, self._matrices = [], np.zeros((0, 4, 4))
        self._poses, self._vertices = {}, {}

    def note_vertices(self, hierarchy: TwoLevelBvh) -> None:
        """Remember which meshes have new positions; call after each update of the hierarchy."""
        if not self._instances:  # none has an earlier place
            return
        self._vertices = hierarchy.moved_vertices | self._vertices
        self.has_moved_vertices |= bool(self._vertices)

    def update(self, instances: list[Instance], hierarchy: TwoLevelBvh, deformation: Deformation) -> NDArray[np.void]:
        """Return a record Motion of wgsl/shared/gbuffer/motion.wgsl for each instance, and one without instances.

        A new instance has not moved. Sends the earlier positions of meshes with new ones.
        """
        now = np.array([i.world_from_local for i in instances], np.float64).reshape(-1, 4, 4)
        known = {id(i): matrix for i, matrix in zip(self._instances, self._matrices, strict=True)}
        before = np.array([known.get(id(i), m) for i, m in zip(instances, now, strict=True)]).reshape(-1, 4, 4)
        to_origin, from_origin = np.eye(4), np.eye(4)
        to_origin[:3, 3], from_origin[:3, 3] = -hierarchy.origin, hierarchy.origin
        change = np.tile(np.eye(4), (max(len(now), 1), 1, 1))
        # Instances at rest keep the exact identity: an inverse would add its rounding.
        moved = np.flatnonzero((before != now).any((1, 2)))
        if len(moved):
            change[moved] = to_origin @ before[moved] @ np.linalg.inv(now[moved]) @ from_origin
        records = np.zeros(len(change), self._dtype)
        records["first_vertex"] = NONE
        # Of deformed ones, transform the earlier positions.
        for number, first in self._deformed(instances, hierarchy, deformation).items():
            change[number] = to_origin @ before[number]
            records["first_vertex"][number] = first & 0xFFFFFFFF
        self._instances, self._matrices, self._vertices = list(instances), now, {}
        records["transform"][..., :3] = change[:, :3].transpose(0, 2, 1)
        return records

    def _deformed(self, instances: list[Instance], hierarchy: TwoLevelBvh, deformation: Deformation) -> dict[int, int]:
        """Return the instances whose vertices have moved, and which vertex `before_positions` begins with for each."""
        found: dict[int, int] = {}
        poses: dict[int, int] = {}
        firsts: dict[int, int] = {}
        place = deformation.reserve(sum(len(positions) for positions in self._vertices.values()))
        for key, positions in self._vertices.items():
            if key in {id(i.mesh) for i in instances}:
                firsts[key] = place
                deformation.send_before(place, positions)
                place += len(positions)
        for number, instance in enumerate(instances):
            mesh = instance.mesh
            figure = hierarchy.figures.get(id(mesh))
            if figure is not None:
                poses[id(instance)] = figure.version
                if deformation.has_before and self._poses.get(id(instance), figure.version) != figure.version:
                    found[number] = hierarchy.first_figures[2]
            elif id(mesh) in firsts:
                found[number] = hierarchy.placement(mesh).vertices.start - firsts[id(mesh)]
        self._poses = poses
        return found
