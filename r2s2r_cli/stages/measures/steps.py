"""Target intervals as the measures see them: observed end caps, and what makes two of them repeats of one phase."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from r2s2r_cli.stages.estimate.smooth import JUMP, OUTLIER
from r2s2r_cli.stages.segments import Intervals

_FAULTS = (OUTLIER, JUMP)


class ObservedRun(Protocol):
    """What the measures need of a run: frames, observed end caps on the ground, their faults, target intervals."""

    @property
    def name(self) -> str:
        """What it is called."""

    @property
    def t(self) -> np.ndarray:
        """Stamps (frame,) [s]."""

    @property
    def observed(self) -> np.ndarray:
        """End caps as the tracker gave them, ground at z = 0, (frame, cap, 3) [m]."""

    @property
    def noise(self) -> np.ndarray:
        """Their standard deviation (cap, 3) [m]."""

    @property
    def quality(self) -> np.ndarray:
        """Codes of `schemas.estimate.QUALITY`, (frame, cap)."""

    @property
    def intervals(self) -> Intervals:
        """Target intervals, counting these frames."""


@dataclass(frozen=True)
class Step:
    """One target interval of a run.

    interval: 1-based. t: (frame,) [s] of its kept frames; p_WE: observed end caps (frame, cap, 3) [m]; first frame:
    start, last: key frame. t_next, p_next: the first frame of the interval that follows at once, None where none does.
    target, before: target vector of this interval and of the one before it (None where none is before it at once).
    noise: sd of the observations (cap, 3) [m]. faulty: at the start or at the key frame the tracker was wrong or
    jumped on more than half of the caps, so the step tells nothing of the robot.
    """

    run: str
    interval: int
    t: np.ndarray
    p_WE: np.ndarray
    t_next: float | None
    p_next: np.ndarray | None
    target: np.ndarray
    before: np.ndarray | None
    noise: np.ndarray
    faulty: bool

    @property
    def start(self) -> np.ndarray:
        """End caps at the first frame, (cap, 3) [m]."""
        return self.p_WE[0]

    @property
    def key(self) -> np.ndarray:
        """End caps at the key frame, (cap, 3) [m]."""
        return self.p_WE[-1]

    @property
    def support(self) -> frozenset[int]:
        """The three caps that are lowest at the start."""
        return support(self.start)

    @property
    def phase(self) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
        """Target vectors before and during the interval: where in its cycle the gait is.

        None for the first interval of a run: nobody knows what the robot came from.
        """
        return None if self.before is None else (tuple(self.before.tolist()), tuple(self.target.tolist()))


def steps_of(run: ObservedRun, intervals: Iterable[int], *, p_WE: np.ndarray | None = None) -> tuple[Step, ...]:
    """The intervals (1-based) of a run as steps, in their order of time.

    p_WE: end caps (frame, cap, 3) [m] instead of the observed ones (smoothed ones, say: training only, since they know
    later frames). Raises IndexError for an interval that the run does not have.
    """
    table, position = run.intervals, run.observed if p_WE is None else p_WE
    found = []
    for number in sorted(intervals):
        i = number - 1
        if not 0 <= i < len(table):
            raise IndexError(f"run {run.name} has intervals 1 to {len(table)}, not {number}")
        frames = slice(int(table.first[i]), int(table.last[i]) + 1)
        follows = i + 1 < len(table) and table.first[i + 1] == table.last[i] + 1
        preceded = i > 0 and table.first[i] == table.last[i - 1] + 1
        found.append(
            Step(
                run=run.name,
                interval=number,
                t=run.t[frames],
                p_WE=position[frames],
                t_next=float(run.t[frames.stop]) if follows else None,
                p_next=position[frames.stop] if follows else None,
                target=table.target[i],
                before=table.target[i - 1] if preceded else None,
                noise=run.noise,
                faulty=bool((np.isin(run.quality[frames][[0, -1]], _FAULTS).mean(axis=1) > 0.5).any()),
            )
        )
    return tuple(found)


def support(p_WE: np.ndarray) -> frozenset[int]:
    """The three lowest of the end caps (cap, 3): on which a robot at rest stands. Caps of equal radius."""
    return frozenset(np.argsort(p_WE[:, 2], kind="stable")[:3].tolist())


def repeats_of(step: Step, others: Sequence[Step], *, standing: frozenset[int] | None = None) -> list[Step]:
    """Steps of the same phase as `step` that start on the same three caps, in the order given.

    Without `step` itself and without faulty ones. standing: the caps that `step` starts on, where its own start must
    not be looked at (free run). None are found for the first interval of a run, before which no target is known.
    """
    if step.phase is None:
        return []
    caps = step.support if standing is None else standing
    same = [other for other in others if other.phase == step.phase and other.support == caps and not other.faulty]
    return [other for other in same if (other.run, other.interval) != (step.run, step.interval)]


def chains(steps: Sequence[Step]) -> tuple[tuple[Step, ...], ...]:
    """Steps of one run that follow each other at once, put together: a free run starts once in each of them."""
    found: list[list[Step]] = []
    for step in sorted(steps, key=lambda s: (s.run, s.interval)):
        last = found[-1][-1] if found else None
        if (
            last is not None
            and last.run == step.run
            and last.interval + 1 == step.interval
            and last.t_next == step.t[0]
        ):
            found[-1].append(step)
        else:
            found.append([step])
    return tuple(tuple(chain) for chain in found)
