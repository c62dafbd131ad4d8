"""`r2s2r plan`: gaits and long policies for the simulator's robot -> 40-plan.h5."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.console import Console
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
from r2s2r_cli.store.project import Project

if TYPE_CHECKING:
    from collections.abc import Iterator

    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.commands.plan_inputs import Asked
    from r2s2r_cli.store.checkpoint import CheckpointFile
    from schemas.config import PlanSettings
    from schemas.results_plan import PlanReport
    from schemas.robot import Robot


def plan(
    behaviour: Annotated[
        list[str] | None,
        typer.Option(
            "--behaviour",
            metavar="NAME",
            help="forward, backward, clockwise, counterclockwise, or package.module:function; repeatable. "
            "Default: these four.",
        ),
    ] = None,
    to: Annotated[
        list[str] | None,
        typer.Option(
            "--to",
            metavar="X,Y,HEADING",
            help="Also a policy that goes there: metres along the principal axis and forward, degrees; repeatable.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of drawn numbers and start poses.")] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where the same command was interrupted.")] = False,
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
    """Search gaits in the simulator, judge them over what is not known, make long policies of them.

    Uses 30-identify.h5 of the iteration; without one, robot.toml's numbers. Writes 40-plan.h5, a picture of every
    behaviour and policy from above, and a page that plays them. Its policies run with `r2s2r record 40-plan.h5:NAME`.

    Example: r2s2r plan --to 0.5,1,90
    """
    from r2s2r_cli.commands.outcome import print_config, show_outcome
    from r2s2r_cli.commands.plan_inputs import Asked
    from r2s2r_cli.commands.resumable_run import ResumableRun
    from r2s2r_cli.commands.wanted import wanted
    from r2s2r_cli.store.checkpoint import CheckpointFile
    from schemas.results_plan import PlanReport

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    place = here.iteration(iteration, create=True)
    overrides = parse_overrides(set_, "plan")
    if show_config:
        print_config("plan", wanted(here, place, "plan", overrides, {}).settings, console)
        return
    settings = here.config(place, overrides).plan
    asked = Asked(here, place, tuple(behaviour or ()), tuple(to or ()), seed, settings.reach_m)
    asked.check(settings)
    run = ResumableRun(
        stage="plan", kind="plan", project=here, iteration=place, find_inputs=asked.refs, report_model=PlanReport,
        overrides=overrides, flags=asked.flags(), dry_run=dry_run, force=force, resume=resume,
    )  # fmt: skip
    again = ["plan", *_typed(behaviour, to, seed, iteration, set_, project)]
    checkpoint = run.checkpoint(CheckpointFile, command=again)
    result, report = run.run_on(
        checkpoint,
        lambda: _compute(asked, settings, checkpoint, console),
        (lambda data, said: _draw(data, here.robot(), said)) if draw else None,
        console.say,
        done="found",
    )
    show_outcome(result, console)
    if report is not None:
        _show(report, console)
    if result.state == "done" and draw:
        page = here.relative(here.artifact("plan", place).with_suffix(".html"))
        console.say(f"open {page} in a browser to look at the policies in three dimensions")


def _typed(
    behaviour: list[str] | None, to: list[str] | None, seed: int, iteration: int | None, set_: list[str] | None,
    project: Path | None,
) -> list[str]:  # fmt: skip
    """The options as they were given, for a command that goes on."""
    words = []
    for option, values in (("--behaviour", behaviour), ("--to", to), ("--set", set_)):
        for value in values or ():
            words += [f"{option}={value}"]
    single = {"--seed": seed or None, "--iteration": iteration, "--project": project}
    return words + [word for name, value in single.items() if value is not None for word in (name, str(value))]


def _compute(
    asked: Asked, settings: PlanSettings, checkpoint: CheckpointFile, console: Console
) -> tuple[ArtifactData, PlanReport]:
    from r2s2r_cli.commands.identify_run import Clock
    from r2s2r_cli.commands.interrupts import loaded

    request, robot = asked.request(settings), asked.project.robot()
    if not request.belief.identified:
        # The report says it as well, but after minutes of work: whoever forgot `identify` would rather stop now.
        console.say(
            f"nothing was identified in iteration {asked.iteration.number}: the gaits are searched with the numbers of "
            f"robot.toml; with those of runs: r2s2r identify --iteration {asked.iteration.number}"
        )
    stage = loaded("r2s2r_cli.stages.plan.stage")
    clock = Clock()
    with console.parts() as show:

        def progress(part: str, done: int, total: int) -> None:
            clock.enter(part)
            show(part, done, total, "")

        clock.enter("start")
        data, report = stage.plan(
            robot, request, settings, cache_dir=asked.project.cache, threads=_cores(), progress=progress,
            checkpoint=checkpoint,
        )  # fmt: skip
    return data, report.model_copy(update={"wall_s": clock.total(), "seconds": clock.seconds()})


def _cores() -> int:
    """Processors that this process may use, four at most: what is found does not depend on it."""
    import os

    known = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(4, known)


def _draw(data: ArtifactData, robot: Robot, report: PlanReport) -> Iterator[tuple[str, bytes]]:
    from r2s2r_cli.views.plan import draw_plan
    from r2s2r_cli.views.plan_page import plan_page

    pictures = []
    for name, title, png in draw_plan(data, robot):
        yield f"-{name}.png", png
        pictures.append((title, png))
    yield ".html", plan_page(report, data, robot, pictures)


def _show(report: PlanReport, console: Console) -> None:
    from r2s2r_cli.views.plan_page import report_tables

    for table in report_tables(report):
        console.table(table.title, table.columns, table.rows)
    for text in report.warnings:
        console.warn(text)
    if report.computed_by == "torch":
        console.warn("computed in plain torch, some hundred times slower: `r2s2r doctor` says what is missing")
