"""How well an effect can be told: noise-free pairs of the rig with it and without it, what nuisances could explain
projected off.

Every target interval of every gait that is fitted is simulated again without what is wrong, from the true state at its
start and under the recorded duties (command replay). The difference of end caps and sensor lengths is whitened with
the noise and the floor, and projected on the complement of the rig's own sensitivities to friction, motor speed (both
common to the set) and start pose (x, y and heading of every interval: exact, the floor is the same everywhere). The
rest of the pose is known as well as the camera's noise allows: every interval is simulated a few times more from a
start that was pushed as far, and what that changes of caps and lengths, a fall that comes earlier, is no effect's;
neither is a clock that is some milliseconds off.
d is the length of what is left: with d >= 8 no test would miss it.
No interval counts for more than MOST, nor for more than the one that counts next: one tip-over that happens in one
world and not in the other is worth more than all the rest together, and says nothing about which effect it was. Nor
does what any difference at all would make: pushes of some micrometres turn the same intervals over at another instant
as a slope of 0.2 mrad does, and what they come to on the average is taken off each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.blind.make.drive import Driven
from r2s2r_cli.blind.make.looks import LET_OUT_M, LOOK_S, Looks, recorded, replayed
from r2s2r_cli.blind.make.worlds import OFFSET_SHARE, Hidden
from schemas.robot import Robot

FLOOR_M, GROWN_M = 0.002, 0.006
"""Floor of a cap's coordinate [m]: constant over a target interval, and a random walk that has grown to so much at its
end: what another engine's numerics make of a motion."""
LENGTH_SD_M, LENGTH_GROWN_M = 0.0015, 0.003
"""Of a sensor [m]: its noise is a count of its converter; a random walk as that of caps, beside LET_OUT_M all along."""
STEP = 0.05
"""Relative change of friction and speed for their sensitivities."""
PUSHES = 6
"""Of every interval's start: what of it nobody knows, and how far the robot repeats itself."""
MINUTE, MINUTES = 0.003, 4
"""Size of the pushes that are next to nothing, in units of the least push, and how many of them there are."""
CLOCK_S = 0.005
"""Floor of time: on a ramp two engines, and two clocks, differ as fast as the ramp."""
MOST = 10.0
"""Of one interval: what happens once can be clear, and no more than that."""
WEAK, CLEAR = 3.0, 8.0


@dataclass(frozen=True)
class Detectable:
    """d: of all that is wrong together; each: of every planted effect alone. gap_mm: root mean square of the caps'
    difference at key frames [mm], before projection."""

    d: float
    each: tuple[float, ...]
    gap_mm: float

    @property
    def stratum(self) -> str:
        """sub-floor, weak or clear."""
        return "sub-floor" if self.d < WEAK else "weak" if self.d < CLEAR else "clear"


@dataclass(frozen=True)
class _Reach:
    """Floor at the end of an interval of a coordinate of a cap, and of a length [m]."""

    caps: float
    length: float


def detectability(robot: Robot, hidden: Hidden, runs: list[Driven]) -> Detectable:
    """Of a set whose gaits that are fitted ran as `runs`, the first ones. Raises NumericalError as the rig does."""
    plain = hidden.healthy()
    base = [replayed(robot, plain, run, g) for g, run in enumerate(runs)]
    rub = [replayed(robot, replace(plain, friction=plain.friction * (1 + STEP)), run, g) for g, run in enumerate(runs)]
    fast = [replayed(robot, replace(plain, speed=plain.speed * (1 + STEP)), run, g) for g, run in enumerate(runs)]
    rng = np.random.default_rng([hidden.seed, 17])
    pushed = [[replayed(robot, plain, run, g, rng) for g, run in enumerate(runs)] for _ in range(PUSHES)]
    minute = [[replayed(robot, plain, run, g, rng, MINUTE) for g, run in enumerate(runs)] for _ in range(MINUTES)]
    whole, later = ([recorded(hidden, run, g, by) for g, run in enumerate(runs)] for by in (0.0, CLOCK_S))
    told = _Told(hidden, base, (rub, fast), pushed, (whole, later), minute)
    d, gap = told(whole)
    d = float(np.hypot(d, _lost(hidden, runs)))
    each = []
    for one in hidden.planted:
        alone = replace(hidden, planted=(one,))
        apart = [replayed(robot, alone, run, g) for g, run in enumerate(runs)] if len(hidden.planted) > 1 else whole
        each.append(float(np.hypot(told(apart)[0], _lost(alone, runs))))
    return Detectable(d, tuple(each), 1e3 * gap)


def _lost(hidden: Hidden, runs: list[Driven]) -> float:
    """Frames that never came, in standard deviations of their number."""
    world = hidden.world(0, runs[0].gait.position, runs[0].gait.heading)
    if world.effects.dropout is None:
        return 0.0
    return float(np.sqrt(world.seen().clock.lost_share * sum(len(run.t_frame) for run in runs)))


class _Told:
    """The length of a difference from `base` off the nuisances."""

    def __init__(
        self, hidden: Hidden, base: list[list[Looks]], varied: tuple[list[list[Looks]], ...],
        pushed: list[list[list[Looks]]], clocks: tuple[list[list[Looks]], list[list[Looks]]],
        minute: list[list[list[Looks]]],
    ) -> None:  # fmt: skip
        self._hidden, self._base = hidden, base
        # The pushes of an interval are few directions of many: how far they reach counts in all of them.
        self._grown = [[_reach(one, [p[g][k] for p in pushed]) for k, one in enumerate(run)]
                       for g, run in enumerate(base)]  # fmt: skip
        again = [self._white(one) for one in pushed]
        repeats = [np.column_stack(parts) / np.sqrt(len(again)) for parts in zip(
            *([part for part, _ in one] for one in again), strict=True)]  # fmt: skip
        right, late = (self._white(one) for one in clocks)
        self._known = [np.column_stack([known, b - a]) for known, (a, _), (b, _) in zip(
            repeats, right, late, strict=True)]  # fmt: skip
        common = [self._white(one) for one in varied]
        self._common = np.column_stack([np.concatenate([part for part, _ in one]) for one in common])
        self._own = [_poses(looks) for run in base for looks in run]
        self._by_nothing = np.mean([self._squares(one) for one in minute], axis=0)

    def __call__(self, other: list[list[Looks]]) -> tuple[float, float]:
        """d, and the root mean square at key frames [m]."""
        last = [(b.p[-1] - a.p[-1]).ravel() for x, y in zip(self._base, other, strict=True)
                for a, b in zip(x, y, strict=True)]  # fmt: skip
        each = np.maximum(self._squares(other) - self._by_nothing, 0.0)
        each = np.minimum(each, np.sort(each)[-2:][0])
        return float(np.sqrt(each.sum())), float(np.sqrt(3 * np.mean(np.concatenate(last) ** 2)))

    def _squares(self, other: list[list[Looks]]) -> np.ndarray:
        """Square of what is left of every interval, MOST at most, (interval,)."""
        white = self._white(other)
        r = np.concatenate([part for part, _ in white])
        nuisances, sized, begins, at = [], [], [], 0
        grown = [one for run in self._grown for one in run]
        for pose, columns, reach, (part, cap_rows) in zip(self._own, self._known, grown, white, strict=True):
            own, of_size = np.zeros((len(r), 3)), np.zeros((len(r), columns.shape[1]))
            own[at : at + cap_rows], of_size[at : at + len(part)] = self._caps_white(pose, reach.caps), columns
            nuisances.append(own)
            sized.append(of_size)
            begins.append(at)
            at += len(part)
        free, known = np.column_stack([self._common, *nuisances]), np.column_stack(sized)
        # Columns differ by orders of magnitude: scaled before the rank is decided.
        free = free / np.maximum(np.linalg.norm(free, axis=0), 1e-12)
        # Pushes and clocks have a size, the other nuisances none.
        J = np.block([[free, known], [np.zeros((known.shape[1], free.shape[1])), np.eye(known.shape[1])]])
        padded = np.concatenate([r, np.zeros(known.shape[1])])
        left = padded - J @ np.linalg.lstsq(J, padded, rcond=1e-9)[0]
        of_known = (left[len(r) :] ** 2).reshape(len(white), -1).sum(axis=1)
        return np.asarray(np.minimum(np.add.reduceat(left[: len(r)] ** 2, begins) + of_known, MOST**2))

    def _white(self, other: list[list[Looks]]) -> list[tuple[np.ndarray, int]]:
        """Whitened difference from the base of every interval, and how much of it is caps."""
        found = []
        for mine, theirs, reach in zip(self._base, other, self._grown, strict=True):
            for a, b, grown in zip(mine, theirs, reach, strict=True):
                caps = self._caps_white((b.p - a.p).reshape(len(a.t), -1, 1), grown.caps).ravel()
                root = _root(len(a.t), LENGTH_SD_M, 0.0, LET_OUT_M, grown.length)
                found.append((np.concatenate([caps, np.linalg.solve(root, b.length - a.length).ravel()]), len(caps)))
        return found

    def _caps_white(self, columns: np.ndarray, grown: float) -> np.ndarray:
        """(look, coordinate, k) whitened over looks, as (look * coordinate, k). grown: of the floor at the end [m]."""
        h = self._hidden
        ar = h.ar1 ** (h.rate_hz * LOOK_S) if h.ar1 else 0.0
        root = _root(len(columns), h.noise_m, ar, np.hypot(FLOOR_M, OFFSET_SHARE * h.noise_m), grown)
        return np.linalg.solve(root, columns.reshape(len(columns), -1)).reshape(-1, columns.shape[2])


def _root(n: int, sd: float, ar: float, constant: float, grown: float) -> np.ndarray:
    """Cholesky factor of the covariance of n values in a row: AR(1) noise, a constant of unknown size, and a random
    walk from 0 to sd `grown`."""
    i = np.arange(n)
    lag = np.abs(np.subtract.outer(i, i))
    walk = grown**2 * np.minimum.outer(i, i) / max(n - 1, 1)
    return np.asarray(np.linalg.cholesky(sd**2 * np.where(lag == 0, 1.0, ar**lag) + constant**2 + walk))


def _reach(base: Looks, pushed: list[Looks]) -> _Reach:
    """Of engines, and of how far pushes carry them: what a fall is to the caps it is to the cables."""
    caps = np.sqrt(np.mean([(one.p[-1] - base.p[-1]) ** 2 for one in pushed]))
    length = np.sqrt(np.mean([(one.length[-1] - base.length[-1]) ** 2 for one in pushed]))
    return _Reach(float(np.hypot(GROWN_M, caps)), float(np.hypot(LENGTH_GROWN_M, length)))


def _poses(looks: Looks) -> np.ndarray:
    """Sensitivity of the caps to x, y [1] and heading [m/rad] at the start, (look, coordinate, 3)."""
    about = looks.p - looks.p[0].mean(axis=0)
    turned = np.stack([-about[..., 1], about[..., 0], np.zeros_like(about[..., 0])], axis=-1)
    x, y = np.zeros_like(about), np.zeros_like(about)
    x[..., 0], y[..., 1] = 1.0, 1.0
    return np.stack([one.reshape(len(looks.t), -1) for one in (x, y, turned)], axis=-1)
