"""The node hierarchy of a glTF file, checked to be a tree, and the world matrices of its nodes in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...float_limits import MAX_COORDINATE
from .document import Document
from .json_object import JsonObject

Matrix = NDArray[np.float64]


class Nodes:
    """The nodes of a document: their `world` matrices (4, 4) by index, and which of them are shown."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._nodes = document.array("nodes")
        self._children = [node.indices("children", len(self._nodes), "nodes") for node in self._nodes]
        self._parents = self._find_parents()
        self.world = self._world_matrices()

    def __len__(self) -> int:
        return len(self._nodes)

    def shown(self) -> list[int]:
        """Return the nodes of the default scene, depth first, in the order of the file."""
        order, stack = [], self._scene_roots()[::-1]
        while stack:
            node = stack.pop()
            order.append(node)
            stack += self._children[node][::-1]
        return order

    def scene_name(self) -> str:
        """Return the name of the default scene."""
        scenes, index = self._document.array("scenes"), self._scene_index()
        return "" if index is None else scenes[index].text("name")

    def _scene_index(self) -> int | None:
        """Return the index of the default scene, the first if the file names none; None if it has no scenes."""
        scenes = self._document.array("scenes")
        if "scene" in self._document.root:
            return self._document.root.index("scene", len(scenes), "scenes")
        return 0 if scenes else None

    def _scene_roots(self) -> list[int]:
        """Return the root nodes of the default scene, or all roots of a file without scenes."""
        scenes, index = self._document.array("scenes"), self._scene_index()
        if index is None:
            return [node for node, parent in enumerate(self._parents) if parent is None]
        scene = scenes[index]
        if len(scenes) > 1:
            self._document.notes.add(f"The file has {len(scenes)} scenes; scene {index} is shown.")
        roots = scene.indices("nodes", len(self._nodes), "nodes")
        if len(set(roots)) < len(roots):
            raise scene.error("it lists a node twice; the file is damaged")
        for root in roots:
            parent = self._parents[root]
            if parent is not None:
                raise scene.error(f"nodes[{root}] is not a root, it is a child of nodes[{parent}]; the file is damaged")
        return roots

    def _find_parents(self) -> list[int | None]:
        """Return the parent of each node. Raises GiError if a node has two."""
        parents: list[int | None] = [None] * len(self._nodes)
        for node, children in enumerate(self._children):
            for child in children:
                if parents[child] is not None:
                    raise self._nodes[child].error(
                        f"it is a child of both nodes[{parents[child]}] and nodes[{node}]; the file is damaged"
                    )
                parents[child] = node
        return parents

    def _world_matrices(self) -> list[Matrix]:
        """Return the world matrix of every node. Raises GiError for cycles and transforms out of range."""
        # Walk down from the roots, without recursion, since the depth is not bounded.
        world: list[Matrix | None] = [None] * len(self._nodes)
        stack = [node for node, parent in enumerate(self._parents) if parent is None]
        while stack:
            node = stack.pop()
            parent = self._parents[node]
            local = _local_matrix(self._nodes[node])
            above = None if parent is None else world[parent]
            with np.errstate(over="ignore", invalid="ignore"):
                matrix = local if above is None else above @ local
            if not (np.abs(matrix) < MAX_COORDINATE).all():
                raise self._nodes[node].error(
                    f"its transform is out of range (above {MAX_COORDINATE:g}); repair the file"
                )
            world[node] = matrix
            stack += self._children[node]
        # A node that no root reaches is on a cycle or below one, as each node has at most one parent.
        reached = [matrix for matrix in world if matrix is not None]
        if len(reached) < len(world):
            unreached = next(node for node, matrix in enumerate(world) if matrix is None)
            raise self._nodes[unreached].error("it is part of a cycle of nodes; the file is damaged")
        return reached


def _local_matrix(node: JsonObject) -> Matrix:
    """Return parent_from_node: the node's matrix, or translation * rotation * scale."""
    if "matrix" in node:
        matrix = np.array(node.vector("matrix", tuple(np.eye(4).ravel()))).reshape(4, 4).T.copy()
        if not np.allclose(matrix[3], (0.0, 0.0, 0.0, 1.0), atol=1e-6):
            raise node.error("matrix is not affine: its last row must be 0 0 0 1; repair the file")
        matrix[3] = 0.0, 0.0, 0.0, 1.0
        return matrix
    matrix = np.eye(4)
    if "rotation" in node:
        matrix[:3, :3] = _rotation_matrix(node)
    if "scale" in node:
        matrix[:3, :3] *= node.vector("scale", (1.0, 1.0, 1.0))
    if "translation" in node:
        matrix[:3, 3] = node.vector("translation", (0.0, 0.0, 0.0))
    return matrix


def _rotation_matrix(node: JsonObject) -> Matrix:
    """Return the matrix of the node's quaternion (x, y, z, w), made unit length."""
    quaternion = np.array(node.vector("rotation", (0.0, 0.0, 0.0, 1.0)))
    largest = float(np.abs(quaternion).max())
    if largest == 0.0:
        raise node.error("rotation is the zero quaternion; repair the file")
    # Dividing by the largest entry first keeps the squares from overflowing.
    quaternion /= largest
    x, y, z, w = (quaternion / np.linalg.norm(quaternion)).tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
