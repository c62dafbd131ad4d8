"""Nuisances that are simple shifts of what is seen: what is left of the camera's pose, offsets of the sensors, and the
height of each run's floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.stretches import Stretch

CAMERA = (("camera_height", "m", 2e-3), ("camera_tilt_x", "rad", 5e-3), ("camera_tilt_y", "rad", 5e-3))
"""What is left of the rigid alignment of the camera after levelling: name, unit, prior sd. Over the plane it is part of
where a stretch starts."""
SENSOR_SD = 3e-3
"""[m] What a length sensor is off by, the same all the time, before anything is called an effect."""
FLOOR_SD = 1e-3
"""[m] How well the height of the floor is known, run by run: each is levelled by its own lowest caps."""


@dataclass(frozen=True)
class Shifts:
    """sensors: cable of each. runs: names."""

    sensors: tuple[int, ...]
    runs: tuple[str, ...]

    @property
    def shared(self) -> tuple[str, ...]:
        """Names of those that are the same in every run, which come first."""
        return (*(name for name, _, _ in CAMERA), *(f"sensor_bias_{k}" for k in self.sensors))

    @property
    def names(self) -> tuple[str, ...]:
        """All, (q,)."""
        return (*self.shared, *(f"floor_{run}" for run in self.runs))

    @property
    def sd(self) -> list[float]:
        """Of their prior, (q,)."""
        return [sd for _, _, sd in CAMERA] + [SENSOR_SD] * len(self.sensors) + [FLOOR_SD] * len(self.runs)

    def columns(self, one: Stretch) -> np.ndarray:
        """What they add to what is seen of a stretch, per unit, (q, channel, F)."""
        F, caps, sensors = len(one.t), one.caps.shape[1], len(self.sensors)
        found = np.zeros((len(self.names), 3 * caps + sensors, F))
        found[: len(CAMERA), : 3 * caps] = camera_columns(one.caps).reshape(len(CAMERA), F, -1).transpose(0, 2, 1)
        for s in range(sensors):
            found[len(CAMERA) + s, 3 * caps + s] = 1.0
        found[len(self.shared) + self.runs.index(one.run), 2 : 3 * caps : 3] = 1.0
        return found


def camera_columns(caps: np.ndarray) -> np.ndarray:
    """What height and tilts of CAMERA add to caps (..., cap, 3), per unit, (3, ..., cap, 3)."""
    found = np.zeros((len(CAMERA), *caps.shape))
    found[0, ..., 2], found[1, ..., 2], found[2, ..., 2] = 1.0, caps[..., 1], -caps[..., 0]
    return found
