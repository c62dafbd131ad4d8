"""How much the readings of a length sensor scatter, from the readings alone."""

from __future__ import annotations

import numpy as np

LENGTH_NOISE_M = 2e-3
"""Least noise of a length sensor: its calibration and its own delay are no better."""


def noise_of(length: np.ndarray) -> np.ndarray:
    """Sd of a sensor's readings (sensor,) [m], from second differences of its own rows: what moves smoothly drops out
    of them. Boards of a wireless robot take turns, so that a row of the log need not have all sensors. LENGTH_NOISE_M
    where there are fewer than three."""
    return np.array([_noise_of(one[np.isfinite(one)]) for one in length.T])


def _noise_of(length: np.ndarray) -> float:
    bend = length[2:] - 2 * length[1:-1] + length[:-2]
    size = float(np.median(np.abs(bend))) / 0.6745 / np.sqrt(6.0) if len(bend) else np.nan
    return size if np.isfinite(size) else LENGTH_NOISE_M
