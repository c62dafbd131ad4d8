"""`r2s2r floor`: repeats of the robot -> floor.h5, what remains of any gap when nothing is wrong."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import ArtifactError, UsageError, require_mujoco
from r2s2r_cli.options import DrawOption, DryRunOption, ForceOption, JsonOption, ProjectOption, QuietOption
from r2s2r_cli.store.project import Iteration, Project

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.stages.floor import Numerics, SeenRun, SensedRun
    from schemas.header import InputRef
    from schemas.results_floor import FloorReport

GAITS_MAX = 1000


class Carry(StrEnum):
    """What `--by` takes."""

    POSE = "pose"
    DISPLACEMENT = "displacement"


def floor(
    iteration: Annotated[
        list[int] | None,
        typer.Option("--iteration", metavar="N", help="Of these iterations; repeatable. Default: all."),
    ] = None,
    by: Annotated[
        Carry, typer.Option("--by", help="Repeats are laid on each other by their start pose, or by what they moved.")
    ] = Carry.POSE,
    numerics: Annotated[
        int,
        typer.Option("--numerics", metavar="N", help="Also engine against the rig's model over N random gait steps."),
    ] = 0,
    project: ProjectOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    draw: DrawOption = True,
    dry_run: DryRunOption = False,
    force: ForceOption = False,
) -> None:
    """Measure how far the robot repeats itself, in end caps and in cable lengths; no simulator can be better than that.

    From 3 or more repeats of a policy, from commissioning runs, or from steps of the same phase within a run. Judged on
    the estimates and recordings that the iterations have, of recorded and of executed runs.

    Example: r2s2r floor --iteration 1
    """
    from r2s2r_cli.commands.outcome import show_outcome
    from r2s2r_cli.commands.stage import StageRun
    from schemas.results_floor import FloorReport

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    if not 0 <= numerics <= GAITS_MAX:
        raise UsageError("this is no number of gait steps", where="--numerics", expected=f"0 to {GAITS_MAX}",
                         received=str(numerics), hint="r2s2r floor --numerics 16")  # fmt: skip
    if numerics:
        require_mujoco("floor --numerics")
    numbers = list(dict.fromkeys(iteration or ()))  # a run asked for twice does not repeat itself
    places = wanted_places(here, numbers)
    run = StageRun(
        stage="floor", kind="floor", project=here, iteration=None, find_inputs=lambda: _refs(here, places, numerics),
        report_model=FloorReport, dry_run=dry_run, force=force,
        flags={"iterations": numbers, "by": by.value, "numerics": numerics},
    )  # fmt: skip
    result, report = run.run(
        lambda: _compute(here, places, by, numerics, console), (lambda data, said: _draw(data, said)) if draw else None
    )
    show_outcome(result, console)
    if report is not None:
        _show(report, console)


def _sources(place: Iteration) -> Iterator[tuple[Path, Path, bool]]:
    """Recording and estimate of an iteration, there or not; then those of its executed plan (True)."""
    for executed in (False, True):
        yield place.artifact("recording", executed=executed), place.artifact("estimate", executed=executed), executed


def wanted_places(project: Project, numbers: Sequence[int]) -> list[Iteration]:
    """The iterations whose runs are measured, all without a number. Raises UsageError for one that does not exist."""
    return [project.iteration(number) for number in numbers] if numbers else project.iterations()


def read_of(places: Sequence[Iteration]) -> list[Path]:
    """Recordings and estimates that are there."""
    pairs = [pair[:2] for place in places for pair in _sources(place)]
    return [path for pair in pairs for path in pair if path.exists()]


def _refs(project: Project, places: Sequence[Iteration], numerics: int) -> list[InputRef]:
    from r2s2r_cli.store.header import whole_header
    from r2s2r_cli.store.staleness import artifact_ref

    found = read_of(places)
    if not found and not numerics:
        raise ArtifactError("there is nothing to measure a floor with", where="r2s2r floor", received="none",
                            expected="an iteration with 10-record.h5 or 20-estimate.h5, or executed runs",
                            hint=project.first_data())  # fmt: skip
    return [artifact_ref(project, path, whole_header(path)) for path in found]


def _compute(
    project: Project, places: Sequence[Iteration], by: Carry, gaits: int, console: Console
) -> tuple[ArtifactData, FloorReport]:
    from r2s2r_cli.stages.floor import floor as measure

    seen, sensed, policies = _runs(project, places)
    found: Numerics | None = None
    if gaits:
        from r2s2r_cli.commands.floor_numerics import numerics

        with console.progress("engine and rig", 1) as advance:
            found = numerics(project.robot(), gaits, project.cache)
            advance(1)
    return measure(seen, sensed, policies=policies, numerics=found, by=by.value)


def _runs(project: Project, places: Sequence[Iteration]) -> tuple[list[SeenRun], list[SensedRun], dict[str, str]]:
    """Runs with caps, runs with sensors, and the policy of each by name. Recorded runs are called NUMBER:RUN, executed
    ones too unless that is taken; the same name of a policy means another one in the plan of another iteration."""
    from r2s2r_cli.stages.floor import seen_run, sensed_run
    from r2s2r_cli.stages.repeated import asked_repeats, policy_of
    from r2s2r_cli.store.read import read_artifact

    robot = project.robot()
    seen: list[SeenRun] = []
    sensed: list[SensedRun] = []
    policies: dict[str, str] = {}
    for place, source, states, executed in ((one, *pair) for one in places for pair in _sources(one)):
        header, recording = read_artifact(source, "recording") if source.exists() else (None, None)
        estimate = read_artifact(states, "estimate")[1] if states.exists() else None
        taken = {*policies, *(one.name for one in seen)}

        def called(run: str, number: int = place.number, taken: set[str] = taken) -> str:
            return f"{number}:executed-{run}" if f"{number}:{run}" in taken else f"{number}:{run}"

        for run in estimate.runs() if estimate is not None else ():
            one = seen_run(called(run), estimate, recording, run) if estimate is not None else None
            seen += [one] if one is not None else []
        if header is None or recording is None:
            continue
        repeats = asked_repeats(header.provenance.settings)
        for run in recording.runs():
            policy = policy_of(recording, run, repeats)
            policies[called(run)] = f"{place.number}:{policy}" if executed else policy
            other = sensed_run(called(run), recording, run, robot)
            sensed += [other] if other is not None else []
    return seen, sensed, policies


def _draw(data: ArtifactData, report: FloorReport) -> Iterator[tuple[str, bytes]]:
    from r2s2r_cli.views.floor import draw_floor, floor_page

    picture = draw_floor(data)
    yield ".png", picture
    yield ".html", floor_page(report, picture)


def _show(report: FloorReport, console: Console) -> None:
    from r2s2r_cli.views.floor import floor_tables

    for table in floor_tables(report):
        console.table(table.title, table.columns, table.rows)
    for text in report.warnings:
        console.warn(text)
