"""Anchors of triangle records and the scene's origin: hits near the details of a scene are exact."""

from __future__ import annotations

import numpy as np
from helpers.anchors import corners_of, weights_of
from helpers.scene_dtypes import DTYPES

from wgpu_gi.scene.built_in.shapes import box, quad, sphere
from wgpu_gi.scene.scene import Instance
from wgpu_gi.upload.anchors import anchor_triangles
from wgpu_gi.upload.mesh_data import prepare_meshes
from wgpu_gi.upload.scene_origin import scene_origin


def records_of(corners):
    records = np.zeros(len(corners), DTYPES["triangles"])
    records["flags"] = 5
    anchor_triangles(records, corners)
    return records


def test_anchors_are_points_of_their_triangles_and_not_far_from_the_origin():
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(20_000, 3, 3)) * 10 ** rng.uniform(-3, 3, (20_000, 1, 1))
    corners += rng.normal(size=(20_000, 1, 3)) * 10 ** rng.uniform(-3, 3, (20_000, 1, 1))
    records = records_of(corners)
    assert (records["flags"] & 15 == 5).all()
    weights, size = weights_of(records["flags"]), np.abs(corners).max((1, 2))
    assert (weights >= 0).all() and (weights.sum(1) <= 1).all()
    assert (np.abs(corners_of(records) - corners).max((1, 2)) < 3e-7 * size).all()
    # No other point is nearer than half as far, but for the steps of the weights.
    b = rng.random((20_000, 40, 2))
    b = np.where(b.sum(2, keepdims=True) > 1, 1 - b, b)
    points = corners[:, None, 0] + b @ (corners[:, 1:] - corners[:, :1])
    nearest = np.linalg.norm(points, axis=2).min(1)
    extent = np.ptp(corners, axis=1).max(1)
    assert (np.linalg.norm(records["anchor"], axis=1) <= 2 * nearest + extent / 2**13 + 1e-6 * size).all()
    assert (weights > 0).any(1).mean() > 0.1


def test_a_plane_through_the_origin_passes_through_its_anchor():
    """A quad of 1e6 m, turned: the anchor lies within a thousandth of a millimetre of the exact plane."""
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    corners = np.array([[(-5e5, 0, -5e5), (5e5, 0, 5e5), (5e5, 0, -5e5)]]) @ turn.T
    records = records_of(corners)
    assert abs(records["anchor"][0].astype(float) @ turn[:, 1]) < 1e-5
    assert np.linalg.norm(records["anchor"][0]) < 100


def origin_of(*instances):
    matrices = np.array([i.world_from_local for i in instances])
    bounds = [np.asarray(i.mesh.positions)[:, :] + i.world_from_local[:3, 3] for i in instances]
    corners = np.concatenate(bounds)
    data = prepare_meshes([i.mesh for i in instances], DTYPES["vertices"])
    origin, _ = scene_origin(data, matrices, np.stack([corners.min(0), corners.max(0)]))
    return origin


def test_the_origin_is_where_the_details_are():
    ground = Instance(quad((-5e5, 0, 5e5), (1e6, 0, 0), (0, 0, -1e6)))
    house = Instance(box((-1, 0, -1), (1, 2, 1)))
    house.world_from_local = house.world_from_local.copy()
    house.world_from_local[:3, 3] = 3.1e5, 0, -2e5
    assert np.abs(origin_of(ground, house) - (3.1e5, 1, -2e5)).max() <= 1


def test_the_origin_of_other_scenes_is_the_middle_of_their_bounds():
    ball, room = Instance(sphere((0.5, 0.4, 0.1), 0.3)), Instance(box((-1, 0, -1), (2, 2, 1), inward=True))
    assert np.allclose(origin_of(ball, room), (0.5, 1, 0))
    assert np.allclose(origin_of(ball), (0.5, 0.4, 0.1), atol=1e-3)
