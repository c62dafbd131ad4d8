"""Target intervals and segments: in order, inside the frames, at the stamps they name."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.checks.base import AGAIN, Found, check, number
from r2s2r_cli.checks.subjects import Run

STAMP_TOLERANCE_S = 1e-9
_ONE = {"intervals": "target interval", "segments": "segment"}
_FIX = f"{AGAIN}   # intervals and segments are then found anew"


@check(
    "error",
    Run,
    what="each target interval and segment begins before it ends, after the end of the one before",
    why="their frames would be counted twice, or not at all",
    fix=_FIX,
)
def spans_ordered(run: Run) -> Iterator[Found]:
    """Spans that overlap, run backwards or begin before frame 0."""
    for stream, first, last in _spans(run):
        ends = np.append(-1, last[:-1])
        bad = (last < first) | (first <= ends)
        if bad.any():
            i = int(np.argmax(bad))
            yield Found(run.at(stream), f"{_ONE[stream]} {i + 1} is out of order",
                        f"frames after {ends[i]}, the first before the last", f"{first[i]} .. {last[i]}")  # fmt: skip


@check(
    "error",
    Run,
    what="the frames of each target interval and segment exist",
    why="a key frame that is not there stops every comparison",
    fix=_FIX,
)
def spans_inside_frames(run: Run) -> Iterator[Found]:
    """Spans beyond the last kept frame."""
    if run.stamps is None:
        return
    count = len(run.stamps[1])
    for stream, _, last in _spans(run):
        if (last >= count).any():
            i = int(np.argmax(last >= count))
            yield Found(run.at(stream, "last"), f"{_ONE[stream]} {i + 1} ends after the last kept frame",
                        f"at most frame {count - 1}", str(last[i]))  # fmt: skip


@check(
    "error",
    Run,
    what="the stamps of each target interval and segment are those of its first and last kept frame",
    why="a span that counts other frames than its stamps say was cut from another version of the run",
    fix=_FIX,
)
def span_stamps_match(run: Run) -> Iterator[Found]:
    """Stamps that are not those of the frames."""
    if run.stamps is None:
        return
    stamps = run.stamps[1]
    for stream, *rows in _spans(run):
        for name, frames in zip(("t_first", "t_last"), rows, strict=True):
            t = run.array(stream, name)
            inside = (frames >= 0) & (frames < len(stamps))
            if t is None or not inside.all():
                continue
            off = np.abs(t - stamps[frames]) > STAMP_TOLERANCE_S
            if off.any():
                i = int(np.argmax(off))
                yield Found(run.at(stream, name), f"{_ONE[stream]} {i + 1} has another stamp than its frame",
                            f"{number(stamps[frames[i]])} s", f"{number(t[i])} s")  # fmt: skip


@check(
    "error",
    Run,
    what="every segment lies within the target interval that it names",
    why="segments are target intervals cut again; train and test are chosen by interval",
    fix=_FIX,
)
def segments_in_their_interval(run: Run) -> Iterator[Found]:
    """Segments of an interval that is not there, or of another one."""
    interval, first, last = (run.array("segments", name) for name in ("interval", "first", "last"))
    begin, end = run.array("intervals", "first"), run.array("intervals", "last")
    if interval is None or first is None or last is None or begin is None or end is None:
        return
    for i, number_ in enumerate(interval.tolist()):
        if not 1 <= number_ <= len(begin):
            yield Found(run.at("segments", "interval"), f"segment {i + 1} names a target interval that is not there",
                        f"1 .. {len(begin)}", str(number_))  # fmt: skip
        elif first[i] < begin[number_ - 1] or last[i] > end[number_ - 1]:
            yield Found(run.at("segments", "interval"),
                        f"segment {i + 1} does not lie within its target interval {number_}",
                        f"frames {begin[number_ - 1]} .. {end[number_ - 1]}", f"{first[i]} .. {last[i]}")  # fmt: skip


@check(
    "error",
    Run,
    what="the direction of a cable in a segment is -1, 0 or +1",
    why="the Key Frame Loss keeps or drops a gradient by this sign",
    fix=_FIX,
)
def directions_known(run: Run) -> Iterator[Found]:
    """Directions that are no sign."""
    direction = run.array("segments", "direction")
    if direction is not None and not np.isin(direction, (-1, 0, 1)).all():
        row, cable = np.argwhere(~np.isin(direction, (-1, 0, 1)))[0]
        yield Found(run.at("segments", "direction"), "a direction is no sign", "-1 extends, 0 holds, +1 reels in",
                    f"{direction[row, cable]} at segment {row + 1}, cable {cable}")  # fmt: skip


def _spans(run: Run) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """(stream, first, last) of the tables that the run has, where they have rows."""
    for stream in ("intervals", "segments"):
        first, last = run.array(stream, "first"), run.array(stream, "last")
        if first is not None and last is not None and len(first):
            yield stream, first, last
