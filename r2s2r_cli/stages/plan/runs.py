"""Planned policies as runs of the simulator, tick by tick, in the layout of `simulate`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli import __version__
from r2s2r_cli.artifact import Group, Scalar
from r2s2r_cli.stages.plan.executor import Executor
from r2s2r_cli.stages.plan.gaits import outcomes, padded, seen
from r2s2r_cli.stages.plan.placement import Reference
from r2s2r_cli.stages.plan.rewards import Outcomes
from r2s2r_cli.stages.plan.standing import Standing, Track
from r2s2r_cli.stages.segments import segments, target_intervals
from r2s2r_cli.stages.simulate.frames import frame_datasets, stored_rows
from r2s2r_cli.stages.simulate.policies import policy_group
from schemas.policy import PolicyFile
from schemas.robot import Robot

if TYPE_CHECKING:
    from r2s2r_cli.engine import Parameters

FRAMES_HZ = 25.0
"""Frames that are kept a second."""


def policy_file(robot: Robot, name: str, description: str, targets: np.ndarray) -> PolicyFile:
    """Targets (S, motor) as a policy; timeouts are the robot's own."""
    steps = [{"target": tuple(float(value) for value in row)} for row in targets]
    return PolicyFile.model_validate(
        {"schema_version": 1, "robot": robot.name, "name": name, "description": description, "steps": steps}
    )


@dataclass(frozen=True)
class Played:
    """A policy that was run from every robot of a start: what came of it, which reached all targets, (B,); the ticks of
    the first."""

    policy: PolicyFile
    came: Outcomes
    sound: np.ndarray
    track: Track


def played(executor: Executor, reference: Reference, start: Standing, policies: Sequence[PolicyFile]) -> list[Played]:
    """Every policy from every robot of `start`, all in one call of the engine."""
    size = len(start)
    at = start.take(np.tile(np.arange(size), len(policies)))
    targets = [np.array([step.target for step in policy.steps]) for policy in policies for _ in range(size)]
    run = executor.run(at, *padded(targets), record=True)
    switched = np.array([np.abs(np.diff(one, axis=0)).sum() for one in targets])
    came = outcomes(reference, seen(executor, at), seen(executor, run.last), run.total, executor.period, switched)
    rows = [np.arange(k * size, (k + 1) * size) for k in range(len(policies))]
    return [
        Played(policy, came.take(block), run.sound[block], run.tracks[block[0]])
        for policy, block in zip(policies, rows, strict=True)
    ]


def run_groups(executor: Executor, robot: Robot, start: Standing, runs: Sequence[Played]) -> dict[str, Group]:
    """Groups `runs/NAME/...` of policies that were run, from the first robot of `start`."""
    draw, substeps = start.draw[:1], executor.substeps(start)
    theta = executor.theta.map(lambda x: x[draw])
    made: dict[str, Group] = {}
    for run in runs:
        for key, group in _groups(executor, robot, theta, run, substeps).items():
            made[f"runs/{run.policy.name}/{key}".rstrip("/")] = group
    return made


def _groups(executor: Executor, robot: Robot, theta: Parameters, run: Played, substeps: int) -> dict[str, Group]:
    from r2s2r_cli.engine.flat import unpack_state

    policy, track = run.policy, run.track
    goal = np.array([step.target for step in policy.steps])
    ticks, period = len(track.u), executor.period
    rows = stored_rows(ticks, max(1, round(robot.pid.rate_hz / FRAMES_HZ)))
    at = np.minimum(rows, ticks - 1)
    target, control = goal[track.index.numpy()], track.u.numpy()
    # The frame after the last tick is the end: nothing is commanded there any more.
    control_at = np.where((rows == ticks)[:, None], 0.0, control[at])
    states = unpack_state(executor.structure, track.s[None])
    h = executor.step / substeps
    frames = {"t": rows * period, **frame_datasets(executor.structure, theta, states, rows, executor.cable_caps, h=h)}
    position = (frames["length"][:, list(robot.actuated)] - robot.pid.min_length_m) / robot.pid.range_m
    intervals = target_intervals(
        frames["t"], target[at], control=control_at, position=position, tolerance=robot.pid.tolerance
    )
    facts: dict[str, Scalar] = {
        "policy": policy.name, "robot": robot.name, "engine": f"r2s2r {__version__}", "step": executor.step,
        "control": "closed loop",
    }  # fmt: skip
    return {
        "": Group(attributes=facts),
        "frames": Group(frames),
        "commands": Group({"t": np.arange(ticks) * period, "target": target, "control": control,
                           "done": track.done.numpy()}),
        "intervals": intervals.to_group(),
        "segments": segments(intervals, frames["t"], control_at).to_group(),
        "policy": policy_group(policy),
    }  # fmt: skip
