"""Segments of the real and the simulated trajectory laid over each other, and their key frames (paper, Key Frame Loss).

Both trajectories are cut by the same rule (stages/segments.py). Paired segments are remapped to start at 0; what both
have is their intersection; the key frame is its last frame. Real stamps are irregular and simulated frames are not, so
the key frame is the last real frame within the intersection, and the simulation is read off at the same time after its
own segment's start, between two ticks by linear interpolation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.segments import Segments

ROUNDING = 1e-9
"""[s] frames this much beyond an intersection still belong to it."""


@dataclass(frozen=True)
class Spans:
    """Segments of one trajectory, one row each, in the order of time; times [s] on the trajectory's own clock.

    interval: target interval that each belongs to. t_first, t_last: first and last moment that is known of it.
    t_next: start of the next segment, or t_last where none follows: t_next - t_first is how long it took, free of the
    rate at which frames come.
    """

    interval: np.ndarray
    t_first: np.ndarray
    t_last: np.ndarray
    t_next: np.ndarray

    def __len__(self) -> int:
        return len(self.interval)


@dataclass(frozen=True)
class KeyFrames:
    """Paired segments, one row each.

    interval: of the real run. start_real, start_sim: where each begins [s]. took_real, took_sim: how long [s].
    first: frame of the real start; frame: the key frame, a real frame; tau: its time after the start, real and
    simulated [s]. whole_real, whole_sim: from the first start to the last end [s].
    """

    interval: np.ndarray
    start_real: np.ndarray
    start_sim: np.ndarray
    took_real: np.ndarray
    took_sim: np.ndarray
    first: np.ndarray
    frame: np.ndarray
    tau: np.ndarray
    whole_real: float
    whole_sim: float

    def __len__(self) -> int:
        return len(self.interval)


def spans(segments: Segments, chosen: Sequence[int], *, exact: bool = False) -> Spans:
    """The complete segments of the target intervals `chosen` (1-based, consecutive).

    exact: the segment lasts until the next begins (a simulation), not only until its last frame.
    """
    keep = np.isin(segments.interval, chosen) & segments.complete
    next_start = np.append(segments.t_first[1:], np.nan)
    t_next = np.where(np.isnan(next_start), segments.t_last, next_start)[keep]
    t_last = segments.t_last[keep]
    return Spans(segments.interval[keep], segments.t_first[keep], t_next if exact else t_last, t_next)


def key_frames(t: np.ndarray, real: Spans, sim: Spans, *, offset: int = 0) -> KeyFrames:
    """Pairs of segments with their key frames.

    t: stamps of the real frames [s], (frame,). offset: interval 1 of the simulation is interval 1 + offset of the real
    run. Within an interval segments are paired in their order; where a reversal was seen on one side only, the interval
    is one segment. Pairs whose only common frame is the start say nothing and are left out.
    """
    rows = []
    for interval in dict.fromkeys(real.interval.tolist()):
        ours, theirs = real.interval == interval, sim.interval == interval - offset
        if not theirs.any():
            continue
        a, b = _rows(real, ours), _rows(sim, theirs)
        if len(a) != len(b):
            a, b = _merged(a), _merged(b)
        rows += [(interval, *x, *y) for x, y in zip(a, b, strict=True)]
    table = np.array(rows, dtype=float).reshape(-1, 7)
    start_real, last_real, next_real = table[:, 1:4].T
    start_sim, last_sim, next_sim = table[:, 4:].T
    common = np.minimum(last_real - start_real, last_sim - start_sim)
    first = np.searchsorted(t, start_real - ROUNDING)
    frame = np.searchsorted(t, start_real + common + ROUNDING, side="right") - 1
    use = frame > first
    whole = (0.0, 0.0) if not len(table) else (next_real[-1] - start_real[0], next_sim[-1] - start_sim[0])
    return KeyFrames(
        interval=table[use, 0].astype(int), start_real=start_real[use], start_sim=start_sim[use],
        took_real=(next_real - start_real)[use], took_sim=(next_sim - start_sim)[use], first=first[use],
        frame=frame[use], tau=t[frame[use]] - start_real[use], whole_real=float(whole[0]), whole_sim=float(whole[1]),
    )  # fmt: skip


def _rows(spans: Spans, which: np.ndarray) -> list[tuple[float, float, float]]:
    """(t_first, t_last, t_next) of some segments."""
    return list(zip(spans.t_first[which], spans.t_last[which], spans.t_next[which], strict=True))


def _merged(rows: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """All segments of an interval as one."""
    return [(rows[0][0], *rows[-1][1:])]
