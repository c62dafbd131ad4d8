"""`r2s2r import`: foreign logs -> 10-record.h5. Nothing of a source is changed or guessed; what is dropped is said."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import InputError, UsageError
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
from schemas.header import Header, InputRef

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from r2s2r_cli.artifact import ArtifactData
    from schemas.config import ImportSettings
    from schemas.results_import import ImportReport, ImportReports


class Format(StrEnum):
    """What `--format` takes."""

    AUTO = "auto"
    TRAJECTORY_CSV = "trajectory_csv"
    AUTHORS_FOLDER = "authors_folder"
    TUM_RGBD = "tum_rgbd"


def import_(
    sources: Annotated[
        list[Path], typer.Argument(help="Trajectory CSVs or recorder folders; one run each, named by its stem.")
    ],
    format_: Annotated[
        Format, typer.Option("--format", help="What the sources are; default: decided by what lies there.")
    ] = Format.AUTO,
    depth_scale: Annotated[
        float | None,
        typer.Option("--depth-scale", metavar="METRES", help="Metres a depth count, where a folder does not say it."),
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
    """Bring logs of a real robot into the project: every row is kept, what is left out later is marked with the reason.

    Says what was dropped and why, the noise, the rod lengths, the ground offset, the target intervals and segments.
    A TOML sidecar of the same stem says which robot it was and who measured it.

    Example: r2s2r import crawl.csv
    """
    from r2s2r_cli.commands.stage import StageRun, print_config, show_outcome, wanted

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    place = here.iteration(iteration, create=True)
    overrides = parse_overrides(set_)
    if show_config:
        print_config(wanted(here, place, "import", overrides, {}).settings, console)
        return
    settings = here.config(place, overrides).imports
    flags = {"format": format_, "depth_scale": depth_scale}
    run = StageRun(
        stage="import", kind="recording", project=here, iteration=place, console=console,
        inputs=_refs(here, sources, format_), overrides=overrides, flags=flags, dry_run=dry_run, force=force,
        guard=_guard(here, place, sources),
    )  # fmt: skip
    outcome: list[ImportReports] = []

    def compute() -> tuple[ArtifactData, ImportReports]:
        data, reports = _compute(here, sources, format_, depth_scale, settings, console)
        outcome.append(reports)
        return data, reports

    result = run.run(compute, (lambda data: _draw(here, data, outcome[0])) if draw else None)
    show_outcome(result, console)
    for report in outcome[0].runs if outcome else ():
        _show(report, console)
    if result.state == "done":
        console.hint("r2s2r estimate")


def _refs(project: Project, sources: list[Path], format_: Format) -> list[InputRef]:
    from r2s2r_cli.stages.import_ import check_source
    from r2s2r_cli.stages.import_.sidecar import sidecar_path
    from r2s2r_cli.store.staleness import source_ref

    refs: list[InputRef] = []
    for path in sources:
        check_source(path, format_.value)
        sidecar = sidecar_path(path)
        try:
            refs.append(source_ref(project, path))
            if sidecar.is_file():
                refs.append(source_ref(project, sidecar))
        except OSError as error:
            raise InputError(
                "the source cannot be read",
                where=str(path),
                expected="a log that is there",
                received=error.strerror or str(error),
                hint=f"ls -la '{path.parent}'",
            ) from error
    return refs


def _guard(project: Project, place: Iteration, sources: list[Path]) -> Callable[[Header | None], None]:
    """Raw runs are not replaced by others without being told to."""
    names = {project.relative(path) for path in sources}

    def guard(present: Header | None) -> None:
        if not place.artifact("recording").exists():
            return
        if present is not None and present.provenance.stage == "import":
            before = {ref.path for ref in present.provenance.inputs}
            if names <= before:
                return
            received = "made from " + ", ".join(sorted(before))
        else:
            received = f"made by {present.provenance.stage}" if present else "a damaged recording"
        raise UsageError(
            "this iteration has a recording already",
            where=project.relative(place.artifact("recording")),
            expected="none, or one of the same sources",
            received=received,
            hint=f"r2s2r import {' '.join(map(str, sources))} --iteration {project.iterations()[-1].number + 1}",
        )

    return guard


def _compute(
    project: Project, sources: list[Path], format_: Format, depth_scale: float | None, settings: ImportSettings,
    console: Console,
) -> tuple[ArtifactData, ImportReports]:  # fmt: skip
    from r2s2r_cli.stages.import_ import import_source, merge_runs
    from r2s2r_cli.stages.init.facts import FACTS
    from schemas.results_import import ImportReports

    robot = project.robot()
    known = {name: [facts.rod_length.value] * len(facts.rods) for name, facts in FACTS.items()}
    runs = []
    with console.progress("import", len(sources)) as advance:
        for path in sources:
            runs.append(
                import_source(
                    path, robot=robot, format=format_.value, depth_scale=depth_scale,
                    rod_length_tolerance=settings.rod_length_tolerance, known_rods=known,
                )
            )  # fmt: skip
            advance(1)
    return merge_runs(runs), ImportReports(runs=tuple(run.report for run in runs))


def _draw(project: Project, data: ArtifactData, reports: ImportReports) -> Iterator[tuple[str, bytes]]:
    from r2s2r_cli.views.recording import draw_recording, recording_page

    radius = project.robot().rods[0].cap_radius_m
    pictures = dict(draw_recording(data, radius))
    for run, png in pictures.items():
        yield f"-{run}.png", png
    yield ".html", recording_page(reports, pictures)


def _show(report: ImportReport, console: Console) -> None:
    from r2s2r_cli.views.recording import import_rows

    console.table(f"run {report.run}: {report.source}", ["what", "found"], import_rows(report))
    for text in report.warnings:
        console.warn(f"{report.run}: {text}")
