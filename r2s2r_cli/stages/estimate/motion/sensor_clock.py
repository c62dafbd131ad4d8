"""How much later than the camera the sensors show a length: clock offset and lag of the sensors together.

The two cannot be told apart by lengths alone, and need not be: both shift what the sensors show against the frames.
"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.estimate.motion.data import Readings, SensorClock

STEP_S = 0.01
CLEAR_M = 0.004
"""[m] Lengths that the camera knows worse than this say nothing."""
MOVED_M = 0.002
"""[m] A cable whose length scatters less than this tells no time."""
KNOWN_SD_S = 0.02
LEAST = 30
"""Fewest samples of a sensor."""


def find_clock(
    t: np.ndarray, length: np.ndarray, rate: np.ndarray, sd: np.ndarray, readings: Readings, range_s: float
) -> SensorClock:
    """The delay with the least squares between shown lengths and those that the camera saw that much earlier.

    t: frames [s]; length, rate, sd: of each sensor's cable by the camera [m], [m/s], [m], all (frame, sensor). Every
    sensor may have an offset, a gain and a bow of its own: what is left is a matter of time. The standard deviation
    counts neighbouring residuals as alike where they are.
    """
    grid = np.arange(-range_s, range_s + STEP_S / 2, STEP_S)
    total = np.zeros(len(grid))
    curve = np.zeros(len(grid))
    used = 0
    for s in range(length.shape[1]):
        shown = readings.length[:, s]
        good = np.isfinite(shown) & np.isfinite(readings.t)
        stamp, shown = readings.t[good], shown[good]
        order = np.argsort(stamp, kind="stable")
        stamp, shown = stamp[order], shown[order]
        inside = (stamp > t[0] + range_s) & (stamp < t[-1] - range_s)
        stamp, shown = stamp[inside], shown[inside]
        clear = length[sd[:, s] < CLEAR_M, s]
        if len(stamp) < LEAST or len(clear) < LEAST or np.std(clear) < MOVED_M:
            continue
        squares = np.array([_residual(t, length[:, s], rate[:, s], sd[:, s], stamp, shown, at) for at in grid])
        valid = np.all(np.isfinite(squares), axis=0)
        if np.sum(valid) < LEAST:
            continue
        squares = squares[:, valid]
        mean = np.mean(squares**2, axis=1)
        best = squares[int(np.argmin(mean))]
        alike = float(np.clip(np.sum(best[1:] * best[:-1]) / max(float(np.sum(best**2)), 1e-30), 0.0, 0.95))
        count = np.sum(valid) * (1 - alike) / (1 + alike)
        total += 0.5 * count * mean / max(float(mean.min()), 1e-12)
        used += 1
    if not used:
        return SensorClock(0.0, float("inf"), False)
    k = int(np.argmin(total))
    if k in (0, len(grid) - 1):
        return SensorClock(0.0, float("inf"), False)
    curve = total[k - 1 : k + 2]
    bend = float(curve[0] - 2 * curve[1] + curve[2])
    if bend <= 0:
        return SensorClock(0.0, float("inf"), False)
    delay = float(grid[k] + STEP_S * 0.5 * (curve[0] - curve[2]) / bend)
    sd_s = float(STEP_S / np.sqrt(bend))
    known = sd_s < KNOWN_SD_S
    return SensorClock(delay if known else 0.0, sd_s, known)


def _residual(
    t: np.ndarray, length: np.ndarray, rate: np.ndarray, sd: np.ndarray, stamp: np.ndarray, shown: np.ndarray, at: float
) -> np.ndarray:
    """Shown minus the best offset, gain and bow of lengths `at` earlier; NaN where the camera does not know them."""
    when = stamp - at
    k = np.clip(np.searchsorted(t, when, side="right") - 1, 0, len(t) - 2)
    seen = hermite(t, length, rate, k, when)
    clear = (sd[k] < CLEAR_M) & (sd[k + 1] < CLEAR_M) & (when >= t[0]) & (when <= t[-1])
    if np.sum(clear) < LEAST:
        return np.full(len(stamp), np.nan)
    s = (seen - np.mean(seen[clear])) / max(float(np.std(seen[clear])), 1e-4)
    design = np.column_stack([np.ones(len(s)), s, s**2])
    weight = clear.astype(float)
    for _ in range(3):
        fit = np.linalg.lstsq(design * weight[:, None], shown * weight, rcond=None)[0]
        residual = shown - design @ fit
        scale = max(1.4826 * float(np.median(np.abs(residual[clear]))), 1e-6)
        weight = clear / np.maximum(np.abs(residual) / (3 * scale), 1.0)
    return np.where(clear, np.clip(residual, -4 * scale, 4 * scale), np.nan)


def hermite(t: np.ndarray, y: np.ndarray, slope: np.ndarray, k: np.ndarray, when: np.ndarray) -> np.ndarray:
    """Cubic through values and slopes at frames k and k + 1, at times `when`."""
    dt = t[k + 1] - t[k]
    s = (when - t[k]) / dt
    a, b = y[k], y[k + 1]
    return np.asarray(
        (1 + 2 * s) * (1 - s) ** 2 * a + s * (1 - s) ** 2 * dt * slope[k]
        + s**2 * (3 - 2 * s) * b + s**2 * (s - 1) * dt * slope[k + 1]
    )  # fmt: skip
