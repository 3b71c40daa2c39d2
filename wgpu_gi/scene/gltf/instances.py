"""The meshes of the shown nodes of a glTF file as instances: posed at rest, repeated, and placed in the world."""

from __future__ import annotations

from ...errors import GiError
from ..scene import Instance
from ..transforms import invertible
from .accessors import Accessors
from .document import Document
from .instancing import instance_matrices
from .materials import Materials, some
from .meshes import Meshes, PlacedMesh
from .nodes import Matrix, Nodes
from .skins import SkinDamage, joint_matrices
from .vertices import Pose

_LONGEST_REASONS = 200  # characters of the notes in a message


def read_instances(document: Document, nodes: Nodes, shown: list[int], point_size: float | None) -> list[Instance]:
    """Return the instances of every shown node that has a mesh. Raises GiError if there are none."""
    # Read the materials of all meshes that are shown.
    descriptions = document.array("nodes")
    accessors = Accessors(document)
    materials = Materials(document, accessors)
    meshes = Meshes(document, accessors, materials, point_size)
    references = {node: descriptions[node].optional_index("mesh", len(meshes), "meshes") for node in shown}
    mesh_of_node = {node: mesh for node, mesh in references.items() if mesh is not None}
    if not mesh_of_node:
        raise GiError(f"{document.path.name}: its scene has no meshes; there is nothing to show{_reasons(document)}")
    materials.load(meshes.materials_of(mesh_of_node.values()))
    # Read the meshes at rest, and place them.
    poses = _Poses(document, accessors, nodes, meshes)
    instances: list[Instance] = []
    flat: dict[str, None] = {}  # an ordered set of names
    for node, index in mesh_of_node.items():
        placed, matrix = poses.meshes(node, index)
        name = descriptions[node].text("name") or meshes.name(index)
        for copy in instance_matrices(document, accessors, descriptions[node], matrix):
            for mesh, mesh_from_local in placed:
                world_from_local = invertible(copy @ mesh_from_local)
                if world_from_local is None:
                    flat[name] = None
                else:
                    instances.append(Instance(mesh, world_from_local, name))
    # Note what was left out.
    meshes.note_left_out()
    if flat:
        document.notes.add(f"Objects scaled to zero were left out: {some(list(flat))}.")
    if not instances:
        raise GiError(f"{document.path.name}: there are no triangles to show{_reasons(document)}")
    return instances


class _Poses:
    """The meshes of nodes at rest, with their morph targets and skins."""

    def __init__(self, document: Document, accessors: Accessors, nodes: Nodes, meshes: Meshes) -> None:
        self._document = document
        self._accessors = accessors
        self._nodes = nodes
        self._meshes = meshes
        self._skins: dict[int, tuple[Matrix, Matrix]] = {}  # the joint matrices and the frame of each skin

    def meshes(self, node: int, index: int) -> tuple[list[PlacedMesh], Matrix]:
        """Return glTF mesh `index`, posed by a shown node, and world_from_mesh."""
        description = self._document.array("nodes")[node]
        weights = self._meshes.weights(description, index)
        skins = self._document.array("skins")
        skin = description.optional_index("skin", len(skins), "skins")
        if skin is not None:
            # A skinned mesh ignores the transform of its own node (glTF 2.0, 3.7.3.2).
            try:
                if skin not in self._skins:
                    self._skins[skin] = joint_matrices(self._document, self._accessors, skin, self._nodes.world)
                joints, frame = self._skins[skin]
                return self._meshes.get(index, Pose(weights, skin, joints)), frame
            except SkinDamage as error:
                self._document.notes.damage(f"{error}; the mesh is shown without its skin.")
        return self._meshes.get(index, Pose(weights)), self._nodes.placed(node)


def _reasons(document: Document) -> str:
    """Return the first notes as the end of a message, damage first; it is no longer than a reader takes in."""
    reasons = ""
    for sentence in [*document.notes.damages, *document.notes.sentences]:
        if len(reasons) + len(sentence) > _LONGEST_REASONS:
            break
        reasons += f" {sentence}" if sentence not in reasons else ""
    return f".{reasons}" if reasons else ""
