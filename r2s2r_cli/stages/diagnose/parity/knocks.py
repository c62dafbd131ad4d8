"""A camera that is knocked: from one frame to the next all end caps are seen displaced alike, and stay so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.parity.series import LEAST_M, Measured, Series

WINDOW_S = 0.3
"""On either side of an instant: how long the caps are taken to move evenly."""
LEAST_FRAMES = 3
"""On either side."""
SEEN = 2
"""Frames on either side in which a cap must be seen to count."""
MOST = 2 / 3
"""Share of the caps that must count."""
UNEVEN = 0.25
"""Of the displacement: how much the caps' own may differ from it, by the lever of a turn. When a robot falls, the caps
that it stands on stay where they are."""
UNSTEADY = 2.0
"""Times the usual remainder of that even motion beyond which it was none."""
HOLES = 1.5
"""Times its usual duration that a window may last: frames are missing from a longer one."""
SPREAD = 0.8
"""Standard deviation of how far the largest displacement stands out from the next one, over that of a displacement. In
23 sets of the rig whose camera nobody knocked it is 0.5 (calibration bank); tails are heavier than a Gaussian's."""


@dataclass(frozen=True)
class Knock:
    """size: of the largest displacement, how far it stands out from the next largest [m]: walking displaces the caps as
    well, again and again. whole: all of it [m]. run, t: where it is, and when [s]."""

    size: Measured
    whole: float
    run: str
    t: float


@dataclass(frozen=True)
class _Steps:
    """Of every instant between two frames of a run: t [s], (k,); step: displacement that all caps share [m], (k, 3);
    even: whether it is shared, in an otherwise even motion, (k,)."""

    run: str
    t: np.ndarray
    step: np.ndarray
    even: np.ndarray


def knock(runs: Sequence[Series]) -> Knock | None:
    """The largest one of these runs; None where they are too short to tell. One camera is knocked once."""
    made = [one for one in map(_steps, runs) if one is not None]
    if not made:
        return None
    sd = max(float(1.4826 * np.median(np.abs(np.concatenate([one.step for one in made])))), LEAST_M)
    size = [np.where(one.even, np.linalg.norm(one.step, axis=1), 0.0) for one in made]
    first = max(range(len(made)), key=lambda i: float(size[i].max()))
    at = int(np.argmax(size[first]))
    whole, t = float(size[first][at]), float(made[first].t[at])
    # Neighbours see the same one.
    size[first] = np.where(np.abs(made[first].t - t) <= 2 * WINDOW_S, 0.0, size[first])
    following = max(float(one.max()) for one in size)
    return Knock(Measured(whole - following, SPREAD * sd), whole, made[first].run, t) if following > 0 else None


def _steps(one: Series) -> _Steps | None:
    """Least squares over windows: place, speed, and the step in the middle, of every cap and axis."""
    t, p = one.t, one.p_WE
    gap = float(np.median(np.diff(t))) if len(t) > 1 else WINDOW_S
    n = max(LEAST_FRAMES, round(WINDOW_S / gap))
    rows = np.arange(max(len(t) - 2 * n + 1, 0))[:, None] + np.arange(2 * n)
    rows = rows[t[rows[:, -1]] - t[rows[:, 0]] <= HOLES * 2 * n * gap]
    seen = np.isfinite(p[rows]).all(axis=-1)
    counts = np.minimum(seen[:, :n].sum(axis=1), seen[:, n:].sum(axis=1)) >= SEEN
    kept = counts.mean(axis=1) >= MOST
    if not kept.any():
        return None
    rows, counts = rows[kept], counts[kept, :, None].astype(float)
    seen, y = seen[kept] * counts[:, None, :, 0], np.nan_to_num(p[rows])
    middle = (t[rows[:, n - 1]] + t[rows[:, n]]) / 2
    after = np.broadcast_to(np.arange(2 * n) >= n, rows.shape)
    X = np.stack([np.ones(rows.shape), t[rows] - middle[:, None], after], axis=-1)
    normal = np.einsum("kfi,kfc,kfj->kcij", X, seen, X) + (1.0 - counts)[..., None] * np.eye(3)
    beta = np.linalg.solve(normal, np.einsum("kfi,kfc,kfca->kcia", X, seen, y))
    rest = seen[..., None] * (y - np.einsum("kfi,kcia->kfca", X, beta))
    left = np.sum(rest**2, axis=(1, 2, 3)) / seen.sum(axis=(1, 2))
    own, share = beta[:, :, 2], counts / counts.sum(axis=1, keepdims=True)
    step = np.sum(share * own, axis=1)
    apart = own - step[:, None]
    noise = 1.4826 * float(np.median(np.abs(apart)[np.broadcast_to(counts > 0, apart.shape)]))
    uneven = np.sum(share * apart**2, axis=(1, 2)) > 3 * noise**2 + UNEVEN**2 * np.sum(step**2, axis=1)
    return _Steps(one.name, middle, step, ~uneven & (left <= UNSTEADY**2 * np.median(left)))
