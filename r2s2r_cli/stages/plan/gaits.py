"""Gaits: which shapes there are, and what came of gaits that were run."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from r2s2r_cli.stages.plan.executor import Executor
from r2s2r_cli.stages.plan.placement import Reference, turned, wrapped
from r2s2r_cli.stages.plan.rewards import Outcomes
from r2s2r_cli.stages.plan.standing import Standing
from r2s2r_cli.stages.plan.symmetry import principal_axis


@dataclass(frozen=True)
class Gait:
    """Target shapes in order, each (motor,) of 0 and 1, the last all 1: from rest to rest."""

    targets: np.ndarray

    @property
    def key(self) -> tuple[str, ...]:
        """The shapes as people write them: `101101`."""
        return tuple("".join(str(int(value)) for value in row) for row in self.targets)

    @property
    def switched(self) -> int:
        """Cables that a target changes, summed over all steps, from rest."""
        before = np.ones((1, self.targets.shape[1]))
        return int(np.abs(np.diff(np.concatenate([before, self.targets]), axis=0)).sum())


@dataclass(frozen=True)
class Seen:
    """Poses as they are compared. points: end caps, then the centre of mass [m], (B, cap + 1, 3)."""

    points: np.ndarray

    @property
    def caps(self) -> np.ndarray:
        """End caps [m], (B, cap, 3)."""
        return self.points[:, :-1]

    @property
    def com(self) -> np.ndarray:
        """Centres of mass [m], (B, 3)."""
        return self.points[:, -1]


def seen(executor: Executor, at: Standing) -> Seen:
    """End caps and centres of mass."""
    return Seen(np.concatenate([executor.caps(at), executor.com(at)[:, None]], axis=1))


def neighbours(shape: np.ndarray, most_changed: int) -> np.ndarray:
    """Shapes (N, motor) that differ from `shape` (motor,) in 1 to `most_changed` cables; the rest shape is left out: a
    gait that passes it is two gaits, the second of which is found from the start, relabelled."""
    motors = len(shape)
    flips = [list(c) for n in range(1, min(most_changed, motors) + 1) for c in combinations(range(motors), n)]
    made = np.tile(shape, (len(flips), 1))
    for row, flip in enumerate(flips):
        made[row, flip] = 1 - made[row, flip]
    return made[(made != 1).any(axis=1)]


def outcomes(
    reference: Reference, start: Seen, end: Seen, ticks: np.ndarray, period: float, switched: np.ndarray
) -> Outcomes:
    """What came of gaits from poses at rest (one, or one a row) to poses at rest."""
    first, last = reference.place(start.caps), reference.place(end.caps)
    batch = len(last.yaw)
    yaw, element = np.broadcast_to(first.yaw, batch), np.broadcast_to(first.element, batch)
    moved = end.com - start.com
    flat = turned(moved[:, :2], -yaw)
    one, two = (principal_axis(pose.caps) for pose in (start, end))
    heading = np.arctan2(two[:, 1], two[:, 0]) - np.arctan2(one[:, 1], one[:, 0])
    table = reference.group.relative()
    return Outcomes(
        com=np.concatenate([flat, moved[:, 2:]], axis=1), turn=wrapped(heading), element=table[element, last.element],
        error=last.error, duration=ticks * period, switched=np.asarray(switched, dtype=float),
    )  # fmt: skip


def padded(gaits: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Target sequences (S_k, motor) as one array (B, S, motor), the last target repeated, and their lengths (B,)."""
    counts = np.array([len(one) for one in gaits])
    longest = int(counts.max())
    return np.stack([np.concatenate([one, np.repeat(one[-1:], longest - len(one), axis=0)]) for one in gaits]), counts


def run_gaits(
    executor: Executor, reference: Reference, at: Standing, gaits: list[Gait], rows: np.ndarray
) -> tuple[Outcomes, np.ndarray]:
    """Gait k from robot rows[k] of `at`, all in one call; outcomes, and whether every target was reached, (B,).

    at: robots at rest; the gait is relabelled for the triangle that each stands on.
    """
    begun = at.take(rows)
    first = seen(executor, begun)
    element = reference.place(first.caps).element
    relabelled = [reference.group.elements[k].relabelled(one.targets) for k, one in zip(element, gaits, strict=True)]
    run = executor.run(begun, *padded(relabelled))
    switched = np.array([gait.switched for gait in gaits])
    came = outcomes(reference, first, seen(executor, run.last), run.total, executor.period, switched)
    return came, run.sound
