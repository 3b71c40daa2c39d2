"""A walk of the figure: the rotation of each joint over a cycle of two steps, and how far a cycle takes it.

Angles follow the curves of Perry and Burnfield, "Gait Analysis" (2010), as sines and bumps. The hips are as high as the
lower foot demands, and move forward as fast as the foot on the ground moves back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .figure import Figure

Array = NDArray[np.float64]

# The foot's pitch against the ground over the cycle of its leg, degrees, toes down positive: the heel strikes at 0.25.
FOOT_PHASES = (0.0, 0.12, 0.25, 0.34, 0.58, 0.68, 0.77, 0.9)
FOOT_PITCH = (18.0, -8.0, -16.0, 0.0, 0.0, 14.0, 48.0, 40.0)


@dataclass(frozen=True)
class Gait:
    """A cycle: phases (t,) from 0 to 1, local rotations (t, j, 4) as quaternions xyzw, heights (t,) and stride.

    heights: of the root joint above its place at rest, metres. stride: metres forward (+Z) in a cycle.
    """

    phases: Array
    rotations: Array
    heights: Array
    stride: float


def make_gait(figure: Figure, keys: int = 24) -> Gait:
    """Return a cycle of `keys` keys and a last one that equals the first."""
    phases = np.linspace(0.0, 1.0, keys + 1)
    angles = joint_angles(phases)
    rotations = np.zeros((len(phases), len(figure.names), 4))
    rotations[..., 3] = 1.0
    for name, xyz in angles.items():
        rotations[:, figure.names.index(name)] = _quaternions(np.radians(xyz))
    # Pose the soles, and put the lower one on the ground.
    soles = np.flatnonzero(figure.positions[:, 1] < 0.12)
    heights = np.empty(len(phases))
    feet = np.empty((len(phases), 2))
    ankles = [figure.names.index(f"{side} foot") for side in ("left", "right")]
    for k, rotation in enumerate(rotations):
        matrices = joint_matrices(figure, rotation)
        heights[k] = -_posed(figure, matrices, soles)[:, 1].min()
        feet[k] = [(matrices[a] @ [*figure.places[a], 1.0])[2] for a in ankles]
    # The foot on the ground is the one that strikes at phase 0.25 (left) or 0.75 (right).
    steps = -np.diff(feet, axis=0)
    middles = (phases[1:] + phases[:-1]) / 2
    on_left = (middles > 0.25) & (middles < 0.75)
    return Gait(phases, rotations, heights, float(np.where(on_left, steps[:, 0], steps[:, 1]).sum()))


def joint_angles(phases: Array) -> dict[str, Array]:
    """Return rotations (t, 3) about x, y and z in degrees by joint; a leg swings forward from phase -0.25 to 0.25."""
    zero = np.zeros_like(phases)
    swing = np.sin(2 * np.pi * phases)
    angles = {
        "hips": np.stack([zero, -6 * swing, 2.5 * np.cos(2 * np.pi * phases)], 1),
        "spine": np.stack([zero + 3, 5 * swing, -2.5 * np.cos(2 * np.pi * phases)], 1),
        "chest": np.stack([zero + 2, 7 * swing, zero], 1),
        "neck": np.stack([zero - 3, -6 * swing, zero], 1),
    }
    for side, sign, shift in (("left", 1.0, 0.0), ("right", -1.0, 0.5)):
        own = (phases + shift) % 1.0
        forward = np.sin(2 * np.pi * own)
        thigh = -(20 * forward + 4)
        knee = 6 + 56 * _bump(own, -0.08, 3) + 9 * _bump(own, 0.37, 8)
        pitch = np.interp(own, FOOT_PHASES, FOOT_PITCH, period=1.0)
        toes = -32 * _bump(own, 0.72, 12)
        angles[f"{side} thigh"] = np.stack([thigh, zero, sign * -2 + zero], 1)
        angles[f"{side} shin"] = np.stack([knee, zero, zero], 1)
        angles[f"{side} foot"] = np.stack([pitch - thigh - knee, zero, zero], 1)
        angles[f"{side} toes"] = np.stack([toes, zero, zero], 1)
        # The arm swings against the leg of its side.
        angles[f"{side} arm"] = np.stack([24 * forward + 4, zero, sign * -17 + zero], 1)
        angles[f"{side} forearm"] = np.stack([-24 + 14 * forward, zero, sign * -8 + zero], 1)
    return angles


def joint_matrices(figure: Figure, rotations: Array, root: Array | None = None) -> Array:
    """Return local_from_bind of each joint, (j, 4, 4), for local rotations (j, 4) as quaternions xyzw.

    root: (4, 4), applied after all.
    """
    local = np.zeros((len(rotations), 4, 4))
    local[:, :3, :3] = _rotations(rotations)
    local[:, 3, 3] = 1.0
    above = np.where(figure.parents[:, None] >= 0, figure.places[figure.parents], 0.0)
    local[:, :3, 3] = figure.places - above
    posed = np.empty_like(local)
    for joint, parent in enumerate(figure.parents):
        outer = (np.eye(4) if root is None else root) if parent < 0 else posed[parent]
        posed[joint] = outer @ local[joint]
    unbind = np.broadcast_to(np.eye(4), posed.shape).copy()
    unbind[:, :3, 3] = -figure.places
    return np.asarray(posed @ unbind)


def _posed(figure: Figure, matrices: Array, chosen: NDArray[np.int64]) -> Array:
    blended = np.einsum("nk,nkij->nij", figure.weights[chosen], matrices[figure.joints[chosen]])
    return np.asarray(np.einsum("nij,nj->ni", blended[:, :3, :3], figure.positions[chosen]) + blended[:, :3, 3])


def _bump(phases: Array, centre: float, power: int) -> Array:
    """Return a smooth periodic bump of height 1; a higher power is narrower."""
    return np.asarray(((1 + np.cos(2 * np.pi * (phases - centre))) / 2) ** power)


def _quaternions(angles: Array) -> Array:
    """Return quaternions xyzw (t, 4) of rotations about z, then x, then y by radians (t, 3)."""
    half = angles / 2
    (sx, sy, sz), (cx, cy, cz) = np.sin(half).T, np.cos(half).T
    # q = q_y q_x q_z
    x, y, z, w = cy * sx, sy * cx, -sy * sx, cy * cx
    return np.stack([x * cz + y * sz, y * cz - x * sz, z * cz + w * sz, w * cz - z * sz], axis=1)


def _rotations(q: Array) -> Array:
    """Return rotation matrices (j, 3, 3) of unit quaternions xyzw (j, 4)."""
    x, y, z, w = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
