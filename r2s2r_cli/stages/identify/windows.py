"""Windows: stretches of a run that are simulated from a start state of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.identify.data import RunData, Selection

if TYPE_CHECKING:
    from r2s2r_cli.engine import State


@dataclass(frozen=True)
class Window:
    """One window: consecutive target intervals of a run.

    intervals: 1-based numbers. first: the frame at which it starts. frames: those that are compared, ascending, (F,);
    key: which of them are key frames; place: how many-th interval of the window each belongs to, 0-based; both (F,).
    state: where the simulation starts (batch of 1). known: that state is the truth, its nuisances are off.
    """

    run: RunData
    intervals: tuple[int, ...]
    first: int
    frames: np.ndarray
    key: np.ndarray
    place: np.ndarray
    state: State
    known: bool = False

    @property
    def start(self) -> float:
        """Stamp of the first frame [s]."""
        return float(self.run.t[self.first])

    @property
    def duration(self) -> float:
        """To the last compared frame [s]."""
        return float(self.run.t[self.frames[-1]]) - self.start if len(self.frames) else 0.0

    def until(self, intervals: int) -> Window:
        """Its first `intervals` intervals: the horizon of a fit that grows."""
        from dataclasses import replace

        inside = self.place < intervals
        return replace(
            self, intervals=self.intervals[:intervals], frames=self.frames[inside], key=self.key[inside],
            place=self.place[inside],
        )  # fmt: skip


TIP_M, TIP_M_PER_S = 0.03, 0.2
"""A cap that moves so far between two frames, and so fast (three times what a winch reels in), is carried by a fall."""


def tips(run: RunData) -> tuple[int, ...]:
    """First frames after the beginning of a tip-over: half of the caps were carried there since the frame before.

    A tracker that jumps moves one or two caps. Where a robot tips is decided by less than a millimetre, so a simulation
    that was started before tells nothing of what comes after. A fall over several frames counts once.
    """
    way = np.linalg.norm(np.diff(run.observed, axis=0), axis=-1)
    fast = (way > TIP_M) & (way > TIP_M_PER_S * np.diff(run.t)[:, None])
    falling = 2 * fast.sum(axis=1) >= way.shape[1]
    began = falling & ~np.concatenate([[False], falling[:-1]])
    return tuple((np.flatnonzero(began) + 1).tolist())


def begins_after_tip(run: RunData) -> frozenset[int]:
    """Intervals (1-based) that must begin a window: the first whose first frame is not before a tip-over."""
    first = run.intervals.first
    return frozenset(int(np.searchsorted(first, frame)) + 1 for frame in tips(run) if frame <= first[-1])


def spans(intervals: Sequence[int], length: int, begins: frozenset[int] = frozenset()) -> list[tuple[int, ...]]:
    """Consecutive numbers cut into tuples of at most `length`, and before every number in `begins`."""
    found: list[tuple[int, ...]] = []
    stretch: list[int] = []
    for number in intervals:
        if stretch and (number != stretch[-1] + 1 or len(stretch) == length or number in begins):
            found.append(tuple(stretch))
            stretch = []
        stretch.append(number)
    return [*found, tuple(stretch)] if stretch else found


def window(run: RunData, numbers: tuple[int, ...], state: State, *, known: bool = False, whole: bool = False) -> Window:
    """The window of consecutive intervals `numbers` that starts with `state` at the first frame of the first.

    Frames after a tip-over inside it are left out, be it all of them, unless `whole`. Segments inside an interval (a
    control that reverses) have key frames of their own.
    """
    keys = set(run.segments.last.tolist())
    begin = int(run.intervals.first[numbers[0] - 1])
    fallen = [frame for frame in tips(run) if frame > begin]
    end = fallen[0] if fallen and not whole else len(run.t)
    frames, place = [], []
    for index, number in enumerate(numbers):
        first, last = int(run.intervals.first[number - 1]), int(run.intervals.last[number - 1])
        inside = np.arange(first + (index == 0), min(last + 1, end))
        frames.append(inside)
        place.append(np.full(len(inside), index))
    chosen = np.concatenate(frames)
    return Window(
        run=run, intervals=numbers, first=begin, frames=chosen,
        key=np.array([frame in keys for frame in chosen.tolist()], dtype=bool), place=np.concatenate(place),
        state=state, known=known,
    )  # fmt: skip


def selected(
    runs: Sequence[RunData], selections: Sequence[Selection], length: int
) -> list[tuple[RunData, tuple[int, ...]]]:
    """Runs and intervals of all windows of at most `length` intervals; none goes on over a tip-over between two."""
    named = {run.name: run for run in runs}
    found: list[tuple[RunData, tuple[int, ...]]] = []
    for one in selections:
        run = named[one.run]
        found += [(run, span) for span in spans(one.intervals, length, begins_after_tip(run))]
    return found
