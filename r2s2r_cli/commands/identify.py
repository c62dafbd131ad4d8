"""`r2s2r identify`: recorded runs -> 30-identify.h5, the numbers of the simulator and what they are worth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

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
    from r2s2r_cli.commands.identify_inputs import Asked
    from schemas.results import StageResult
    from schemas.results_identify import IdentifyReport, IdentifyResult

METHODS = ("default", "paper", "cma")
DRIVES = {"replay": "command replay", "closed-loop": "closed loop"}


def identify(
    train: Annotated[
        list[str] | None,
        typer.Option(
            "--train", metavar="RUN:1-7", help="Target intervals to learn from; RUN alone: all of them. Repeatable."
        ),
    ] = None,
    test: Annotated[
        list[str] | None,
        typer.Option(
            "--test", metavar="RUN:8-11", help="Target intervals to predict. Default: what is not trained on."
        ),
    ] = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free",
            metavar="SPEC",
            help="Parameter that is free; repeatable. Default: the set of the method; +SPEC: beside it.",
        ),
    ] = None,
    fix: Annotated[
        list[str] | None,
        typer.Option("--fix", metavar="NAME=VALUE", help="Give a parameter this value and do not fit it; repeatable."),
    ] = None,
    with_effect: Annotated[
        list[str] | None,
        typer.Option(
            "--with-effect",
            metavar="ID[:K]",
            help="Put an effect (`r2s2r effects`) into the simulator and fit its numbers, or those of element K; "
            "repeatable. Default: the effects of the identification before; none: no effect.",
        ),
    ] = None,
    method: Annotated[
        str,
        typer.Option("--method", metavar="NAME", help="default, paper (Adam, Key Frame Loss) or cma (no gradients)."),
    ] = "default",
    drive: Annotated[
        str,
        typer.Option(
            "--drive", metavar="HOW", help="replay recorded motor commands, or closed-loop: simulate the PID."
        ),
    ] = "replay",
    discrepancy: Annotated[
        bool,
        typer.Option(
            "--discrepancy/--no-discrepancy",
            help="Add to the prediction of test intervals what the simulator leaves behind in training intervals and "
            "the robot repeats, where these speak for it; no physics.",
        ),
    ] = True,
    online: Annotated[
        bool,
        typer.Option("--online", help="Go on from the last iteration's estimate, run after run; parameters may drift."),
    ] = False,
    also: Annotated[
        list[int] | None,
        typer.Option("--also", metavar="N", help="Also the runs of iteration N, as NNN-RUN; repeatable."),
    ] = None,
    self_test: Annotated[
        bool, typer.Option("--self-test", help="Plant known values in this set-up, fit them, report bias and coverage.")
    ] = False,
    starts: Annotated[
        int | None, typer.Option("--starts", metavar="N", help="Fits from N starts; same as --set identify.starts=N.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of starts, re-drawn noise and bootstrap.")] = 0,
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
    """Learn the simulator's numbers from recorded runs, and say which of them can be trusted.

    Says before the fit what the runs can tell at all, and after it how sure each number is and how well intervals that
    were not fitted are predicted. Needs estimated runs; an iteration without its own takes those of the one before.

    Example: r2s2r identify --train crawl:1-7 --test crawl:8-11
    """
    from r2s2r_cli.commands.identify_hints import require_one_of, require_starts, typed_options, whole_hints
    from r2s2r_cli.commands.identify_inputs import Asked
    from r2s2r_cli.commands.outcome import print_config
    from r2s2r_cli.commands.wanted import wanted

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    place = here.iteration(iteration, create=True)
    overrides = parse_overrides(set_, "identify")
    if starts is not None:
        overrides["identify.starts"] = starts
    if show_config:
        print_config("identify", wanted(here, place, "identify", overrides, {}).settings, console)
        return
    typed = typed_options(
        train=train, test=test, free=free, fix=fix, with_effect=with_effect,
        method=None if method == "default" else method, drive=None if drive == "replay" else drive,
        online=online, no_discrepancy=not discrepancy, also=also, self_test=self_test, starts=starts, seed=seed or None,
        project=project, iteration=iteration, set_=set_, no_draw=not draw, json=json, quiet=quiet, force=force,
        dry_run=dry_run,
    )  # fmt: skip
    asked = Asked(
        here, place, train=tuple(train or ()), test=tuple(test or ()), free=tuple(free or ()), fix=tuple(fix or ()),
        effects=tuple(with_effect or ()), method=method, drive=DRIVES.get(drive, drive),  # type: ignore[arg-type]
        online=online, discrepancy=discrepancy, also=tuple(dict.fromkeys(also or ())), seed=seed, typed=tuple(typed),
    )  # fmt: skip
    with whole_hints([*typed, *["--resume"] * resume], asked.artifacts):
        require_one_of(method, METHODS, "--method")
        require_one_of(drive, tuple(DRIVES), "--drive")
        if starts is not None:
            require_starts(asked, overrides)
        if self_test:
            _plant(asked, overrides, console, dry_run)
        else:
            _fit(asked, overrides, console, _Ways(resume=resume, draw=draw, dry_run=dry_run, force=force))


@dataclass(frozen=True)
class _Ways:
    """How the command goes about it."""

    resume: bool
    draw: bool
    dry_run: bool
    force: bool


def _plant(asked: Asked, overrides: dict[str, Any], console: Console, dry_run: bool) -> None:
    from r2s2r_cli.commands.identify_run import plant

    settings = asked.project.config(asked.iteration, overrides).identify
    if dry_run:
        asked.check(settings, planted=True)
        console.say("would plant and fit, and write nothing")
    else:
        plant(asked, settings, console)


def _fit(asked: Asked, overrides: dict[str, Any], console: Console, how: _Ways) -> None:
    from r2s2r_cli.commands.identify_outcome import Outcome
    from r2s2r_cli.commands.identify_run import compute
    from r2s2r_cli.commands.outcome import show_outcome
    from r2s2r_cli.commands.resumable_run import ResumableRun
    from r2s2r_cli.store.checkpoint import CheckpointFile
    from r2s2r_cli.store.lock import writer
    from schemas.results_identify import IdentifyReport

    here, place = asked.project, asked.iteration
    settings = here.config(place, overrides).identify
    run = ResumableRun(
        stage="identify", kind="identification", project=here, iteration=place, find_inputs=asked.refs,
        report_model=IdentifyReport, overrides=overrides, flags=asked.flags(), dry_run=how.dry_run,
        force=how.force, resume=how.resume,
    )  # fmt: skip
    if how.dry_run or writer(here.root) is not None:  # to wait for the other one mends no misspelt request
        asked.check(settings)
    outcome = Outcome(place.number, asked.typed)
    checkpoint = run.checkpoint(CheckpointFile, command=["identify", *asked.typed])
    result, report = run.run_on(
        checkpoint,
        lambda: compute(asked, settings, checkpoint, console),
        outcome.pictures if how.draw else None,
        console.say,
    )
    show_outcome(_answer(result, report), console)
    if report is not None:
        outcome.show(report, console)


def _answer(result: StageResult, report: IdentifyReport | None) -> IdentifyResult:
    """The document: what every stage says, and at the top the numbers that others rely on."""
    from schemas.results_identify import IdentifyResult

    shared: dict[str, Any] = result.model_dump(exclude={"schema_"})
    if report is None:
        return IdentifyResult(**shared)
    return IdentifyResult(
        **shared, parameters=report.parameters, train=report.train, heldout=report.heldout, wall_s=report.wall_s,
        rollouts=report.rollouts,
    )  # fmt: skip
