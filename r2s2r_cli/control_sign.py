"""Do motor commands shorten the cables? One measure for `import`, which warns, and for the check of `validate`."""

from __future__ import annotations

import numpy as np

MIN_GAPS = 20
"""Gaps between frames with a command, over all cables, below which a correlation says nothing."""

WRONG_SIGN = -0.3
"""Correlation below which all commands have the wrong sign. The real crawl has 0.65, and 0.55 to 0.82 in each eighth of
its 16 s; a single cable of wrong sign among the others does not get here, chance does not either."""


def cable_response(t: np.ndarray, length: np.ndarray, t_control: np.ndarray, control: np.ndarray) -> float:
    """Correlation of the motor command with the speed at which its cable shortens; NaN where that cannot be told.

    t: stamps of the frames [s], (frame,); length: distance of the caps of each actuated cable [m], (frame, actuated);
    t_control [s], (row,), ascending; control: -1 .. 1, +1 reels in, (row, actuated), NaN where not logged. A command
    holds until the next row. The correlation is about zero, not about the means: a command of 0 is a motion of 0.
    Positive for the convention +1 reels in; all signs wrong give the negative of it.
    """
    if len(t) < 2 or len(t_control) == 0:
        return float("nan")
    row = np.searchsorted(t_control, t[:-1], side="right") - 1
    u = np.where(row[:, None] >= 0, control[np.maximum(row, 0)], np.nan)
    gap = np.diff(t)
    with np.errstate(all="ignore"):
        v = -np.diff(length, axis=0) / gap[:, None]
    good = np.isfinite(u) & np.isfinite(v) & (u != 0)
    u, v = u[good], v[good]
    size = float(np.sqrt((u**2).sum() * (v**2).sum())) if len(u) >= MIN_GAPS else 0.0
    return float((u * v).sum()) / size if size > 0 and np.isfinite(size) else float("nan")
