"""The rig's sensors on the bench: what `r2s2r calibrate --points` would have been given for them, the day before."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.rig.firmware.generators import generator
from r2s2r_cli.rig.firmware.sensors import StretchSensors
from r2s2r_cli.rig.world.file import World
from schemas.robot import Robot

POINTS = 5
"""Lengths at which each sensor is held."""
_RULE_SD_M = 0.0005
"""How well a length is set with a rule [m]; an assumption."""


def points_csv(robot: Robot, world: World) -> str:
    """A table of `set, sensor_id, length_mm, capacitance_pF`, five lengths a sensor over its working range.

    The sensors are those that `Firmware` makes of the same robot and world, without today's offset and drift: those are
    what a calibration of yesterday does not know.
    """
    sensors = StretchSensors(robot, world, generator(world, "sensors"))
    rng = generator(world, "bench")
    low, high = sensors.working_range
    rows = ["set,sensor_id,length_mm,capacitance_pF"]
    for share in np.linspace(1.0, 0.0, POINTS):
        length = low + share * (high - low)
        pF = sensors.on_the_bench(length, rng)
        told = length + _RULE_SD_M * rng.standard_normal(len(length))
        rows += [f"bench,{i},{1e3 * told[i]:.1f},{pF[i]:.2f}" for i in range(len(length))]
    return "\n".join(rows) + "\n"
