"""The robot's low-level controller on the wire: PID on cable positions, latched `done`, event-based steps of a policy.

The same definition as the controller inside the simulator (`engine/pid.py` has the law and its reasons), written again
in NumPy for one robot, because neither `hardware` nor the loop of `record` may load torch. A test feeds both the same
lengths and compares every command.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from schemas.robot import Robot


@dataclass
class WirePid:
    """The controller of one robot. p, i, d [1 a tick], tolerance [1], min_length, range [m], as in robot.toml.

    motors: how many. total, previous, done: what it remembers between ticks, (actuated,).
    """

    p: float
    i: float
    d: float
    tolerance: float
    min_length: float
    range: float
    motors: int
    total: np.ndarray = field(init=False)
    previous: np.ndarray = field(init=False)
    done: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.restart()

    @classmethod
    def of(cls, robot: Robot) -> WirePid:
        """The controller of a robot description, at a fresh target."""
        pid = robot.pid
        return cls(p=pid.p, i=pid.i, d=pid.d, tolerance=pid.tolerance, min_length=pid.min_length_m,
                   range=pid.range_m, motors=len(robot.actuated))  # fmt: skip

    def restart(self) -> None:
        """A new target: nothing summed, nothing done."""
        n = self.motors
        self.total, self.previous, self.done = np.zeros(n), np.zeros(n), np.zeros(n, dtype=bool)

    def position(self, length: np.ndarray) -> np.ndarray:
        """Positions [1], 0 short .. 1 long, of lengths [m], (actuated,)."""
        return (length - self.min_length) / self.range

    def tick(self, length: np.ndarray, target: np.ndarray) -> np.ndarray:
        """One control tick: speeds in [-1, 1], +1 reels in, (actuated,).

        length: of the winched cables as the sensors give them [m], (actuated,). One whose length is NaN gets 0 and
        remembers what it did before: without a reading there is no error. target: positions [1], (actuated,).
        """
        position = self.position(length)
        seen = np.isfinite(position)
        error = np.where(seen, position, target) - target
        # Not seen is not arrived: a lost reading must not latch `done`.
        there = seen & ((np.abs(error) < self.tolerance) | ((target == 0) & (position < 0)))
        self.done = self.done | there
        runs = seen & ~self.done
        self.total = np.where(runs, self.total + error, self.total)
        u = np.clip(self.p * error + self.i * self.total + self.d * (error - self.previous), -1.0, 1.0)
        self.previous = np.where(runs, error, self.previous)
        return np.where(runs, u, 0.0)


@dataclass
class WireSteps:
    """Where a policy of S targets stands. hold, timeout: ticks of every target, (S,), int (`ticks`).

    index: of the present target, S once through; elapsed, held: ticks on it, and since all its cables were done.
    """

    hold: np.ndarray
    timeout: np.ndarray
    index: int = 0
    elapsed: int = 0
    held: int = 0

    @property
    def finished(self) -> bool:
        """Through all targets."""
        return self.index >= len(self.hold)

    def advance(self, done: np.ndarray) -> tuple[bool, bool]:
        """After a tick that left `done` (actuated,): whether the target is left, and whether by its time-out."""
        if self.finished:
            return False, False
        self.elapsed += 1
        there = bool(done.all())
        self.held += there
        # A cable that is done stays done: once all are, the time-out has nothing to give up.
        timed_out = not there and self.elapsed >= int(self.timeout[self.index])
        changed = timed_out or (there and self.held > int(self.hold[self.index]))
        if changed:
            self.index, self.elapsed, self.held = self.index + 1, 0, 0
        return changed, timed_out


def ticks(seconds: np.ndarray, period: float) -> np.ndarray:
    """Times [s], (S,), in whole control ticks, rounded up, int64. Raises ValueError for a negative or infinite time."""
    seconds = np.asarray(seconds, dtype=np.float64)
    if not np.isfinite(seconds).all() or (seconds < 0).any() or not (math.isfinite(period) and period > 0):
        raise ValueError(f"no times to wait: {seconds} in ticks of {period} s")
    return np.ceil(seconds / period - 1e-9).astype(np.int64)
