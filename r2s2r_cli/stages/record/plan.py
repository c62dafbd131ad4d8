"""What is to be recorded: which policies, how often, under which names."""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass
from statistics import fmean

import numpy as np

from r2s2r_cli.artifact import Scalar
from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.simulate.policies import Sequence, sequence
from schemas.policy import PolicyFile
from schemas.robot import Robot

REPEATS_MAX = 1000


@dataclass(frozen=True)
class RunPlan:
    """One run to record. repeat: which of its policy, from 1. rest: time in the rest shape before and after [s]."""

    name: str
    policy: PolicyFile
    repeat: int
    rest: float


def plans(
    policies: Items[PolicyFile], *, repeats: int, rest: float, again: str = "record gait.toml"
) -> tuple[RunPlan, ...]:
    """Every policy `repeats` times, named `<policy>`, or `<policy>-<repeat>` where there are several.

    The repeats of one policy do not follow each other: slow drift of the robot then looks like what it is, and not like
    a difference between policies. again: the command that asks, as a hint repeats it. Raises UsageError where two runs
    would have one name, or for a number of repeats that is none.
    """
    require_repeats(repeats)
    found = [
        RunPlan(policy.name if repeats == 1 else f"{policy.name}-{number}", policy, number, rest)
        for number in range(1, repeats + 1)
        for policy in policies
    ]
    names = [plan.name for plan in found]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(
                "two runs would have the same name", where=f"r2s2r {again.split()[0]}", expected="a name for each",
                received=name, hint=f"r2s2r {again} --repeats 2   # one policy twice; another one needs another name",
            )  # fmt: skip
    return tuple(found)


def require_repeats(repeats: int) -> None:
    """Raises UsageError for a number of repeats that is none."""
    if not 1 <= repeats <= REPEATS_MAX:
        raise UsageError("this is no number of repeats", where="--repeats", expected=f"1 to {REPEATS_MAX}",
                         received=str(repeats), hint="--repeats 1")  # fmt: skip


def with_rest(sequence: Sequence, *, rest: float, timeout: float) -> Sequence:
    """The same with the rest shape (all cables long) before and after, each held for `rest` [s]; 0: without.

    Where the sequence itself begins or ends in the rest shape, that target is held for so much longer.
    """
    if rest <= 0:
        return sequence
    target, hold, limit = sequence.target, sequence.hold.copy(), sequence.timeout
    for end in (0, -1):
        if (target[end] == 1).all():
            hold[end] += rest
            continue
        place = 0 if end == 0 else len(target)
        target = np.insert(target, place, 1.0, axis=0)
        hold, limit = np.insert(hold, place, rest), np.insert(limit, place, timeout)
    return Sequence(target, hold, limit)


def as_run(plan: RunPlan, robot: Robot) -> Sequence:
    """The targets of a run, those in the rest shape included. Raises InputError for a policy of another robot."""
    return with_rest(sequence(plan.policy, robot), rest=plan.rest, timeout=robot.pid.step_timeout_s)


def run_attributes(plan: RunPlan, robot: Robot, *, origin: str, source: str, lock_step: bool) -> dict[str, Scalar]:
    """Attributes of the group of the run, as they are known before it. origin: robot or rig."""
    pid = robot.pid
    return {
        "origin": origin, "nature": "simulated" if origin == "rig" else "measured", "source": source,
        "robot": robot.name, "pid_min_length": pid.min_length_m, "pid_range": pid.range_m,
        "pid_tolerance": pid.tolerance, "pid_p": pid.p, "pid_i": pid.i, "pid_d": pid.d,
        "motor_speed": fmean(motor.speed for motor in robot.motors),
        "winch_radius": fmean(motor.winch_radius_m for motor in robot.motors),
        "clock": "board" if lock_step else "host", "repeat": plan.repeat, "rest": plan.rest,
    }  # fmt: skip
