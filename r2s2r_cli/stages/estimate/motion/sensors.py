"""Samples of the cable sensors at the frames they belong to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.estimate.motion.data import Readings

LATE_S = 0.03
"""[s] By which a sensor may be late besides its usual delay: 10 ms, which ten neighbouring frames have in common. A
sensor follows its cable as a lag does, not as a clock that is late, and no two are alike."""
BOW, BOW_M = 0.03, 0.03
"""How much the offset of a sensor changes with its length, as a share, and over which change of length [m] that share
stays the same: calibrations are straight lines through points that lie on bows of 2 mm."""
DEAD_NOISE_M = 0.02
"""[m] A sensor with more noise than this says nothing."""


@dataclass(frozen=True)
class Binned:
    """Means of the samples nearest to each frame, shapes (frame, sensor)."""

    shown: np.ndarray
    """[m]; 0 where there is none."""
    later: np.ndarray
    """How much later than the frame they were taken, on average [s]."""
    samples: np.ndarray
    """How many."""


def sample_variance(samples: np.ndarray, noise: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Of means of so many samples (frame, sensor) with `noise` (sensor,) [m]; lengths change by `rate` [m/s]."""
    return np.asarray(noise**2 / np.maximum(samples, 1) + (LATE_S * rate) ** 2)


def sample_weights(samples: np.ndarray, noise: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """1 / variance; 0 where there is no sample, and for sensors that say nothing."""
    return np.where((noise < DEAD_NOISE_M) & (samples > 0), 1.0 / sample_variance(samples, noise, rate), 0.0)


def offset_drift(t: np.ndarray, rate: np.ndarray, walk_m: float) -> np.ndarray:
    """Variance of the change of each offset over each gap [m^2], (frame - 1, sensor): with time, and with length."""
    dt = np.diff(t)[:, None]
    change = dt * 0.5 * np.abs(rate[1:] + rate[:-1])
    return np.asarray(walk_m**2 * dt + BOW**2 * BOW_M * change)


def bin_readings(t: np.ndarray, readings: Readings, delay_s: float) -> Binned:
    """t: stamps of the frames [s]; delay_s: of the sensors' clock, see `SensorClock`.

    A sample belongs to the nearest frame, at most half a median gap away at the ends.
    """
    stamp = readings.t - delay_s
    ok = np.isfinite(stamp)
    stamp, length = stamp[ok], readings.length[ok]
    middle = 0.5 * (t[1:] + t[:-1])
    frame = np.searchsorted(middle, stamp)
    reach = 0.5 * float(np.median(np.diff(t))) + 1e-9
    off = stamp - t[frame]
    near = np.abs(off) <= np.maximum(reach, 0.0)
    frame, off, length = frame[near], off[near], length[near]
    good = np.isfinite(length)
    shape = (len(t), length.shape[1])
    count, total, late = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    np.add.at(count, frame, good)
    np.add.at(total, frame, np.where(good, length, 0.0))
    np.add.at(late, frame, np.where(good, off[:, None], 0.0))
    some = np.maximum(count, 1)
    return Binned(total / some, late / some, count)
