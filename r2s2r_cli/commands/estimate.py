"""`r2s2r estimate`: 10-record.h5 -> 20-estimate.h5 (50 -> 51), the state of the robot at every kept frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import StrEnum
from functools import partial
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
    from pathlib import Path

    from r2s2r_cli.artifact import ArtifactData
    from schemas.results_estimate import EstimateReport
    from schemas.robot import Robot


class Of(StrEnum):
    """What `--of` takes."""

    RECORD = "record"
    EXECUTE = "execute"


def estimate(
    of: Annotated[
        Of, typer.Option("--of", help="Runs of 10-record.h5, or of the executed plan: 50-execute.h5 -> 51-estimate.h5.")
    ] = Of.RECORD,
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
    """Estimate states: end caps with covariance, velocities, poses, contacts, from camera images or observed end caps.

    Camera images are tracked (colour, depth and cable sensors); logs bring their end caps. The ground is put at z = 0
    and the rods are rigid; what is hidden, lost, an outlier or a jump is marked, frame by frame.

    Example: r2s2r estimate --iteration 1
    """
    from r2s2r_cli.commands.estimate_hints import hints_of
    from r2s2r_cli.commands.outcome import print_config, require_input, show_outcome
    from r2s2r_cli.commands.stage import StageRun
    from r2s2r_cli.commands.wanted import wanted
    from r2s2r_cli.store.header import whole_header
    from r2s2r_cli.store.staleness import artifact_ref
    from schemas.results_estimate import EstimateReport

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    place = here.iteration(iteration)
    overrides = parse_overrides(set_, "estimate")
    if show_config:
        print_config("estimate", wanted(here, place, "estimate", overrides, {}).settings, console)
        return
    executed = of is Of.EXECUTE
    source = place.artifact("recording", executed=executed)
    first: str | Callable[[], str] = partial(here.first_data, place)
    if executed:
        first = f"r2s2r execute --iteration {place.number}"
    elif place.artifact("recording", executed=True).exists():  # an iteration after the first
        first = f"r2s2r estimate --of execute --iteration {place.number}"
    require_input(source, first)
    header = whole_header(source)
    run = StageRun(
        stage="estimate", kind="estimate", project=here, iteration=place,
        find_inputs=lambda: [artifact_ref(here, source, whole_header(source))],
        report_model=EstimateReport, overrides=overrides, dry_run=dry_run, force=force, executed=executed,
    )  # fmt: skip

    def compute() -> tuple[ArtifactData, EstimateReport]:
        from r2s2r_cli.stages.estimate import estimate as compute_states
        from r2s2r_cli.store.frames import PictureFile
        from r2s2r_cli.store.read import read_artifact

        _, recording = read_artifact(source, "recording")
        rig = any(recording.groups[f"runs/{name}"].attributes["origin"] == "rig" for name in recording.runs())
        hints = hints_of(here.relative(source), source, header.provenance, rig=rig)
        with PictureFile(source) as file, console.parts() as show, hints:
            return compute_states(
                recording, here.robot(), here.config(place, overrides).estimate, show=show,
                pictures=lambda run, name: file.pictures(f"runs/{run}/camera/{name}"),
            )  # fmt: skip

    result, report = run.run(compute, (lambda data, said: _draw(data, here.robot(), said, source)) if draw else None)
    show_outcome(result, console)
    if report is not None:
        _show(report, console)


def _draw(data: ArtifactData, robot: Robot, report: EstimateReport, source: Path) -> Iterator[tuple[str, bytes]]:
    from r2s2r_cli.views.estimate import draw_estimate
    from r2s2r_cli.views.estimate_page import estimate_page

    pictures = dict(draw_estimate(data, robot))
    for run, png in pictures.items():
        yield f"-{run}.png", png
    for run in [run for run in data.runs() if data.group(run, "camera") is not None]:
        for suffix, drawn in _seen(data, run, robot, source):
            if suffix.endswith(".png"):
                pictures[f"{run}{suffix.removesuffix('.png').replace('-', ', ')}"] = drawn
            yield f"-{run}{suffix}", drawn
    yield ".html", estimate_page(report, data, pictures)


def _seen(data: ArtifactData, run: str, robot: Robot, source: Path) -> Iterator[tuple[str, bytes]]:
    """What only a run of camera images has: confidence and residuals, the model over the pictures, the film of it."""
    from r2s2r_cli.stages.estimate.camera_input import kept_frames
    from r2s2r_cli.store.frames import PictureFile
    from r2s2r_cli.store.read import read_artifact
    from r2s2r_cli.views.estimate_camera import draw_camera_run
    from r2s2r_cli.views.estimate_overlay import overlay_film, overlay_strip

    yield "-camera.png", draw_camera_run(data, run)
    _, recording = read_artifact(source, "recording")
    with PictureFile(source) as file:
        _, frames = kept_frames(
            run, dict(recording.streams(run)), lambda of, name: file.pictures(f"runs/{of}/camera/{name}")
        )
        for suffix, draw in (("-overlay.png", overlay_strip), ("-overlay.mp4", overlay_film)):
            if drawn := draw(data, run, robot, frames.color_of):
                yield suffix, drawn


def _show(report: EstimateReport, console: Console) -> None:
    from r2s2r_cli.views.estimate_page import report_tables

    for table in report_tables(report):
        console.table(table.title, table.columns, table.rows)
    for run in report.runs:
        for text in run.warnings:
            console.warn(f"{run.run}: {text}")
