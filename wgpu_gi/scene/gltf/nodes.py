"""The node hierarchy of a glTF file, made a tree, and the world matrices of its nodes at rest, in float64."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ...float_limits import MAX_COORDINATE
from ..animation import Node
from ..transforms import rotation_matrices
from .document import Document
from .json_object import JsonObject

Matrix = NDArray[np.float64]


class Nodes:
    """The nodes of a document by index: their `frames`, their `world` matrices (4, 4), and which of them are shown.

    A matrix is None if the transforms above the node are out of range; such nodes are not shown.
    """

    def __init__(self, document: Document) -> None:
        self._document = document
        self._nodes = document.array("nodes")
        self._scene = self._default_scene()
        self._children, self._parents = self._family()
        self.frames = [_frame(node) for node in self._nodes]
        self.world: list[Matrix | None] = [None] * len(self._nodes)
        self._place_all()
        for frame, above in zip(self.frames, self._parents, strict=True):
            frame.parent = None if above is None else self.frames[above]

    def __len__(self) -> int:
        return len(self._nodes)

    def shown(self) -> list[int]:
        """Return the nodes of the default scene, depth first, in the order of the file."""
        order: dict[int, None] = {}  # an ordered set
        stack = self._scene_roots()[::-1]
        while stack:
            node = stack.pop()
            if node not in order and self._visible(node):
                order[node] = None
                stack += [child for child in self._children[node][::-1] if child not in order]
        return [node for node in order if self.world[node] is not None]

    def _visible(self, node: int) -> bool:
        extension = self._nodes[node].extension("KHR_node_visibility")
        return extension is None or extension.flag("visible", True)

    def placed(self, node: int) -> Matrix:
        """Return the world matrix of a shown node."""
        matrix = self.world[node]
        assert matrix is not None, "shown nodes have a matrix"
        return matrix

    def below(self, nodes: Iterable[int]) -> set[int]:
        """Return `nodes` and all nodes below them."""
        found: set[int] = set()
        stack = list(nodes)
        while stack:
            node = stack.pop()
            if node not in found:
                found.add(node)
                stack += self._children[node]
        return found

    def scene_name(self) -> str:
        """Return the name of the default scene."""
        return "" if self._scene is None else self._scene.text("name")

    def _default_scene(self) -> JsonObject | None:
        """Return the default scene, the first if the file names none; None if it has no scenes."""
        scenes = self._document.array("scenes")
        index = self._document.root.optional_index("scene", len(scenes), "scenes")
        if len(scenes) > 1:
            self._document.notes.add(f"The file has {len(scenes)} scenes; scene {index or 0} is shown.")
        return scenes[index or 0] if scenes else None

    def _scene_roots(self) -> list[int]:
        """Return the nodes that the default scene lists, or all roots of a file without scenes."""
        if self._scene is None:
            return [node for node, parent in enumerate(self._parents) if parent is None]
        roots = self._scene.correct_indices("nodes", len(self._nodes), "nodes")
        for root in roots:
            parent = self._parents[root]
            if parent is not None:
                self._scene.damage(f"nodes[{root}] is not a root; it is shown as a child of nodes[{parent}]")
        if len(set(roots)) < len(roots):
            self._scene.damage("it lists a node twice; the node is shown once")
        return roots

    def _family(self) -> tuple[list[list[int]], list[int | None]]:
        """Return the children and the parent of each node, without second parents."""
        parents: list[int | None] = [None] * len(self._nodes)
        children: list[list[int]] = []
        for node, description in enumerate(self._nodes):
            own = []
            for child in description.correct_indices("children", len(self._nodes), "nodes"):
                if parents[child] is None:
                    parents[child] = node
                    own.append(child)
                else:
                    others = f"nodes[{parents[child]}] and nodes[{node}]"
                    self._nodes[child].damage(f"it is a child of both {others}; the second was ignored")
            children.append(own)
        return children, parents

    def _place_all(self) -> None:
        """Set the world matrices of all nodes, and open the cycles."""
        placed = [False] * len(self._nodes)
        for node, parent in enumerate(self._parents):
            if parent is None:
                self._place(node, placed)
        # A node that no root reaches is on a cycle or below one, as each node has at most one parent. A cycle is opened
        # above the node that the scene lists, or else above its first node.
        listed = [] if self._scene is None else self._scene.correct_indices("nodes", len(self._nodes), "nodes")
        for start in [*listed, *range(len(self._nodes))]:
            if placed[start]:
                continue
            root, seen = start, set[int]()
            while root not in seen:
                seen.add(root)
                root = self._parents[root] or 0
            parent = self._parents[root] or 0
            self._nodes[root].damage(f"it is part of a cycle of nodes; its parent, nodes[{parent}], was ignored")
            self._children[parent].remove(root)
            self._parents[root] = None
            self._place(root, placed)

    def _place(self, root: int, placed: list[bool]) -> None:
        """Set the world matrices of a root and of all nodes below it."""
        # Walk down without recursion, since the depth is not bounded.
        stack = [root]
        while stack:
            node = stack.pop()
            placed[node] = True
            stack += self._children[node]
            parent = self._parents[node]
            above = np.eye(4) if parent is None else self.world[parent]
            if above is None:
                continue
            with np.errstate(over="ignore", invalid="ignore"):
                matrix = above @ _local_matrix(self.frames[node])
            if (np.abs(matrix) < MAX_COORDINATE).all():
                self.world[node] = matrix
            else:
                self._nodes[node].damage(
                    f"its transform is out of range (above {MAX_COORDINATE:g}); it was left out, with all below it"
                )


def _frame(node: JsonObject) -> Node:
    """Return the frame of a node, without its parent: its matrix, or translation, rotation and scale."""
    name = node.text("name")
    if "matrix" in node:
        matrix = np.array(node.vector("matrix", tuple(np.eye(4).ravel()))).reshape(4, 4).T.copy()
        if not np.allclose(matrix[3], (0.0, 0.0, 0.0, 1.0), atol=1e-6):
            node.damage("matrix is not affine; its last row must be 0 0 0 1 and was ignored")
        matrix[3] = 0.0, 0.0, 0.0, 1.0
        return Node(matrix=matrix, name=name)
    x, y, z, w = node.vector("rotation", (0.0, 0.0, 0.0, 1.0))
    if not any((x, y, z, w)):
        node.damage("rotation is the zero quaternion; it was ignored")
        w = 1.0
    right, up, back = node.vector("scale", (1.0, 1.0, 1.0))
    along, above, behind = node.vector("translation", (0.0, 0.0, 0.0))
    return Node(None, (along, above, behind), (x, y, z, w), (right, up, back), name=name)


def _local_matrix(frame: Node) -> Matrix:
    """Return parent_from_node: the frame's matrix, or translation * rotation * scale."""
    if frame.matrix is not None:
        return frame.matrix
    matrix = np.eye(4)
    if frame.rotation != (0.0, 0.0, 0.0, 1.0):
        matrix[:3, :3] = rotation_matrices(np.array([frame.rotation]))[0]
    matrix[:3, :3] *= frame.scale
    matrix[:3, 3] = frame.translation
    return matrix
