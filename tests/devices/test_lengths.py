"""Capacitances as lengths."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from r2s2r_cli.devices.lengths import Lengths
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import Robot
from tests.support.wire_robot import OFFSET, SLOPE, calibrated


def test_lengths_invert_the_line_of_each_sensor() -> None:
    """C = slope L + offset, backwards; 0.20 pF is no reading; sensors may stand in any order."""
    robot = calibrated()
    robot = robot.model_copy(update={"sensors": robot.sensors[::-1]})
    length = np.linspace(0.1, 0.3, 9)
    capacitance = (SLOPE * length + OFFSET)[::-1].copy()
    np.testing.assert_allclose(Lengths.of(robot)(capacitance), length, rtol=1e-12)
    capacitance[8] = 0.2e-12
    found = Lengths.of(robot)(np.stack([capacitance, capacitance]))
    assert found.shape == (2, 9) and np.isnan(found[:, 0]).all() and np.isfinite(found[:, 1:]).all()


def test_a_winched_cable_without_calibration_is_an_error_of_input() -> None:
    """The message names the cable, and the command that helps."""
    robot = Robot.model_validate(tomllib.loads(robot_toml("threebar", "surface")))
    with pytest.raises(InputError, match="cable 0 is not calibrated") as caught:
        Lengths.of(robot)
    assert "r2s2r calibrate" in caught.value.hint
