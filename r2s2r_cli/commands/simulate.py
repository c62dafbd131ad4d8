"""`r2s2r simulate`: policies, or the motor commands of a recorded run, in the simulator -> simulation.h5."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import UsageError
from r2s2r_cli.options import (
    DrawOption,
    DryRunOption,
    ForceOption,
    IterationOption,
    JsonOption,
    ProjectOption,
    QuietOption,
    SetOption,
    ShowConfigOption,
    parse_overrides,
)
from r2s2r_cli.store.project import Iteration, Project

if TYPE_CHECKING:
    from collections.abc import Iterator

    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.commands.simulate_inputs import Asked
    from schemas.config import SimulateSettings
    from schemas.results_simulate import SimulateReport


def simulate(
    policies: Annotated[
        list[str] | None,
        typer.Argument(
            help="Policies: a TOML file, an artifact (all it holds), or ARTIFACT.h5:NAME (one of them).",
            show_default=False,
        ),
    ] = None,
    random: Annotated[
        int | None, typer.Option("--random", metavar="N", help="Also a random policy of N binary target shapes.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random policy; it is named random-SEED.")] = 0,
    replay: Annotated[
        list[str] | None,
        typer.Option("--replay", metavar="RUN", help="Also the recorded motor commands of this run; repeatable."),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="RUN",
            help="Start from the first estimated state of this run, or `rest`. Default: rest; a replay, its own run.",
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model", metavar="FILE", help="Simulate with the numbers of this 30-identify.h5. Default: robot.toml's."
        ),
    ] = None,
    project: ProjectOption = None,
    iteration: IterationOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    draw: DrawOption = True,
    dry_run: DryRunOption = False,
    force: ForceOption = False,
    set_: SetOption = None,
    show_config: ShowConfigOption = False,
) -> None:
    """Simulate policies with the robot's controller, or replay recorded motor commands; one run each.

    Starts from the rest state, settled under gravity and tension. Writes simulation.h5 of the iteration, a picture of
    each run, and a page that plays the runs in three dimensions.

    Example: r2s2r simulate policies/crawl.toml
    """
    from r2s2r_cli.commands.outcome import print_config, show_outcome
    from r2s2r_cli.commands.simulate_inputs import Asked
    from r2s2r_cli.commands.stage import StageRun
    from r2s2r_cli.commands.wanted import wanted
    from schemas.results_simulate import SimulateReport

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    place = here.iteration(iteration, create=True)
    overrides = parse_overrides(set_, "simulate")
    if show_config:
        print_config("simulate", wanted(here, place, "simulate", overrides, {}).settings, console)
        return
    if not policies and random is None and not replay:
        raise UsageError("there is nothing to simulate", where="r2s2r simulate",
                         expected="a policy file, --random N or --replay RUN", received="none of them",
                         hint="r2s2r simulate --random 15")  # fmt: skip
    asked = Asked(here, place, tuple(policies or ()), random, seed, tuple(replay or ()), start, model)
    if dry_run:
        asked.check()
    run = StageRun(
        stage="simulate", kind="simulation", project=here, iteration=place, find_inputs=asked.refs,
        report_model=SimulateReport, overrides=overrides, flags=asked.flags(), dry_run=dry_run, force=force,
    )  # fmt: skip
    settings = here.config(place, overrides).simulate
    result, report = run.run(
        lambda: _compute(asked, settings, console),
        (lambda data, said: _draw(data, asked, said)) if draw else None,
    )
    show_outcome(result, console)
    if report is not None:
        _show(report, asked, console)
    if result.state == "done" and draw:
        console.say(f"open {here.relative(_page(here, place))} in a browser to look at it in three dimensions")


def _page(project: Project, place: Iteration) -> Path:
    return project.artifact("simulation", place).with_suffix(".html")


def _compute(asked: Asked, settings: SimulateSettings, console: Console) -> tuple[ArtifactData, SimulateReport]:
    from r2s2r_cli.commands.interrupts import loaded

    stage = loaded("r2s2r_cli.stages.simulate")
    requests, robot = asked.requests(), asked.project.robot()
    passed = {request.name: 0 for request in requests}
    with console.progress("simulate, targets", sum(map(stage.parts, requests))) as advance:

        def progress(name: str, done: int) -> None:
            if done > passed[name]:
                advance(done - passed[name])
                passed[name] = done

        data, report = stage.simulate(
            robot, requests, settings, model=asked.simulator(), cache_dir=asked.project.cache, progress=progress
        )
    return data, report


def _draw(data: ArtifactData, asked: Asked, report: SimulateReport) -> Iterator[tuple[str, bytes]]:
    from r2s2r_cli.views.simulation import draw_simulation
    from r2s2r_cli.views.simulation_page import simulation_page

    robot = asked.project.robot()
    for run, png in draw_simulation(data, robot):
        yield f"-{run}.png", png
    yield ".html", simulation_page(report, data, robot, asked.numbers, _unused(asked))


def _show(report: SimulateReport, asked: Asked, console: Console) -> None:
    from r2s2r_cli.views.simulation_page import report_tables, said_of_numbers

    for table in report_tables(report):
        console.table(table.title, table.columns, table.rows)
    console.data(said_of_numbers(asked.numbers))
    for run in report.runs:
        for text in run.warnings:
            console.warn(f"{run.run}: {text}")
    if report.computed_by == "torch":
        console.warn("computed in plain torch, some hundred times slower: `r2s2r doctor` says what is missing")
    unused = _unused(asked)
    if unused:
        sentence, command = unused
        console.data(f"{sentence}.")
        console.hint(command)


def _unused(asked: Asked) -> tuple[str, str] | None:
    """That an identification was not used, and the same command with it."""
    from r2s2r_cli.commands.typed import typed_words
    from r2s2r_cli.views.simulation_page import said_of_unused

    path = asked.unused
    if path is None:
        return None
    command = shlex.join(["r2s2r", *typed_words("simulate"), "--model", os.path.relpath(path)])
    return said_of_unused(asked.project.relative(path)), command
