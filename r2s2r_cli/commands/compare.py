"""`r2s2r compare`: real runs beside the same policies in one or several simulators -> 60-compare.h5."""

from __future__ import annotations

from enum import StrEnum
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
)
from r2s2r_cli.store.project import Project

if TYPE_CHECKING:
    from collections.abc import Iterator

    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.commands.compare_inputs import Asked
    from r2s2r_cli.store.checkpoint_arrays import ArrayCheckpoint
    from schemas.results_compare import CompareReport
    from schemas.robot import Robot

MOST_BYTES = 1_000_000_000
"""Of a checkpoint. A minute of one simulated run takes less than half a million."""


class Of(StrEnum):
    """What `--of` takes."""

    RECORD = "record"
    EXECUTE = "execute"


def compare(
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model", metavar="[NAME=]FILE",
            help="A 30-identify.h5; repeatable. Default: all up to this iteration. robot.toml is always there.",
        ),
    ] = None,
    of: Annotated[
        Of | None,
        typer.Option("--of", help="Runs of 51-estimate.h5 (execute) or 20-estimate.h5. Default: executed, if any."),
    ] = None,
    own: Annotated[
        bool, typer.Option("--own", help="Without the executed runs of earlier iterations, which are compared as well.")
    ] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where the same command was interrupted.")] = False,
    project: ProjectOption = None,
    iteration: IterationOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    draw: DrawOption = True,
    dry_run: DryRunOption = False,
    force: ForceOption = False,
) -> None:  # fmt: skip
    """Compare real runs with the same policies in the simulator: ends, headings, paths, caps, times, ranking of gaits.

    Every policy is simulated with the controller in the loop, from where the real robot came to rest before it; key
    frames are by command replay. Each error stands beside the floor: what a perfect simulator would be found to be
    wrong by. From the second iteration on the executed runs of the earlier ones are compared as well: how the gap went.

    Example: r2s2r compare --iteration 2
    """
    from r2s2r_cli.commands.compare_inputs import Asked
    from r2s2r_cli.commands.outcome import show_outcome
    from r2s2r_cli.commands.resumable_run import ResumableRun
    from r2s2r_cli.installed import installed_words
    from r2s2r_cli.store.checkpoint_arrays import ArrayCheckpoint
    from schemas.results_compare import CompareReport

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    place = here.iteration(iteration)
    asked = Asked(here, place, tuple(model or ()), None if of is None else of.value, own)
    run = ResumableRun(
        stage="compare", kind="comparison", project=here, iteration=place, find_inputs=asked.refs,
        report_model=CompareReport, flags=asked.flags(), dry_run=dry_run, force=force, resume=resume,
    )  # fmt: skip
    # An effect of a package is another one in its next version.
    checkpoint = run.checkpoint(ArrayCheckpoint, installed_words(), most=MOST_BYTES)
    result, report = run.run_on(
        checkpoint,
        lambda: _compute(asked, checkpoint, console),
        (lambda data, said: _draw(data, said, here.robot())) if draw else None,
        console.say,
        done="simulated",
    )
    show_outcome(result, console)
    if report is not None:
        _show(report, console)


def _compute(asked: Asked, checkpoint: ArrayCheckpoint, console: Console) -> tuple[ArtifactData, CompareReport]:
    from r2s2r_cli.commands.interrupts import loaded

    stage = loaded("r2s2r_cli.stages.compare")
    (runs, left_out), (models, stale) = asked.runs(), asked.simulators()
    settings = asked.project.config(asked.iteration, {}).simulate
    with console.progress("compare, runs", len(runs) * len(models)) as advance:
        data, report = stage.compare(
            runs, models, settings, keyframe_floor_m=asked.keyframe_floor(), cache_dir=asked.project.cache,
            checkpoint=checkpoint, done=lambda: advance(1),
        )  # fmt: skip
    return data, report.model_copy(update={"stale": stale, "warnings": (*left_out, *report.warnings)})


def _draw(data: ArtifactData, report: CompareReport, robot: Robot) -> Iterator[tuple[str, bytes]]:
    from r2s2r_cli.views.compare import draw_comparison
    from r2s2r_cli.views.compare_history import draw_history
    from r2s2r_cli.views.compare_page import comparison_page
    from r2s2r_cli.views.compare_strip import draw_strips

    pictures, strips = dict(draw_comparison(data)), dict(draw_strips(data, robot))
    for run, png in pictures.items():
        yield f"-{run}.png", png
    for run, png in strips.items():
        yield f"-{run}-frames.png", png
    history = draw_history(report)
    if history is not None:
        yield "-history.png", history
    yield ".html", comparison_page(report, data, robot, pictures, strips, history)


def _show(report: CompareReport, console: Console) -> None:
    from r2s2r_cli.views.compare_tables import comparison_tables
    from r2s2r_cli.views.compare_verdict import verdict

    for table in comparison_tables(report):
        console.table(table.title, table.columns, table.rows)
    console.data(verdict(report))
    for text in report.warnings:
        console.warn(text)
