"""Triangles split for rasterisation: the same surface, no gaps between neighbours, small pieces near the origin."""

from __future__ import annotations

import numpy as np

from wgpu_gi.upload.split_triangles import SHORTEST, split_triangles


def ground(size, at=(0.0, 0.0), cells=1, seed=0):
    """A turned square of `size` as 2 cells^2 triangles, whose point `at` of [-1, 1]^2 lies at the origin."""
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    t = np.linspace(-1, 1, cells + 1)
    x, z = np.meshgrid(t - at[0], t - at[1])
    p = np.stack([x, 0 * x, z], -1) @ turn.T * size / 2
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], 2), np.stack([a, c, d], 2)]).reshape(-1, 3, 3)


def areas(corners):
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2


def test_pieces_cover_their_triangles():
    corners = ground(1e6, (0.3, -0.2))
    split, pieces, owners = split_triangles(corners, 1.5e6)
    assert split.any() and set(owners.tolist()) == set(np.flatnonzero(split).tolist())
    assert np.allclose(np.bincount(owners, areas(pieces), len(corners))[split], areas(corners)[split])
    # On the same side as their triangle.
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[owners]
    assert (np.einsum("nc,nc->n", np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0]), normal) > 0).all()


def test_neighbours_split_their_edges_alike():
    """Every directed edge inside the square has its opposite, with the same corners bit for bit."""
    for at in ((0.0, 0.0), (0.25, 0.1), (1.0, 1.0), (-0.5, 0.5)):
        corners = ground(1e6, at, cells=2, seed=3)
        # Neighbours share their corners bit for bit, as those of a mesh do.
        split, pieces, _ = split_triangles(corners, 1.5e6)
        every = np.concatenate([corners[~split], pieces]).astype(np.float32)
        edges = {(tuple(t[k]), tuple(t[k - 2])) for t in every.tolist() for k in range(3)}
        single = [(a, b) for a, b in edges if (b, a) not in edges]
        border = sum(np.linalg.norm(np.subtract(a, b)) for a, b in single)
        assert abs(border / 4e6 - 1) < 1e-3


def test_pieces_near_the_origin_are_small():
    for at in ((0.3, -0.2), (0.0, 0.0), (1.0, 1.0)):
        _, pieces, _ = split_triangles(ground(1e6, at), 1.5e6)
        size = np.linalg.norm(pieces - pieces[:, [1, 2, 0]], axis=2).max(1)
        distance = np.linalg.norm(pieces.mean(1), axis=1)
        assert (size <= np.maximum(4 * distance, 2 * SHORTEST * 1.5e6)).all()
        assert len(pieces) < 250


def test_triangles_far_from_the_origin_stay():
    rng = np.random.default_rng(0)
    middle = rng.normal(size=(500, 1, 3))
    corners = middle + 0.3 * np.linalg.norm(middle, axis=2, keepdims=True) * rng.uniform(-1, 1, (500, 3, 3)) / 3**0.5
    split, pieces, owners = split_triangles(corners, 10.0)
    assert not split.any() and len(pieces) == len(owners) == 0
