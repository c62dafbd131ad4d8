"""Time: frames and samples in order."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.checks.base import AGAIN, Found, check, number
from r2s2r_cli.checks.subjects import Run

MIN_GAP_S = 0.020
"""Two frames closer than this are one observation stamped twice (docs/guides/import.md)."""
ROUNDING_S = 1e-6
"""Logs round stamps to milliseconds: 0.020 must not fall below 20 ms by binary rounding."""
_SAMPLED = (("commands", "t"), ("sensors", "t"), ("motors", "t"), ("camera", "t"), ("camera", "t_depth"),
            ("camera_pose", "t"), ("mocap", "t"))  # fmt: skip


@check(
    "error",
    Run,
    what="the stamps of the frames that count increase",
    why="velocities, intervals and key frames are built on their order",
    fix=f"{AGAIN}   # first sort the rows of the source by time",
)
def time_increases(run: Run) -> Iterator[Found]:
    """Stamps of kept frames that stand still or run backwards."""
    if run.stamps is not None:
        location, t = run.stamps
        gap = np.diff(t)
        if (gap <= 0).any():
            yield Found(location, f"the stamps of the {run.frame}s do not increase", "each later than the one before",
                        _first(t, gap <= 0, run.frame))  # fmt: skip


@check(
    "error",
    Run,
    kinds=("recording",),
    what="kept frames are at least 20 ms apart",
    why="two frames closer than that are one observation stamped twice, and their difference is noise",
    fix=f"{AGAIN}   # import marks such frames as dropped",
)
def kept_frames_apart(run: Run) -> Iterator[Found]:
    """Duplicates that were not dropped."""
    if run.stamps is not None:
        location, t = run.stamps
        gap = np.diff(t)
        bad = (gap > 0) & (gap < MIN_GAP_S - ROUNDING_S)
        if bad.any():
            yield Found(location, "two kept frames are one observation stamped twice", "gaps of at least 20 ms",
                        _gap(gap, bad))  # fmt: skip


@check(
    "warning",
    Run,
    what="the stamps of every sampled stream are in order",
    why="samples out of order are interpolated wrongly",
    fix=f"{AGAIN}   # first sort the samples of the source by time",
)
def samples_ordered(run: Run) -> Iterator[Found]:
    """Streams whose clock runs backwards. Equal stamps are allowed: two samples may share one."""
    for stream, name in _SAMPLED:
        t = run.array(stream, name)
        if t is not None and (np.diff(t) < 0).any():
            yield Found(run.at(stream, name), "the stamps run backwards", "in the order of time",
                        _first(t, np.diff(t) < 0, "sample"))  # fmt: skip
    t, board = run.array("imu", "t"), run.array("imu", "board")
    if t is not None and board is not None:
        for number_ in np.unique(board).tolist():
            own = t[board == number_]
            if (np.diff(own) < 0).any():
                yield Found(run.at("imu", "t"), f"the stamps of board {number_} run backwards", "in the order of time",
                            _first(own, np.diff(own) < 0, "sample"))  # fmt: skip


@check(
    "error",
    Run,
    kinds=("estimate",),
    what="the frames of an estimate are rows of the recording, in its order",
    why="row k must be kept frame k, as intervals and segments count them",
    fix=AGAIN,
)
def source_frames_increase(run: Run) -> Iterator[Found]:
    """Row numbers that are negative or out of order."""
    rows = run.array("frames", "source_frame")
    if rows is not None and len(rows) and (rows[0] < 0 or (np.diff(rows) <= 0).any()):
        bad = 0 if rows[0] < 0 else int(np.argmax(np.diff(rows) <= 0)) + 1
        yield Found(run.at("frames", "source_frame"), "the frames are not in the order of the recording",
                    "rows that increase from 0 on", f"{rows[bad]} at frame {bad}")  # fmt: skip


def _first(t: np.ndarray, bad: np.ndarray, name: str) -> str:
    i = int(np.argmax(bad))
    more = f" (and {int(bad.sum()) - 1} more)" if bad.sum() > 1 else ""
    return f"{number(t[i])} s then {number(t[i + 1])} s at {name} {i + 1}{more}"


def _gap(gap: np.ndarray, bad: np.ndarray) -> str:
    i = int(np.argmin(np.where(bad, gap, np.inf)))
    more = f" (and {int(bad.sum()) - 1} more)" if bad.sum() > 1 else ""
    return f"{number(gap[i], 1e3)} ms before kept frame {i + 1}{more}"
