"""Engine steps in one tick of the robot's controller, for the stages that run it in the loop."""

from __future__ import annotations

import math

from r2s2r_cli.errors import InputError
from schemas.config import LONGEST_STEP_S
from schemas.robot import Robot

STEPS = 20
"""Engine steps a control tick that are proposed where those asked for do not fit."""


def whole_steps(robot: Robot, step: float, setting: str) -> int:
    """How many steps of `step` [s] make a control period. setting: the name of that step, for the message. Raises
    InputError where the step does not divide the period."""
    from r2s2r_cli.engine import EngineInputError
    from r2s2r_cli.engine.pid import steps_a_tick

    period = 1.0 / robot.pid.rate_hz
    try:
        return steps_a_tick(period, step)
    except EngineInputError as error:
        fits = period / max(STEPS, math.ceil(period / LONGEST_STEP_S))
        raise InputError(
            "the engine step does not divide the control period", where=setting,
            expected=f"{period:g} s (pid.rate_hz {robot.pid.rate_hz:g}) over a whole number",
            received=f"{step:g} s", hint=f"--set {setting}={fits!r}",
        ) from error  # fmt: skip
