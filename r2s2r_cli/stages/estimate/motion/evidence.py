"""Everything that is known of a run besides the states: data, and the present guesses of noise and contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Evidence:
    """Of every frame; weights are 1 / variance, 0 where there is nothing."""

    t: np.ndarray
    """[s], (frame,)."""
    seen: np.ndarray
    """Sighted caps [m], (frame, cap, 3); 0 where there is none."""
    information: np.ndarray
    """Of the sightings [1/m^2], (frame, cap, 3, 3); 0 where there is none."""
    across: np.ndarray
    """Shared errors of one standard deviation [m], (frame, cap, 3, ACROSS)."""
    density: np.ndarray
    """Of the white acceleration [m^2/s^3], (frame - 1, cap)."""
    kick: np.ndarray
    """Variance of a change of velocity in the gap [m^2/s^2], (frame - 1,)."""
    shown: np.ndarray
    """Mean of the sensor samples nearest to the frame [m], (frame, sensor)."""
    later: np.ndarray
    """By how much these were taken after the frame [s], (frame, sensor)."""
    samples: np.ndarray
    """How many, (frame, sensor)."""
    sensor_weight: np.ndarray
    """[1/m^2], (frame, sensor)."""
    sensor_drift: np.ndarray
    """Variance of the change of a sensor's offset over each gap [m^2], (frame - 1, sensor)."""
    sighting_bend: float | None
    """Beyond so many standard deviations the cost of a sighting grows linearly; None: Student's t, which lets it go."""
    sensor_bend: float | None
    """Beyond so many standard deviations the cost of a sensor grows linearly; None: never."""
    touching: np.ndarray
    """Probability that a cap carries weight, (frame, cap); 0 everywhere while it is not asked for."""

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.t)
