"""Fixed-interval smoothing of many independent positions on irregular stamps: one pass forward, one back.

Kalman filter and Rauch-Tung-Striebel smoother (Rauch, Tung and Striebel 1965; both covariance updates in Joseph's
form, which stays positive under rounding). The backward pass also carries the score vector of the disturbance smoother
(Durbin and Koopman, Time Series Analysis by State Space Methods, 2nd ed., section 4.5): it gives the tests for
outliers and jumps with no further pass (auxiliary residuals, Harvey and Koopman 1992).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PRIOR_SD = (10.0, 10.0)
"""Vague start: m, m/s. So wide that it moves no smoothed state by more than 1e-5 of itself, and narrow
enough that rounding (1e-16 of the square) stays below every variance that is wanted."""


@dataclass(frozen=True)
class Disturbances:
    """What may move a state besides the process noise; one value a gap between frames k and k + 1."""

    kick: np.ndarray
    """Variance of the change of velocity in the gap [m^2/s^2], shape (frame - 1,)."""
    jump: np.ndarray
    """Variance of a jump of position in the gap [m^2], shape (frame - 1, series)."""


@dataclass(frozen=True)
class Filtered:
    """Forward pass. `loglik` has one row a grid point, the other arrays belong to the last one."""

    loglik: np.ndarray
    """Log likelihood of the innovations, shape (grid, series)."""
    density: np.ndarray
    """Spectral density of the process noise, shape (series,)."""
    mean: np.ndarray
    """Predicted states, shape (frame, series, 2)."""
    cov: np.ndarray
    """Their covariance, shape (frame, series, 2, 2)."""
    innovation: np.ndarray
    """Observed minus predicted [m], shape (frame, series); 0 where nothing was used."""
    innovation_var: np.ndarray
    """Variance of the innovation [m^2], shape (frame, series)."""
    gain: np.ndarray
    """Kalman gain, shape (frame, series, 2); 0 where nothing was used."""


@dataclass(frozen=True)
class Smoothed:
    """Backward pass, shapes (frame, series, 2), (frame, series, 2, 2) and (frame, series)."""

    mean: np.ndarray
    cov: np.ndarray
    outlier: np.ndarray
    """Leave-one-out residual of each observation over its standard deviation; 0 where nothing was used."""
    jump: np.ndarray
    """Score of a jump of position just before each frame, over its standard deviation; 0 for the first frame."""


def transition(dt: float) -> np.ndarray:
    """State transition over `dt` [s] of position and velocity."""
    return np.array([[1.0, dt], [0.0, 1.0]])


def process(dt: float) -> np.ndarray:
    """Covariance over `dt` [s] of unit white acceleration."""
    return np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])


def forward(t: np.ndarray, y: np.ndarray, var: np.ndarray, density: np.ndarray, free: Disturbances) -> Filtered:
    """Kalman filter of every series and every process noise of a grid at once.

    t: stamps [s], shape (frame,), increasing. y: positions [m], shape (frame, series), NaN where there is none.
    var: variance of the noise [m^2], above 0, shape (frame, series). density: spectral densities of the white
    acceleration [m^2/s^3], shape (grid, series) or (grid, 1).
    """
    n, series = y.shape
    density = np.broadcast_to(density, (len(density), series))
    seen = np.isfinite(y)
    x = np.zeros((len(density), series, 2))
    x[:, :, 0] = y[np.argmax(seen, axis=0), np.arange(series)]
    cov = np.zeros((len(density), series, 2, 2))
    cov[:] = np.diag(np.square(PRIOR_SD))
    loglik = np.zeros(density.shape)
    means, covs, gains = (np.zeros((n, series, *shape)) for shape in ((2,), (2, 2), (2,)))
    innovations, variances = np.zeros((n, series)), np.ones((n, series))
    for k in range(n):
        means[k], covs[k] = x[-1], cov[-1]
        e = np.where(seen[k], y[k] - x[:, :, 0], 0.0)
        s = cov[:, :, 0, 0] + var[k]
        gain = np.where(seen[k][:, None], cov[:, :, :, 0] / s[:, :, None], 0.0)
        innovations[k], variances[k], gains[k] = e[-1], s[-1], gain[-1]
        loglik -= 0.5 * np.where(seen[k], np.log(2 * np.pi * s) + e**2 / s, 0.0)
        if k + 1 < n:
            step = transition(float(t[k + 1] - t[k]))
            x = (x + gain * e[:, :, None]) @ step.T
            cov = step @ update(cov, gain, var[k]) @ step.T + _noise(t, k, density, free)
    return Filtered(loglik, density[-1], means, covs, innovations, variances, gains)


def backward(t: np.ndarray, y: np.ndarray, var: np.ndarray, free: Disturbances, run: Filtered) -> Smoothed:
    """Smoothed states and the two scores, from the last grid point of a forward pass."""
    n, series, _ = run.mean.shape
    seen = np.isfinite(y)
    mean, cov = np.empty_like(run.mean), np.empty_like(run.cov)
    outlier, jump = np.zeros((n, series)), np.zeros((n, series))
    r, info = np.zeros((series, 2)), np.zeros((series, 2, 2))
    eye = np.eye(2)
    for k in range(n - 1, -1, -1):
        gain = run.gain[k]
        mean[k] = run.mean[k] + gain * run.innovation[k][:, None]
        cov[k] = update(run.cov[k], gain, var[k])
        if k + 1 < n:
            step = transition(float(t[k + 1] - t[k]))
            back = cov[k] @ step.T @ np.linalg.inv(run.cov[k + 1])
            rest = eye - back @ step
            mean[k] += np.einsum("sij,sj->si", back, mean[k + 1] - run.mean[k + 1])
            noise = cov[k + 1] + _noise(t, k, run.density[None], free)[0]
            cov[k] = rest @ cov[k] @ np.swapaxes(rest, 1, 2) + back @ noise @ np.swapaxes(back, 1, 2)
            r, info = r @ step, step.T @ info @ step
        weight = np.where(seen[k], 1.0 / run.innovation_var[k], 0.0)
        spread = weight + np.einsum("si,sij,sj->s", gain, info, gain)
        u = run.innovation[k] * weight - np.sum(gain * r, axis=1)
        outlier[k] = np.where(seen[k], u / np.sqrt(np.where(seen[k], spread, 1.0)), 0.0)
        keep = np.broadcast_to(eye, (series, 2, 2)).copy()
        keep[:, :, 0] -= gain
        r = np.einsum("sji,sj->si", keep, r)
        info = np.swapaxes(keep, 1, 2) @ info @ keep
        r[:, 0] += run.innovation[k] * weight
        info[:, 0, 0] += weight
        if k:
            jump[k] = r[:, 0] / np.sqrt(np.maximum(info[:, 0, 0], np.finfo(float).tiny))
    return Smoothed(mean, 0.5 * (cov + np.swapaxes(cov, -1, -2)), outlier, jump)


def update(cov: np.ndarray, gain: np.ndarray, var: np.ndarray) -> np.ndarray:
    """Covariance after an observation of variance `var` was taken in with `gain`; shapes as in `forward`."""
    keep = np.broadcast_to(np.eye(cov.shape[-1]), cov.shape).copy()
    keep[..., :, 0] -= gain
    return keep @ cov @ np.swapaxes(keep, -1, -2) + var[:, None, None] * gain[..., :, None] * gain[..., None, :]


def _noise(t: np.ndarray, k: int, density: np.ndarray, free: Disturbances) -> np.ndarray:
    """Covariance that the gap after frame k adds, shape (grid, series, 2, 2)."""
    dt = float(t[k + 1] - t[k])
    noise = (density[:, :, None, None] + free.kick[k] / dt) * process(dt)
    noise[:, :, 0, 0] += free.jump[k]
    return noise
