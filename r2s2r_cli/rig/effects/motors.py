"""Effects between the command and the shaft: dead zone, latency, lag, mismatch, droop."""

from __future__ import annotations

from collections import deque

import numpy as np

from r2s2r_cli.rig.effects.base import EffectSection, Law, Scene, per
from r2s2r_cli.rig.section import NonNegative, Positive, Share

_ROUNDING = 1e-9
"""Times that differ by less [s] are the same: they are sums of steps."""


class MotorDeadZone(EffectSection):
    """Gears stick: a motor starts at a drive of `start` only, and once it turns it stops below `keep`."""

    start: Share = 0.2
    """Drive at which a motor at rest starts."""
    keep: Share = 0.1
    """Drive below which one that turns stops."""

    def law(self, scene: Scene) -> Law:
        """A switch with hysteresis a motor, where the catalogue has a plain threshold."""
        return _Stiction(self, len(scene.r))


class _Stiction(Law):
    def __init__(self, p: MotorDeadZone, n: int) -> None:
        self._p, self._turns = p, np.zeros(n, dtype=bool)

    def command(self, t: float, u: np.ndarray) -> np.ndarray:
        self._turns = np.abs(u) >= np.where(self._turns, self._p.keep, self._p.start)
        return np.where(self._turns, u, 0.0)


class CommandLatency(EffectSection):
    """Commands arrive late: by `delay_s` and by a random time beyond, drawn anew whenever the command changes."""

    delay_s: NonNegative = 0.1
    """The part that is always there [s]."""
    jitter_s: NonNegative = 0.0
    """Mean of the random part, exponential [s]."""

    def law(self, scene: Scene) -> Law:
        """A queue of changes; one never overtakes another."""
        return _Queue(self, len(scene.r), scene.rng)


class _Queue(Law):
    def __init__(self, p: CommandLatency, n: int, rng: np.random.Generator) -> None:
        self._p, self._rng = p, rng
        self._queue: deque[tuple[float, np.ndarray]] = deque()
        self._last, self._now = np.zeros(n), np.zeros(n)

    def command(self, t: float, u: np.ndarray) -> np.ndarray:
        if (u != self._last).any():
            due = t + self._p.delay_s + (self._rng.exponential(self._p.jitter_s) if self._p.jitter_s else 0.0)
            self._queue.append((max(due, self._queue[-1][0] if self._queue else due), u.copy()))
            self._last = u.copy()
        while self._queue and self._queue[0][0] <= t + _ROUNDING:
            self._now = self._queue.popleft()[1]
        return self._now


class MotorLag(EffectSection):
    """Inertia of the motors: speed follows with `start_s`, and runs out with `stop_s`."""

    start_s: NonNegative = 0.15
    """Time constant towards a higher speed [s]."""
    stop_s: NonNegative | None = None
    """Time constant towards a lower one [s]; left out: the same."""

    def law(self, scene: Scene) -> Law:
        """Two time constants, where the catalogue has one."""
        return _Lag(self, len(scene.r))


class _Lag(Law):
    def __init__(self, p: MotorLag, n: int) -> None:
        self._start, self._stop = p.start_s, p.start_s if p.stop_s is None else p.stop_s
        self._w = np.zeros(n)

    def turn(self, dt: float, w: np.ndarray, tension: np.ndarray) -> np.ndarray:
        tau = np.where(np.abs(w) >= np.abs(self._w), self._start, self._stop)
        # The exact solution over the step, so that a time constant of 0 needs no case of its own.
        self._w = w + (self._w - w) * np.exp(-dt / np.maximum(tau, 1e-9))
        return self._w.copy()


class MotorSpeedMismatch(EffectSection):
    """No two motors are alike: each turns at its own factor of the speed."""

    factors: tuple[Positive, ...]
    """One a motor, in the order of the winched cables; missing ones are 1."""

    def law(self, scene: Scene) -> Law:
        """A constant factor."""
        return _Factors(per(self.factors, len(scene.r), 1.0))


class _Factors(Law):
    def __init__(self, factors: np.ndarray) -> None:
        self._factors = factors

    def turn(self, dt: float, w: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return w * self._factors


class LoadDroop(EffectSection):
    """Motors are slower against a load: a tension of `stall_n` stops one that reels in, and helps one that lets out."""

    stall_n: Positive = 40.0
    """Tension of the cable at which the motor stands still, whatever its drive [N]."""
    help_share: Share = 0.3
    """How much a load speeds a motor up that lets out, against how much it slows one that reels in (a worm-like gear
    lets little through)."""

    def law(self, scene: Scene) -> Law:
        """Straight torque-speed line, with a gear that is not the same both ways."""
        return _Droop(self)


class _Droop(Law):
    def __init__(self, p: LoadDroop) -> None:
        self._p = p

    def turn(self, dt: float, w: np.ndarray, tension: np.ndarray) -> np.ndarray:
        load = np.maximum(tension, 0.0) / self._p.stall_n
        against = np.maximum(1.0 - load, 0.0)
        along = 1.0 + self._p.help_share * load
        return np.where(w > 0, w * against, w * along)
