"""The report of `plan` as tables for the terminal, and its page with the player and the pictures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.views.page import Page, PageTable, Picture, counted
from r2s2r_cli.views.plan import signed, told
from r2s2r_cli.views.simulation_playback import playback_page
from schemas.results_plan import GaitFigures, PlanReport, PolicyFigures
from schemas.robot import Robot


def report_tables(report: PlanReport) -> Iterator[PageTable]:
    """The gaits of every behaviour by score, the long policies, and what the search took."""
    pairs = report.pairs
    yield PageTable(
        f"gaits: reward over {pairs} pairs of drawn numbers ({report.draws} draws) and start poses; shapes: a digit a "
        "motor, 1: its cable long, 0: short",
        ["name", "shapes", "best numbers", "mean", "sd", "score", "came back", "x, y [mm]", "turned [deg]", "time [s]"],
        [_gait(one, pairs) for one in report.gaits],
    )
    if report.policies:
        yield PageTable(
            "; ".join(["long policies", *(f"{one.name} leads to {_goal(one)}" for one in report.policies if one.goal)]),
            ["name", "targets", "shortcuts", "on paper x, y [m]", "turn [deg]", "simulated x, y [m]", "turn [deg]",
             "came back", "time [s]", "gaits"],
            [_policy(one) for one in report.policies],
        )  # fmt: skip
    seconds = ", ".join(f"{part} {spent:.1f} s" for part, spent in report.seconds.items())
    yield PageTable(
        "the search",
        ["symmetries", "targets simulated", "given up", "poses left behind", "gaits found", "time"],
        [[str(report.symmetries), str(report.simulated), str(report.lost), str(report.pruned), str(report.found),
          f"{report.wall_s:.1f} s: {seconds}"]],
    )  # fmt: skip


def plan_page(report: PlanReport, data: ArtifactData, robot: Robot, pictures: Sequence[tuple[str, bytes]]) -> bytes:
    """The HTML page of a plan: player, tables, pictures, warnings."""
    best = {one.behaviour: one for one in reversed(report.gaits)}
    said = "; ".join(
        f"{name} {told(name, best[name].mean)} +- {told(name, best[name].sd)} a gait" for name in reversed(best)
    )
    page = Page(
        title=f"Plan for {robot.title}",
        sentence=f"{counted(len(report.gaits), 'gait')} and {_long(len(report.policies))}, simulated with "
        f"{report.numbers}: {said}.",
        labels=list(report.warnings),
        tables=list(report_tables(report)),
        pictures=[Picture(title, png) for title, png in pictures],
    )
    return playback_page(page, data, robot)


def _long(count: int) -> str:
    return f"{count} long {'policy' if count == 1 else 'policies'}"


def _gait(one: GaitFigures, pairs: int) -> list[str]:
    def of(value: float) -> str:
        return told(one.behaviour, value)

    x, y = one.shift_m
    return [
        one.name, " ".join(one.shapes), of(one.nominal), of(one.mean), of(one.sd), of(one.score),
        f"{round(one.worked * pairs)} of {pairs}", f"{signed(1e3 * x)}, {signed(1e3 * y)}",
        signed(math.degrees(one.turn_rad)), f"{one.duration_s:.1f}",
    ]  # fmt: skip


def _goal(one: PolicyFigures) -> str:
    """Where it was to go. Its name stays the one that `execute` knows."""
    x, y, turn = one.goal or (math.nan,) * 3
    return f"({x:g} m, {y:g} m, {math.degrees(turn):.0f} deg)"


def _policy(one: PolicyFigures) -> list[str]:
    (ex, ey), (x, y), (sx, sy) = one.expected_m, one.shift_m, one.shift_sd_m
    shortcuts = f"{one.shortcuts} (-{counted(one.saved, 'target')})" if one.shortcuts else "0"
    return [
        one.name, str(one.targets), shortcuts, f"{signed(ex, 2)}, {signed(ey, 2)}",
        signed(math.degrees(one.expected_turn_rad)), f"{signed(x, 2)} +- {sx:.2f}, {signed(y, 2)} +- {sy:.2f}",
        f"{signed(math.degrees(one.turn_rad))} +- {math.degrees(one.turn_sd_rad):.0f}", f"{one.worked:.0%}",
        f"{one.duration_s:.0f}", " ".join(one.gaits),
    ]  # fmt: skip
