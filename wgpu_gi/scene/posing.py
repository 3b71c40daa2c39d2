"""Poses parts of a scene: evaluates an animation's channels, then the nodes below each other, then what nodes carry.

Channels with the same key times are evaluated at once, and so are nodes at the same depth.

Departures from glTF: at a time when a node scales its part to zero, the part keeps a size that nobody sees, so that its
transform stays invertible; where a transform leaves the range of coordinates, the part stays where the scene has it.
"""

from __future__ import annotations

import hashlib
from copy import copy
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..float_limits import MAX_COORDINATE
from .animated_fields import set_field
from .animation import Animation, Attachment, Channel, Skeleton
from .hierarchy import Hierarchy
from .parts import DirectionalLight, Instance, Light, Material, Mesh, PointLight
from .tracks import value_at, values_at
from .transforms import rigid, visible

Array = NDArray[np.float64]


class Parts(Protocol):
    """The lists of a scene, and its other fields."""

    instances: list[Instance]
    lights: list[Light]
    cameras: list[Camera]


@dataclass
class _Batch:
    """Channels evaluated at once: `values` (c, k, w), or (c, k, 3, w), at the same `times`."""

    channels: list[Channel]
    times: Array
    values: Array

    def at(self, time: float) -> Array:
        """Return the values (c, w) at a time."""
        track, path = self.channels[0].track, self.channels[0].path
        found = values_at(self.times, self.values, track.interpolation, time, path == "rotation")
        for row, channel in enumerate(self.channels):
            if channel.factor is not None:
                found[row] = found[row] * value_at(channel.factor, time)
        return found


class Posing:
    """The copies of those parts of a scene that an animation drives, and their pose at a time."""

    def __init__(self, animation: Animation) -> None:
        self._hierarchy = Hierarchy(animation)
        moving = self._hierarchy.is_moving
        self._attachments = [a for a in animation.attachments if moving(a.node)]
        self._skeletons = [s for s in animation.skeletons if any(map(moving, s.joints))]
        self._batches = _batches(animation.channels)
        self._driven = self._find_driven(animation)
        self._materials = {key for key, part in self._driven.items() if isinstance(part, Material)}
        self._copies: dict[int, tuple[Any, Any]] = {}  # the part and its copy, by the id of the part

    def _find_driven(self, animation: Animation) -> dict[int, Any]:
        """Return the parts that the animation changes, by id."""
        parts: list[Any] = [attachment.part for attachment in self._attachments]
        parts += [instance for skeleton in self._skeletons for instance in skeleton.instances]
        parts += [channel.target for channel in animation.channels if not self._hierarchy.holds(channel.target)]
        return {id(part): part for part in parts}

    def copy_of(self, part: Any) -> Any:
        """Return the copy that is posed in place of a part, or the part itself if nothing drives it."""
        return self._copies.get(id(part), (part, part))[1]

    def take_over(self, source: Parts, target: Parts) -> None:
        """Bring `target` up to date with `source`: what is not driven is shared, the copies of driven parts equal it.

        The copies are made once. Write a pose into them next: it depends on the source and the time alone.
        """
        for f in fields(source):  # type: ignore[arg-type]
            if f.name not in ("instances", "lights", "cameras"):
                setattr(target, f.name, getattr(source, f.name))
        target.instances = [self._own_instance(instance) for instance in source.instances]
        target.lights = [self._own(light) for light in source.lights]
        target.cameras = [self._own(camera) for camera in source.cameras]

    def _own(self, part: Any) -> Any:
        """Return a part that nothing drives, or an updated copy."""
        return self._copied(part) if id(part) in self._driven else part

    def _copied(self, part: Any, kept: str = "") -> Any:
        """Return the copy of a part, with the part's fields but the one `kept`."""
        if id(part) not in self._copies:
            self._copies[id(part)] = part, copy(part)
        found = self._copies[id(part)][1]
        for f in fields(part):
            if f.name != kept:
                setattr(found, f.name, getattr(part, f.name))
        return found

    def _own_instance(self, instance: Instance) -> Instance:
        """Return an instance, or a copy if it or a material of its mesh is driven."""
        if self._materials and any(id(material) in self._materials for material in instance.mesh.materials):
            found: Instance = self._copied(instance)
            mesh: Mesh = self._copied(instance.mesh, "materials")
            materials = [self._own(material) for material in instance.mesh.materials]
            if len(mesh.materials) != len(materials) or any(map(_differs, mesh.materials, materials)):
                mesh.materials = materials
            found.mesh = mesh
            return found
        own: Instance = self._own(instance)
        return own

    def write(self, time: float) -> None:
        """Set the driven fields of the copies to their values at a time in seconds."""
        # Evaluate all channels.
        for batch in self._batches:
            values = batch.at(time)
            if not self._hierarchy.set(batch.channels, values):
                for channel, value in zip(batch.channels, values, strict=True):
                    if id(channel.target) in self._copies:
                        set_field(self.copy_of(channel.target), channel.path, value, channel.index)
        # Place what hangs on nodes.
        if self._attachments or self._skeletons:
            self._hierarchy.place()
        for attachment in self._attachments:
            if id(attachment.part) in self._copies:
                self._place(attachment)
        for skeleton in self._skeletons:
            self._pose(skeleton)

    def _place(self, attachment: Attachment) -> None:
        """Place what a node carries."""
        matrix, part = self._hierarchy.world(attachment.node) @ attachment.node_from_part, self.copy_of(attachment.part)
        if not (np.abs(matrix) <= MAX_COORDINATE).all():  # false for NaN, too
            return
        if isinstance(part, Instance):
            part.world_from_local = visible(matrix)
        elif isinstance(part, Camera):
            pose = rigid(matrix)
            part.world_from_view = part.world_from_view if pose is None else pose
        else:
            if not isinstance(part, DirectionalLight):
                part.position = tuple(matrix[:3, 3].tolist())
            length = float(np.linalg.norm(matrix[:3, 2]))
            if not isinstance(part, PointLight) and length > 0:
                part.direction = tuple((-matrix[:3, 2] / length).tolist())

    def _pose(self, skeleton: Skeleton) -> None:
        """Set the joint matrices of the instances of a skeleton, and their place."""
        posed = self._hierarchy.worlds(skeleton.joints)
        origin = posed[0, :3, 3].copy()
        posed[:, :3, 3] -= origin
        posed = posed @ skeleton.inverse_bind
        if not (np.abs(posed) <= MAX_COORDINATE).all() or not (np.abs(origin) <= MAX_COORDINATE).all():
            return
        for k, instance in enumerate(skeleton.instances):
            if id(instance) in self._copies:
                part = self.copy_of(instance)
                part.joint_matrices = posed
                part.world_from_local = np.eye(4) if skeleton.offsets is None else skeleton.offsets[k].copy()
                part.world_from_local[:3, 3] += origin


def retargeted(animation: Animation, posing: Posing) -> Animation:
    """Return an animation that moves the copies of `posing` in place of their originals."""
    own = posing.copy_of
    return Animation(
        animation.name,
        [replace(channel, target=own(channel.target)) for channel in animation.channels],
        [replace(attachment, part=own(attachment.part)) for attachment in animation.attachments],
        [replace(skeleton, instances=list(map(own, skeleton.instances))) for skeleton in animation.skeletons],
    )


def _differs(one: Any, other: Any) -> bool:
    return one is not other


def _batches(channels: list[Channel]) -> list[_Batch]:
    """Group channels by what their tracks have in common: times, interpolation, shape, and kind of target."""
    groups: dict[tuple[Any, ...], list[Channel]] = {}
    for channel in channels:
        track = channel.track
        times = hashlib.blake2b(track.times.tobytes(), digest_size=16).digest()
        key = (times, track.interpolation, track.values.shape, channel.path, type(channel.target))
        groups.setdefault(key, []).append(channel)
    batches = []
    for group in groups.values():
        tracks = [channel.track for channel in group]
        values = np.stack([np.asarray(track.values, np.float64) for track in tracks])
        batches.append(_Batch(group, np.asarray(tracks[0].times, np.float64), values))
    return batches
