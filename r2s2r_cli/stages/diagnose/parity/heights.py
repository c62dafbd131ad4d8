"""Caps that stand against the ground plane: a slope of what is seen, and caps that stand too high or too low."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.parity.series import Measured, Series, regression
from schemas.robot import Robot

STILL_M_PER_S = 0.03
"""Smoothed speed below which a cap may stand."""
LEAST_FRAMES = 3
"""Of a cap in an interval."""
LEAST_SD_M = 5e-4
"""Of a mean height of one cap over one interval: the ground of a room, and a tracker."""
SLOPE_RAD, HEIGHT_M = 0.1, 2e-3
"""Prior sd of a slope and of a cap's height: few intervals tell them apart."""
STANDS_M = 0.004
"""A cap whose mean height is further off than this from that of the others does not stand: it hangs by its cables."""
NEAR_M = 0.012
"""A cap stands if its smoothed centre lies within this and three times its error of its radius over the plane."""


@dataclass(frozen=True)
class Heights:
    """slope: of the plane that the standing caps lie on, about x and y [rad] (rise along y, less rise along x); cap:
    height of each cap over that plane less its radius, against the mean of all [m]."""

    slope: tuple[Measured, Measured]
    cap: list[Measured]


def heights(runs: Sequence[Series], robot: Robot) -> Heights | None:
    """None where fewer than three caps ever stand."""
    radius = np.repeat([rod.cap_radius_m for rod in robot.rods], 2)
    plane = _lowest(runs, radius)
    rows: list[np.ndarray] = []
    for number, one in enumerate(runs):
        caps = one.run.caps
        near = 3 * one.noise / np.sqrt(5) + NEAR_M
        over = caps.p_WE[..., 2] - radius - caps.p_WE[..., :2] @ plane[:2] - plane[2]
        standing = (np.linalg.norm(caps.v_WE, axis=-1) < STILL_M_PER_S) & (np.abs(over) < near)
        standing &= np.isfinite(one.p_WE).all(axis=-1)
        frame, cap = np.nonzero(standing)
        p = one.p_WE[frame, cap]
        rows.append(
            np.column_stack([np.full(len(cap), number), one.interval[frame], cap, p[:, :2], p[:, 2] - radius[cap]])
        )
    table = np.concatenate(rows) if rows else np.zeros((0, 6))
    # One point an interval and cap: what a tracker has wrong stays over an interval.
    names, place = np.unique(table[:, [0, 1, 2]], axis=0, return_inverse=True)
    place = place.reshape(-1)
    count = np.bincount(place, minlength=len(names)).astype(float)
    mean = np.stack([np.bincount(place, table[:, j], len(names)) / np.maximum(count, 1) for j in (3, 4, 5)], axis=1)
    kept = count >= LEAST_FRAMES
    names, mean = names[kept], mean[kept]
    stands = np.ones(len(radius), dtype=bool)
    while True:
        own = stands[names[:, 2].astype(int)]
        found = _fitted(names[own], mean[own], len(radius))
        if found is None:
            return None
        off = np.array([abs(one.value) > STANDS_M for one in found.cap])
        if not off.any():
            return found
        # One cap that hangs lifts the plane that all the others are measured from: they are fitted anew without it.
        worst = int(np.nanargmax([abs(one.value) for one in found.cap]))
        stands[worst] = False


def _fitted(names: np.ndarray, mean: np.ndarray, count: int) -> Heights | None:
    """Of means of a cap over an interval: names (row, 3) run, interval, cap; mean (row, 3) x, y, height less radius.
    count: of caps. None where fewer than three are there."""
    cap, run = names[:, 2].astype(int), names[:, 0].astype(int)
    if len(np.unique(cap)) < 3 or len(names) < 6:
        return None
    # One level a run (its ground was put to z = 0 by its own caps), one slope, one height a cap with its prior.
    levels = (run[:, None] == np.unique(run)).astype(float)
    each = (cap[:, None] == np.arange(count)).astype(float)
    x = np.column_stack([levels, mean[:, :2] - mean[:, :2].mean(axis=0), each])
    n = levels.shape[1]
    prior = np.concatenate([np.zeros(n), np.full(2, SLOPE_RAD**-2), np.full(count, HEIGHT_M**-2)])
    weight, beta = np.ones(len(mean)), np.zeros(x.shape[1])
    sigma = LEAST_SD_M
    for _ in range(5):
        normal = (x * weight[:, None]).T @ x / sigma**2 + np.diag(prior)
        beta = np.linalg.solve(normal, (x * weight[:, None]).T @ mean[:, 2] / sigma**2)
        rest = mean[:, 2] - x @ beta
        sigma = max(
            1.4826 * float(np.median(np.abs(rest))) * np.sqrt(len(mean) / max(len(mean) - n - 4, 1)), LEAST_SD_M
        )
        weight = np.minimum(1.0, 1.345 * sigma / np.maximum(np.abs(rest), 1e-12))
    cov = np.linalg.inv(normal)
    seen = np.isin(np.arange(count), cap)
    average = np.eye(count) - seen / seen.sum()
    own, wide = average @ beta[n + 2 :], average @ cov[n + 2 :, n + 2 :] @ average.T
    found = [
        Measured(float(own[k]), float(np.sqrt(wide[k, k]))) if seen[k] else Measured(float("nan"), float("nan"))
        for k in range(count)
    ]
    sd = np.sqrt(np.diag(cov))
    slope = Measured(float(beta[n + 1]), float(sd[n + 1])), Measured(float(-beta[n]), float(sd[n]))
    return Heights(slope, found)


def _lowest(runs: Sequence[Series], radius: np.ndarray) -> np.ndarray:
    """Rise along x and y and level of the plane under the three lowest caps of all frames, (3,)."""
    rows, group = [], []
    for one in runs:
        caps = one.run.caps.p_WE
        low = np.argsort(caps[..., 2] - radius, axis=1)[:, :3]
        p = np.take_along_axis(caps, low[..., None], axis=1).reshape(-1, 3)
        rows.append(np.column_stack([p[:, :2], np.ones(len(p)), p[:, 2] - radius[low.ravel()]]))
        group.append(np.repeat(1000 * len(rows) + one.interval, 3))
    table = np.concatenate(rows)
    beta, _ = regression(table[:, 3], table[:, :3], np.concatenate(group))
    return np.nan_to_num(beta)
