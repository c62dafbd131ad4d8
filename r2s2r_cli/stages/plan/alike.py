"""Poses that are the same but for a symmetry and a motion over the ground: their futures are the same, too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.plan.placement import turned
from r2s2r_cli.stages.plan.symmetry import SymmetryGroup

MOVING = 0.05
"""[s] by which a difference in speed counts as one in place."""


@dataclass(frozen=True)
class Alike:
    """Rows and the row that stands for each. leader: (B,); rows whose leader they are themselves stand for a class.
    element: symmetry in whose labels the row's canonical form is read, (B,); shape: canonical targets, (B, motor)."""

    leader: np.ndarray
    element: np.ndarray
    shape: np.ndarray

    @property
    def leaders(self) -> np.ndarray:
        """Rows that stand for a class, ascending."""
        return np.unique(self.leader)


def alike(group: SymmetryGroup, shape: np.ndarray, p_WE: np.ndarray, speed: np.ndarray, tolerance: float) -> Alike:
    """Classes of robots with targets (B, motor), caps (B, cap, 3) [m] and cap speeds (B, cap) [m/s], given in order of
    preference: the first of a class leads it. tolerance: largest difference of a distance or height [m]; 0: no classes.
    """
    batch = len(shape)
    motors = np.array([element.motors for element in group.elements])
    caps = group.caps()
    relabelled = shape[:, motors]  # (B, element, motor): what motor k of the canonical robot has
    weight = 2.0 ** np.arange(shape.shape[1])[::-1]
    code = relabelled @ weight
    element = code.argmin(axis=1)
    row = np.arange(batch)
    canonical = relabelled[row, element]
    if tolerance <= 0:
        return Alike(row, element, canonical)
    q = p_WE[row[:, None], caps[element]]
    v = speed[row[:, None], caps[element]]
    i, j = np.triu_indices(q.shape[1], 1)
    described = np.concatenate([q[..., 2], np.linalg.norm(q[:, i] - q[:, j], axis=-1), MOVING * v], axis=1)
    leader = row.copy()
    for one in np.unique(code[row, element]):
        members = np.flatnonzero(code[row, element] == one)
        heads = np.empty(0, dtype=int)
        for m in members:
            near = np.flatnonzero((np.abs(described[heads] - described[m]) < tolerance).all(axis=1))
            if len(near):
                leader[m] = heads[near[0]]
            else:
                heads = np.append(heads, m)
    return Alike(leader, element, canonical)


def carried(group: SymmetryGroup, same: Alike, p_WE: np.ndarray, member: np.ndarray, points: np.ndarray) -> np.ndarray:
    """What became of leaders, told of their members: points (M, cap + more, 3) of the leader's future, as the member's.

    member: rows (M,) of the class; the first caps of `points` are end caps and are relabelled, further points only
    moved. p_WE: caps (B, cap, 3) of all rows.
    """
    caps = group.caps()
    lead = same.leader[member]
    g_lead, g_member = caps[same.element[lead]], caps[same.element[member]]
    row = np.arange(len(member))[:, None]
    from_, to = p_WE[lead[:, None], g_lead], p_WE[member[:, None], g_member]
    centre_from, centre_to = from_[..., :2].mean(axis=1), to[..., :2].mean(axis=1)
    a, b = from_[..., :2] - centre_from[:, None], to[..., :2] - centre_to[:, None]
    yaw = np.arctan2((a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]).sum(axis=1), (a * b).sum(axis=(1, 2)))
    moved = points.copy()
    moved[..., :2] = turned(points[..., :2] - centre_from[:, None], yaw[:, None]) + centre_to[:, None]
    told = moved.copy()
    told[row, g_member] = moved[row, g_lead]
    return told


def told_targets(group: SymmetryGroup, same: Alike, member: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Targets (M, motor) of the leaders as the members' own."""
    motors = np.array([element.motors for element in group.elements])
    row = np.arange(len(member))[:, None]
    told = np.empty_like(targets)
    told[row, motors[same.element[member]]] = targets[row, motors[same.element[same.leader[member]]]]
    return told
