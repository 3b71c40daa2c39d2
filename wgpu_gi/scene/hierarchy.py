"""The nodes of an animation: their local transforms as arrays, and world matrices by products from the roots down."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .animation import Animation, Channel, Node
from .transforms import rotation_matrices

Array = NDArray[np.float64]


class Hierarchy:
    """The nodes that an animation needs, parents before children, and their `world` matrices (n, 4, 4)."""

    def __init__(self, animation: Animation) -> None:
        targets = [channel.target for channel in animation.channels if isinstance(channel.target, Node)]
        joints = [joint for skeleton in animation.skeletons for joint in skeleton.joints]
        self._nodes, depths = _ordered([*targets, *(a.node for a in animation.attachments), *joints])
        self._row = {id(node): row for row, node in enumerate(self._nodes)}
        parents = [-1 if node.parent is None else self._row[id(node.parent)] for node in self._nodes]
        self._parents = np.array(parents, np.int64)
        # A node moves if a channel aims at it, or if its parent moves.
        self._moving = np.zeros(len(self._nodes), np.bool_)
        self._moving[[self._row[id(node)] for node in targets]] = True
        levels = [np.flatnonzero(depths == depth) for depth in range(int(depths.max(initial=-1)) + 1)]
        for level in levels[1:]:
            self._moving[level] |= self._moving[self._parents[level]]
        # The local transforms at rest.
        count = len(self._nodes)
        self._fields: dict[str, Array] = {
            name: np.array([getattr(node, name) for node in self._nodes], np.float64).reshape(count, width)
            for name, width in (("translation", 3), ("rotation", 4), ("scale", 3))
        }
        self._given = {row: node.matrix for row, node in enumerate(self._nodes) if node.matrix is not None}
        self._world = np.tile(np.eye(4), (count, 1, 1))
        self._place(levels)
        self._levels = [rows for level in levels if len(rows := level[self._moving[level]])]

    def holds(self, target: Any) -> bool:
        """Tell whether the target of a channel is one of the nodes."""
        return id(target) in self._row

    def is_moving(self, node: Node) -> bool:
        """Tell whether channels move a node, or one above it."""
        return bool(self._moving[self._row[id(node)]])

    def set(self, channels: Sequence[Channel], values: Array) -> bool:
        """Set the local transforms of nodes to values (c, w) of the same path; False if the targets are no nodes."""
        if not self.holds(channels[0].target):
            return False
        self._fields[channels[0].path][[self._row[id(channel.target)] for channel in channels]] = values
        return True

    def place(self) -> None:
        """Compute the world matrices of all nodes that move."""
        self._place(self._levels)

    def world(self, node: Node) -> Array:
        """Return the world matrix of a node."""
        matrix: Array = self._world[self._row[id(node)]]
        return matrix

    def worlds(self, nodes: Iterable[Node]) -> Array:
        """Return the world matrices (j, 4, 4) of nodes, as a copy."""
        matrices: Array = self._world[[self._row[id(node)] for node in nodes]]
        return matrices

    def _place(self, levels: list[NDArray[np.int64]]) -> None:
        """Compute the world matrices of `levels`: rows of nodes whose parents are in levels before, or are known."""
        with np.errstate(over="ignore", invalid="ignore"):
            for rows in levels:
                local = np.tile(np.eye(4), (len(rows), 1, 1))
                turned = rotation_matrices(self._fields["rotation"][rows])
                local[:, :3, :3] = turned * self._fields["scale"][rows][:, None, :]
                local[:, :3, 3] = self._fields["translation"][rows]
                for k, row in enumerate(rows.tolist() if self._given else ()):
                    local[k] = self._given.get(row, local[k])
                parents = self._parents[rows]
                self._world[rows] = np.where((parents >= 0)[:, None, None], self._world[parents] @ local, local)


def _ordered(nodes: Iterable[Node]) -> tuple[list[Node], NDArray[np.int64]]:
    """Return nodes and all nodes above them, and the depth of each, (n,): 0 for roots."""
    depth: dict[int, int] = {}
    order: list[Node] = []
    for node in nodes:
        # Climb to a known node, or a root, then come down again.
        way: list[Node] = []
        above: Node | None = node
        while above is not None and id(above) not in depth:
            way.append(above)
            above = above.parent
        for found in reversed(way):
            depth[id(found)] = 0 if found.parent is None else depth[id(found.parent)] + 1
            order.append(found)
    return order, np.array([depth[id(node)] for node in order], np.int64)
