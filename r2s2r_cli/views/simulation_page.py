"""The report of `simulate` as tables for the terminal, and its page with the player."""

from __future__ import annotations

import math
from collections.abc import Iterator

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.views.page import Page, PageTable, counted
from r2s2r_cli.views.simulation_playback import playback_page
from schemas.results_simulate import SimulateReport, SimulateRun
from schemas.robot import Robot

WORTH_A_WORD = 0.005
"""A smaller share of slack time rounds to 0 %."""


def report_tables(report: SimulateReport) -> Iterator[PageTable]:
    """What was simulated: one row a run, and how often cables were slack."""
    yield PageTable(
        "simulated runs",
        ["run", "control", "from", "time [s]", "targets", "given up", "moved x, y [mm]", "way [mm]", "turned [deg]",
         "highest cap [mm]", "strongest tension [N] (cable)", "deepest [mm]"],
        [_row(run) for run in report.runs],
    )  # fmt: skip
    yield PageTable("share of the time that cables are slack", ["run", "slack"],
                    [[run.run, _slack(run)] for run in report.runs])  # fmt: skip


def said_of_numbers(numbers: str) -> str:
    """Whose numbers the simulator has. numbers: `robot.toml`, or the path of an identification."""
    return f"Simulated with the numbers of {numbers}."


def said_of_unused(identification: str) -> str:
    """That there is an identification, whose numbers are not those that were simulated."""
    return f"{identification} is there and was not used: without --model nothing that was identified counts"


def simulation_page(
    report: SimulateReport, data: ArtifactData, robot: Robot, numbers: str, unused: tuple[str, str] | None = None
) -> bytes:
    """The HTML page of a simulation: the player, the tables, the warnings. numbers: as `said_of_numbers`. unused: that
    an identification was not used, and the command that uses it."""
    seconds = sum(run.duration_s for run in report.runs)
    what = f"{counted(len(report.runs), 'run')}, {seconds:.1f} s of the robot, simulated: not a measurement."
    warnings = [f"{run.run}: {text}" for run in report.runs for text in run.warnings]
    page = Page(
        title=f"Simulation of {robot.title}",
        sentence=f"{what} {said_of_numbers(numbers)}",
        labels=[*([unused[0]] if unused else []), *warnings],
        tables=list(report_tables(report)),
        commands=[("with what was identified", unused[1])] if unused else [],
    )
    return playback_page(page, data, robot)


def _slack(run: SimulateRun) -> str:
    shares = [f"{k} {share:.0%}" for k, share in enumerate(run.slack_share) if share >= WORTH_A_WORD]
    return "cables " + ", ".join(shares) if shares else "none"


def _row(run: SimulateRun) -> list[str]:
    x, y, _ = run.com_displacement_m
    turned = "-" if run.heading_change_rad is None else f"{math.degrees(run.heading_change_rad):+.1f}"
    return [
        run.run, run.control.removeprefix("command "), run.start, f"{run.duration_s:.2f}",
        str(run.targets) if run.targets else "-", str(len(run.timed_out)),
        f"{1e3 * x:+.0f}, {1e3 * y:+.0f}", f"{1e3 * run.com_path_m:.0f}", turned, f"{1e3 * run.cap_height_max_m:.0f}",
        f"{run.tension_max_n:.1f} ({run.tension_max_cable})", f"{1e3 * run.penetration_max_m:.2f}",
    ]  # fmt: skip
