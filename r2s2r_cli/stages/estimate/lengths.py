"""Cable lengths: from the caps, and from the sensors where there are any."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.stages.sensed import sensed_lengths
from schemas.robot import Robot


@dataclass(frozen=True)
class SensorLengths:
    """Lengths that the cable sensors gave."""

    length: np.ndarray
    """[m], shape (frame, sensor); NaN where no reading is near enough."""
    cable: np.ndarray
    """Cable of each sensor, shape (sensor,)."""


def cap_distances(p_WE: np.ndarray, cov_p: np.ndarray, caps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance between the caps of each cable and its standard deviation [m], both of shape (frame, cable).

    p_WE: [m], shape (frame, cap, 3). cov_p: [m^2], shape (frame, cap, 3, 3). caps: shape (cable, 2). The two caps lie
    on different rods, so their errors count as independent.
    """
    a, b = caps[:, 0], caps[:, 1]
    bar = p_WE[:, b] - p_WE[:, a]
    length = np.linalg.norm(bar, axis=-1)
    u = bar / np.maximum(length, 1e-9)[..., None]
    variance = np.einsum("tci,tcij,tcj->tc", u, cov_p[:, a] + cov_p[:, b], u)
    return length, np.sqrt(variance)


def sensor_lengths(t: np.ndarray, sensors: Group, robot: Robot, gap_s: float) -> SensorLengths | None:
    """Lengths of the cable sensors at the frames; None where no sensor gives any.

    t: stamps of the frames [s]. The recording's own lengths are taken where it has them, else capacitances through
    the lines of robot.toml. Between two readings at most `gap_s` apart the length is interpolated linearly.
    """
    found = sensed_lengths(sensors, robot)
    if found is None:
        return None
    readings, cable = found
    lengths = np.column_stack([_at(t, sensors["t"], column, gap_s) for column in readings.T])
    return SensorLengths(lengths, cable) if np.any(np.isfinite(lengths)) else None


def _at(t: np.ndarray, stamps: np.ndarray, values: np.ndarray, gap_s: float) -> np.ndarray:
    good = np.isfinite(values) & np.isfinite(stamps)
    if np.sum(good) < 2:
        return np.full(len(t), np.nan)
    stamps, values = stamps[good], values[good]
    after = np.clip(np.searchsorted(stamps, t), 1, len(stamps) - 1)
    near = (stamps[after] - stamps[after - 1] <= gap_s) & (t >= stamps[0]) & (t <= stamps[-1])
    near |= np.isin(t, stamps)  # a reading at the very stamp needs no other, whatever gap lies beside it
    return np.where(near, np.interp(t, stamps, values), np.nan)
