"""`r2s2r calibrate`: bench measurements -> calibration.h5, and into robot.toml."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import InputError, R2S2RError, quoted
from r2s2r_cli.options import (
    DrawOption,
    DryRunOption,
    ForceOption,
    JsonOption,
    ProjectOption,
    QuietOption,
    SetOption,
    ShowConfigOption,
    parse_overrides,
)
from r2s2r_cli.store.project import Project
from schemas.header import InputRef

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.stages.calibrate import Source
    from schemas.results_calibrate import CalibrationReport, SensorSet
    from schemas.robot import Robot

PARTS: dict[str, tuple[str, ...]] = {
    "points": ("points", "lines"),
    "history": ("history", "drift"),
    "tendons": ("tendon_points", "tendons"),
    "masses": ("mass_parts", "masses"),
}
"""What can be given, and the groups of calibration.h5 that come from it."""
MAX_SOURCE_BYTES = 16 << 20

_File = Path | None


def calibrate(
    points: Annotated[
        _File, typer.Option("--points", metavar="CSV", help="Length and capacitance of the sensors, one or more sets.")
    ] = None,
    history: Annotated[
        _File, typer.Option("--history", metavar="JSON", help="Dated calibrations: their drift.")
    ] = None,
    tendons: Annotated[
        list[Path] | None, typer.Option("--tendons", metavar="CSV", help="Force-displacement curves; repeatable.")
    ] = None,
    masses: Annotated[
        _File, typer.Option("--masses", metavar="TOML", help="Weighed parts of the rods: mass, centre, inertia.")
    ] = None,
    use: Annotated[
        str | None, typer.Option("--use", metavar="SET", help="Which set of the points goes into robot.toml.")
    ] = None,
    project: ProjectOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    draw: DrawOption = True,
    dry_run: DryRunOption = False,
    force: ForceOption = False,
    set_: SetOption = None,
    show_config: ShowConfigOption = False,
) -> None:
    """Fit what was measured on the bench: sensor lines, drift, tendon curves, masses.

    Writes calibration.h5 with residuals and pictures, and the new numbers with their source into robot.toml.
    What an earlier run fitted from other files is kept.

    Example: r2s2r calibrate --points points.csv --use monday
    """
    from r2s2r_cli.commands.outcome import print_config, show_outcome
    from r2s2r_cli.commands.stage import StageRun
    from r2s2r_cli.commands.wanted import wanted
    from schemas.results_calibrate import CalibrationReport

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    overrides = parse_overrides(set_, "calibrate")
    if show_config:
        print_config("calibrate", wanted(here, None, "calibrate", overrides, {}).settings, console)
        return
    given = {"points": points, "history": history, "tendons": tendons, "masses": masses}
    asked = {name: value for name, value in given.items() if value}
    flags, kept, _ = _merge_with_earlier(here, asked, use)
    run = StageRun(
        stage="calibrate", kind="calibration", project=here, iteration=None,
        find_inputs=lambda: _merge_with_earlier(here, asked, use)[2],
        report_model=CalibrationReport, overrides=overrides, flags=flags, dry_run=dry_run, force=force,
        not_applied=lambda said: _not_applied(here, said),
    )  # fmt: skip
    before = _source(here.robot_path).data
    result, report = run.run(
        # What an earlier run chose is chosen again with its points; what is typed now must have its points with it.
        lambda: _compute(here, asked, flags.get("use") if "points" in asked else use, overrides, kept),
        (lambda data, said: _draw(data, said, here.robot())) if draw else None,
        lambda said: _apply(here, said),
    )
    show_outcome(result, console)
    if report is not None:
        _show(report, console, done=result.state == "done", changed=_source(here.robot_path).data != before)


def _merge_with_earlier(
    project: Project, asked: dict[str, Any], use: str | None
) -> tuple[dict[str, Any], list[str], list[InputRef]]:
    """Flags of this run, names of the parts kept from the artifact that is there, and all inputs."""
    from r2s2r_cli.store.header import read_header
    from r2s2r_cli.store.staleness import source_ref

    paths = {name: value if isinstance(value, list) else [value] for name, value in asked.items()}
    for path in (p for group in paths.values() for p in group):
        _require_file(path)
    refs = {name: [source_ref(project, path) for path in group] for name, group in paths.items()}
    flags: dict[str, Any] = {name: [ref.path for ref in group] for name, group in refs.items()}
    if use is not None:
        flags["use"] = use
    inputs = [ref for group in refs.values() for ref in group]
    target = project.artifact("calibration", None)
    try:
        made = read_header(target).provenance if target.exists() else None
    except R2S2RError:
        made = None  # damaged: the stage says so and makes it again from what is given
    if made is None:
        return flags, [], inputs
    before: dict[str, Any] = made.settings.get("flags", {})
    kept = [name for name in PARTS if name in before and name not in flags]
    kept_paths = {path for name in kept for path in before[name]}
    inputs += [ref for ref in made.inputs if ref.path in kept_paths]
    inherited = {name: before[name] for name in kept}
    same_points = before.get("points") == flags.get("points", before.get("points"))
    if same_points and "use" in before and "use" not in flags:
        inherited["use"] = before["use"]  # the choice stands until another is made
    return {**inherited, **flags}, kept, inputs


def _require_file(path: Path) -> None:
    if not path.is_file():
        raise InputError("there is no such file", where=str(path), expected="a file that can be read",
                         received="nothing" if not path.exists() else "no file",
                         hint=f"ls -la {quoted(path.parent)}")  # fmt: skip
    if path.stat().st_size > MAX_SOURCE_BYTES:
        raise InputError("the file is too large for bench measurements", where=str(path), expected="at most 16 MB",
                         received=f"{path.stat().st_size / 1e6:.0f} MB", hint=f"head {quoted(path)}")  # fmt: skip


def _compute(
    project: Project, asked: dict[str, Any], use: str | None, overrides: dict[str, Any], kept: list[str]
) -> tuple[ArtifactData, CalibrationReport]:
    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.stages.calibrate import calibrate as fit
    from r2s2r_cli.store.read import read_artifact

    sources: dict[str, Any] = {
        name: [_source(path) for path in value] if isinstance(value, list) else _source(value)
        for name, value in asked.items()
    }
    settings = project.config(None, overrides).calibrate
    data, report = fit(robot=project.robot(), use=use, settings=settings, **sources)
    if kept:
        _, before = read_artifact(project.artifact("calibration", None), "calibration")
        wanted_groups = {group for name in kept for group in PARTS[name]}
        earlier = {path: group for path, group in before.groups.items() if path.split("/")[0] in wanted_groups}
        data = ArtifactData(data.kind, {**earlier, **data.groups})
    return data, report


def _apply(project: Project, report: CalibrationReport) -> None:
    """Write the new numbers into robot.toml, once the artifact that explains them stands."""
    from r2s2r_cli.stages.calibrate import apply_changes
    from r2s2r_cli.store.atomic import write_text
    from r2s2r_cli.store.toml import read_text

    if not report.changes.empty:
        write_text(project.robot_path, apply_changes(read_text(project.robot_path), report.changes))


def _not_applied(project: Project, report: CalibrationReport) -> list[str]:
    from r2s2r_cli.stages.calibrate import apply_changes
    from r2s2r_cli.store.toml import read_text

    if report.changes.empty:
        return []
    text = read_text(project.robot_path)
    return [] if apply_changes(text, report.changes) == text else ["robot.toml does not hold its numbers"]


def _source(path: Path) -> Source:
    from r2s2r_cli.stages.calibrate import Source

    try:
        return Source(str(path), path.read_bytes())
    except OSError as error:
        raise InputError("the file cannot be read", where=str(path), received=error.strerror or str(error),
                         hint=f"ls -la {quoted(path)}") from error  # fmt: skip


def _draw(data: ArtifactData, report: CalibrationReport, robot: Robot) -> Iterator[tuple[str, bytes]]:
    from r2s2r_cli.views.calibration import draw_calibration
    from r2s2r_cli.views.calibration_page import calibration_page

    pictures = dict(draw_calibration(data, robot))
    for name, png in pictures.items():
        yield f"-{name}.png", png
    yield ".html", calibration_page(report, pictures)


def _show(report: CalibrationReport, console: Console, *, done: bool, changed: bool) -> None:
    from r2s2r_cli.views.calibration_page import report_tables

    for table in report_tables(report):
        console.table(table.title, table.columns, table.rows)
    for text in report.warnings:
        console.warn(text)
    if report.changes.empty:
        if report.sets and report.used is None:
            console.hint(_with_set(report.sets))
        return
    if done:
        what = [f"{len(report.changes.sensors)} sensor lines" if report.changes.sensors else "",
                "the tendon curve" if report.changes.tendon else "",
                f"the parts of {len(report.changes.rods)} rods" if report.changes.rods else ""]  # fmt: skip
        has = "has new numbers" if changed else "had these numbers already"
        console.say(f"robot.toml {has}: {', '.join(filter(None, what))}")


def _with_set(sets: Sequence[SensorSet]) -> str:
    """The command as typed, with the place of a set of the points that goes into robot.toml, and what to choose from:
    one of them on the line would be taken for the recommended one."""
    from r2s2r_cli.commands.typed import typed_words
    from r2s2r_cli.stages.calibrate.report import choices

    known = choices((one.name, one.rms_m) for one in sets)
    return f"{shlex.join(['r2s2r', *typed_words('calibrate')])} --use SET   # SET: {known}"
