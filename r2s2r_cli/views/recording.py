"""Pictures and page of a recording: what came in, what was dropped, and the target intervals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.views.figure import new_figure, png_bytes
from r2s2r_cli.views.page import Page, PageTable, Picture, counted, render
from r2s2r_cli.views.recording_camera import camera_height, draw_camera, has_frames
from r2s2r_cli.views.recording_motion import COMMANDS_HEIGHT, MOTION_HEIGHT, draw_commands, draw_motion
from r2s2r_cli.views.recording_streams import draw_streams, panels, streams_height
from schemas.results_import import ImportReport, ImportReports

_WIDTH = 13.0
"""Of a picture [inches]."""


def draw_recording(data: ArtifactData, cap_radius_m: float) -> Iterator[tuple[str, bytes]]:
    """(run, PNG) of every run: end caps and commands, sensors and motors, camera frames; each where it has them.

    cap_radius_m: height of a resting cap centre.
    """
    for run in data.runs():
        picture = _picture(data, run, cap_radius_m)
        if picture is not None:
            yield run, picture


def _picture(data: ArtifactData, run: str, cap_radius_m: float) -> bytes | None:
    caps, commands = data.group(run, "caps"), data.group(run, "commands")
    streams = panels(data, run)
    camera = data.group(run, "camera")
    if camera is not None and not has_frames(camera):  # taken out, to keep the rest small
        camera = None
    parts: list[float] = []
    if caps is not None:
        parts.append(MOTION_HEIGHT)
    # Without end caps the commands share the axis of time of what the robot sent.
    above = caps is None and commands is not None
    if streams or above:
        parts.append(streams_height(streams) + COMMANDS_HEIGHT * above)
    if camera is not None:
        parts.append(camera_height(camera, _WIDTH))
    if not parts:
        return None
    figure = new_figure(_WIDTH, sum(parts) + 0.3)
    nature = str(data.groups[f"runs/{run}"].attributes.get("nature", "not stated"))
    figure.suptitle(f"run {run}: as recorded ({stated(nature)})")
    places = iter(figure.subfigures(len(parts), 1, height_ratios=parts, squeeze=False)[:, 0])
    if caps is not None:
        draw_motion(next(places), data, run, cap_radius_m)
    if streams or above:
        draw_streams(
            next(places), streams, data.group(run, "intervals"), above_height=COMMANDS_HEIGHT,
            above=(lambda axes: draw_commands(axes, data, run)) if above else None,
        )  # fmt: skip
    if camera is not None:
        draw_camera(next(places), camera)
    return png_bytes(figure)


def stated(nature: str) -> str:
    """The nature of a run as a title says it."""
    return "nature not stated" if nature in ("", "not stated") else nature


def import_rows(report: ImportReport) -> list[tuple[str, str]]:
    """What `import` found, as (what, found) rows with units."""
    return [*_frame_rows(report), *_geometry_rows(report), *_stream_rows(report)]


def _frame_rows(report: ImportReport) -> Iterator[tuple[str, str]]:
    dropped = report.dropped
    yield "nature", report.nature
    yield "frames kept", f"{report.kept} of {report.rows} rows, {report.duration_s:.2f} s"
    share = f"{dropped.total} ({dropped.total / max(1, report.rows):.0%})"
    duplicates = f"{dropped.duplicate} duplicates (< 20 ms after a kept frame)"
    others = f"{dropped.backwards} backwards in time, {dropped.not_observed} not observed"
    yield "dropped", f"{share}: {duplicates}, {others}"
    if report.frame_gap_median_s is not None and report.stamp_jitter_s is not None:
        median, jitter = 1e3 * report.frame_gap_median_s, 1e3 * report.stamp_jitter_s
        yield "frame gap", f"median {median:.0f} ms, jitter of the stamps {jitter:.0f} ms (sd)"
    if report.gaps:
        longest = max(report.gaps, key=lambda gap: gap.length_s)
        yield "gaps", f"{len(report.gaps)}, the longest {longest.length_s:.2f} s after {longest.after_s:.2f} s"
    complete = f"{report.intervals} ({report.intervals_complete} complete)"
    yield "target intervals", f"{complete}, {counted(report.segments, 'segment')}"


def _geometry_rows(report: ImportReport) -> Iterator[tuple[str, str]]:
    if report.noise is not None:
        low, high, median = (1e3 * sd for sd in (report.noise.low_m, report.noise.high_m, report.noise.median_m))
        held = f"; held by the source: {', '.join(report.noise.held)}" if report.noise.held else ""
        yield "noise per axis", f"{low:.1f} to {high:.1f} mm (sd), median {median:.1f} mm{held}"
    # Only the robot's own lengths are known of a run without end caps (camera folders).
    stated_m = report.rod_length_robot_m if report.rod_length_m else ()
    rods = zip(report.rod_length_m, report.rod_length_sd_m, stated_m, strict=True)
    for i, (length, sd, stated) in enumerate(rods):
        found = f"{1e3 * length:.1f} +- {1e3 * sd:.1f} mm between cap centres"
        yield f"rod {i}", f"{found}, robot.toml says {1e3 * stated:.1f} mm"
    if report.ground_offset_m is not None:
        yield "ground offset", ground_offset(report.ground_offset_m)


def ground_offset(offset_m: float) -> str:
    """How the lowest cap lies over the ground, in words. offset_m: cap radius minus its mean height."""
    side = "too low" if offset_m >= 0 else "too high"
    return f"{1e3 * offset_m:+.1f} mm to add to z: the lowest cap lies {1e3 * abs(offset_m):.1f} mm {side} on average"


def _stream_rows(report: ImportReport) -> Iterator[tuple[str, str]]:
    for title, counts in (("samples", report.streams), ("missing", report.missing)):
        if counts:
            yield title, ", ".join(f"{name} {count}" for name, count in counts.items())


def import_title(report: ImportReport) -> str:
    """What the source says is quoted as what its sidecar says: a path in it starts from there, not from the project."""
    return f'run {report.run}, its sidecar beside the log says: "{report.source}"'


def recording_page(reports: ImportReports, pictures: Mapping[str, bytes]) -> bytes:
    """The HTML page of an import: its report and its pictures."""
    frames = sum(report.kept for report in reports.runs)
    intervals = sum(report.intervals for report in reports.runs)
    warnings = [f"{report.run}: {text}" for report in reports.runs for text in report.warnings]
    made = ("simulated", "kinematic sample")
    samples = [f"{r.run}: {r.nature}, not a measurement" for r in reports.runs if r.nature in made]
    return render(
        Page(
            title="Import",
            sentence=f"{counted(len(reports.runs), 'run')} with {counted(frames, 'kept frame')} in "
            f"{counted(intervals, 'target interval')}.",
            labels=[*samples, *warnings],
            tables=[PageTable(import_title(r), ["what", "found"], import_rows(r)) for r in reports.runs],
            pictures=[Picture(f"run {run}", png) for run, png in pictures.items()],
        )
    )
