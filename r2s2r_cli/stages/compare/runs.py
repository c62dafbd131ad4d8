"""Real runs to compare with: what an estimate says of them, and the policy that they executed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.masses import mass_properties
from r2s2r_cli.stages.compare.opening import Opening, opening_of, policy_part, without_opening
from r2s2r_cli.stages.compare.walk import Walk
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.load import run_data
from r2s2r_cli.stages.measures.upright import not_at_rest
from r2s2r_cli.stages.repeated import policy_of
from r2s2r_cli.stages.segments import Intervals
from r2s2r_cli.stages.simulate.policies import Sequence as Targets, sequence, stored_policies
from schemas.robot import Robot


@dataclass(frozen=True)
class RealRun:
    """One executed policy, from the end of its opening rest on. walk: smoothed, up to the first interval that is not
    complete; intervals: how many there are in all. targets: what the controller was given then, the rest at the end
    included. opening: what came before, `opening.intervals` of the recorded intervals.
    data: what a replay of the commands of the whole run needs; None where the motor commands were not logged.
    iteration: in which it was run. fallen: where the robot did not stand as at rest when the policy began, what was
    wrong."""

    name: str
    policy: str
    iteration: int
    intervals: int
    walk: Walk
    targets: Targets
    data: RunData | None
    opening: Opening
    fallen: str = ""


def real_runs(
    estimate: ArtifactData,
    recording: ArtifactData | None,
    robot: Robot,
    *,
    iteration: int,
    prefix: str = "",
    repeats: int = 0,
) -> tuple[tuple[RealRun, ...], tuple[str, ...]]:
    """The runs of an estimate that allow a comparison, and why others do not, in words.

    prefix: before the names of runs and policies, where those of several iterations are compared. repeats: how often
    each policy was to be run, 0: not known.
    Raises InputError where none does.
    """
    found, refused = [], []
    for run in estimate.runs():
        try:
            called = prefix + run, prefix + policy_of(estimate, run, repeats)
            found.append(_run(estimate, recording, run, robot, iteration, called))
        except InputError as error:
            refused.append(error)
    if not found and refused:
        raise refused[0]
    if not found:
        raise InputError("there is no run to compare with", where="estimate", expected="at least one estimated run",
                         received="none", hint="r2s2r estimate")  # fmt: skip
    left_out = tuple(f"left out: {error.what} ({error.received})" for error in refused)
    cut = tuple(
        f"run {one.name}: its first {len(one.walk.intervals)} target intervals are compared, the next is not complete"
        for one in found if len(one.walk.intervals) < one.intervals
    )  # fmt: skip
    return tuple(found), left_out + cut


def cap_shares(robot: Robot) -> np.ndarray:
    """Share of the robot's mass that stands at each cap, (cap,): the lever rule along each rod."""
    bodies = [mass_properties(rod.parts) for rod in robot.rods]
    mass = np.array([body.mass for body in bodies])
    odd = np.array([0.5 + body.com / rod.length_m for body, rod in zip(bodies, robot.rods, strict=True)])
    return np.asarray((np.stack([1 - odd, odd], axis=1) * mass[:, None]).reshape(-1) / mass.sum())


def _run(
    estimate: ArtifactData, recording: ArtifactData | None, run: str, robot: Robot, iteration: int,
    called: tuple[str, str],
) -> RealRun:  # fmt: skip
    """called: the run and its policy."""
    name, policy = called
    groups = dict(estimate.streams(run))
    told = str(groups[""].attributes.get("robot", robot.name))
    if told != robot.name:
        raise InputError(f"run {run} is of another robot", where=f"runs/{run}", expected=robot.name, received=told,
                         hint="compare in the project of the robot that was recorded")  # fmt: skip
    frames = groups["frames"]
    intervals = _intervals(groups)
    whole = Walk(frames["t"], frames["p_WE"], cap_shares(robot), intervals)
    opening = opening_of(whole)
    if (count := len(intervals) - opening.intervals) < 2:
        after = " after the opening rest" if opening.intervals else ", from the first on"
        raise InputError(
            f"run {run} has no gait to compare", where=f"runs/{run}/intervals",
            expected=f"at least two complete target intervals{after}", received=f"{count}",
            hint="r2s2r record --random 15 --port /dev/ttyUSB0",
        )  # fmt: skip
    walk = without_opening(whole, opening).first(count)
    if not (known := np.isfinite(walk.p_WE[0]).all(axis=-1)).all():
        frame = "last frame of the opening rest" if opening.intervals else "first frame"
        raise InputError(f"run {run} starts nowhere: a simulation has no start", where=f"runs/{run}/frames/p_WE",
                         expected=f"every end cap at the {frame}", received=f"none of cap {int(np.argmin(known))}",
                         hint="r2s2r validate")  # fmt: skip
    return RealRun(
        name=name, policy=policy, iteration=iteration,
        intervals=len(groups["intervals"]["first"]) - opening.intervals, walk=walk,
        targets=policy_part(_targets(estimate, recording, run, intervals, robot), opening),
        data=_data(estimate, recording, run, name), opening=opening,
        fallen=not_at_rest(whole.p_WE, intervals, robot),
    )  # fmt: skip


def _intervals(groups: dict[str, Group]) -> Intervals:
    """The complete intervals from the first on; none where the run has no targets."""
    held = groups.get("intervals")
    if held is None:
        return Intervals(*(np.zeros(0),) * 4, target=np.zeros((0, 1)), complete=np.zeros(0, dtype=bool))
    whole = Intervals.from_group(held)
    count = int(np.argmin(np.append(whole.complete, False)))
    return Intervals(**{name: value[:count] for name, value in vars(whole).items()})


def _targets(
    estimate: ArtifactData, recording: ArtifactData | None, run: str, intervals: Intervals, robot: Robot
) -> Targets:
    """Of the policy as it was run (holds and the rest round it are in it); of a log the targets that it shows."""
    for data in (recording, estimate):
        group = None if data is None else data.group(run, "policy")
        if data is not None and group is not None:
            return sequence(stored_policies(data, [run])[run], robot)
    none = np.zeros(len(intervals))
    return Targets(intervals.target, none, none + robot.pid.step_timeout_s)


def _data(estimate: ArtifactData, recording: ArtifactData | None, run: str, name: str) -> RunData | None:
    try:
        return run_data(recording, estimate, run, name=name)
    except InputError:
        return None  # without motor commands there is nothing to replay; the closed loop is compared


def policies_of(runs: Sequence[RealRun]) -> dict[str, str]:
    """Policy of each run by its name."""
    return {run.name: run.policy for run in runs}
