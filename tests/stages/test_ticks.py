"""Engine steps that do not fit the controller: said with a step that does."""

from __future__ import annotations

import re

import numpy as np
import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.plan.belief import assumed
from r2s2r_cli.stages.plan.executor import Executor
from r2s2r_cli.stages.ticks import whole_steps
from tests.support.robots import subject


@pytest.mark.parametrize("rate", [1.0, 30.0, 50.0, 333.0])
def test_the_step_that_is_proposed_fits(rate: float) -> None:
    """Whatever the controller's rate: the hint's step divides its period, and is none that settings refuse."""
    robot = subject().robot
    robot = robot.model_copy(update={"pid": robot.pid.model_copy(update={"rate_hz": rate})})
    with pytest.raises(InputError) as refused:
        whole_steps(robot, 0.37 / rate, "simulate.step_s")
    proposed = re.fullmatch(r"--set simulate\.step_s=(\S+)", refused.value.hint)
    assert proposed is not None
    step = float(proposed[1])
    assert step <= 0.01 and whole_steps(robot, step, "simulate.step_s") * step == pytest.approx(1.0 / rate)


def test_a_plan_refuses_such_a_step() -> None:
    """By the name of its own setting."""
    robot = subject().robot
    belief = assumed(robot)
    draws = belief.draws(1, np.random.default_rng(0))
    with pytest.raises(InputError) as refused:
        Executor(robot, belief, draws, step=0.0033)
    assert refused.value.where == "plan.step_s" and refused.value.hint.startswith("--set plan.step_s=")
