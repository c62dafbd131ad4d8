"""The report of `estimate` as tables for the terminal, and as an HTML page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.views.page import Page, PageTable, Picture, counted, render
from schemas.results_estimate import EstimateReport, EstimateRun

_MADE = ("simulated", "kinematic sample")
_AXES = "xyz"


def report_tables(report: EstimateReport) -> Iterator[PageTable]:
    """What was estimated, two tables a run."""
    for run in report.runs:
        yield PageTable(f"run {run.run}", ["what", "found"], list(_rows(run)))
        yield PageTable(
            f"run {run.run}: end caps",
            ["cap", "noise sd x, y, z [mm]", "sd after smoothing [mm]", "in contact", "lowest [mm]",
             "speed, median [mm/s]", "fastest [mm/s]", "outliers", "jumps"],
            [
                [str(cap.cap), ", ".join(f"{1e3 * sd:.1f}{'*' if held else ''}"
                                         for sd, held in zip(cap.noise_sd_m, cap.held, strict=True)),
                 f"{1e3 * cap.sd_median_m:.1f}", f"{cap.contact_share:.0%}", f"{1e3 * cap.height_min_m:.1f}",
                 f"{1e3 * cap.speed_median_m_per_s:.0f}", f"{1e3 * cap.speed_max_m_per_s:.0f}", str(cap.outliers),
                 str(cap.jumps)]
                for cap in run.caps
            ],
        )  # fmt: skip


def estimate_page(report: EstimateReport, data: ArtifactData, pictures: Mapping[str, bytes]) -> bytes:
    """The HTML page of an estimate."""
    frames = sum(run.frames for run in report.runs)
    natures = [(run.run, str(data.groups[f"runs/{run.run}"].attributes.get("nature", ""))) for run in report.runs]
    labels = [f"{run}: {nature}, not a measurement" for run, nature in natures if nature in _MADE]
    labels += [f"{run.run}: {text}" for run in report.runs for text in run.warnings]
    return render(
        Page(
            title="Estimate",
            sentence=f"States at {counted(frames, 'frame')} of {counted(len(report.runs), 'run')}.",
            labels=labels,
            tables=list(report_tables(report)),
            pictures=[Picture(f"run {run}", png) for run, png in pictures.items()],
        )
    )


def _rows(run: EstimateRun) -> Iterator[tuple[str, str]]:
    yield "frames", f"{run.frames} of {run.rows} rows, {run.duration_s:.2f} s"
    yield "target intervals", f"{run.intervals}, {counted(run.segments, 'segment')}"
    for rod in run.rods:
        text = f"observed length {1e3 * rod.length_m:.1f} +- {1e3 * rod.length_sd_m:.1f} mm"
        given = f"robot.toml says {1e3 * rod.length_robot_m:.1f} mm"
        # Smoothing moves the caps of a rod apart although every observed frame had its length.
        yield f"rod {rod.rod}", f"{text}, {given}; largest move of a smoothed cap {1e3 * rod.correction_max_m:.1f} mm"
    ground = run.ground
    side = "up" if ground.shift_m >= 0 else "down"
    shift = f"{1e3 * abs(ground.shift_m):.1f} +- {1e3 * ground.shift_sd_m:.1f} mm"
    yield "ground", f"caps moved {side} by {shift}, so that it lies at z = 0"
    if ground.slope is not None and ground.slope_sd is not None:
        slopes = [f"{_AXES[i]} {1e3 * ground.slope[i]:.1f} +- {1e3 * ground.slope_sd[i]:.1f}" for i in range(2)]
        yield "ground slope", f"{', '.join(slopes)} mm/m, not applied"
    few = f"fewer than three in {run.ground.below_three_share:.0%} of the frames"
    yield "contacts", f"{ground.contacts_mean:.1f} caps on average, {few}"
    for broken in run.broken:
        where = f"interval {broken.interval}" if broken.interval else "outside the intervals"
        times = ", ".join(f"{t:.2f}" for t in broken.t_s)
        yield "track broken", f"{where} at {times} s, caps {', '.join(map(str, broken.caps))}"
