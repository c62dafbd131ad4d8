"""Smoothing as one big Gaussian: the same problem as `kalman.py`, solved by matrices of the whole run.

It checks the recursions, and it compares motion models: white acceleration (order 2, what `estimate` uses) with white
jerk (order 3). The figures in docs/concepts/estimate.md are those of `compare` on JUDGING_SEEDS and the real crawl.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np

from r2s2r_cli.stages.estimate.smooth import BURSTS, JUMP, JUMP_SD, MISSING, OUTLIER, chi2_quantile

PRIOR = (1.0, 1.0, 3.0)
"""[m, m/s, m/s^2] Wide for a robot, and narrow enough that one big matrix can be inverted."""
FOLDS = 5
DECADES = (-7.0, 5.0)
"""In which the density is searched: half decades, then tenths."""


def transition(dt: float, order: int) -> np.ndarray:
    """Taylor: derivative j moves derivative i by dt^(j - i) / (j - i)!."""
    return np.array([[dt ** (j - i) / factorial(j - i) if j >= i else 0.0 for j in range(order)] for i in range(order)])


def process(dt: float, order: int) -> np.ndarray:
    """Unit white noise integrated a and b times over dt: dt^(a + b + 1) / ((a + b + 1) a! b!)."""
    times = range(order - 1, -1, -1)
    return np.array([[dt ** (a + b + 1) / ((a + b + 1) * factorial(a) * factorial(b)) for b in times] for a in times])


def covariance(
    t: np.ndarray, density: float, kick: np.ndarray, jump: np.ndarray, order: int, prior: tuple[float, ...] = PRIOR
) -> np.ndarray:
    """Of all states of a run before anything is observed, shape (frame * order, frame * order); linear in density,
    kick, jump and the squared prior."""
    n = len(t)
    cov = np.zeros((n * order, n * order))
    cov[:order, :order] = np.diag(np.square(prior[:order]))
    for k in range(n - 1):
        dt = float(t[k + 1] - t[k])
        step, noise = transition(dt, order), density * process(dt, order)
        noise[:2, :2] += kick[k] / dt * process(dt, 2)
        noise[0, 0] += jump[k]
        now, after = slice(k * order, (k + 1) * order), slice((k + 1) * order, (k + 2) * order)
        past = slice(0, (k + 1) * order)
        cov[after, past] = step @ cov[now, past]
        cov[past, after] = cov[after, past].T
        cov[after, after] = step @ cov[now, now] @ step.T + noise
    return cov


@dataclass(frozen=True)
class Compared:
    """How one motion model does on one run."""

    held_out: float
    """Mean log density of left-out frames [nats a coordinate]: every fifth in turn, not the first and last two."""
    held_out_inside: float
    """Share of the left-out positions inside their 95 % ellipsoid."""
    position: np.ndarray
    """Smoothed [m], shape (frame, cap, 3), and its variance."""
    position_var: np.ndarray
    velocity: np.ndarray
    velocity_var: np.ndarray


def compare(
    t: np.ndarray, p_WE: np.ndarray, noise_sd: np.ndarray, kick: np.ndarray, quality: np.ndarray, order: int
) -> Compared:
    """Fit one density a cap by likelihood, use it BURSTS times, smooth, and predict what is left out.

    p_WE: [m], shape (frame, cap, 3). noise_sd: [m], shape (cap, 3). kick: [m^2/s^2], shape (frame - 1,). quality: codes
    of `smooth`, shape (frame, cap); outliers are not used and not predicted, jumps are free.
    """
    n, caps, _ = p_WE.shape
    zero = np.zeros(n - 1)
    unit = covariance(t, 1.0, zero, zero, order, prior=(0.0,) * order)
    p, v = np.zeros_like(p_WE), np.zeros_like(p_WE)
    var_p, var_v = np.zeros_like(p_WE), np.zeros_like(p_WE)
    scores, distances = [], []
    for cap in range(caps):
        jump = np.where(quality[1:, cap] == JUMP, JUMP_SD**2, 0.0)
        rest = covariance(t, 0.0, kick, jump, order)
        used = np.flatnonzero((quality[:, cap] != OUTLIER) & (quality[:, cap] != MISSING))
        y = p_WE[:, cap] - p_WE[used[0], cap]
        cov = rest + BURSTS * _likeliest(rest, unit, y[used], noise_sd[cap], used * order) * unit
        distance = np.zeros(n)
        for axis in range(3):
            noise = noise_sd[cap, axis] ** 2
            mean, var = _posterior(cov, y[:, axis], noise, used, order)
            p[:, cap, axis], var_p[:, cap, axis] = mean[:, 0] + p_WE[used[0], cap, axis], var[:, 0]
            v[:, cap, axis], var_v[:, cap, axis] = mean[:, 1], var[:, 1]
            for fold in range(FOLDS):
                out = used[(used % FOLDS == fold) & (used > 1) & (used < n - 2)]
                mean, var = _posterior(cov, y[:, axis], noise, np.setdiff1d(used, out), order)
                spread = var[out, 0] + noise
                z2 = (y[out, axis] - mean[out, 0]) ** 2 / spread
                distance[out] += z2
                scores.append(-0.5 * (np.log(2 * np.pi * spread) + z2))
        distances.append(distance[used[(used > 1) & (used < n - 2)]])
    inside = float(np.mean(np.concatenate(distances) < chi2_quantile(0.95)))
    return Compared(float(np.mean(np.concatenate(scores))), inside, p, var_p, v, var_v)


def _likeliest(rest: np.ndarray, unit: np.ndarray, y: np.ndarray, sd: np.ndarray, here: np.ndarray) -> float:
    """Density of highest likelihood of the three axes; y: shape (frame, 3), here: rows of the observed positions."""
    known, one = rest[np.ix_(here, here)], unit[np.ix_(here, here)]

    def loglik(decade: float) -> float:
        total = 0.0
        for axis in range(3):
            root = np.linalg.cholesky(known + 10.0**decade * one + sd[axis] ** 2 * np.eye(len(here)))
            total -= 0.5 * float(np.sum(np.linalg.solve(root, y[:, axis]) ** 2)) + float(np.sum(np.log(np.diag(root))))
        return total

    best = max(np.arange(*DECADES, 0.5), key=loglik)
    return float(10.0 ** max(best + np.linspace(-0.4, 0.4, 9), key=loglik))


def _posterior(
    cov: np.ndarray, y: np.ndarray, noise: float, used: np.ndarray, order: int
) -> tuple[np.ndarray, np.ndarray]:
    """Means and variances of all states, both of shape (frame, order)."""
    here = used * order
    gain = np.linalg.solve(cov[np.ix_(here, here)] + noise * np.eye(len(used)), cov[here]).T
    mean = gain @ y[used]
    var = np.diag(cov) - np.sum(gain * cov[:, here], axis=1)
    return mean.reshape(-1, order), var.reshape(-1, order)
