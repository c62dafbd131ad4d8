"""Identified values back into a robot description."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from r2s2r_cli.engine.parameters import shapes, value
from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.stages.identify.free import Mapping, with_values
from r2s2r_cli.stages.identify.free.catalogue import entries
from r2s2r_cli.stages.identify.free.entry import Entry
from r2s2r_cli.stages.model import parameters_of
from tests.support.varied import varied

ENTRIES = {
    name: entry for name, entry in entries(varied()).items() if not entry.effect or entry.element in (None, 2)
}  # of effects one element stands for all: their numbers are made in one loop
NOT_IN_ROBOT_TOML = {
    "motor_speed_in", "motor_speed_out", "motor_lag", "load_droop", "ground_slope_x", "ground_slope_y",
    "ground_height", "command_delay", "camera_delay",
}  # fmt: skip


@pytest.mark.parametrize("entry", ENTRIES.values(), ids=lambda entry: entry.free.name)
def test_the_written_robot_is_the_fitted_one(entry: Entry) -> None:
    """Parameters of the written robot are those of the fit; or the name comes back, and the robot stays as it is.

    Ends of the winches apart: robot.toml gives them as cap distances, which a turned site converts differently.
    """
    fitted = 0.93 * entry.nominal + 0.002
    robot, left = with_values(varied(), {entry.free.name: fitted})
    one_cap = entry.family == "friction" and entry.element is not None
    if entry.family in NOT_IN_ROBOT_TOML or entry.effect or one_cap:
        assert left == (entry.free.name,)
        assert robot == varied()
        return
    assert left == ()
    assert robot != varied()
    mapping = Mapping(varied(), [entry.free])
    x = np.array([fitted])
    theta, own = mapping.theta(x), parameters_of(robot)
    for name in shapes(mapping.structure):
        if name not in ("rest_min", "rest_max"):
            assert torch.allclose(value(theta, name), value(own, name), rtol=1e-12, atol=1e-14), name
    written = Mapping(robot, []).pid(np.zeros(0))
    for key in ("p", "i", "d", "tolerance", "min_length", "range"):
        assert float(getattr(written, key)) == float(getattr(mapping.pid(x), key))


def test_many_at_once() -> None:
    """Values go in together, the special after the whole; what is left comes back in the catalogue's order."""
    values = {"ground_height": 0.001, "motor_speed.1": 0.9, "motor_lag": 0.04, "motor_speed": 0.4, "friction": 0.5}
    robot, left = with_values(varied(), values)
    assert left == ("motor_lag", "ground_height")
    mean = np.mean([motor.speed for motor in varied().motors])
    for motor, own in zip(robot.motors, varied().motors, strict=True):
        assert motor.speed == pytest.approx(0.9 if own.cable == 1 else own.speed * 0.4 / mean)
    assert robot.contact.friction == 0.5


def test_a_winch_faster_than_without_load() -> None:
    """robot.toml has shares up to 1: the rest goes into the no-load speed, and the winding rate is the fitted one."""
    robot, _ = with_values(varied(), {"motor_speed.0": 1.25})
    motor, own = robot.motors[0], varied().motors[0]
    assert motor.speed == 1.0
    assert motor.no_load_rad_per_s == pytest.approx(1.25 * own.no_load_rad_per_s)


def test_no_robot_and_no_name() -> None:
    """A value that no robot has: exit code 4; a name that none has: exit code 2."""
    with pytest.raises(InputError, match="no robot"):
        with_values(varied(), {"restitution": 1.2})
    with pytest.raises(UsageError, match="unknown parameter"):
        with_values(varied(), {"masss": 0.1})
