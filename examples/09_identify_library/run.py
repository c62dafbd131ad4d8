"""Identification as a library: from an estimate to a fit, its held-out errors, and what its numbers are worth.

Run `python examples/09_identify_library/run.py`, or with `--project DIR` on the runs of a project of your own;
docs/guides/identify-library.md explains it line by line.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from robot_log import log, threebar

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.stages.identify import identify
from r2s2r_cli.stages.identify.conclude import known_before
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.free import select, with_values
from r2s2r_cli.stages.identify.load import run_data
from r2s2r_cli.stages.identify.request import Request, Step
from r2s2r_cli.stages.identify.selection import split
from r2s2r_cli.stages.identify.task import Task
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.read import read_artifact
from schemas.config import IdentifySettings
from schemas.results_identify import HeldOut, IdentifyReport
from schemas.robot import Robot

FREE = ("motor_speed,~0.3", "friction,~0.3", "restitution")
SETTINGS = IdentifySettings(starts=1, profiles=0)


def stored(root: Path) -> tuple[Robot, list[RunData]]:
    """Robot and runs of a project's first iteration. Raises ArtifactError where it is not estimated."""
    project = Project.find(root)
    place = project.iteration(1)
    recording = read_artifact(place.artifact("recording"), "recording")[1]
    states = read_artifact(place.artifact("estimate"), "estimate")[1]
    return project.robot(), [run_data(recording, states, name) for name in states.runs()]


def played() -> tuple[Robot, list[RunData]]:
    """The same of a log that the engine made."""
    robot = threebar()
    recording, states = log(robot)
    return robot, [run_data(recording, states, "gait")]


def asked(runs: list[RunData]) -> Request:
    """Learn from the first three target intervals of the first run, predict its others."""
    train, test = split(runs, [f"{runs[0].name}:1-3"], [])
    return Request(train=train, test=test, free=FREE, seed=0)


def told_before(robot: Robot, runs: list[RunData], request: Request) -> None:
    """What these runs can tell of these numbers at all, without a fit."""
    task = Task(robot, runs, request, SETTINGS)
    before = known_before(task, task.predictor(select(FREE, robot)))
    for name, trust, reason in zip(before.names, before.trust, before.reason, strict=True):
        print(f"before the fit {name:12s} {trust}: {reason}")
    for words, weak in zip(before.words, before.weak.tolist(), strict=True):
        if weak:
            print(f"               {words}")


def fitted(robot: Robot, runs: list[RunData], request: Request) -> tuple[ArtifactData, IdentifyReport]:
    """The artifact and the report, with a word on the way."""

    def progress(step: Step) -> None:
        if step.done == step.total:
            print(f"done           {step.part}")

    return identify(robot, runs, request, SETTINGS, progress=progress)


def judged(held: HeldOut) -> None:
    """What nothing was fitted to, beside rivals."""
    own = held.intervals.keyframe_cap_rmse_m
    spread = "of one segment: no interval" if own is None else f"{mm(own[0])} .. {mm(own[1])}"
    print(f"held out       {'identified':24s} {mm(held.keyframe_cap_rmse_m)}, {spread}")
    for name, rival in held.baselines.items():
        ends = rival.difference.keyframe_cap_rmse_m
        sure = ends is not None and ends[1] < 0.0
        print(f"               {name:24s} {mm(rival.keyframe_cap_rmse_m)}{', surely worse' if sure else ''}")


def trusted(report: IdentifyReport) -> None:
    """Every number with its worth, and what speaks against the fit."""
    for name, one in report.parameters.items():
        interval = "no interval" if one.lower is None or one.upper is None else f"{one.lower:.3f} .. {one.upper:.3f}"
        print(f"found          {name:12s} {one.value:.3f}, {interval}, {one.trust}: {one.reason}")
    for text in report.warnings:
        print(f"doubt          {text}")


def learnt(robot: Robot, report: IdentifyReport) -> Robot:
    """The robot with the numbers that the runs determine; the others keep what robot.toml says."""
    values = {name: one.value for name, one in report.parameters.items() if one.identifiable}
    return with_values(robot, values)[0]


def mm(value: float | None) -> str:
    """Metres as millimetres."""
    return "-" if value is None else f"{1e3 * value:.1f} mm"


def main() -> None:
    """Everything in turn."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--project", type=Path, help="a project whose first iteration is estimated")
    root = parser.parse_args().project
    robot, runs = played() if root is None else stored(root)
    request = asked(runs)
    told_before(robot, runs, request)
    data, report = fitted(robot, runs, request)
    if report.heldout is not None:
        judged(report.heldout)
    trusted(report)
    print(f"robot.toml     motors[0].speed {robot.motors[0].speed:.3f} -> {learnt(robot, report).motors[0].speed:.3f}")
    print(f"artifact       {data.kind}, {len(data.groups)} groups")


if __name__ == "__main__":
    main()
