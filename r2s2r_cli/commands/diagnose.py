"""`r2s2r diagnose`: identified simulator and runs -> 70-diagnose.h5: where the gap lies, what causes it, how far it
shrinks."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
from r2s2r_cli.store.project import Project

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.commands.diagnose_inputs import Asked
    from r2s2r_cli.store.checkpoint_arrays import ArrayCheckpoint
    from schemas.config import DiagnoseSettings
    from schemas.results_diagnose import DiagnoseReport


def diagnose(
    train: Annotated[
        list[str] | None,
        typer.Option("--train", metavar="RUN:1-7", help="Target intervals to fit. Default: those of 30-identify.h5."),
    ] = None,
    test: Annotated[
        list[str] | None,
        typer.Option("--test", metavar="RUN:8-11", help="Target intervals to judge on. Default: as identified."),
    ] = None,
    healthy: Annotated[
        list[str] | None,
        typer.Option("--healthy", metavar="RUN", help="A run from when nothing was wrong; repeatable."),
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            metavar="ID",
            help="Consider only this effect; repeatable. The word catalogue: all that are looked for by default, "
            "beside those that are named.",
        ),
    ] = None,
    model: Annotated[
        Path | None, typer.Option("--model", metavar="FILE", help="Another 30-identify.h5 as the nominal simulator.")
    ] = None,
    also: Annotated[
        list[int] | None, typer.Option("--also", metavar="N", help="Also the runs of iteration N; repeatable.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of filters and bootstrap.")] = 0,
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
    """Say where the sim-to-real gap lies, which unmodelled effect causes it, and how far it shrinks with that effect.

    Fits the identified simulator again, alone and with every effect of the catalogue, and compares them on all runs
    together and on what was left out. Says `no_gap`, `ambiguous` or `unknown` where that is the answer, and what to run
    next.

    Example: r2s2r diagnose
    """
    from r2s2r_cli.commands.diagnose_inputs import Asked
    from r2s2r_cli.commands.diagnose_outcome import answer, pictures, show
    from r2s2r_cli.commands.identify_hints import typed_options, whole_hints
    from r2s2r_cli.commands.outcome import print_config, show_outcome
    from r2s2r_cli.commands.resumable_run import ResumableRun
    from r2s2r_cli.commands.wanted import wanted
    from r2s2r_cli.store.checkpoint_arrays import ArrayCheckpoint
    from r2s2r_cli.store.lock import writer
    from schemas.results_diagnose import DiagnoseReport

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    place = here.iteration(iteration)
    overrides = parse_overrides(set_, "diagnose")
    if show_config:
        print_config("diagnose", wanted(here, place, "diagnose", overrides, {}).settings, console)
        return
    asked = Asked(
        here, place, model=model, train=tuple(train or ()), test=tuple(test or ()), healthy=tuple(healthy or ()),
        effects=tuple(effect or ()), also=tuple(dict.fromkeys(also or ())), seed=seed,
    )  # fmt: skip
    typed = typed_options(
        train=train, test=test, healthy=healthy, effect=effect, model=model, also=also, seed=seed or None,
        project=project, iteration=iteration, set_=set_, resume=resume, no_draw=not draw, json=json, quiet=quiet,
        force=force, dry_run=dry_run,
    )  # fmt: skip
    with whole_hints(typed, asked.artifacts, "r2s2r diagnose"):
        _require_effects(asked.named)
        settings = here.config(place, overrides).diagnose
        run = ResumableRun(
            stage="diagnose", kind="diagnosis", project=here, iteration=place, find_inputs=asked.refs,
            report_model=DiagnoseReport, overrides=overrides, flags=asked.flags(), dry_run=dry_run,
            force=force, resume=resume,
        )  # fmt: skip
        if dry_run:
            asked.evidence(console.say)
        elif writer(here.root) is not None:  # to wait for the other one mends no misspelt request
            asked.evidence(lambda _: None)
        checkpoint = run.checkpoint(ArrayCheckpoint)
        result, report = run.run_on(
            checkpoint,
            lambda: _compute(asked, settings, checkpoint, console, draw),
            partial(pictures, asked=asked.named, only=asked.only, link=here.file.link) if draw else None,
            console.say,
            done="simulated",
        )
    show_outcome(answer(result, report), console)
    if report is not None:
        show(report, console, asked.named, only=asked.only, link=here.file.link)


def _require_effects(names: tuple[str, ...]) -> None:
    """Raises UsageError for an effect that is not known, or with an element: here they are found, not chosen."""
    if names:
        from r2s2r_cli.commands.diagnose_inputs import CATALOGUE
        from r2s2r_cli.stages.effects import effect_of

        for name in names:
            known, colon, _ = name.partition(":")
            if known == CATALOGUE:
                raise UsageError("the catalogue is named as a whole", where="--effect", expected=known, received=name,
                                 hint=f"r2s2r diagnose --effect {known}")  # fmt: skip
            try:
                effect_of(known, where="--effect", command="r2s2r diagnose --effect")
            except UsageError as error:
                error.received = name
                raise
            if colon:
                raise UsageError(
                    "an effect is named without its element here: diagnose finds which one it is",
                    where="--effect", expected=known, received=name, hint=f"r2s2r diagnose --effect {known}",
                )  # fmt: skip


def _compute(
    asked: Asked, settings: DiagnoseSettings, checkpoint: ArrayCheckpoint, console: Console, draw: bool
) -> tuple[ArtifactData, DiagnoseReport]:
    from r2s2r_cli.commands.diagnose_outcome import NEXT
    from r2s2r_cli.commands.interrupts import loaded

    evidence = asked.evidence(console.say)
    stage = loaded("r2s2r_cli.stages.diagnose.stage")
    seconds: dict[str, float] = {}
    begun = time.monotonic()
    with _shown(console, seconds) as progress:
        data, report = stage.diagnosed(
            evidence, settings, seed=asked.seed, effects=asked.considered(), policies=asked.policies(),
            cache_dir=asked.project.cache, progress=progress, checkpoint=checkpoint,
        )  # fmt: skip
    if report.next_gait is not None and draw:  # the policy is a file beside the pictures
        target = asked.project.artifact("diagnosis", asked.iteration)
        file = asked.project.relative(target.with_name(target.stem + NEXT))
        report = report.model_copy(update={"next_gait": report.next_gait.model_copy(update={"file": file})})
    numbers = {
        "iteration": None if asked.iteration is None else asked.iteration.number,
        "free_iteration": 1 + max((one.number for one in asked.project.iterations()), default=0),
    }
    return data, report.model_copy(update={**numbers, "wall_s": time.monotonic() - begun, "seconds": seconds})


PARTS = ("parity", "healthy runs", "refit", "screening", "fits", "left out", "where", "judged", "next gait")
"""Of the work, in its order."""


@contextmanager
def _shown(console: Console, seconds: dict[str, float]) -> Iterator[Callable[[str, int, int], None]]:
    """Progress over all parts; keeps the wall time of each."""
    with console.progress("diagnose", len(PARTS)) as advance:
        state: dict[str, Any] = {"part": None, "since": time.monotonic(), "at": 0}

        def told(part: str, done: int, total: int) -> None:
            del done, total
            if part == state["part"]:
                return
            now = time.monotonic()
            if state["part"] is not None:
                seconds[state["part"]] = seconds.get(state["part"], 0.0) + now - state["since"]
            place = PARTS.index(part) if part in PARTS else state["at"]
            if place > state["at"]:
                advance(place - state["at"])
                state["at"] = place
            state["part"], state["since"] = part, now

        yield told
        if state["part"] is not None:
            seconds[state["part"]] = seconds.get(state["part"], 0.0) + time.monotonic() - state["since"]
        advance(len(PARTS) - state["at"])
