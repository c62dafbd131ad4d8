"""A rigid motion of a robot in closed form: it turns about the vertical and glides, nothing else changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schemas.robot import Robot

STEP_S = 0.1
YAW_RAD_PER_S = 0.2
GLIDE_M_PER_S = np.array([0.02, -0.01, 0.0])


@dataclass(frozen=True)
class Motion:
    """Exact states; arrays as in schemas.simulation, frame W."""

    t: np.ndarray
    p_WE: np.ndarray
    v_WE: np.ndarray
    p_WR: np.ndarray
    q_WR: np.ndarray
    v_WR: np.ndarray
    w_WR: np.ndarray
    """Without its part along the rod, which nobody can see."""
    length: np.ndarray
    rod_length: np.ndarray


def motion(robot: Robot, frames: int) -> Motion:
    """`frames` states, 0.1 s apart, that start at the rest pose."""
    t = STEP_S * np.arange(frames)
    rest = np.array(robot.rest_caps_m)
    rest[1::2] = rest[::2] + _unit(rest[1::2] - rest[::2]) * np.array([[rod.length_m] for rod in robot.rods])
    rest[:, 2] += _lift(robot, rest)
    c, s, o, i = np.cos(YAW_RAD_PER_S * t), np.sin(YAW_RAD_PER_S * t), np.zeros(frames), np.ones(frames)
    R_WB = np.stack([c, -s, o, s, c, o, o, o, i], axis=-1).reshape(frames, 3, 3)
    turned = np.einsum("tij,cj->tci", R_WB, rest)
    p_WE = turned + t[:, None, None] * GLIDE_M_PER_S
    w = np.array([0.0, 0.0, YAW_RAD_PER_S])
    v_WE = np.cross(w, turned) + GLIDE_M_PER_S
    even, odd = p_WE[:, ::2], p_WE[:, 1::2]
    axis = _unit(odd - even)
    ends = np.array([cable.caps for cable in robot.cables])
    return Motion(
        t=t, p_WE=p_WE, v_WE=v_WE, p_WR=(even + odd) / 2, q_WR=_shortest_arc(axis),
        v_WR=(v_WE[:, ::2] + v_WE[:, 1::2]) / 2, w_WR=w - (axis @ w)[..., None] * axis,
        length=np.linalg.norm(p_WE[:, ends[:, 1]] - p_WE[:, ends[:, 0]], axis=-1),
        rod_length=np.array([rod.length_m for rod in robot.rods]),
    )  # fmt: skip


def _lift(robot: Robot, caps: np.ndarray) -> float:
    """What to add to z so that the lowest cap touches the ground."""
    radius = np.repeat([rod.cap_radius_m for rod in robot.rods], 2)
    return float(-(caps[:, 2] - radius).min())


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def _shortest_arc(axis: np.ndarray) -> np.ndarray:
    """Quaternion xyzw that turns z to `axis` the shortest way (axis is never -z here)."""
    x, y, z = np.moveaxis(axis, -1, 0)
    return _unit(np.stack([-y, x, np.zeros_like(z), 1 + z], axis=-1))
