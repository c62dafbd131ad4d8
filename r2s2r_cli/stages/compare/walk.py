"""A run as it is compared: where caps, centre of mass and heading were, and when which target held."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from r2s2r_cli.stages.measures.align import planar
from r2s2r_cli.stages.segments import Intervals
from r2s2r_cli.stages.simulate.measures import headings

POINTS = 20
"""Instants of each segment at which two runs of different speed are compared."""


@dataclass(frozen=True)
class Walk:
    """A run, real or simulated, from where the comparison begins. t: (frame,) [s]. p_WE: end caps (frame, cap, 3) [m];
    ground at z = 0. share: of the robot's mass that each cap stands for, (cap,), sums to 1. intervals: target
    intervals, counting these frames."""

    t: np.ndarray
    p_WE: np.ndarray
    share: np.ndarray
    intervals: Intervals

    @cached_property
    def com(self) -> np.ndarray:
        """Centre of mass (frame, 3) [m]."""
        return np.einsum("c,fcx->fx", self.share, self.p_WE)

    @cached_property
    def heading(self) -> np.ndarray | None:
        """Of the mean rod axis (frame,) [rad], whole turns counted; None where it has none at some frame."""
        return headings(self.p_WE)

    @cached_property
    def first_heading(self) -> float | None:
        """Of the first frame alone [rad]: where the axis stands upright later, only that frame has one."""
        found = headings(self.p_WE[:1])
        return None if found is None else float(found[0])

    @property
    def durations(self) -> np.ndarray:
        """Of the target intervals [s], (interval,); an interval lasts until the next one begins."""
        begin = self.intervals.t_first
        return np.append(begin[1:], self.intervals.t_last[-1]) - begin

    def first(self, count: int) -> Walk:
        """The same up to the end of interval `count`."""
        end = int(self.intervals.last[count - 1]) + 1
        kept = Intervals(**{name: value[:count] for name, value in vars(self.intervals).items()})
        return Walk(self.t[:end], self.p_WE[:end], self.share, kept)

    def laid_on(self, other: Walk) -> Walk:
        """Moved over the ground (x, y, yaw) so that its first frame lies on that of the other as well as it can."""
        move = planar(self.p_WE[0], other.p_WE[0])
        return Walk(self.t, move.move(self.p_WE), self.share, self.intervals)

    @cached_property
    def at_phase(self) -> np.ndarray:
        """End caps at POINTS equal shares of each interval, its end included, (interval, point, cap, 3) [m]."""
        begin = self.intervals.t_first
        when = begin[:, None] + self.durations[:, None] * np.arange(1, POINTS + 1) / POINTS
        return np.asarray(self._at(when))

    def _at(self, when: np.ndarray) -> np.ndarray:
        columns = self.p_WE.reshape(len(self.t), -1).T
        found = np.stack([np.interp(when, self.t, column) for column in columns], axis=-1)
        return found.reshape(*when.shape, *self.p_WE.shape[1:])


def same_targets(one: Intervals, other: Intervals) -> int:
    """How many intervals from the first on have the same target in both."""
    n = min(len(one), len(other))
    alike = np.all(np.abs(one.target[:n] - other.target[:n]) < 1e-9, axis=1)
    return int(np.argmin(alike)) if not alike.all() else n
