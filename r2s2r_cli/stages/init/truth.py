"""Closed-form motion of the prism for the sample: closed-form kinematic sample, no physics.

The six winches run at one constant rate; both triangles stay equilateral, rods stay rigid. Meanwhile the robot rolls
about the world's x axis at a constant rate, and travels along y as a wheel would whose radius is the height of the
robot's centre at rest. Forces, friction and tension play no part, so nothing here says how a robot behaves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.init.prism import PRISM_CABLES, PRISM_SUPPORT, prism_caps, prism_caps_rate, resting_rotation
from r2s2r_cli.stages.init.robot_facts import RobotFacts

SHAPES: tuple[tuple[float, float], ...] = ((0.2, 1.0), (0.2, 0.3), (1.0, 0.3), (1.0, 1.0), (0.5, 0.6), (0.9, 0.2))
"""Target positions (odd triangle, even triangle), one a target interval, repeated; the start is (1, 1), the rest."""

WINCH_RATE = 0.045
"""Rate of the cables [m/s]: the real ones shorten at 37-60 mm/s under full command (real crawl)."""

HOLD = 0.3
"""Time between the last cable's arrival and the next target [s]."""

ROLL_RATE = 0.12
"""Roll about the world's x axis [rad/s]: about 100 degrees in the 14 s of the default sample."""


@dataclass(frozen=True)
class KinematicTruth:
    """The noise-free motion. All methods take times [s], shape (T,), in 0..t_end.

    start: (interval,) [s], when each target is set. target: (interval, 2), position of odd and even triangle.
    """

    rod_length: float
    cap_radius: float
    min_length: float
    range: float
    start: np.ndarray
    target: np.ndarray
    t_end: float
    R_WP: np.ndarray
    """Rotation of the prism's frame at rest, shape (3, 3)."""
    travel: float
    """Rolling radius [m]: sideways travel is this times the roll angle."""

    def interval(self, t: np.ndarray) -> np.ndarray:
        """Number of the target interval, 0-based, shape (T,)."""
        return np.clip(np.searchsorted(self.start, t, side="right") - 1, 0, len(self.start) - 1)

    def targets(self, t: np.ndarray) -> np.ndarray:
        """Target positions of cables 0..5, shape (T, 6)."""
        return np.repeat(self.target[self.interval(t)], 3, axis=1)

    def controls(self, t: np.ndarray) -> np.ndarray:
        """Motor commands of cables 0..5: +1 reels in, -1 lets out, 0 holds; shape (T, 6)."""
        return np.repeat(-np.sign(self.edge_rates(t)), 3, axis=1)

    def edges(self, t: np.ndarray) -> np.ndarray:
        """Triangle edges (odd, even), cap centre to cap centre [m], shape (T, 2)."""
        i = self.interval(t)
        gone = WINCH_RATE * (t - self.start[i])[:, None]
        begin, end = self._length(self._from()[i]), self._length(self.target[i])
        return begin + np.sign(end - begin) * np.minimum(gone, np.abs(end - begin))

    def edge_rates(self, t: np.ndarray) -> np.ndarray:
        """Rates of the edges [m/s], shape (T, 2); 0 from the moment of arrival."""
        i = self.interval(t)
        left = self._length(self.target[i]) - self._length(self._from()[i])
        moving = WINCH_RATE * (t - self.start[i])[:, None] < np.abs(left)
        return WINCH_RATE * np.sign(left) * moving

    def caps(self, t: np.ndarray) -> np.ndarray:
        """End caps p_WE [m], shape (T, 6, 3), lowest one at z = cap radius."""
        return self._motion(t)[0]

    def velocities(self, t: np.ndarray) -> np.ndarray:
        """Velocities of the end caps v_WE [m/s], shape (T, 6, 3).

        One-sided at the few moments when a winch starts or stops or another cap becomes the lowest.
        """
        return self._motion(t)[1]

    def lengths(self, t: np.ndarray) -> np.ndarray:
        """Cable lengths 0..8, cap centre to cap centre [m], shape (T, 9)."""
        p_WE, pairs = self.caps(t), np.array(PRISM_CABLES)
        return np.linalg.norm(p_WE[:, pairs[:, 0]] - p_WE[:, pairs[:, 1]], axis=-1)

    def _from(self) -> np.ndarray:
        return np.vstack([[1.0, 1.0], self.target[:-1]])

    def _length(self, position: np.ndarray) -> np.ndarray:
        return self.min_length + self.range * position

    def _motion(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        t = np.asarray(t, dtype=float)
        edge, rate = self.edges(t), self.edge_rates(t)
        p_PE = np.stack([prism_caps(self.rod_length, *e) for e in edge])
        v_PE = np.stack([prism_caps_rate(self.rod_length, *e, *r) for e, r in zip(edge, rate, strict=True)])
        angle = ROLL_RATE * t
        cos, sin, one, zero = np.cos(angle), np.sin(angle), np.ones_like(t), np.zeros_like(t)
        roll = np.stack([one, zero, zero, zero, cos, -sin, zero, sin, cos], axis=-1).reshape(-1, 3, 3)
        p_WE = np.einsum("tij,jk,tck->tci", roll, self.R_WP, p_PE)
        v_WE = np.einsum("tij,jk,tck->tci", roll, self.R_WP, v_PE)
        w_WP = np.array([ROLL_RATE, 0.0, 0.0])
        v_WE += np.cross(w_WP, p_WE)
        p_WE[..., 1] -= self.travel * angle[:, None]
        v_WE[..., 1] -= self.travel * ROLL_RATE
        frame, lowest = np.arange(len(t)), np.argmin(p_WE[..., 2], axis=1)
        v_WE[..., 2] -= v_WE[frame, lowest, 2][:, None]
        p_WE[..., 2] += self.cap_radius - p_WE[frame, lowest, 2][:, None]
        return p_WE, v_WE


def kinematic_truth(facts: RobotFacts, intervals: int) -> KinematicTruth:
    """The motion of one 3-bar robot through `intervals` target intervals, from its rest pose.

    Raises UsageError for a robot that is no 3-bar prism, or fewer than one interval.
    """
    if facts.support != PRISM_SUPPORT or len(facts.rods) != 3:
        raise UsageError(
            f"the kinematic sample is a 3-bar prism, {facts.name} is not one",
            where="--sample", expected="--robot threebar or threebar-330", received=facts.name,
            hint="r2s2r init --robot threebar --sample",
        )  # fmt: skip
    if intervals < 1:
        raise UsageError(
            "the sample needs at least one target interval", where="intervals", expected=">= 1",
            received=str(intervals), hint="ask for 8 target intervals",
        )  # fmt: skip
    target = np.array([SHAPES[i % len(SHAPES)] for i in range(intervals)])
    step = np.abs(np.diff(np.vstack([[1.0, 1.0], target]), axis=0)).max(axis=1)
    ends = np.cumsum(facts.range.value * step / WINCH_RATE + HOLD)
    p = prism_caps(facts.rod_length.value, facts.rest_edge, facts.rest_edge)
    R_WP = resting_rotation(p, PRISM_SUPPORT, np.array([0.0, 0.0, 1.0]))
    height = float(-(p @ R_WP.T)[:, 2].min()) + facts.cap_radius.value
    return KinematicTruth(
        rod_length=facts.rod_length.value,
        cap_radius=facts.cap_radius.value,
        min_length=facts.min_length.value,
        range=facts.range.value,
        start=np.concatenate([[0.0], ends[:-1]]),
        target=target,
        t_end=float(ends[-1]),
        R_WP=R_WP,
        travel=height,
    )
