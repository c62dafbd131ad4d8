"""`r2s2r import`: foreign logs -> 10-record.h5. Nothing of a source is changed or guessed; what is dropped is said."""

from __future__ import annotations

import math
import shlex
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import ArtifactError, InputError, UsageError, quoted
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
        list[Path] | None,
        typer.Argument(
            help="Trajectory CSVs or recorder folders; one run each, named by its stem.", show_default=False
        ),
    ] = None,
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
    from r2s2r_cli.commands.outcome import print_config, show_outcome
    from r2s2r_cli.commands.stage import StageRun
    from r2s2r_cli.commands.wanted import wanted
    from schemas.results_import import ImportReports

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    place = here.iteration(iteration, create=True)
    overrides = parse_overrides(set_, "import")
    if show_config:
        print_config("import", wanted(here, place, "import", overrides, {}).settings, console)
        return
    if not sources:
        raise UsageError("no log is named", where="r2s2r import", expected="a trajectory CSV or a recorder folder",
                         received="nothing", hint=here.first_data())  # fmt: skip
    if depth_scale is not None and not (math.isfinite(depth_scale) and depth_scale > 0):
        raise UsageError("this is no size of a depth count", where="--depth-scale", expected="metres, above 0",
                         received=str(depth_scale), hint="--depth-scale 0.001")  # fmt: skip
    settings = here.config(place, overrides).imports
    flags = {"format": format_.value, "depth_scale": depth_scale}
    logs = sources
    run = StageRun(
        stage="import", kind="recording", project=here, iteration=place, find_inputs=lambda: _refs(here, logs, format_),
        report_model=ImportReports, overrides=overrides, flags=flags, dry_run=dry_run, force=force,
        guard=_guard(here, place, logs, format_),
    )  # fmt: skip
    result, report = run.run(
        lambda: _compute(here, logs, format_, depth_scale, settings, console),
        (lambda data, said: _draw(here, data, said)) if draw else None,
    )
    if result.state == "dry_run":  # read and checked as the command would, and forgotten
        _compute(here, logs, format_, depth_scale, settings, console)
    show_outcome(result, console)
    for said in report.runs if report is not None else ():
        _show(said, console)
    if result.state == "done" and report is not None and all("caps" in said.streams for said in report.runs):
        console.hint(f"r2s2r estimate --iteration {place.number}")


def _refs(project: Project, sources: list[Path], format_: Format) -> list[InputRef]:
    from r2s2r_cli.commands.sources import other_than_log
    from r2s2r_cli.commands.typed import typed_instead
    from r2s2r_cli.stages.import_ import check_source
    from r2s2r_cli.stages.import_.files import Missing
    from r2s2r_cli.stages.import_.sidecar import sidecar_path
    from r2s2r_cli.store.staleness import source_ref

    refs: list[InputRef] = []
    for path in sources:
        other = other_than_log(path) if format_.value == "auto" else None
        if other is not None:
            raise InputError("this is no log that can be imported", where=str(path), received=other.words,
                             expected="a trajectory CSV or a recorder folder", hint=other.command)  # fmt: skip
        try:
            check_source(path, format_.value)
        except Missing as error:
            if error.near:
                error.hint = typed_instead("import", str(path), str(path.with_name(error.near)))
            raise
        sidecar = sidecar_path(path)
        try:
            refs.append(source_ref(project, path))
            if sidecar.is_file():
                refs.append(source_ref(project, sidecar, kind="sidecar"))
        except OSError as error:
            raise InputError(
                "the source cannot be read",
                where=str(path),
                expected="a log that is there",
                received=error.strerror or str(error),
                hint=f"ls -la {quoted(path.parent)}",
            ) from error
    return refs


def _guard(project: Project, place: Iteration, sources: list[Path], format_: Format) -> Callable[[Header | None], None]:
    """A recording is replaced only by one that holds all its runs."""
    from r2s2r_cli.commands.freshness import identity

    def guard(present: Header | None) -> None:
        path = place.artifact("recording")
        if not path.exists():
            return
        made = (present or _head(project, path)).provenance
        asked = _refs(project, sources, format_)
        paths, same = {ref.path for ref in asked}, {identity(ref) for ref in asked}
        before = [ref for ref in made.inputs if ref.kind in ("file", "folder")]
        if before and all(ref.path in paths or identity(ref) in same for ref in before):
            return
        received = f"made by {made.stage} from {', '.join(ref.path for ref in before) or 'a robot'}"
        raise UsageError(
            "this iteration has a recording of other runs already, and import loses none",
            where=project.relative(path),
            expected="none, or the same sources and more",
            received=received,
            hint=f"r2s2r import {shlex.join(map(str, sources))} --iteration {project.iterations()[-1].number + 1}",
        )

    return guard


def _head(project: Project, path: Path) -> Header:
    """What a damaged recording still says of itself. Raises UsageError where that is nothing: what it held nobody can
    compare, so that only people can say that it may go."""
    from r2s2r_cli.commands.typed import typed_again
    from r2s2r_cli.store.header import read_header
    from r2s2r_cli.store.verify import find_body

    try:
        return read_header(path)
    except ArtifactError as error:
        name = project.relative(path)
        whole = error.__cause__ is None and find_body(path) is not None
        raise UsageError(
            "the recording of this iteration is damaged, and does not say which runs it held",
            where=name,
            expected="none, or one whose head can be read",
            received=error.received,
            hint=f"r2s2r recover {quoted(name)}" if whole else typed_again("import", "--force"),
        ) from error


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
    from r2s2r_cli.views.recording import import_rows, import_title

    console.table(import_title(report), ["what", "found"], import_rows(report))
    for text in report.warnings:
        console.warn(f"{report.run}: {text}")
