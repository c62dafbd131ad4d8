"""When an effect that begins at a time or a place begins: the target interval of the set in which it first matters."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.blind.make.drive import Driven
from r2s2r_cli.blind.make.effects import Planted

TOUCH_M = 0.004
"""A cap whose lowest point is nearer to the floor touches it."""


def onset(one: Planted, runs: list[Driven]) -> dict[str, object] | None:
    """{"gait": name, "interval": 1-based in its run, "of_set": 1-based through all gaits}; None: it holds throughout.

    Target intervals as `import` counts them, the rest at the beginning of a run being the first.
    """
    if one.late is not None:
        return _place(runs, *one.late)
    patches = one.table.get("patches", ())
    if not patches:
        return None
    center, radius = np.array(patches[0]["center_m"]), float(patches[0]["radius_m"])
    for g, run in enumerate(runs):
        low = run.p_WE[..., 2] < run.p_WE[..., 2].min() + TOUCH_M
        on = low & (np.linalg.norm(run.p_WE[..., :2] - center, axis=-1) < radius)
        # Slipping is what tells a patch: a cap that stands still there says nothing.
        moves = np.linalg.norm(np.gradient(run.p_WE[..., :2], run.t_frame, axis=0), axis=-1) > 0.02
        frames = np.flatnonzero((on & moves).any(axis=1))
        if len(frames):
            return _place(runs, g, float(run.t_frame[frames[0]]))
    return None


def _place(runs: list[Driven], gait: int, t: float) -> dict[str, object]:
    run = runs[gait]
    interval = int(np.searchsorted(run.t[run.starts], t, side="right"))
    before = sum(len(other.starts) for other in runs[:gait])
    return {"gait": run.gait.name, "interval": interval, "of_set": before + interval}
