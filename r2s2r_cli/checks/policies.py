"""Policies: can this robot run them?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.checks.base import Found, beyond, check, worst
from r2s2r_cli.checks.subjects import Policy


@check(
    "error",
    Policy,
    what="the policy was written for the project's robot",
    why="the same positions are other shapes on another robot",
    fix="set robot in the policy to the name in robot.toml, if the policy is meant for this robot",
)
def policy_robot_known(policy: Policy) -> Iterator[Found]:
    """A policy of another robot."""
    robot = policy.project_robot
    if robot is not None and policy.robot_name != robot.name:
        location = f"{policy.root}@robot" if policy.root else "robot"
        yield Found(location, "the policy is for another robot", robot.name, policy.robot_name)


@check(
    "error",
    Policy,
    what="every step has one target for each actuated cable",
    why="a target too few or too many shifts the others to the wrong cables",
    fix="give each step as many targets as robot.toml has actuated cables, in their order",
)
def policy_fits_cables(policy: Policy) -> Iterator[Found]:
    """Steps with another number of targets."""
    robot = policy.project_robot
    if robot is not None and policy.robot_name == robot.name and policy.target.shape[1] != len(robot.actuated):
        yield Found(policy.at("target"), "a step has another number of targets than the robot has actuated cables",
                    str(len(robot.actuated)), str(policy.target.shape[1]))  # fmt: skip


@check(
    "error",
    Policy,
    what="target positions lie between 0 (short) and 1 (long)",
    why="a target outside is never reached: the robot waits for it until the step times out",
    fix="write positions 0 .. 1",
)
def policy_targets_in_range(policy: Policy) -> Iterator[Found]:
    """Targets outside 0 .. 1."""
    outside = beyond(policy.target, 0.0, 1.0)
    if (outside > 0).any():
        yield Found(policy.at("target"), "a target position is out of range", "0 (short) .. 1 (long)",
                    worst(policy.target, outside, ("step", "cable")))  # fmt: skip


@check(
    "error",
    Policy,
    what="times to hold are 0 or more, times out are above 0, and the policy runs at least once",
    why="a step without time is skipped, and nobody sees that it was",
    fix="write seconds; leave timeout_s out for the robot's own",
)
def policy_times_sensible(policy: Policy) -> Iterator[Found]:
    """Times that cannot be."""
    for name, bad, expected in (
        ("hold", policy.hold < 0, "0 s or more"),
        ("timeout", policy.timeout <= 0, "above 0 s"),
    ):
        if bad.any():
            values = policy.hold if name == "hold" else policy.timeout
            yield Found(policy.at(name), f"the {name} of a step is too short", expected,
                        worst(values, bad * (1.0 - np.nan_to_num(values)), ("step",), unit="s"))  # fmt: skip
    if policy.repeat < 1:
        location = f"{policy.root}@repeat" if policy.root else "repeat"
        yield Found(location, "the policy is never run", "1 or more", str(policy.repeat))


@check(
    "advice",
    Policy,
    what="every step has another target than the one before",
    why="two steps of one target are one target interval: they cannot be told apart in what is recorded",
    fix="join the two steps, with hold_s for the time to wait",
)
def policy_steps_differ(policy: Policy) -> Iterator[Found]:
    """Steps that do nothing."""
    target = policy.target
    if policy.repeat > 1 and len(target) > 1:
        target = np.concatenate([target, target[:1]])
    same = (np.diff(target, axis=0) == 0).all(axis=1)
    if same.any():
        step = int(np.argmax(same)) + 1
        more = f" (and {int(same.sum()) - 1} more)" if same.sum() > 1 else ""
        after = step if step < len(policy.target) else 0
        yield Found(policy.at("target"), "a step has the target of the step before it", "another target",
                    f"step {after} repeats step {step - 1}{more}")  # fmt: skip
