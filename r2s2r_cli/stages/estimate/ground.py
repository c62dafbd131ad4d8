"""The ground plane that the caps stand on, from the heights of the caps that touch it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

REACH = 2
"""Frames to each side that choose the lowest cap."""
BLOCKS = 10
"""Parts of a run whose scatter gives the standard deviation of the offset: neighbouring frames are not independent."""
SLOPE_SD_MAX = 0.02
"""About 1 degree. Beyond, the contacts say nothing useful about the slope of the ground."""


@dataclass(frozen=True)
class Ground:
    """Ground plane in the frame of the recording."""

    shift: float
    """What to add to z so that the ground lies at 0 [m]."""
    shift_sd: float
    """[m]"""
    slope: np.ndarray | None
    """dz/dx and dz/dy, or None where the contacts do not spread widely enough."""
    slope_sd: np.ndarray | None


def find_ground(p_WE: np.ndarray, used: np.ndarray, radius: np.ndarray) -> Ground:
    """Height and slope of the ground from observed caps.

    p_WE: observed caps [m], shape (frame, cap, 3). used: bool, shape (frame, cap). radius: of the caps [m],
    shape (cap,).

    At every moment some cap touches the ground: the lowest one. The lowest of several noisy heights is too low on
    average, so the cap is chosen by the mean height in the two frames before and after, and its height is read in the
    frame itself, whose noise had no part in the choice. The offset is the median of these heights, for a tracker jumps
    now and then. The slope is a plane through the same points, reported and never applied: a camera sees the floor to
    0.1 degree (docs/concepts/estimate.md), better than heights with a millimetre of bias a cap can.
    """
    height = np.where(used, p_WE[:, :, 2] - radius, np.nan)
    lowest = np.argmin(np.nan_to_num(_neighbours(height), nan=np.inf), axis=1)
    rows = np.arange(len(p_WE))
    good = np.isfinite(height[rows, lowest])
    z = height[rows, lowest][good]
    xy = p_WE[rows, lowest, :2][good]
    blocks = np.array([np.median(part) for part in np.array_split(z, min(BLOCKS, len(z) // 2))])
    slope, slope_sd = _plane(xy, z)
    return Ground(
        shift=float(-np.median(z)),
        shift_sd=float(np.std(blocks, ddof=1) / np.sqrt(len(blocks))),
        slope=slope,
        slope_sd=slope_sd,
    )


def _neighbours(height: np.ndarray) -> np.ndarray:
    """Mean over the frames within REACH, the frame itself left out, shape (frame, cap); NaN where there is none."""
    n = len(height)
    total, count = np.zeros_like(height), np.zeros_like(height)
    for shift in (*range(-REACH, 0), *range(1, REACH + 1)):
        here = np.arange(max(0, -shift), min(n, n - shift))
        there = height[here + shift]
        total[here] += np.nan_to_num(there)
        count[here] += np.isfinite(there)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _plane(xy: np.ndarray, z: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Least-squares slope and its standard deviation, corrected for neighbouring residuals being alike."""
    middle = np.mean(xy, axis=0)
    design = np.column_stack([np.ones(len(z)), xy - middle])
    normal = design.T @ design
    if len(z) < 2 * BLOCKS or np.linalg.cond(normal) > 1e12:
        return None, None
    keep = np.ones(len(z), dtype=bool)
    fit = np.zeros(3)
    for _ in range(2):
        fit = np.linalg.lstsq(design[keep], z[keep], rcond=None)[0]
        residual = z - design @ fit
        scale = 1.4826 * np.median(np.abs(residual))
        keep = np.abs(residual) <= max(4.0 * scale, 1e-9)
    rest = residual[keep]
    alike = float(np.clip(np.sum(rest[1:] * rest[:-1]) / max(np.sum(rest**2), 1e-300), 0.0, 0.95))
    variance = np.sum(rest**2) / max(len(rest) - 3, 1) * (1 + alike) / (1 - alike)
    sd = np.sqrt(variance * np.diag(np.linalg.inv(design[keep].T @ design[keep])))[1:]
    return (fit[1:], sd) if np.all(sd < SLOPE_SD_MAX) else (None, None)
