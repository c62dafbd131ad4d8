"""Who moves the robot alike is simulated once, and sees the same as if it had been simulated alone."""

from __future__ import annotations

import numpy as np
import torch

from r2s2r_cli.stages.diagnose.which.motion import first_of_each, moves_nothing
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.identified import nominal
from tests.support.builders import robot

MODEL = Model(nominal(robot()), effects=("backlash", "sensor_bias", "sensor_gain", "camera_delay"))


def first_and_back(values: np.ndarray, starts: np.ndarray, delays: np.ndarray) -> tuple[list[int], list[int]]:
    """Of hypotheses with two stretches each."""
    first, back = first_of_each(MODEL.structure, MODEL.packed(values), torch.as_tensor(starts), delays)
    return first.tolist(), back.tolist()


def test_sensors_and_cameras_move_nothing_and_winches_do() -> None:
    """By their hooks. A camera's delay makes commands later by its clock, which is counted beside."""
    quiet = moves_nothing(MODEL.structure)
    assert {name.split(".")[0] for name in quiet} == {"sensor_bias", "sensor_gain", "camera_delay"}


def test_only_what_moves_the_robot_counts() -> None:
    """Another bias is the same motion; another play, start, or delay of the commands is another one."""
    values = np.repeat(MODEL.values0[None], 6, axis=0)
    starts = np.zeros((12, 7))
    delays = np.zeros(6)
    values[1, MODEL.off("sensor_bias")[0]] = 0.003
    values[2, MODEL.off("backlash")[0]] = 0.003
    starts[7, 2] = 1e-12
    delays[4] = 0.01
    values[5] = values[2]
    assert first_and_back(values, starts, delays) == ([0, 2, 3, 4], [0, 0, 1, 2, 3, 1])
