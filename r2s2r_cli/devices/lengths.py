"""Capacitances of the sensors as lengths of the cables, by the line of each sensor in robot.toml."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import InputError

if TYPE_CHECKING:
    from schemas.robot import Limits, Robot

NOT_INITIALISED = 0.20e-12
"""Capacitance [F] that the boards send while their sensor chip is not initialised (firmware of ChemStud24/tensegrity):
no reading."""
FROZEN_SAMPLES = 20
"""At 10 Hz two seconds: a live sensor's last digit has moved by then."""
LIMIT_MARGIN = 0.02
"""[m] beyond the robot's limits up to which a length is believed. Assumption: 90 % of recalibrations a day later differ
by less than 18 mm."""


@dataclass(frozen=True)
class Lengths:
    """slope [F/m], offset [F]: of every sensor, (sensor,). cable: that each sensor measures, (sensor,), int64.

    cables: how many there are.
    """

    slope: np.ndarray
    offset: np.ndarray
    cable: np.ndarray
    cables: int

    @classmethod
    def of(cls, robot: Robot) -> Lengths:
        """Of a robot description. Raises InputError where a sensor of a winched cable is missing or not calibrated."""
        measured = {sensor.cable: sensor for sensor in robot.sensors}
        for cable in robot.actuated:
            sensor = measured.get(cable)
            if sensor is None or not sensor.slope_f_per_m or sensor.offset_f is None:
                raise InputError(
                    f"the sensor of cable {cable} is not calibrated", where=f"robot.toml, sensors of cable {cable}",
                    expected="slope_f_per_m and offset_f", received="neither" if sensor else "no such sensor",
                    hint="r2s2r calibrate --points points.csv   # of the rig: r2s2r rig --points points.csv before it",
                )  # fmt: skip
        nan = float("nan")
        return cls(
            slope=np.array([sensor.slope_f_per_m or nan for sensor in robot.sensors]),
            offset=np.array([nan if sensor.offset_f is None else sensor.offset_f for sensor in robot.sensors]),
            cable=np.array([sensor.cable for sensor in robot.sensors], dtype=np.int64),
            cables=len(robot.cables),
        )

    def __call__(self, capacitance: np.ndarray) -> np.ndarray:
        """Lengths of all cables [m], (..., cable), of capacitances [F], (..., sensor). NaN: no sensor, no reading."""
        length = np.full((*capacitance.shape[:-1], self.cables), np.nan)
        length[..., self.cable] = (readings(capacitance) - self.offset) / self.slope
        return length


def believed(length: np.ndarray, limits: Limits) -> np.ndarray:
    """Lengths [m] with NaN where none can be: beyond the robot's limits by more than LIMIT_MARGIN. A digit lost on the
    way makes metres of one: a controller that sums it up would pull the wrong way for seconds."""
    low, high = limits.cable_length_min_m - LIMIT_MARGIN, limits.cable_length_max_m + LIMIT_MARGIN
    return np.where((length >= low) & (length <= high), length, np.nan)


def readings(capacitance: np.ndarray) -> np.ndarray:
    """Capacitances [F] with NaN where a board has sent that its sensor chip is not initialised."""
    return np.where(not_initialised(capacitance), np.nan, capacitance)


def not_initialised(capacitance: np.ndarray) -> np.ndarray:
    """Which capacitances [F] say that a sensor chip is not initialised; NaN says nothing."""
    return np.abs(capacitance - NOT_INITIALISED) < 1e-15


def frozen(values: np.ndarray) -> bool:
    """Whether a sensor hangs: all that was heard of it, finite, is one number; a few are no evidence."""
    return len(values) >= FROZEN_SAMPLES and bool(np.ptp(values) == 0)
