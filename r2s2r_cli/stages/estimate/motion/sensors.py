"""Samples of the cable sensors at the frames they belong to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.estimate.motion.data import Readings


@dataclass(frozen=True)
class Binned:
    """Means of the samples nearest to each frame, shapes (frame, sensor)."""

    shown: np.ndarray
    """[m]; 0 where there is none."""
    later: np.ndarray
    """How much later than the frame they were taken, on average [s]."""
    samples: np.ndarray
    """How many."""


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
