"""What is left above the floor, and how much of that an effect explains (docs/concepts/measures.md)."""

from __future__ import annotations

import numpy as np

NO_GAP_FACTOR = 1.25
"""There is no gap where the refit RMSE is surely below this many floors."""
TINY = 1e-9
"""Of a number of segments: shares are not exact."""


def counting(worst: np.ndarray, kept: float) -> np.ndarray:
    """Which of squared errors (..., segment), of several models the largest, are among the share `kept` of the best; no
    error that is not finite is."""
    worst = np.where(np.isfinite(worst), worst, np.inf)
    last = int(np.floor(kept * (worst.shape[-1] - 1) + TINY))
    return np.asarray((worst <= np.sort(worst, axis=-1)[..., last : last + 1]) & np.isfinite(worst))


def kept_rmse(squared: np.ndarray, kept: float) -> float:
    """Root mean square [m] of the share `kept` of the best of squared errors (segment,) [m^2]."""
    return float(np.sqrt(np.mean(squared[counting(squared, kept)])))


def corrected_gap(mse: float, floor_m: float) -> float:
    """G = sqrt(max(0, MSE - floor^2)) [m]; mse [m^2]."""
    return float(np.sqrt(max(0.0, mse - floor_m**2)))


def own_share(refit: np.ndarray, with_effect: np.ndarray, floor_m: float) -> float | None:
    """(G_refit - G_refit+effect) / G_refit of mean squared errors by test segment, both (segment,) [m^2].

    The squared errors are pooled over the segments before the ratio, so that one small segment cannot blow it up.
    None ("at floor") where G_refit is below half the floor: a share of nothing.
    """
    before, after = (corrected_gap(float(np.mean(mse)), floor_m) for mse in (refit, with_effect))
    return None if before < 0.5 * floor_m or before == 0.0 else (before - after) / before


def no_gap(upper_90_m: float, floor_m: float) -> bool:
    """Whether the upper 90 % bound of the refit RMSE (`bootstrap.upper_bound`) lies below 1.25 floor.

    A test of equivalence: little data leaves the bound high and says nothing, instead of finding no gap.
    """
    return upper_90_m < NO_GAP_FACTOR * floor_m
