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
        return float(self.run.t[self.frames[-1]]) - self.start

    def until(self, intervals: int) -> Window:
        """Its first `intervals` intervals: the horizon of a fit that grows."""
        from dataclasses import replace

        inside = self.place < intervals
        return replace(
            self, intervals=self.intervals[:intervals], frames=self.frames[inside], key=self.key[inside],
            place=self.place[inside],
        )  # fmt: skip


def spans(intervals: Sequence[int], length: int) -> list[tuple[int, ...]]:
    """Consecutive numbers cut into tuples of `length`; what is left over at the end of a stretch is shorter."""
    found: list[tuple[int, ...]] = []
    stretch: list[int] = []
    for number in intervals:
        if stretch and (number != stretch[-1] + 1 or len(stretch) == length):
            found.append(tuple(stretch))
            stretch = []
        stretch.append(number)
    return [*found, tuple(stretch)] if stretch else found


def window(run: RunData, numbers: tuple[int, ...], state: State, *, known: bool = False) -> Window:
    """The window of consecutive intervals `numbers` that starts with `state` at the first frame of the first.

    Segments inside an interval (a control that reverses) have key frames of their own.
    """
    keys = set(run.segments.last.tolist())
    frames, place = [], []
    for index, number in enumerate(numbers):
        first, last = int(run.intervals.first[number - 1]), int(run.intervals.last[number - 1])
        inside = np.arange(first + (index == 0), last + 1)
        frames.append(inside)
        place.append(np.full(len(inside), index))
    chosen = np.concatenate(frames)
    return Window(
        run=run, intervals=numbers, first=int(run.intervals.first[numbers[0] - 1]), frames=chosen,
        key=np.array([frame in keys for frame in chosen.tolist()]), place=np.concatenate(place), state=state, known=known,
    )  # fmt: skip


def selected(runs: Sequence[RunData], selections: Sequence[Selection], length: int) -> list[tuple[RunData, tuple[int, ...]]]:
    """Runs and intervals of all windows of `length` intervals."""
    named = {run.name: run for run in runs}
    return [(named[one.run], span) for one in selections for span in spans(one.intervals, length)]
