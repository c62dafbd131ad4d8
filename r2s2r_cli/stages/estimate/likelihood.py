"""Likelihood of a grid of process noises: the forward pass of `kalman`, without all that only a smoother needs.

The 2 x 2 matrices are written out, which is several times as fast; most of the time of a smoothing goes in here.
"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.kalman import PRIOR_SD, Disturbances


def log_likelihood(
    t: np.ndarray, y: np.ndarray, var: np.ndarray, density: np.ndarray, free: Disturbances
) -> np.ndarray:
    """Log likelihood of the innovations, shape (grid, series); arguments as of `kalman.forward`.

    A state is position `x` and velocity `v`, its covariance [[a, b], [b, c]].
    """
    n, series = y.shape
    shape = (len(density), series)
    density = np.broadcast_to(density, shape)
    seen = np.isfinite(y)
    x = np.broadcast_to(y[np.argmax(seen, axis=0), np.arange(series)], shape)
    v, b = np.zeros(shape), np.zeros(shape)
    a, c = (np.full(shape, sd**2) for sd in PRIOR_SD)
    total = np.zeros(shape)
    for k in range(n):
        r = var[k]
        e = np.where(seen[k], y[k] - x, 0.0)
        s = a + r
        total -= 0.5 * np.where(seen[k], np.log(2 * np.pi * s) + e**2 / s, 0.0)
        if k + 1 == n:
            break
        weight = np.where(seen[k], 1.0 / s, 0.0)
        g, h = a * weight, b * weight  # gain
        x, v = x + g * e, v + h * e
        left, below = 1.0 - g, b - h * a
        # Joseph's form of the update, as in `kalman.update`; then the gap to the next frame.
        a, b, c = left**2 * a + r * g**2, left * below + r * g * h, c - h * b - h * below + r * h**2
        dt = float(t[k + 1] - t[k])
        q = density + free.kick[k] / dt
        x = x + dt * v
        a = a + 2 * dt * b + dt**2 * c + q * (dt**3 / 3) + free.jump[k]
        b = b + dt * c + q * (dt**2 / 2)
        c = c + q * dt
    return total
