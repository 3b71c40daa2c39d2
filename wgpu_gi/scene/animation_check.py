"""Checks animations: every target, path, track and node. Each animation once, since it is immutable once in use."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..camera import Camera
from .animated_fields import FIELDS, LIGHTS, fields_of
from .animation import Animation, Attachment, Channel, Node, Skeleton, Track
from .parts import Instance
from .rules import Rule, array, choice, fault_of, instance_of, is_whole, items, optional, text, vector

_ANIMATION = {
    "name": text,
    "channels": items(Channel),
    "attachments": items(Attachment),
    "skeletons": items(Skeleton),
}
_CHANNEL = {
    "target": instance_of(*FIELDS),
    "path": text,
    "track": instance_of(Track),
    "factor": optional(instance_of(Track)),
    "index": Rule(lambda v: v is None or (is_whole(v) and v >= 0), "None or the index of a morph weight"),
}
_INTERPOLATION = {"interpolation": choice("step", "linear", "cubic")}
_MATRIX = array("numbers", 4, 4)
_NODE = {
    "parent": optional(instance_of(Node)),
    "translation": vector(3),
    "rotation": vector(4),
    "scale": vector(3),
    "matrix": optional(Rule(lambda m: _MATRIX.allows(m) and bool(np.isfinite(m).all()), "a finite (4, 4) array")),
    "name": text,
}
_ATTACHMENT = {"part": instance_of(Instance, *LIGHTS, Camera), "node": instance_of(Node), "node_from_part": _MATRIX}
_SKELETON = {
    "instances": items(Instance),
    "joints": items(Node),
    "inverse_bind": array("numbers", None, 4, 4),
    "offsets": optional(items(np.ndarray)),
}
_KNOWN: WeakKeyDictionary[Animation, bool] = WeakKeyDictionary()


def animation_fault(animation: Animation) -> str | None:
    """Return what is wrong with an animation, beginning with the field; None if nothing is."""
    if animation not in _KNOWN:
        fault = fault_of(animation, _ANIMATION) or _parts_fault(animation)
        if fault is not None:
            return fault
        _KNOWN[animation] = True
    return None


def _parts_fault(animation: Animation) -> str | None:
    """Return the first fault of the channels, attachments, skeletons and their nodes."""
    nodes: dict[int, tuple[str, Node]] = {}
    for k, channel in enumerate(animation.channels):
        if (fault := _channel_fault(channel)) is not None:
            return f"channels[{k}].{fault}"
        if isinstance(channel.target, Node):
            nodes.setdefault(id(channel.target), (f"channels[{k}].target", channel.target))
    for k, attachment in enumerate(animation.attachments):
        if (fault := fault_of(attachment, _ATTACHMENT)) is not None:
            return f"attachments[{k}].{fault}"
        nodes.setdefault(id(attachment.node), (f"attachments[{k}].node", attachment.node))
    for k, skeleton in enumerate(animation.skeletons):
        if (fault := _skeleton_fault(skeleton)) is not None:
            return f"skeletons[{k}].{fault}"
        for n, node in enumerate(skeleton.joints):
            nodes.setdefault(id(node), (f"skeletons[{k}].joints[{n}]", node))
    known: set[int] = set()
    faults = (fault for where, node in nodes.values() if (fault := _node_fault(where, node, known)) is not None)
    return next(faults, None)


def _channel_fault(channel: Channel) -> str | None:
    """Return the first fault of a channel."""
    if (fault := fault_of(channel, _CHANNEL)) is not None:
        return fault
    known = fields_of(channel.target)
    if channel.path not in known:
        kind, names = type(channel.target).__name__, ", ".join(map(repr, known))
        return f"path must be one of {names[:400]} for a {kind}, not {channel.path[:40]!r}"
    if channel.index is not None and channel.path != "morph_weights":
        return f"index must be None for {channel.path!r}, not {channel.index}"
    for name, width in (("track", known[channel.path].width if channel.index is None else 1), ("factor", 1)):
        track = getattr(channel, name)
        if track is not None and (fault := _track_fault(track, width)) is not None:
            return f"{name}.{fault}"
    if channel.path == "rotation" and not np.abs(_keys(channel.track)).max(axis=-1).all():
        return "track.values must not be zero quaternions"
    return None


def _keys(track: Track) -> Any:
    """Return the values at the keys, (k, w), without tangents."""
    return track.values[:, 1] if track.interpolation == "cubic" else track.values


def _track_fault(track: Track, width: int | None) -> str | None:
    """Return the first fault of a track of `width` values."""
    if (fault := fault_of(track, _INTERPOLATION)) is not None:
        return fault
    rows = (3,) if track.interpolation == "cubic" else ()
    rules = {"times": array("numbers", None), "values": array("numbers", None, *rows, width)}
    if (fault := fault_of(track, rules)) is not None:
        return fault
    if not len(track.times) or len(track.times) != len(track.values):
        return f"times must be as many as the values, {len(track.values)}, and at least one, not {len(track.times)}"
    if not np.isfinite(track.times).all() or (np.diff(track.times) < 0).any():
        return "times must be finite seconds that do not fall"
    return None if np.isfinite(track.values).all() else "values must be finite"


def _skeleton_fault(skeleton: Skeleton) -> str | None:
    """Return the first fault of a skeleton, apart from its nodes."""
    if (fault := fault_of(skeleton, _SKELETON)) is not None:
        return fault
    if not skeleton.joints or len(skeleton.joints) != len(skeleton.inverse_bind):
        return f"inverse_bind must have a matrix for each of the {len(skeleton.joints)} joints, at least one"
    if not np.isfinite(skeleton.inverse_bind).all():
        return "inverse_bind must be finite"
    offsets = skeleton.offsets
    if offsets is not None and (len(offsets) != len(skeleton.instances) or not all(map(_MATRIX.allows, offsets))):
        return f"offsets must be a (4, 4) array for each of the {len(skeleton.instances)} instances"
    return None


def _node_fault(where: str, node: Node, known: set[int]) -> str | None:
    """Return the first fault of a node and of those above it, unless they are in `known`."""
    path: set[int] = set()
    above: Node | None = node
    while above is not None and id(above) not in known:
        if id(above) in path:
            return f"{where} must not be below itself"
        path.add(id(above))
        if (fault := fault_of(above, _NODE)) is not None:
            return f"{where}.{fault}" if above is node else f"{where}: a node above it: {fault}"
        above = above.parent
    known |= path
    return None
