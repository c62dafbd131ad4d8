"""Stamps of a run: in seconds? Refused where they are clearly not, never converted."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.import_.files import in_place
from schemas.results_import import DroppedFrames

SLOW_GAP_S = 5.0
"""Median gap above which stamps are no camera's seconds: 30 frames a second in milliseconds have 33, one frame every
two seconds has 2. A robot moves a cable over its range in less."""
MAX_DURATION_S = 86400.0
"""A run of more than a day is a clock that jumped, or several runs in one file; batteries last an hour."""
MIN_FRAMES = 5
"""`estimate` smooths nothing shorter, and the noise is read from 5-frame lines."""
UNITS: dict[str, float] = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
"""Ticks a second."""
COLUMNS: dict[str, str] = {
    f"{word}_{unit}": name
    for word in ("t", "time", "timestamp", "stamp")
    for unit, name in (("ms", "milliseconds"), ("us", "microseconds"), ("ns", "nanoseconds"))
}
"""Column names that say another unit."""
ALIASES = ("t", "time", "timestamp", "stamp", "t_sec", "time_s", "time_sec", "timestamp_s", "sec", "secs", "seconds")
"""Names by which people call the stamps in seconds."""


def check_stamps(t: np.ndarray, where: str) -> None:
    """Refuse stamps of another unit, and runs that last longer than a day.

    t: stamps of the rows as they stand [s], NaN where there is none. Raises InputError.
    """
    known = t[np.isfinite(t)]
    gap = np.diff(known)
    gap = gap[gap > 0]
    if len(gap) == 0:
        return
    median = float(np.median(gap))
    if median > SLOW_GAP_S:
        unit = next((name for name, ticks in UNITS.items() if median / ticks <= SLOW_GAP_S), "nanoseconds")
        raise InputError(
            f"the stamps are not in seconds, they look like {unit}",
            where=f"{where}, column t_s",
            expected=f"a median gap between frames of at most {SLOW_GAP_S:g} s",
            received=f"{median:g}, which in {unit} would be {median / UNITS[unit]:.4g} s",
            hint=to_seconds("t_s", unit, where),
        )
    duration = float(known.max() - known.min())
    if duration > MAX_DURATION_S:
        row = int(np.argmax(np.abs(np.diff(known))))
        raise InputError(
            "the run lasts longer than a day",
            where=f"{where}, column t_s, frame {row + 2}",
            expected=f"at most {MAX_DURATION_S:g} s from the first stamp to the last",
            received=f"{duration:g} s; the largest step leads from {known[row]:.10g} s to {known[row + 1]:.10g} s",
            hint="split the file where a new run begins, or take out the row with the wrong stamp",
        )


def to_seconds(column: str, unit: str, where: str) -> str:
    """Command that converts the stamps of a CSV in place, names the column t_s, and keeps a copy beside it."""
    ticks = UNITS[unit]
    script = (
        f'NR==1{{for(i=1;i<=NF;i++)if($i=="{column}"){{c=i;$i="t_s"}}}} NR>1{{$c=sprintf("%.9f",$c/{ticks:.0f})}} 1'
    )
    return in_place(where, f"awk -F, -v OFS=, '{script}'")


def few_frames(kept: int, dropped: DroppedFrames) -> list[str]:
    """The warning about a run too short to do anything with; where duplicates are why, what that may mean."""
    if kept >= MIN_FRAMES:
        return []
    why = "; nearly all stamps are less than 20 ms apart: are they in minutes or hours?" * (dropped.duplicate > kept)
    return [f"only {kept} frame{'s are' if kept != 1 else ' is'} kept: `estimate` needs at least {MIN_FRAMES}{why}"]
