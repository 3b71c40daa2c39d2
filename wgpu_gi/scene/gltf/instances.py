"""The meshes of the shown nodes of a glTF file as instances: posed at rest, repeated, and placed in the world."""

from __future__ import annotations

from ...errors import GiError
from ..scene import Instance
from ..transforms import invertible, visible
from .accessors import Accessors
from .animations import Motion
from .document import Document
from .instancing import instance_matrices
from .materials import Materials, some
from .meshes import Meshes, PlacedMesh
from .morphs import Weights
from .nodes import Nodes
from .skins import RestSkin, SkinDamage, rest_skin
from .vertices import Pose

_LONGEST_REASONS = 200  # characters of the notes in a message


def read_instances(
    document: Document, accessors: Accessors, nodes: Nodes, shown: list[int], motion: Motion, point_size: float | None
) -> list[Instance]:
    """Return the instances of every shown node that has a mesh, and tell `motion` of them. GiError if none is left."""
    # Read the materials of all meshes that are shown.
    descriptions = document.array("nodes")
    materials = Materials(document, accessors)
    meshes = Meshes(document, accessors, materials, point_size)
    references = {node: descriptions[node].optional_index("mesh", len(meshes), "meshes") for node in shown}
    mesh_of_node = {node: mesh for node, mesh in references.items() if mesh is not None}
    if not mesh_of_node:
        raise GiError(f"{document.path.name}: its scene has no meshes; there is nothing to show{_reasons(document)}")
    materials.load(meshes.materials_of(mesh_of_node.values()))
    # Read the meshes at rest, and place them.
    poses = _Poses(document, accessors, nodes, meshes, motion)
    instances: list[Instance] = []
    for node, index in mesh_of_node.items():
        instances += poses.instances(node, index, descriptions[node].text("name") or meshes.name(index))
    for number, material in materials.loaded():
        motion.found("material", number, material)
    # Note what was left out.
    meshes.note_left_out()
    if poses.flat:
        document.notes.add(f"Objects scaled to zero were left out: {some(list(poses.flat))}.")
    if not instances:
        raise GiError(f"{document.path.name}: there are no triangles to show{_reasons(document)}")
    return instances


class _Poses:
    """The meshes of nodes as instances at rest, with their morph targets and skins."""

    def __init__(self, document: Document, accessors: Accessors, nodes: Nodes, meshes: Meshes, motion: Motion) -> None:
        self._document = document
        self._accessors = accessors
        self._nodes = nodes
        self._meshes = meshes
        self._motion = motion
        self._skins: dict[int, RestSkin] = {}
        self.flat: dict[str, None] = {}  # an ordered set of the names of instances that were left out

    def instances(self, node: int, index: int, name: str) -> list[Instance]:
        """Return the instances of glTF mesh `index` that a shown node places, without those scaled to zero for good."""
        description = self._document.array("nodes")[node]
        placed, skin, weights = self._posed(node, index)
        world = self._nodes.placed(node) if skin is None else skin.frame
        moves = skin is None and self._motion.moves([node])
        instances, offsets = [], []
        for copy in instance_matrices(self._document, self._accessors, description, world):
            for mesh, mesh_from_local in placed:
                offset = copy @ mesh_from_local
                world_from_local = visible(world @ offset) if moves else invertible(world @ offset)
                if world_from_local is None:
                    self.flat[name] = None
                    continue
                instance = Instance(mesh, world_from_local, name)
                if mesh.skin is not None and skin is not None:
                    instance.joint_matrices = skin.matrices
                if mesh.morph_targets:
                    count = len(mesh.morph_targets)
                    instance.morph_weights = (*weights, *(0.0,) * count)[:count]
                instances.append(instance)
                offsets.append(offset)
                if moves:
                    self._motion.place(node, instance, offset)
        posed = [k for k, instance in enumerate(instances) if instance.joint_matrices is not None]
        if skin is not None:
            self._motion.pose(skin, [instances[k] for k in posed], [offsets[k] for k in posed])
        self._motion.morph(node, index, [instance for instance in instances if instance.morph_weights])
        return instances

    def _posed(self, node: int, index: int) -> tuple[list[PlacedMesh], RestSkin | None, Weights]:
        """Return glTF mesh `index` as a shown node poses it, with the skin that does, and the morph weights."""
        description = self._document.array("nodes")[node]
        weights, morphs = self._meshes.weights(description, index), self._motion.morphs(node, index)
        baked, targets = ((), self._meshes.target_count(index)) if morphs else (weights, 0)
        skins = self._document.array("skins")
        number = description.optional_index("skin", len(skins), "skins")
        if number is not None:
            # A skinned mesh ignores the transform of its own node (glTF 2.0, 3.7.3.2).
            try:
                if number not in self._skins:
                    self._skins[number] = rest_skin(self._document, self._accessors, number, self._nodes.world)
                skin = self._skins[number]
                pose = Pose(baked, number, skin.matrices, morphs or self._motion.moves(skin.joints), targets)
                return self._meshes.get(index, pose), skin, weights
            except SkinDamage as error:
                self._document.notes.damage(f"{error}; the mesh is shown without its skin.")
        return self._meshes.get(index, Pose(baked, targets=targets)), None, weights


def _reasons(document: Document) -> str:
    """Return the first notes as the end of a message, damage first; it is no longer than a reader takes in."""
    reasons = ""
    for sentence in [*document.notes.damages, *document.notes.sentences]:
        if len(reasons) + len(sentence) > _LONGEST_REASONS:
            break
        reasons += f" {sentence}" if sentence not in reasons else ""
    return f".{reasons}" if reasons else ""
