"""Policies to simulate: from the groups of an artifact, or random ones; and as the sequence of targets that is run."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import InputError, UsageError
from schemas.policy import PolicyFile
from schemas.robot import Robot

RANDOM_MAX = 10_000
"""Targets of a random policy: ten thousand take some eight hours of robot time."""
ROUNDING = 1e-6
"""Logs may write a target so far outside 0 .. 1, and `import` stores it as it stands. Beyond, no cable goes there."""


@dataclass(frozen=True)
class Sequence:
    """Targets as they are run, with repeats. target: (S, actuated), 0 short .. 1 long; hold, timeout: (S,) [s]."""

    target: np.ndarray
    hold: np.ndarray
    timeout: np.ndarray


def sequence(policy: PolicyFile, robot: Robot) -> Sequence:
    """The targets of a policy in order. Raises InputError where it is not for this robot."""
    width, motors = len(policy.steps[0].target), len(robot.actuated)
    if policy.robot != robot.name or width != motors:
        raise InputError(
            f"policy {policy.name} is for another robot",
            where=f"policy {policy.name}",
            expected=f"robot {robot.name}, {motors} targets a step",
            received=f"robot {policy.robot}, {width} targets a step",
            hint=f"r2s2r plan   # makes policies of {robot.name}",
        )
    default = robot.pid.step_timeout_s
    once = [(s.target, s.hold_s, default if s.timeout_s is None else s.timeout_s) for s in policy.steps]
    target, hold, timeout = (np.array(column, dtype=float) for column in zip(*once, strict=True))
    return Sequence(np.tile(target, (policy.repeat, 1)), np.tile(hold, policy.repeat), np.tile(timeout, policy.repeat))


def require_length(steps: int) -> None:
    """Raises UsageError for a number of targets that no random policy has."""
    if not 1 <= steps <= RANDOM_MAX:
        raise UsageError("this is no length of a random policy", where="--random", expected=f"1 to {RANDOM_MAX}",
                         received=str(steps), hint="--random 15")  # fmt: skip


def random_policy(robot: Robot, steps: int, seed: int) -> PolicyFile:
    """`steps` binary target shapes, each another one than the one before; the first is not the rest shape (all long).

    The random policy of the paper, section "Random Policy and Real World Execution". Raises UsageError.
    """
    require_length(steps)
    generator = np.random.default_rng(seed)
    before = np.ones(len(robot.actuated), dtype=int)
    shapes: list[dict[str, Any]] = []
    while len(shapes) < steps:
        shape = generator.integers(0, 2, len(before))
        if (shape != before).any():
            shapes.append({"target": tuple(map(float, shape))})
            before = shape
    return PolicyFile.model_validate(
        {"schema_version": 1, "robot": robot.name, "name": f"random-{seed}", "steps": shapes,
         "description": f"{steps} random binary target shapes, seed {seed}"}
    )  # fmt: skip


def stored_policies(data: ArtifactData, names: Collection[str] | None = None) -> dict[str, PolicyFile]:
    """The policies that an artifact holds, by name: of its own, of its runs, or the targets that its runs had.

    names: only these. Raises InputError as `run_policy`.
    """
    return {name: make() for name, make in _stored(data).items() if names is None or name in names}


def policy_names(data: ArtifactData) -> list[str]:
    """Names of the policies that an artifact holds, whether or not each of them can be run."""
    return list(_stored(data))


def run_policy(data: ArtifactData, run: str) -> PolicyFile:
    """The targets that a run had, one step a target interval; it has one at least.

    Raises InputError where a target is none that a cable can have: the folder of the authors may hold any number.
    """
    target = data.groups[f"runs/{run}/intervals"]["target"]
    outside = target[np.abs(target - 0.5) > 0.5 + ROUNDING]
    if len(outside):
        raise InputError(
            f"the targets of run {run} make no policy", where=f"runs/{run}/intervals/target",
            expected="cable positions, 0 short .. 1 long", received=f"{outside[0]:g}",
            hint=f"r2s2r simulate --replay {run}   # the motor commands that it had",
        )  # fmt: skip
    robot = str(data.groups[f"runs/{run}"].attributes["robot"])
    return _policy(run, robot, f"targets of the run {run}, in their order", np.clip(target, 0.0, 1.0))


def _stored(data: ArtifactData) -> dict[str, Callable[[], PolicyFile]]:
    """What makes each policy: one that cannot be run must not keep the others from it."""
    found: dict[str, Callable[[], PolicyFile]] = {}
    for path, group in data.groups.items():
        parts = path.split("/")
        if parts[0] == "policies" or parts[2:] == ["policy"]:
            found[parts[1]] = partial(_from_group, parts[1], group)
    for run in data.runs():
        intervals = data.group(run, "intervals")
        if run not in found and intervals is not None and len(intervals["target"]):
            found[run] = partial(run_policy, data, run)
    return found


def policy_group(policy: PolicyFile) -> Group:
    """The policy as the group that artifacts keep."""
    columns = {
        "target": [step.target for step in policy.steps],
        "hold": [step.hold_s for step in policy.steps],
        "timeout": [np.nan if step.timeout_s is None else step.timeout_s for step in policy.steps],
    }
    return Group(
        {name: np.array(values, dtype=float) for name, values in columns.items()},
        {"robot": policy.robot, "description": policy.description, "repeat": policy.repeat},
    )


def _from_group(name: str, group: Group) -> PolicyFile:
    attributes = group.attributes
    return _policy(
        name, str(attributes["robot"]), str(attributes.get("description", "")), group["target"],
        hold=group["hold"], timeout=group["timeout"], repeat=int(attributes["repeat"]),
    )  # fmt: skip


def _policy(
    name: str,
    robot: str,
    description: str,
    target: np.ndarray,
    *,
    hold: np.ndarray | None = None,
    timeout: np.ndarray | None = None,
    repeat: int = 1,
) -> PolicyFile:
    steps: list[dict[str, Any]] = []
    for i, row in enumerate(target):
        step: dict[str, Any] = {"target": tuple(float(value) for value in row)}
        if hold is not None:
            step["hold_s"] = float(hold[i])
        if timeout is not None and np.isfinite(timeout[i]):
            step["timeout_s"] = float(timeout[i])
        steps.append(step)
    head = {"schema_version": 1, "robot": robot, "name": name, "description": description, "repeat": repeat}
    return PolicyFile.model_validate({**head, "steps": steps})
