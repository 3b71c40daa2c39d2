"""Animations of a glTF file (3.11): channels of nodes and morph weights, and of what KHR_animation_pointer points to.

The channels are read first, since meshes keep their skins and targets only if these move. A channel that cannot be
played is left out, with a note.

Departures: nodes with a matrix do not move by channels, and pointers to texture transforms are left out.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...float_limits import LARGEST_LIGHT, MAX_COORDINATE
from ..animated_fields import fields_of
from ..animation import Animation, Attachment, Channel, Skeleton, Track
from ..scene import Instance
from .accessors import Accessors
from .document import Document
from .json_object import JsonObject
from .morphs import target_count
from .nodes import Nodes
from .pointers import Property, property_of
from .skins import RestSkin

MOST_KEYS = 1 << 16  # of a channel: half an hour at 30 Hz
_INTERPOLATIONS = {"STEP": "step", "LINEAR": "linear", "CUBICSPLINE": "cubic"}
_PATHS = ("translation", "rotation", "scale", "weights")
_SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
_EMISSION = ("emission", "emission_strength")
_ARRAYS = {"node": "nodes", "mesh": "meshes", "camera": "cameras", "material": "materials"}


class Motion:
    """What the animations of a file move: asked before the parts of the scene are read, and told about each part."""

    def __init__(self, document: Document, accessors: Accessors, nodes: Nodes) -> None:
        self._document = document
        self._accessors = accessors
        self._nodes = nodes
        self._lights = document.named_objects(
            document.root.extension_or_empty("KHR_lights_punctual").values("lights"), "lights"
        )
        self._seconds: dict[int, NDArray[np.float64]] = {}  # the times of keys, by accessor
        self._target_counts: dict[int, int] = {}  # by mesh
        self._descriptions = document.array("animations")
        self._channels = [self._read(description) for description in self._descriptions]
        every = [(what.kind, what.index, what.path) for channels in self._channels for what, _ in channels]
        self._moving = nodes.below({i for kind, i, path in every if kind == "node" and path != "morph_weights"})
        self._morphing = {(kind, i) for kind, i, path in every if path == "morph_weights"}
        self._attachments: list[Attachment] = []
        self._skeletons: list[Skeleton] = []
        self._parts: dict[tuple[str, int], list[Any]] = {}

    # -------------------------------------------------------------------------------------------- questions

    def moves(self, nodes: Iterable[int]) -> bool:
        """Tell whether some of the nodes move."""
        return not self._moving.isdisjoint(nodes)

    def morphs(self, node: int, mesh: int) -> bool:
        """Tell whether the weights of a mesh change, as a node shows it."""
        return self._weights_key(node, mesh) in self._morphing

    def _weights_key(self, node: int, mesh: int) -> tuple[str, int]:
        """Return whose weights a node shows: its own, or those of its mesh, which it has no weights of its own for."""
        own = ("node", node)
        by_mesh = own not in self._morphing and "weights" not in self._document.array("nodes")[node]
        return ("mesh", mesh) if by_mesh else own

    # -------------------------------------------------------------------------------------------- parts of the scene

    def place(self, node: int, part: Any, node_from_part: NDArray[np.float64] | None = None) -> None:
        """Tell that a node carries a part."""
        if self.moves([node]):
            self._attachments.append(
                Attachment(part, self._nodes.frames[node], np.eye(4) if node_from_part is None else node_from_part)
            )

    def pose(self, skin: RestSkin, instances: list[Instance], offsets: list[NDArray[np.float64]]) -> None:
        """Tell that the joints of a skin pose instances, which `offsets` place relative to the frame of the skin."""
        if instances and self.moves(skin.joints):
            joints = [self._nodes.frames[joint] for joint in skin.joints]
            self._skeletons.append(Skeleton(instances, joints, skin.inverse_bind, offsets))

    def morph(self, node: int, mesh: int, instances: list[Instance]) -> None:
        """Tell which instances show the weights of a node's mesh."""
        self._parts.setdefault(self._weights_key(node, mesh), []).extend(instances)

    def found(self, kind: str, index: int, part: Any) -> None:
        """Tell which part of the scene is the light, camera or material `index` of the file, or one more of them."""
        self._parts.setdefault((kind, index), []).append(part)

    # -------------------------------------------------------------------------------------------- the result

    def animations(self) -> list[Animation]:
        """Return the animations that move something, after all parts were told."""
        found = []
        for description, changes in zip(self._descriptions, self._channels, strict=True):
            emission = {(what.index, what.path): track for what, track in changes if what.path in _EMISSION}
            channels = [channel for what, track in changes for channel in self._bound(what, track, emission)]
            if channels:
                name = description.text("name")
                found.append(Animation(name, channels, self._attachments, self._skeletons))
            else:
                self._document.notes.add(f"{description.where} was left out: it moves nothing that is shown.")
        return found

    def _bound(self, what: Property, track: Track, emission: dict[tuple[int, str], Track]) -> list[Channel]:
        """Return the channels that change a property of all parts that have it; `emission`: of materials, by path."""
        if what.kind == "node" and what.path != "morph_weights":
            return [Channel(self._nodes.frames[what.index], what.path, track)]
        parts, factor = self._parts.get((what.kind, what.index), []), None
        path = what.path
        if path in _EMISSION:
            if path == "emission_strength" and (what.index, "emission") in emission:
                return []  # the channel of the emission has it as its factor
            gain = emission.get((what.index, "emission_strength"))
            path, (track, factor) = "emission", self._emission(what, track, gain)
            parts = parts[:1]  # further ones are copies for points, which do not glow
        return [Channel(part, path, track, factor, what.part) for part in parts if path in fields_of(part)]

    def _emission(self, what: Property, track: Track, gain: Track | None) -> tuple[Track, Track]:
        """Return the tracks of the emissive factor and its strength, one of which may be constant."""
        description = self._document.array("materials")[what.index]
        if what.path == "emission":
            strength = description.extension_or_empty("KHR_materials_emissive_strength")
            constant = np.array([strength.number("emissiveStrength", 1.0, low=0.0, high=LARGEST_LIGHT)])
            return track, gain or Track(np.zeros(1), constant)
        rgb = description.vector("emissiveFactor", (0.0, 0.0, 0.0), low=0.0, high=LARGEST_LIGHT)
        return Track(np.zeros(1), np.array([rgb])), track

    # -------------------------------------------------------------------------------------------- reading

    def _read(self, description: JsonObject) -> list[tuple[Property, Track]]:
        """Return what the channels of an animation change, and their tracks; others are left out, with notes."""
        samplers = description.objects("samplers")
        found: list[tuple[Property, Track]] = []
        aims: dict[tuple[str, int, str], set[int | None]] = {}  # the elements of each property that have a channel
        for channel in description.objects("channels"):
            with self._document.leaving_out("the channel"):
                target = channel.child("target")
                if target.raw.get("path") in _PATHS and "node" not in target:
                    self._document.notes.add(
                        f"{target.where} has no node; the channel was left out."
                    )  # it may lack one
                    continue
                what = self._target(target)
                parts = aims.setdefault((what.kind, what.index, what.path), set())
                if parts and (what.part is None or not parts.isdisjoint({None, what.part})):
                    raise channel.error("another channel of the animation has the same target")
                sampler = samplers[channel.index("sampler", len(samplers), "samplers")]
                found.append((what, self._track(sampler, what)))
                parts.add(what.part)
        return found

    def _target(self, target: JsonObject) -> Property:
        """Return the property that a channel aims at. Raises Damage."""
        path = target.text("path", None)
        if path == "pointer":
            pointer = target.extension_or_empty("KHR_animation_pointer").text("pointer", None)
            what = property_of(pointer)
            if what is None:
                raise target.error(f"the property {pointer[:80]!r} cannot be animated here")
        elif path in _PATHS:
            node = target.index("node", len(self._nodes), "nodes")
            what = property_of(f"/nodes/{node}/{path}")
            assert what is not None, "all paths of nodes are known"
        else:
            raise target.error(f"path must be one of {', '.join(_PATHS)} or pointer, not {path[:40]!r}")
        self._check(target, what)
        return what

    def _check(self, target: JsonObject, what: Property) -> None:
        """Raise Damage unless the property exists, and may be animated."""
        owners = self._lights if what.kind == "light" else self._document.array(_ARRAYS[what.kind])
        if what.index >= len(owners):
            raise target.error(f"it aims at {what.kind} {what.index}, and there are {len(owners)}")
        owner = owners[what.index]
        if what.kind == "node" and what.path != "morph_weights" and "matrix" in owner:
            raise target.error(f"it aims at nodes[{what.index}], which has a matrix")
        if what.path == "morph_weights":
            count = self._target_count(what)
            if what.part is not None and what.part >= count:
                raise target.error(f"it aims at morph target {what.part} of {count}")
        kind = {"yfov": "perspective", "orthographic_height": "orthographic"}.get(what.path)
        if kind is not None and owner.text("type") != kind:
            raise target.error(f"it aims at the {kind} lens of cameras[{what.index}], which has none")
        if what.kind == "light" and what.path.endswith("cone_angle") and owner.text("type") != "spot":
            raise target.error(f"it aims at the cone of lights[{what.index}], which is no spot light")
        if what.path in ("base_color", "metallic", "roughness") and owner.extension(_SPECULAR_GLOSSINESS):
            raise target.error(f"it aims at metallic roughness, and materials[{what.index}] has {_SPECULAR_GLOSSINESS}")

    def _target_count(self, what: Property) -> int:
        """Return the number of morph targets of a mesh, or of the mesh of a node."""
        meshes, index = self._document.array("meshes"), what.index
        if what.kind == "node":
            found = self._document.array("nodes")[what.index].optional_index("mesh", len(meshes), "meshes")
            if found is None:
                return 0
            index = found
        if index not in self._target_counts:
            self._target_counts[index] = target_count(meshes[index])
        return self._target_counts[index]

    def _times(self, sampler: JsonObject) -> NDArray[np.float64]:
        """Return the times of the keys of a sampler, in seconds. Raises Damage for times that cannot be played."""
        index = sampler.index("input", len(self._accessors), "accessors")
        if index not in self._seconds:
            times = self._accessors.read(index)
            if times.shape[1] != 1 or times.dtype.kind != "f":
                raise sampler.error("input must hold floats (SCALAR)")
            if not 1 <= len(times) <= MOST_KEYS:
                raise sampler.error(f"it has {len(times)} keys; there must be from 1 to {MOST_KEYS}")
            self._document.budget.take(8 * len(times), sampler.where)
            seconds = times[:, 0].astype(np.float64)
            if not np.isfinite(seconds).all() or (np.diff(seconds) < 0).any():
                raise sampler.error("the times of its keys must be finite and increase")
            self._seconds[index] = seconds
        return self._seconds[index]

    def _track(self, sampler: JsonObject, what: Property) -> Track:
        """Return the track of a sampler. Raises Damage for keys that cannot be played."""
        seconds = self._times(sampler)
        count = len(seconds)
        interpolation: Any = sampler.choice("interpolation", _INTERPOLATIONS, "LINEAR")
        values = self._accessors.read(sampler.index("output", len(self._accessors), "accessors"))
        width = self._target_count(what) if what.width is None else what.width
        columns = 1 if what.width is None else width
        rows = count * (3 if interpolation == "cubic" else 1) * (width // columns)
        if not width:
            raise sampler.error("it changes weights of a mesh without morph targets")
        if values.shape != (rows, columns):
            raise sampler.error(f"output must have {rows} elements of {columns} numbers, not {values.shape}")
        if values.dtype.kind != "f":
            raise sampler.error("output must hold floats or normalized integers")
        self._document.budget.take(8 * values.size, sampler.where)
        doubles = values.astype(np.float64) * what.scale
        limit = MAX_COORDINATE if what.kind == "node" else LARGEST_LIGHT
        if not (np.abs(doubles) <= limit).all():  # false for NaN, too
            raise sampler.error(f"its values must be finite, at most {limit:g}")
        keys = doubles.reshape(count, 3, width) if interpolation == "cubic" else doubles.reshape(count, width)
        quaternions = keys[:, 1] if interpolation == "cubic" else keys
        if what.path == "rotation" and not quaternions.any(axis=1).all():
            raise sampler.error("a rotation is the zero quaternion")
        return Track(seconds, keys, interpolation)
