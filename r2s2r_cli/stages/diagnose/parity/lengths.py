"""Cable sensors against the camera: bias, gain, and how much later one of them shows a motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Evidence
from r2s2r_cli.stages.diagnose.parity.fitted import fitted_runs
from r2s2r_cli.stages.diagnose.parity.series import Measured, Series, regression, series

LATEST_S = 0.35
"""Time shifts are looked for up to so much, both ways."""
STEP_S = 0.02
MOVING_M_PER_S = 0.01
"""Cables that never move faster say nothing of time."""


@dataclass(frozen=True)
class SensorParity:
    """Of every cable: bias of its sensor in the middle of its travel [m], gain - 1 [1], and drift [m/s]; later: by how
    much the camera shows motions later than the sensors do [s], all cables together. about: the middle [m], (cable,).
    """

    bias: list[Measured]
    gain: list[Measured]
    drift: list[Measured]
    later: Measured
    about: np.ndarray


def sensor_parity(runs: Sequence[Series]) -> SensorParity | None:
    """None where no sensor was heard."""
    usable = [one for one in runs if one.has_sensors]
    if not usable:
        return None
    cables = usable[0].seen.shape[1]
    later = _later(usable)
    shift = later.value if np.isfinite(later.value) else 0.0
    group = np.concatenate([1000 * i + one.interval for i, one in enumerate(usable)])
    since = np.concatenate([one.t - one.t[0] for one in usable])
    sensed = np.concatenate([_moved(one, shift) for one in usable])
    seen = np.concatenate([one.seen for one in usable])
    bias: list[Measured] = []
    gain: list[Measured] = []
    drift: list[Measured] = []
    about = np.full(cables, np.nan)
    for k in range(cables):
        good = np.isfinite(sensed[:, k]) & np.isfinite(seen[:, k])
        if good.sum() < 10:
            for part in (bias, gain, drift):
                part.append(Measured(float("nan"), float("nan")))
            continue
        about[k] = float(np.median(sensed[good, k]))
        x = np.stack([np.ones(int(good.sum())), sensed[good, k] - about[k]], axis=1)
        y = sensed[good, k] - seen[good, k]
        beta, cov = regression(y, x, group[good])
        # y = bias + (1 - 1 / factor) (sensed - about): the sensor is the regressor, being much less noisy.
        bias.append(Measured(float(beta[0]), float(np.sqrt(cov[0, 0]))))
        gain.append(Measured(float(beta[1] / (1 - beta[1])), float(np.sqrt(cov[1, 1]) / (1 - beta[1]) ** 2)))
        x = np.concatenate([x, (since[good] - since[good].mean())[:, None]], axis=1)
        beta, cov = regression(y, x, group[good])
        drift.append(Measured(float(beta[2]), float(np.sqrt(cov[2, 2]))))
    return SensorParity(bias, gain, drift, later, about)


def late_readings(evidence: Evidence) -> float:
    """By how much the length sensors seem late against the camera [s], without a simulator: in the healthy runs, else
    in what is fitted of today's; 0 where it cannot be told. A fit that does not begin there stays with a late command
    and a hasty camera, which do as well for a while."""
    runs = evidence.healthy or fitted_runs(evidence)
    seen = sensor_parity([series(run, evidence.robot) for run in runs])
    return -seen.later.value if seen is not None and np.isfinite(seen.later.value) else 0.0


def _moved(one: Series, shift: float) -> np.ndarray:
    """Sensor lengths as they were `shift` seconds before the frames, (frame, cable)."""
    t, length = one.heard
    found = np.full_like(one.sensed, np.nan)
    for k in range(length.shape[1]):
        good = np.isfinite(length[:, k])
        if good.sum() > 2:
            found[:, k] = np.interp(one.t - shift, t[good], length[good, k], left=np.nan, right=np.nan)
    return np.where(np.isfinite(one.sensed), found, np.nan)


def _later(runs: Sequence[Series]) -> Measured:
    """The shift at which both agree best, a parabola through the least of the misfits; its error from how much the
    cables and runs differ in it."""
    parts = []
    shifts = np.arange(-LATEST_S, LATEST_S + STEP_S / 2, STEP_S)
    for one in runs:
        moving = np.nanmax(np.abs(np.where(np.isfinite(one.sensed_rate), one.sensed_rate, 0.0)), axis=0)
        rows = (one.t > one.t[0] + LATEST_S) & (one.t < one.t[-1] - LATEST_S)
        moved = [_moved(one, float(shift))[rows] for shift in shifts]
        for k in np.flatnonzero(moving > MOVING_M_PER_S):
            away = np.stack([m[:, k] for m in moved]) - one.seen[rows, k]
            good = np.isfinite(away).all(axis=0)
            if good.sum() < 20:
                continue
            away = away[:, good]
            gained = np.linspace(-1, 1, away.shape[1])  # a slow drift is no motion
            away = away - away.mean(axis=1, keepdims=True)
            away = away - (away @ gained)[:, None] / (gained @ gained) * gained
            cost = np.mean(away**2, axis=1)
            best = int(np.argmin(cost))
            if 0 < best < len(shifts) - 1:
                a, b, c = float(cost[best - 1]), float(cost[best]), float(cost[best + 1])
                parts.append(shifts[best] + 0.5 * STEP_S * (a - c) / max(a - 2 * b + c, 1e-30))
    if len(parts) < 3:
        return Measured(float("nan"), float("nan"))
    found = np.array(parts)
    middle = float(np.median(found))
    spread = 1.4826 * float(np.median(np.abs(found - middle)))
    return Measured(middle, max(1.2533 * spread / np.sqrt(len(found)), 1e-4))
