"""What the simulator says that policies will do, before the robot does it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from r2s2r_cli.console import Console
from r2s2r_cli.store.project import Iteration, Project

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.stages.record import RunPlan
    from schemas.policy import PolicyFile
    from schemas.results_simulate import SimulateReport


PICTURE_MB = 0.34
"""Of disk for a colour and a depth picture of 640 x 480 pixels (docs/guides/record.md)."""
PICTURES_HZ = 30.0


def expect(
    project: Project, place: Iteration, runs: Sequence[RunPlan], numbers: Path | None, console: Console, *, camera: bool
) -> None:
    """What the simulator says that the policies will do, how long it takes, whether the camera sees all of it, and what
    its pictures take on the disk. camera: whether one is recorded."""
    from r2s2r_cli.views.page import counted
    from r2s2r_cli.views.simulation_page import report_tables

    policies = list({run.policy.name: run.policy for run in runs}.values())
    data, report = _simulated(project, place, policies, numbers, console)
    words = "robot.toml: nothing was identified yet" if numbers is None else project.relative(numbers)
    console.say(f"what the simulator expects (numbers of {words})")
    for table in report_tables(report):
        console.table(table.title, table.columns, table.rows)
    for run in report.runs:
        for text in run.warnings:
            console.warn(f"{run.run}: {text}")
    lasts = {run.run: run.duration_s for run in report.runs}
    total = sum(lasts[run.policy.name] + 2 * run.rest for run in runs)
    console.say(f"{counted(len(runs), 'run')}, about {_lasting(total)} on the robot")
    if camera:
        console.say(
            f"its pictures: about {PICTURE_MB * PICTURES_HZ * total:.0f} MB, of 640 x 480 pixels {PICTURES_HZ:g} times "
            "a second; fewer or smaller ones take as much less"
        )
    _tell_of_view(project, place, data, console, camera=camera)


def _lasting(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.1f} minutes"


def _tell_of_view(project: Project, place: Iteration, data: ArtifactData, console: Console, *, camera: bool) -> None:
    """Say which policies lead out of what the camera saw, the robot starting in the middle of its picture; of a camera
    that has seen nothing yet, how far they lead."""
    from r2s2r_cli.commands.plan_inputs import last_estimate
    from r2s2r_cli.stages.plan.view import far, reach_seen
    from r2s2r_cli.store.read import read_artifact

    seen = last_estimate(project, place)
    reach = None if seen is None else reach_seen(read_artifact(seen, "estimate")[1], project.robot())
    away = far(data)
    if seen is None or reach is None:
        if camera:
            console.say(
                f"the robot goes up to {max(away.values(), default=0.0):.2f} m from where it starts; whether this "
                "camera sees that is not known, since nothing was estimated from its pictures yet"
            )
        return
    for name, distance in away.items():
        if distance > reach:
            console.warn(
                f"{name}: goes {distance:.2f} m from its start, and the camera of {project.relative(seen)} sees "
                f"{reach:.2f} m about the middle of its picture: let it walk through the middle, or raise the camera"
            )


def _simulated(
    project: Project, place: Iteration, policies: Sequence[PolicyFile], numbers: Path | None, console: Console
) -> tuple[ArtifactData, SimulateReport]:
    from r2s2r_cli.commands.interrupts import loaded
    from r2s2r_cli.commands.simulate_inputs import Asked

    stage = loaded("r2s2r_cli.stages.simulate")
    robot, model = project.robot(), Asked(project, place, (), None, 0, (), None, numbers).simulator()
    requests = [stage.Request(policy) for policy in policies]
    with console.progress("simulate, policies", len(requests)) as advance:
        done: set[str] = set()

        def progress(name: str, _: int) -> None:
            if name not in done:
                done.add(name)
                advance(1)

        data, report = stage.simulate(
            robot, requests, project.config(place, {}).simulate, model=model, cache_dir=project.cache, progress=progress
        )
    return data, report
