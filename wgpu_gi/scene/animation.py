"""Animations as plain data: tracks of keys, the nodes that they move, and what the nodes carry (glTF 2.0, 3.11).

A channel sets one value of its target from a track. A target is a `Node`, whose world matrix then places the instances,
lights, cameras and skeletons that hang below it, or a light, a camera, a material or an instance itself. `player.py`
shows a scene at a time.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError, known_names
from ..records import KnownAttributes
from .parts import Instance, Light, Material

Interpolation = Literal["step", "linear", "cubic"]


@dataclass(eq=False, repr=False, slots=True)
class Track(KnownAttributes):
    """Values at key times: `times` (k,) seconds, increasing, and `values` (k, w), or (k,) for single numbers.

    "cubic" is glTF's CUBICSPLINE: `values` (k, 3, w) hold the in-tangent, the value and the out-tangent of each key,
    tangents per second. Before the first key and after the last, the value stays. Treated as immutable once in use.
    """

    times: NDArray[np.float64]
    values: NDArray[np.float64]
    interpolation: Interpolation = "linear"

    def __post_init__(self) -> None:
        try:
            times, values = np.asarray(self.times, np.float64), np.asarray(self.values, np.float64)
        except (TypeError, ValueError):
            return  # the check of the scene says what is wrong
        rows = 2 if self.interpolation == "cubic" else 1
        self.times, self.values = times, values[..., None] if values.ndim == rows else values


@dataclass(eq=False, repr=False, slots=True)
class Node(KnownAttributes):
    """A frame of a hierarchy: parent_from_node = translation * rotation * scale, or `matrix` (4, 4), if given.

    `rotation` is a quaternion (x, y, z, w). A node without a parent stands in the world.
    """

    parent: Node | None = None
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    matrix: NDArray[np.float64] | None = None
    name: str = ""


@dataclass(eq=False, repr=False, slots=True)
class Attachment(KnownAttributes):
    """A part of the scene that a node carries: world_from_part = world_from_node @ node_from_part (4, 4).

    Lights and cameras look along the part's -Z; lights stand at its origin.
    """

    part: Instance | Light | Camera
    node: Node
    node_from_part: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))


@dataclass(eq=False, repr=False, slots=True)
class Skeleton(KnownAttributes):
    """The nodes that pose skinned instances: joint_from_bind = world_from_joint @ `inverse_bind` (j, 4, 4).

    The local space of the instances has its origin at the first joint and the axes of the world, so that joint matrices
    stay small numbers: world_from_local = translation to the first joint @ the instance's matrix in `offsets`.
    """

    instances: list[Instance]
    joints: list[Node]
    inverse_bind: NDArray[np.float64]
    offsets: list[NDArray[np.float64]] | None = None  # (4, 4) each; None: the identity


@dataclass(eq=False, repr=False, slots=True)
class Channel(KnownAttributes):
    """One value that changes: the field `path` of `target`, from `track`, times `factor` if there is one.

    Nodes have "translation", "rotation" (spherically interpolated) and "scale", instances "morph_weights", of which
    `index` selects one. Lights, cameras and materials: any field of numbers, such as "intensity", "yfov", "base_color".
    """

    target: Node | Instance | Light | Camera | Material
    path: str
    track: Track
    factor: Track | None = None
    index: int | None = None


@dataclass(eq=False, repr=False, slots=True)
class Animation(KnownAttributes):
    """Channels that play together, and what their nodes carry. Treated as immutable once in use.

    Animations of one file share the lists `attachments` and `skeletons`. Parts that a scene does not hold stay.
    """

    name: str = ""
    channels: list[Channel] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)
    skeletons: list[Skeleton] = field(default_factory=list)

    @property
    def duration(self) -> float:
        """Seconds from 0 to the last key of all channels."""
        tracks = [t for c in self.channels for t in (c.track, c.factor) if t is not None]
        return max(0.0, *(float(t.times[-1]) for t in tracks), 0.0)


def chosen_animation(animations: list[Animation], choice: str | int | None = None) -> Animation:
    """Return the animation with a name or an index, also as a text; None is the first. Raises GiError if none fits."""
    if not animations:
        raise GiError("the scene has no animation")
    if choice is None:
        return animations[0]
    named = [animation for animation in animations if animation.name == choice]
    if named:
        return named[0]
    index = int(choice) if isinstance(choice, str) and choice.isdecimal() and len(choice) < 9 else choice
    if isinstance(index, int) and not isinstance(index, bool) and 0 <= index < len(animations):
        return animations[index]
    if isinstance(choice, int):
        raise GiError(f"the scene has no animation {choice!r}; its last is {len(animations) - 1}")
    names = known_names(str(choice), (animation.name for animation in animations))
    raise GiError(f"the scene has no animation {str(choice)[:60]!r}; {names}")
