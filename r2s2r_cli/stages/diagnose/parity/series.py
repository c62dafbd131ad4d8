"""A run as series to be held against each other: cap distances, sensor lengths, commands; and their statistics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Run
from r2s2r_cli.stages.diagnose.parity.finding import cable_ends
from schemas.robot import Robot

LEAST_M = 1e-5
"""[m] A log without noise must not divide by 0."""
GAP_S = 0.5
"""Readings further apart than this [s] are not interpolated."""
UNUSED = (1, 2)
"""Codes of `schemas.estimate.QUALITY`: not observed, and outliers."""


@dataclass(frozen=True)
class Measured:
    """A number with its standard deviation; nan where nothing was measured."""

    value: float
    sd: float


@dataclass(frozen=True)
class Series:
    """One run. t: frames [s], (frame,); interval: target interval of each, (frame,). p_WE: observed end caps [m],
    (frame, cap, 3), nan where not seen or an outlier; noise: sd of a coordinate, (cap,) [m]. seen: distance of the caps
    of every cable [m], (frame, cable), less what noise adds to it; seen_sd: (cable,). sensed: what the sensors read at
    the frames [m], (frame, cable), nan without one; sensed_rate: its rate [m/s]. heard: times of the readings [s] and
    what they were [m], (sample,), (sample, cable), nan: none.
    """

    name: str
    t: np.ndarray
    interval: np.ndarray
    p_WE: np.ndarray
    noise: np.ndarray
    seen: np.ndarray
    seen_sd: np.ndarray
    sensed: np.ndarray
    sensed_rate: np.ndarray
    heard: tuple[np.ndarray, np.ndarray]
    run: Run

    @property
    def has_sensors(self) -> bool:
        """Whether any sensor was heard."""
        return bool(np.isfinite(self.sensed).any())


def series(run: Run, robot: Robot, scale: float = 1.0) -> Series:
    """The series of one run. scale: by which the camera is known to show everything too large."""
    caps, ends = run.caps, cable_ends(robot)
    sd = np.sqrt(np.mean(np.maximum(caps.noise, LEAST_M) ** 2, axis=-1))
    p_WE = np.where(np.isin(caps.quality, UNUSED)[..., None], np.nan, caps.observed) / scale
    apart = p_WE[:, ends[:, 1]] - p_WE[:, ends[:, 0]]
    raw = np.linalg.norm(apart, axis=-1)
    both = sd[ends[:, 0]] ** 2 + sd[ends[:, 1]] ** 2
    # Noise across a distance makes it longer: sqrt(d^2 + n^2) = d + n^2 / 2 d, on two axes.
    seen = raw - both / np.maximum(raw, LEAST_M)
    t, length = np.zeros(0), np.full((0, len(ends)), np.nan)
    if run.lengths is not None:
        t = run.lengths.t
        length = np.full((len(t), len(ends)), np.nan)
        length[:, run.lengths.cable] = run.lengths.length
    sensed, rate = _at(caps.t, t, length)
    interval = np.searchsorted(caps.intervals.first, np.arange(len(caps.t)), side="right")
    return Series(run.name, caps.t, interval, p_WE, sd, seen, np.sqrt(both), sensed, rate, (t, length), run)


def _at(t: np.ndarray, stamps: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values (sample, cable) at times t by interpolation, and their rate over two gaps between readings."""
    found, rate = np.full((len(t), values.shape[1]), np.nan), np.full((len(t), values.shape[1]), np.nan)
    for k in range(values.shape[1]):
        good = np.isfinite(values[:, k])
        if good.sum() < 3:
            continue
        own, length = stamps[good], values[good, k]
        place = np.clip(np.searchsorted(own, t), 1, len(own) - 1)
        inside = (t >= own[0]) & (t <= own[-1]) & (own[place] - own[place - 1] < GAP_S)
        found[:, k] = np.where(inside, np.interp(t, own, length), np.nan)
        low, high = np.maximum(place - 2, 0), np.minimum(place + 1, len(own) - 1)
        rate[:, k] = np.where(inside, (length[high] - length[low]) / np.maximum(own[high] - own[low], 1e-9), np.nan)
    return found, rate


def combined(parts: Sequence[Measured], *, least_sd: float = 0.0) -> Measured:
    """Mean of several measurements of one number, weighted; where they scatter more than they say, so does the mean.

    least_sd: what repeats differ by anyway, beyond their own errors.
    """
    known = [one for one in parts if np.isfinite(one.value) and np.isfinite(one.sd)]
    if not known:
        return Measured(float("nan"), float("nan"))
    value = np.array([one.value for one in known])
    variance = np.array([one.sd for one in known]) ** 2 + least_sd**2
    weight = 1.0 / np.maximum(variance, 1e-30)
    mean = float(weight @ value / weight.sum())
    chi2 = float(weight @ (value - mean) ** 2)
    wide = max(1.0, chi2 / (len(known) - 1)) if len(known) > 1 else 1.0
    return Measured(mean, float(np.sqrt(wide / weight.sum())))


def regression(y: np.ndarray, x: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (n,) of y (row,) on x (row, n) and their covariance (n, n). Rows of one number in `group` (row,) are
    neighbours in time and share an error: the covariance is that of Liang and Zeger (1986) for clusters, and at least
    that of errors that persist (first-order autoregression). Rows that stick out count less (Huber). nan: too few."""
    keep = np.isfinite(y) & np.isfinite(x).all(axis=1)
    y, x, group = y[keep], x[keep], group[keep]
    n = x.shape[1]
    names, place = np.unique(group, return_inverse=True)
    if len(y) < n + 2 or len(names) < 2:
        return np.full(n, np.nan), np.full((n, n), np.nan)
    weight = np.ones(len(y))
    beta = np.zeros(n)
    for _ in range(4):
        root = np.sqrt(weight)[:, None]
        beta = np.linalg.lstsq(x * root, y * root[:, 0], rcond=None)[0]
        rest = y - x @ beta
        sigma = max(float(1.4826 * np.median(np.abs(rest))), 1e-12)
        weight = np.minimum(1.0, 1.345 * sigma / np.maximum(np.abs(rest), 1e-12))
    rest = y - x @ beta
    spread = float(np.sum(weight * rest**2) / max(len(y) - n, 1))
    inverse = np.linalg.pinv((x * weight[:, None]).T @ x)
    alone = inverse * spread * persistence(rest, group)
    score = np.zeros((len(names), n))
    np.add.at(score, place, x * (weight * rest)[:, None])
    shared = inverse @ (score.T @ score) @ inverse * len(names) / max(len(names) - n, 1)
    wide = np.sqrt(np.maximum(np.diag(shared), np.diag(alone)) / np.maximum(np.diag(alone), 1e-300))
    return beta, alone * wide[:, None] * wide[None, :]


def persistence(rest: np.ndarray, group: np.ndarray) -> float:
    """Factor by which errors that persist widen a variance, (1 + r) / (1 - r), r: correlation of neighbours, >= 0."""
    near = group[1:] == group[:-1]
    size = float(np.sum(rest**2))
    if not near.any() or size <= 0:
        return 1.0
    r = float(np.sum(rest[1:][near] * rest[:-1][near]) / near.sum() / (size / len(rest)))
    r = min(max(r, 0.0), 0.95)
    return (1 + r) / (1 - r)
