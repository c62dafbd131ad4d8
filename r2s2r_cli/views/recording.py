"""Pictures of a recording: what came in, what was dropped, and the target intervals."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from schemas.results_import import ImportReport, ImportReports

ROD_COLORS = ("#c1272d", "#2a7f3e", "#0b5fa5", "#b8860b", "#6b3fa0", "#3b8ea5")
"""Rods in their order; the first three are the robot's own red, green and blue."""
_DROPPED = "#888888"
_BAND = ("#eef2f7", "#dbe3ee")


def draw_recording(data: ArtifactData, cap_radius_m: float) -> Iterator[tuple[str, bytes]]:
    """(run, PNG) of every run that has end caps or commands. `cap_radius_m`: height of a resting cap centre [m]."""
    for run in data.runs():
        caps, commands = data.group(run, "caps"), data.group(run, "commands")
        if caps is not None or commands is not None:
            yield run, _picture(run, caps, commands, data.group(run, "intervals"), cap_radius_m)


def _picture(run: str, caps: Group | None, commands: Group | None, intervals: Group | None, radius: float) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 7.5), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(3, 2, width_ratios=(2, 1.2))
    figure.suptitle(f"run {run}: as recorded")
    heights, targets, gaps = (figure.add_subplot(grid[i, 0]) for i in range(3))
    for axes in (heights, targets, gaps):
        _bands(axes, intervals)
    if caps is not None:
        _heights(heights, caps, radius)
        _gaps(gaps, caps)
        _top_view(figure.add_subplot(grid[:, 1]), caps)
    if commands is not None:
        _targets(targets, commands)
    gaps.set_xlabel("time [s]")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    return buffer.getvalue()


def _bands(axes: Axes, intervals: Group | None) -> None:
    if intervals is None:
        return
    spans = zip(intervals["t_first"], intervals["t_last"], strict=True)
    for i, (start, stop) in enumerate(spans):
        axes.axvspan(start, stop, color=_BAND[i % 2], lw=0)
        axes.annotate(str(i + 1), ((start + stop) / 2, 1.0), xycoords=("data", "axes fraction"), ha="center",
                      va="bottom", fontsize=7, color="#5a6675")  # fmt: skip


def _heights(axes: Axes, caps: Group, radius: float) -> None:
    kept = caps["drop_reason"] == 0
    for i in range(caps["p_WE"].shape[1]):
        style = "-" if i % 2 == 0 else "--"
        axes.plot(caps["t"][kept], 1e3 * caps["p_WE"][kept, i, 2], style, lw=1,
                  color=ROD_COLORS[i // 2 % len(ROD_COLORS)], label=f"cap {i}")  # fmt: skip
    axes.axhline(1e3 * radius, color="black", lw=0.8, ls=":")
    axes.set_ylabel("cap height [mm]\n(dotted: resting on z = 0)")
    axes.legend(ncol=6, fontsize=7, loc="upper right")


def _targets(axes: Axes, commands: Group) -> None:
    target = commands["target"]
    for i in range(target.shape[1]):
        axes.step(commands["t"], target[:, i] * 0.8 + i, where="post", color="black", lw=1)
        if "control" in commands:
            axes.fill_between(commands["t"], i, i + 0.4 * np.nan_to_num(commands["control"][:, i]), step="post",
                              color="#0b5fa5", alpha=0.4, lw=0)  # fmt: skip
    axes.set_yticks(range(target.shape[1]), [f"cable {i}" for i in range(target.shape[1])])
    axes.set_ylabel("target (line, 0 to 1)\ncontrol (blue, up = reel in)")


def _gaps(axes: Axes, caps: Group) -> None:
    t, kept = caps["t"], caps["drop_reason"] == 0
    if len(t) < 2:
        return
    step = 1e3 * np.diff(t)
    axes.plot(t[1:][kept[1:]], step[kept[1:]], ".", ms=4, color="black", label="kept")
    axes.plot(t[1:][~kept[1:]], step[~kept[1:]], "x", ms=4, color=_DROPPED, label="dropped")
    axes.set_ylabel("gap to the row before [ms]")
    axes.legend(fontsize=7, loc="upper right")


def _top_view(axes: Axes, caps: Group) -> None:
    kept = caps["drop_reason"] == 0
    p_WE = caps["p_WE"][kept]
    if not len(p_WE):
        return
    path = p_WE.mean(axis=1)
    axes.plot(path[:, 0], path[:, 1], color="black", lw=1.2, label="mean of the caps")
    for frame, alpha in ((0, 0.35), (-1, 1.0)):
        for rod in range(p_WE.shape[1] // 2):
            ends = p_WE[frame, 2 * rod : 2 * rod + 2]
            axes.plot(ends[:, 0], ends[:, 1], "o-", color=ROD_COLORS[rod % len(ROD_COLORS)], lw=3, ms=9, alpha=alpha)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]", title="from above: first frame (pale) and last")
    axes.legend(fontsize=7)


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
    yield "target intervals", f"{complete}, {report.segments} segments"


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


def recording_page(reports: ImportReports, pictures: Mapping[str, bytes]) -> bytes:
    """The HTML page of an import: its report and its pictures."""
    from r2s2r_cli.views.page import Page, PageTable, Picture, render

    frames = sum(report.kept for report in reports.runs)
    intervals = sum(report.intervals for report in reports.runs)
    warnings = [f"{report.run}: {text}" for report in reports.runs for text in report.warnings]
    made = ("simulated", "kinematic sample")
    samples = [f"{r.run}: {r.nature}, not a measurement" for r in reports.runs if r.nature in made]
    return render(
        Page(
            title="Import",
            sentence=f"{len(reports.runs)} run{'s' * (len(reports.runs) > 1)} with {frames} kept frames in "
            f"{intervals} target intervals.",
            labels=[*samples, *warnings],
            tables=[PageTable(f"run {r.run}: {r.source}", ["what", "found"], import_rows(r)) for r in reports.runs],
            pictures=[Picture(f"run {run}", png) for run, png in pictures.items()],
        )
    )
