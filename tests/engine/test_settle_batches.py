"""Batches of observations that do not fit, or hold nothing: an error that names the odd one."""

from __future__ import annotations

import pytest
import torch

from r2s2r_cli.engine import EngineInputError, end_caps, settled, window_state
from tests.support.robots import frames, rested, subject


@pytest.mark.parametrize(
    ("field", "caps", "turns", "lengths"), [("p_WE", 0, 1, 1), ("p_WE", 2, 1, 3), ("R_WR", 3, 2, 1)]
)
def test_settled_from_batches_that_do_not_fit(field: str, caps: int, turns: int, lengths: int) -> None:
    """Poses, frames and lengths are of one number of robots, or shared."""
    robot = subject()
    many = robot.p_WE[:1].repeat(caps, 1, 1)
    with pytest.raises(EngineInputError) as error:
        settled(
            robot.simulator, robot.theta, many, frames(robot.p_WE).expand(turns, -1, -1, -1), robot.cable_caps,
            lengths=torch.full((lengths, 9), 0.2, dtype=torch.float64),
        )  # fmt: skip
    assert error.value.field == field


@pytest.mark.parametrize(("field", "caps", "speeds"), [("p_WE", 0, 1), ("p_WE", 2, 3), ("v_WE", 3, 2)])
def test_a_window_from_batches_that_do_not_fit(field: str, caps: int, speeds: int) -> None:
    """Poses and velocities likewise."""
    robot, start = subject(), rested().state
    p_WE = end_caps(robot.theta, start)
    with pytest.raises(EngineInputError) as error:
        window_state(
            robot.simulator,
            robot.theta,
            p_WE.repeat(caps, 1, 1),
            start,
            v_WE=torch.zeros_like(p_WE).repeat(speeds, 1, 1),
        )
    assert error.value.field == field
