"""The vertices of a glTF primitive: attributes from accessors or Draco data, morphed, cleaned and skinned.

An animated skin, or animated morph weights, leave them in the bind pose, with their influences and displacements.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import compression as gltf_compression
from .accessors import Accessors, Array, dequantise
from .document import Document
from .geometry import clean_attribute
from .json_object import Damage, JsonObject
from .morphs import Weights, apply_morphs, read_displacements
from .skins import SkinDamage, apply_skin, read_influences

# Arrays of equal length by attribute names of glTF, JOINTS and WEIGHTS (all sets together), and `displacement_key`.
Vertices = dict[str, NDArray[Any]]

_SKIN_BYTES = 12 * 8  # of the blended matrix of a vertex
_TARGET_BYTES = 9 * 4  # of the displacements of a vertex by a target: position, normal and tangent
_MORPH_BYTES = 12 * 8  # of the morphed position, normal and tangent of a vertex, while they are added

# The vertex attributes of a Mesh, each with the component counts that glTF allows and a neutral value. Primitives that
# lack the attribute get this value if others of the mesh have it.
ATTRIBUTES: dict[str, tuple[tuple[int, ...], NDArray[np.float32]]] = {
    "POSITION": ((3,), np.zeros(3, np.float32)),
    "NORMAL": ((3,), np.zeros(3, np.float32)),
    "TANGENT": ((4,), np.zeros(4, np.float32)),
    "TEXCOORD_0": ((2,), np.zeros(2, np.float32)),
    "TEXCOORD_1": ((2,), np.zeros(2, np.float32)),
    "COLOR_0": ((3, 4), np.ones(4, np.float32)),
}


@dataclass(frozen=True)
class Pose:
    """How a node poses its mesh: weights of the morph targets, and the joint matrices (k, 4, 4) of a skin.

    What moves is not applied: the mesh keeps its skin, or all of its `targets` morph targets.
    """

    weights: Weights = ()
    skin: int | None = None
    joints: NDArray[np.float64] | None = field(default=None, compare=False)
    skin_moves: bool = False
    targets: int = 0

    @property
    def is_baked(self) -> bool:
        """Tell whether the mesh has its final shape."""
        return not self.skin_moves and not self.targets


class VertexReader:
    """Reads the vertices of primitives; those without a skin are read once for all primitives that share them."""

    def __init__(self, document: Document, accessors: Accessors) -> None:
        self._document = document
        self._accessors = accessors
        self._vertices_of_accessors: dict[Hashable, Vertices] = {}

    def shared(self, primitive: JsonObject, pose: Pose) -> tuple[Hashable, Vertices]:
        """Return a key of the accessors of an uncompressed primitive without skin, and its vertices."""
        attributes = primitive.child("attributes").raw
        targets = repr(primitive.raw.get("targets")) if pose.weights else ""
        key = (*(repr(attributes.get(name)) for name in ATTRIBUTES), targets, pose.weights)
        if key not in self._vertices_of_accessors:
            self._vertices_of_accessors[key] = self.read(primitive, None, pose)
        return key, self._vertices_of_accessors[key]

    def draco(self, primitive: JsonObject) -> gltf_compression.DracoMesh | None:
        """Return the Draco mesh of a primitive; None without one, or if only the uncompressed data can be read."""
        extension = primitive.extension("KHR_draco_mesh_compression")
        if extension is None:
            return None
        attributes = primitive.child("attributes")
        position = self._accessors.describe(attributes.index("POSITION", len(self._accessors), "accessors"))
        if "bufferView" in position and not gltf_compression.has_draco():
            return None
        return self._accessors.draco_mesh(extension)

    def read(self, primitive: JsonObject, draco: gltf_compression.DracoMesh | None, pose: Pose) -> Vertices:
        """Return the attributes of a posed primitive as float32 arrays of equal length.

        Raises Damage without readable positions, and SkinDamage for a skin that cannot be applied.
        """
        arrays = self._attributes(primitive, draco)
        # Most attributes become float32 arrays of their own; four bytes a component bound them all.
        count = len(arrays["POSITION"])
        size = sum(4 * values.size for values in arrays.values())
        size += (_MORPH_BYTES * count if pose.weights else 0) + (_SKIN_BYTES * count if pose.joints is not None else 0)
        self._document.budget.take(size + _TARGET_BYTES * pose.targets * count, primitive.where)
        moves: Vertices = {}
        if pose.targets:
            moves = dict(read_displacements(arrays, primitive, self._target))
        else:
            apply_morphs(arrays, primitive, pose.weights, self._target)
        vertices: Vertices = {name: self._cleaned(primitive, name, values) for name, values in arrays.items()}
        if pose.joints is not None:
            try:
                read = partial(self._attribute, primitive, draco=draco)
                influences = read_influences(count, len(pose.joints), primitive, read)
            except Damage as error:
                raise SkinDamage(str(error)) from None
            if pose.skin_moves:
                moves["JOINTS"], moves["WEIGHTS"] = influences[0].astype(np.uint16), influences[1].astype(np.float32)
            else:
                # Absurd weights give positions that are not finite; their triangles are left out later.
                with np.errstate(over="ignore", invalid="ignore"):
                    apply_skin(vertices, pose.joints, influences)
        return vertices | moves

    def _attributes(self, primitive: JsonObject, draco: gltf_compression.DracoMesh | None) -> dict[str, Array]:
        """Return the dequantised attributes of a primitive, without those that do not suit its positions."""
        arrays: dict[str, Array] = {}
        for name, (widths, _) in ATTRIBUTES.items():
            try:
                values = self._attribute(primitive, name, draco)
                if values is None:
                    continue
                if values.shape[1] not in widths:
                    raise primitive.error(f"{name} must have {widths[-1]} components, not {values.shape[1]}")
                count = len(arrays.get("POSITION", values))
                if len(values) != count:
                    raise primitive.error(f"{name} has {len(values)} elements for {count} positions")
                arrays[name] = values
            except Damage as error:
                if name == "POSITION":
                    raise
                self._document.notes.damage(f"{error}; {name} was ignored.")
        if "NORMAL" not in arrays:
            arrays.pop("TANGENT", None)  # tangents without normals are to be ignored (glTF 2.0, 3.7.2.1)
        return arrays

    def _attribute(
        self, primitive: JsonObject, name: str, draco: gltf_compression.DracoMesh | None = None
    ) -> Array | None:
        """Return a dequantised vertex attribute; None if the primitive does not have it."""
        attributes = primitive.child("attributes")
        if name not in attributes:
            return None
        index = attributes.index(name, len(self._accessors), "accessors")
        if draco is not None and name in draco.attributes:
            return dequantise(self._accessors.describe(index), draco.attributes[name])
        return self._accessors.read(index)

    def _target(self, target: JsonObject, name: str) -> Array:
        """Return the displacements of an attribute by a morph target."""
        return self._accessors.read(target.index(name, len(self._accessors), "accessors"))

    def _cleaned(self, primitive: JsonObject, name: str, values: Array) -> NDArray[np.float32]:
        """Return an attribute in the form of a Mesh, with a note if some of its values are not finite."""
        cleaned, bad = clean_attribute(name, values)
        if bad:
            primitive.damage(f"{bad} values of {name} are not finite; they were left out")
        return cleaned
