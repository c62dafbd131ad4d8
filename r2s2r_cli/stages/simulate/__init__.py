"""`simulate`: policies and recorded commands through the engine, as runs of one simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence as Items
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from r2s2r_cli import __version__
from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.identified import Identified
from r2s2r_cli.stages.segments import segments, target_intervals
from r2s2r_cli.stages.simulate.drive import REPLAY_SPELL_S, Driver, Simulated, Start
from r2s2r_cli.stages.simulate.measures import com_path, heading_change, penetration, slack_share
from r2s2r_cli.stages.simulate.policies import policy_group, sequence
from r2s2r_cli.stages.simulate.replay import Replay
from schemas.config import SimulateSettings
from schemas.policy import PolicyFile
from schemas.results_simulate import SimulateReport, SimulateRun
from schemas.robot import Robot

__all__ = ["Request", "Start", "parts", "simulate"]

DEEP_M = 1e-3
"""A cap deeper in the ground than this is worth a warning: contact did not hold."""
SHIFTED_M = 0.01
"""A start that settled by more than this is not the observed one any more."""


@dataclass(frozen=True)
class Request:
    """One run to simulate: a policy in closed loop, or recorded commands; start None: the robot's rest state."""

    what: PolicyFile | Replay
    start: Start | None = None

    @property
    def name(self) -> str:
        """Of the run that is made: a replay must not be taken for the closed loop of the same targets."""
        return f"{self.what.run}-replay" if isinstance(self.what, Replay) else self.what.name

    @property
    def policy(self) -> str:
        """Name of the policy, or of the recorded run."""
        return self.what.run if isinstance(self.what, Replay) else self.what.name


def parts(request: Request) -> int:
    """Parts in which a run is reported on the way: targets of a policy, seconds of a replay."""
    if isinstance(request.what, Replay):
        return math.ceil((request.what.t_last - request.what.t_first) / REPLAY_SPELL_S)
    return len(request.what.steps) * request.what.repeat


def simulate(
    robot: Robot,
    requests: Items[Request],
    settings: SimulateSettings,
    *,
    model: Identified | None = None,
    cache_dir: Path | None = None,
    progress: Callable[[str, int], None] = lambda name, done: None,
) -> tuple[ArtifactData, SimulateReport]:
    """Simulate every request; the layout is that of `schemas/simulation.py`.

    model: whose numbers are simulated; None: robot.toml's. progress: called with the run's name and how many of its
    `parts` are done. Raises UsageError where two runs have one name, InputError for a robot or policy that cannot be
    simulated, NumericalError where numbers are not finite.
    """
    names = [request.name for request in requests]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(
                "two runs would have the same name", where="r2s2r simulate", expected="a name for each", received=name,
                hint="change name in one of the policies, or simulate one at a time",
            )  # fmt: skip
    driver = Driver(robot, settings, cache_dir, model)
    groups: dict[str, Group] = {}
    reports = []
    for request in requests:
        name = request.name
        start = request.start or driver.rest()
        if isinstance(request.what, Replay):
            run = driver.replay(name, request.what, start, partial(progress, name))
        else:
            run = driver.closed_loop(name, sequence(request.what, robot), start, partial(progress, name))
        groups.update(_groups(request, run, robot, settings))
        reports.append(_report(request, run, start, robot, settings))
    return ArtifactData("simulation", groups), SimulateReport(runs=tuple(reports), computed_by=driver.computed_by)


def _control(request: Request) -> Literal["closed loop", "command replay"]:
    return "command replay" if isinstance(request.what, Replay) else "closed loop"


def _groups(request: Request, run: Simulated, robot: Robot, settings: SimulateSettings) -> dict[str, Group]:
    """Groups of one run by path."""
    t, pid = run.frames["t"], robot.pid
    position = (run.frames["length"][:, list(robot.actuated)] - pid.min_length_m) / pid.range_m
    intervals = target_intervals(t, run.target_at, control=run.control_at, position=position, tolerance=pid.tolerance)
    made = {
        "": Group(attributes={"policy": request.policy, "robot": robot.name, "engine": f"r2s2r {__version__}",
                              "step": settings.step_s, "control": _control(request)}),
        "frames": Group(run.frames),
        "commands": Group(run.commands),
        "intervals": intervals.to_group(),
        "segments": segments(intervals, t, run.control_at).to_group(),
    }  # fmt: skip
    if not isinstance(request.what, Replay):
        made["policy"] = policy_group(request.what)
    return {f"runs/{request.name}/{key}".rstrip("/"): group for key, group in made.items()}


def _report(request: Request, run: Simulated, start: Start, robot: Robot, settings: SimulateSettings) -> SimulateRun:
    frames = run.frames
    radius = np.repeat([rod.cap_radius_m for rod in robot.rods], 2)
    moved = run.com[-1] - run.com[0]
    strongest = np.unravel_index(np.argmax(frames["tension"]), frames["tension"].shape)
    targets = 0 if isinstance(request.what, Replay) else len(request.what.steps) * request.what.repeat
    return SimulateRun(
        run=request.name,
        policy=request.policy,
        control=_control(request),
        start=start.words,
        start_shift_m=run.start_shift,
        frames=len(frames["t"]),
        duration_s=float(frames["t"][-1] - frames["t"][0]),
        step_s=settings.step_s,
        substeps=run.substeps,
        targets=targets,
        timed_out=run.timed_out,
        com_displacement_m=(float(moved[0]), float(moved[1]), float(moved[2])),
        com_path_m=com_path(run.com),
        heading_change_rad=heading_change(frames["p_WE"]),
        penetration_max_m=penetration(frames["p_WE"], radius),
        cap_height_max_m=float(frames["p_WE"][..., 2].max()),
        tension_max_n=float(frames["tension"][strongest]),
        tension_max_cable=int(strongest[1]),
        slack_share=slack_share(frames["tension"]),
        warnings=tuple(_warnings(request, run, start, radius)),
    )


def _warnings(request: Request, run: Simulated, start: Start, radius: np.ndarray) -> list[str]:
    found = []
    if run.timed_out:
        numbers = ", ".join(map(str, run.timed_out))
        found.append(f"targets given up after their timeout, not all cables were done: {numbers}")
    if isinstance(request.what, Replay) and request.what.missing:
        found.append(f"{request.what.missing} recorded commands were not logged and replayed as 0")
    deep = penetration(run.frames["p_WE"], radius)
    if deep > DEEP_M:
        found.append(f"a cap was {1e3 * deep:.1f} mm below the ground: give the engine a smaller simulate.step_s")
    if run.start_shift > SHIFTED_M:
        pose = "rest_caps_m of robot.toml" if start.words == "rest" else f"the first state of run {start.words}"
        found.append(f"{pose} is not at rest: settling moved a cap by {1e3 * run.start_shift:.0f} mm")
    return found
