"""Frames of the rods at rest, and quaternions at MuJoCo's border. Written from the definition, not from `init`'s code.

Frame R of a rod (docs/concepts/attachment.md): origin in the middle between its caps, z towards the odd cap, x the
direction perpendicular to the rod that points most upwards at rest (for a vertical rod: most along the world's x),
y = z cross x.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import InputError
from schemas.robot import Robot

UP = np.array([0.0, 0.0, 1.0])
FORWARD = np.array([1.0, 0.0, 0.0])
_UPRIGHT = 1e-6
"""A rod whose direction has a smaller horizontal part stands upright and has no upper side."""


@dataclass(frozen=True)
class Pose:
    """A pose of the robot. p_WR: middles of the rods [m], (rod, 3), frame W; q_WR: unit quaternions xyzw, (rod, 4);
    rest: rest lengths of the winched cables [m], (actuated,)."""

    p_WR: np.ndarray
    q_WR: np.ndarray
    rest: np.ndarray


def rest_pose(robot: Robot) -> Pose:
    """The rest pose of `robot.toml`, every winched cable as long as the distance it spans there."""
    R_WR = rest_frames(robot)
    p_WR = _middles(np.array(robot.rest_caps_m))
    spans = site_spans(robot, p_WR, R_WR)
    return Pose(p_WR, np.array([quaternion(R) for R in R_WR]), spans[list(robot.actuated)])


def rest_frames(robot: Robot) -> np.ndarray:
    """R_WR of every rod at rest, (rod, 3, 3). Raises InputError for a rod without length."""
    frames = []
    for z in _axes(np.array(robot.rest_caps_m)):
        towards = UP if np.linalg.norm(z[:2]) >= _UPRIGHT else FORWARD
        x = towards - (towards @ z) * z
        x = x / np.linalg.norm(x)
        frames.append(np.column_stack([x, np.cross(z, x), z]))
    return np.array(frames)


def site_spans(robot: Robot, p_WR: np.ndarray, R_WR: np.ndarray) -> np.ndarray:
    """Distance between the attachment points of every cable [m], (cable,)."""
    spans = []
    for cable in robot.cables:
        ends = [p_WR[cap // 2] + R_WR[cap // 2] @ site for cap, site in zip(cable.caps, cable.sites_m, strict=True)]
        spans.append(np.linalg.norm(ends[1] - ends[0]))
    return np.array(spans)


def cap_spans(robot: Robot) -> np.ndarray:
    """Distance between the centres of the two caps of every cable at rest [m], (cable,)."""
    p_WE = np.array(robot.rest_caps_m)
    return np.array([np.linalg.norm(p_WE[b] - p_WE[a]) for a, b in (cable.caps for cable in robot.cables)])


def quaternion(R: np.ndarray) -> np.ndarray:
    """Unit quaternion xyzw of a rotation matrix (3, 3); w >= 0."""
    # The largest of the four squares decides which row of q q^T is divided by its root: never near zero.
    t = np.trace(R)
    outer = np.array(
        [
            [1 + 2 * R[0, 0] - t, R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[2, 1] - R[1, 2]],
            [R[0, 1] + R[1, 0], 1 + 2 * R[1, 1] - t, R[1, 2] + R[2, 1], R[0, 2] - R[2, 0]],
            [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], 1 + 2 * R[2, 2] - t, R[1, 0] - R[0, 1]],
            [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1 + t],
        ]
    )
    row = outer[int(np.argmax(np.diagonal(outer)))]
    q = row / np.linalg.norm(row)
    return q if q[3] >= 0 else -q


def rotation(q: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of unit quaternions xyzw (..., 4)."""
    v, w = q[..., :3], q[..., 3, None, None]
    zero = np.zeros_like(v[..., 0])
    cross = np.stack(
        [
            np.stack([zero, -v[..., 2], v[..., 1]], axis=-1),
            np.stack([v[..., 2], zero, -v[..., 0]], axis=-1),
            np.stack([-v[..., 1], v[..., 0], zero], axis=-1),
        ],
        axis=-2,
    )
    return np.asarray(np.eye(3) + 2 * w * cross + 2 * cross @ cross)


def wxyz(q: np.ndarray) -> np.ndarray:
    """Our quaternions (..., 4) in MuJoCo's order."""
    return np.roll(np.asarray(q, dtype=float), 1, axis=-1)


def xyzw(q: np.ndarray) -> np.ndarray:
    """MuJoCo's quaternions (..., 4) in our order."""
    return np.roll(np.asarray(q, dtype=float), -1, axis=-1)


def _middles(p_WE: np.ndarray) -> np.ndarray:
    return np.asarray((p_WE[0::2] + p_WE[1::2]) / 2)


def _axes(p_WE: np.ndarray) -> np.ndarray:
    d = p_WE[1::2] - p_WE[0::2]
    length = np.linalg.norm(d, axis=1)
    if not (length > 0).all():
        rod = int(np.argmin(length))
        raise InputError(
            f"the two caps of rod {rod} are one point", where=f"caps {2 * rod} and {2 * rod + 1}",
            expected="two different points", received=f"{p_WE[2 * rod]}", hint="correct rest_caps_m in robot.toml",
        )  # fmt: skip
    return np.asarray(d / length[:, None])
