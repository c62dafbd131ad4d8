"""Boards of the rig on a plant that has settled, for tests of what they measure and when."""

from __future__ import annotations

from typing import Any

import numpy as np

from r2s2r_cli.rig.firmware import BoardSample, Firmware, nominal_calibration
from r2s2r_cli.rig.plant import Plant
from r2s2r_cli.rig.world import World
from tests.support.rig_robots import known

TICK = 0.02
EXACT = {
    "day_sd_m": 0.0, "drift_sd_m": 0.0, "bow_sd_m": 0.0, "noise_sd_m": 0.0, "lag_s": 0.0, "converter": "exact",
    "dropout_share": 0.0,
}  # fmt: skip
"""Sensors that tell the truth."""
ROBOT = known()
ALL = tuple(range(9))
"""Sensors of the robot."""
GAIT = np.array([0.8, 0.0, 0.5, 0.0, -0.1, 0.0])


def make(**tables: Any) -> tuple[Firmware, Plant]:
    """Boards on a plant that has settled quickly."""
    world = World.model_validate({"start": {"settle_s": 0.2}, **tables})
    plant = Plant(ROBOT, world)
    return Firmware(ROBOT, world, plant), plant


def run(firmware: Firmware, seconds: float, tick: float = TICK) -> list[BoardSample]:
    """What the boards send while nothing is commanded."""
    start, samples = firmware.t, []
    for k in range(1, round(seconds / tick) + 1):
        samples += firmware.tick(start + k * tick)
    return samples


def lengths_of(pF: np.ndarray) -> np.ndarray:
    """Lengths by the nominal calibration [m]."""
    slope, offset = nominal_calibration(ROBOT, World().sensors)
    return np.asarray((pF * 1e-12 - offset) / slope)
