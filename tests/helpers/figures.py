"""A tube of skinned rings that bends: a figure with joints, and with morph targets."""

from __future__ import annotations

import numpy as np

from wgpu_gi.scene.scene import Instance, Material, Mesh, MorphTarget, Skin

LENGTH = 2.0


def tube(rings=24, around=16, joints=5, radius=0.2, targets=0, material=None):
    """Return a tube along +Y from the origin, open at both ends; two joints move each vertex."""
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    height, angle = np.meshgrid(np.linspace(0, 1, rings), turn, indexing="ij")
    out = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], -1).reshape(-1, 3)
    positions = radius * out + np.outer(height.ravel() * LENGTH, (0, 1, 0))
    place = np.arange(rings * around).reshape(rings, around)
    a, b = place[:-1], np.roll(place, -1, 1)[:-1]
    c, d = np.roll(place, -1, 1)[1:], place[1:]
    triangles = np.concatenate([np.stack(corners, -1).reshape(-1, 3) for corners in ((a, c, b), (a, d, c))])
    along = height.ravel() * (joints - 1)
    first = np.clip(np.floor(along), 0, joints - 2).astype(np.uint16)
    weights = np.stack([1 - (along - first), along - first], 1)
    bulges = [np.sin(np.pi * (k + 1) * height.ravel())[:, None] * out for k in range(targets)]
    tangents = np.column_stack([np.stack([-out[:, 2], 0 * out[:, 0], out[:, 0]], -1), np.ones(len(out))])
    return Mesh(
        positions.astype(np.float32),
        triangles.astype(np.uint32),
        [material or Material("skin", (0.8, 0.3, 0.2, 1.0))],
        normals=out.astype(np.float32),
        tangents=tangents.astype(np.float32),
        skin=Skin(np.stack([first, first + 1], 1), weights.astype(np.float32)),
        morph_targets=[MorphTarget(b.astype(np.float32) * 0.1, b.astype(np.float32) * 0.3) for b in bulges],
    )


def bent(angle, joints=5, scale=1.0):
    """Return joint matrices (j, 4, 4) that bend each joint of a tube by an angle about Z, and by half of it about X."""
    cos, sin, half = np.cos(angle), np.sin(angle), angle / 2
    turn = np.array([[cos, -sin, 0, 0], [sin, cos, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    cos, sin = np.cos(half), np.sin(half)
    turn = turn @ np.array([[1, 0, 0, 0], [0, cos, -sin, 0], [0, sin, cos, 0], [0, 0, 0, 1]])
    found, whole = [], np.diag([scale, scale, scale, 1.0])
    for joint in range(joints):
        up = np.eye(4)
        up[1, 3] = joint * LENGTH / (joints - 1)
        whole = whole @ up @ turn @ np.linalg.inv(up)
        found.append(whole)
    return np.array(found)


def figure(angle=0.0, at=(0.0, 0.0, 0.0), **fields):
    """Return an instance of a bent tube."""
    placed = np.eye(4)
    placed[:3, 3] = at
    mesh = tube(**fields)
    joints = int(mesh.skin.joints.max()) + 1
    return Instance(mesh, placed, "figure", bent(angle, joints), tuple(0.5 for _ in mesh.morph_targets))
