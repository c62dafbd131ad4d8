"""Target intervals and segments of a run (docs/concepts/words.md). Frames are indices among kept frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.stages.frames import in_hole


@dataclass(frozen=True)
class Intervals:
    """Target intervals; row i is interval i + 1. All fields have one row an interval."""

    first: np.ndarray
    last: np.ndarray
    t_first: np.ndarray
    """[s]"""
    t_last: np.ndarray
    """[s]"""
    target: np.ndarray
    """Shape (interval, actuated), 0 short .. 1 long."""
    complete: np.ndarray
    """bool: another row follows, or it has moved to its end; not where its end lies in a hole (`target_intervals`)."""

    def __len__(self) -> int:
        return len(self.first)

    @property
    def opens_at_rest(self) -> bool:
        """Whether the first target is the rest shape, all cables long."""
        return len(self) > 0 and bool((self.target[0] == 1).all())

    def to_group(self) -> Group:
        """As the group `runs/<run>/intervals`."""
        return Group(datasets=dict(vars(self)))

    @classmethod
    def from_group(cls, group: Group) -> Intervals:
        """Read back what `to_group` wrote."""
        return cls(**{name: group[name] for name in cls.__dataclass_fields__})


@dataclass(frozen=True)
class Segments:
    """Segments; one row each, in the order of time."""

    interval: np.ndarray
    """1-based."""
    first: np.ndarray
    last: np.ndarray
    """The key frame."""
    t_first: np.ndarray
    """[s]"""
    t_last: np.ndarray
    """[s]"""
    direction: np.ndarray | None
    """Shape (segment, actuated): -1 extends, 0 holds, +1 reels in; None where the control was not logged."""
    complete: np.ndarray

    def __len__(self) -> int:
        return len(self.first)

    def to_group(self) -> Group:
        """As the group `runs/<run>/segments`."""
        return Group(datasets={name: value for name, value in vars(self).items() if value is not None})

    @classmethod
    def from_group(cls, group: Group) -> Segments:
        """Read back what `to_group` wrote."""
        direction = group["direction"] if "direction" in group.datasets else None
        names = [name for name in cls.__dataclass_fields__ if name != "direction"]
        return cls(direction=direction, **{name: group[name] for name in names})


def target_intervals(
    t: np.ndarray,
    target: np.ndarray,
    *,
    control: np.ndarray | None = None,
    position: np.ndarray | None = None,
    tolerance: float = 0.0,
    hidden: np.ndarray | None = None,
) -> Intervals:
    """Maximal spans of one constant target vector.

    t: stamps of the kept frames [s], shape (frame,). target: shape (frame, actuated); a row with NaN has no target
    and ends the interval before it. control: shape (frame, actuated), +1 reels in. position: cable positions by
    whatever measures them, shape (frame, actuated). tolerance: of the controller, in position. hidden: of
    `hidden_targets`, shape (frame,); where there are any, the interval before ends in the hole, even where the target
    is the same again.

    Every interval is stored. Those with a later row of another target are complete. The last one is complete if it
    has moved to its end: each of its cables (a) has control 0 in the last row, or (b) lies within the tolerance of
    its target, or (c) lies at least as near to it as at the end of some earlier interval of the same target (the
    gait goes on before the slowest cable is seen to arrive). Without control and position it is not complete. Nor is
    one whose end lies in a hole of the frames, with other targets that came and went there: its last frame may be
    anywhere on its way.
    """
    has_target = np.isfinite(target).all(axis=1)
    changed = np.ones(len(t), dtype=bool)
    if len(t) > 1:
        changed[1:] = (target[1:] != target[:-1]).any(axis=1)
    unseen = np.zeros(len(t), dtype=bool) if hidden is None else hidden > 0
    changed |= unseen
    first = np.flatnonzero(changed & has_target)
    ends = np.flatnonzero(changed)
    following = np.append(ends, len(t))[np.searchsorted(ends, first) + 1] if len(first) else first
    last = following - 1
    complete = np.ones(len(first), dtype=bool)
    if len(first) and last[-1] == len(t) - 1:
        complete[-1] = _moved_to_end(first, last, target, control, position, tolerance)
    complete &= ~np.append(unseen, False)[last + 1]
    return Intervals(
        first=first.astype(np.int64),
        last=last.astype(np.int64),
        t_first=t[first],
        t_last=t[last],
        target=target[first],
        complete=complete,
    )


def hidden_targets(t: np.ndarray, t_command: np.ndarray, target: np.ndarray) -> np.ndarray:
    """How many targets came and went in the hole before each frame, (frame,); 0 where there is none.

    t: stamps of the kept frames [s], (frame,). t_command [s], (row,), and target, (row, actuated): a log that goes on
    where frames are left out. Rows without a whole target are passed over, and so is what is over between two frames of
    an even series: rows that were stamped twice have such.
    """
    whole = np.isfinite(target).all(axis=1)
    at = t_command[whole][1:][(np.diff(target[whole], axis=0) != 0).any(axis=1)]
    before = np.searchsorted(at, t, side="right")
    return np.where(in_hole(t), np.maximum(np.diff(before, prepend=before[:1]) - 1, 0), 0)


def _moved_to_end(
    first: np.ndarray,
    last: np.ndarray,
    target: np.ndarray,
    control: np.ndarray | None,
    position: np.ndarray | None,
    tolerance: float,
) -> bool:
    """Whether the last interval has moved to its end (see `target_intervals`)."""
    end = last[-1]
    there = np.zeros(target.shape[1], dtype=bool)
    if control is not None:
        there |= control[end] == 0
    if position is not None:
        error = np.abs(position[last] - target[last])
        there |= error[-1] <= tolerance
        same = (target[first[:-1]] == target[end]).all(axis=1)
        if same.any():
            there |= error[-1] <= np.nanmax(np.append(error[:-1][same], np.full((1, len(there)), -1.0), axis=0), axis=0)
    return bool(there.all())


def segments(intervals: Intervals, t: np.ndarray, control: np.ndarray | None = None) -> Segments:
    """Intervals cut again where the control of a cable reverses its sign, so that each cable moves one way.

    t: stamps of the kept frames [s]. control: shape (frame, actuated), +1 reels in; NaN (not logged) counts as 0,
    and 0 is no reversal: +1, 0, +1 stays one segment. The frame that first shows the new sign starts the new segment.
    Without control the segments are the intervals, and their direction is unknown.
    """
    sign = None if control is None else np.sign(np.nan_to_num(control)).astype(np.int32)
    rows: list[tuple[int, int, int, bool]] = []
    for i in range(len(intervals)):
        begin, end = int(intervals.first[i]), int(intervals.last[i])
        cuts = [] if sign is None else _reversals(sign[begin : end + 1])
        starts = [begin, *(begin + cut for cut in cuts)]
        ends = [*(start - 1 for start in starts[1:]), end]
        for start, stop in zip(starts, ends, strict=True):
            rows.append((i + 1, start, stop, stop < end or bool(intervals.complete[i])))
    table = np.array([row[:3] for row in rows], dtype=np.int64).reshape(-1, 3)
    direction = None
    if sign is not None:
        # Within a segment a cable has one sign or 0, so the largest and the smallest sign add up to it.
        spans = [sign[start : stop + 1] for _, start, stop, _ in rows]
        empty = np.zeros((0, sign.shape[1]), dtype=np.int32)
        direction = np.array([span.max(axis=0) + span.min(axis=0) for span in spans]) if spans else empty
        direction = np.sign(direction).astype(np.int32)
    return Segments(
        interval=table[:, 0],
        first=table[:, 1],
        last=table[:, 2],
        t_first=t[table[:, 1]],
        t_last=t[table[:, 2]],
        direction=direction,
        complete=np.array([row[3] for row in rows], dtype=bool),
    )


def _reversals(sign: np.ndarray) -> list[int]:
    """Rows of sign (frame, cable) at which some cable first has the opposite sign of its last one since the cut."""
    cuts: list[int] = []
    current = np.zeros(sign.shape[1], dtype=np.int32)
    for row, now in enumerate(sign):
        if (now * current < 0).any():
            cuts.append(row)
            current = now.copy()
        else:
            current = np.where(now != 0, now, current)
    return cuts
