"""The report of `estimate` as tables for the terminal, and as an HTML page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.views.page import Page, PageTable, Picture, counted, render
from schemas.results_estimate import CameraFigures, EstimateReport, EstimateRun

_MADE = ("simulated", "kinematic sample")
_AXES = "xyz"
_HELD = "; * the source held this axis still: the median noise of the run stands in"


def report_tables(report: EstimateReport) -> Iterator[PageTable]:
    """What was estimated, two tables a run."""
    for run in report.runs:
        yield PageTable(f"run {run.run}", ["what", "found"], list(_rows(run)))
        if run.camera is not None:
            yield from _camera_tables(run.run, run.camera)
        yield PageTable(
            f"run {run.run}: end caps" + _HELD * any(any(cap.held) for cap in run.caps),
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


def _camera_tables(run: str, camera: CameraFigures) -> Iterator[PageTable]:
    yield PageTable(f"run {run}: camera", ["what", "found"], list(_camera_rows(camera)))
    yield PageTable(
        f"run {run}: sightings", ["cap", "seen and used", "rejected", "longest without [s]", "residual [sd]"],
        [[str(cap.cap), f"{cap.seen:.1%}", str(cap.rejected), f"{cap.hidden_longest_s:.2f}",
          "" if cap.residual_sd is None else f"{cap.residual_sd:.2f}"] for cap in camera.sight],
    )  # fmt: skip
    if camera.sensors:
        yield PageTable(
            f"run {run}: cable sensors against the camera", ["cable", "bias [mm]", "noise sd [mm]", ""],
            [[str(one.cable), f"{1e3 * one.bias_m:+.1f} +- {1e3 * one.bias_sd_m:.1f}",
              "" if one.noise_sd_m is None else f"{1e3 * one.noise_sd_m:.1f}", "not used" if one.dead else ""]
             for one in camera.sensors],
        )  # fmt: skip


def _camera_rows(camera: CameraFigures) -> Iterator[tuple[str, str]]:
    yield (
        "camera",
        f"{camera.height_m:.3f} m above the ground, {math.degrees(camera.tilt_rad):.1f} degrees off the vertical",
    )
    if camera.plane_share is not None and camera.depth_noise_sd_m is not None:
        noise = f"depth scatters by {1e3 * camera.depth_noise_sd_m:.1f} mm about it"
        yield "ground seen", f"{camera.plane_share:.0%} of the pixels with depth, {noise}"
    yield "depth beside colour", "{:+.2f}, {:+.2f} px, corrected".format(*camera.shift_px)
    yield "noise of sightings", "{:.2f} times what one frame tells across the line of sight, {:.2f} along".format(
        *camera.noise_scale)  # fmt: skip
    if camera.delay_s is not None and camera.delay_sd_s is not None:
        text = f"{1e3 * camera.delay_s:.0f} +- {1e3 * camera.delay_sd_s:.0f} ms later than the pictures (clock and lag)"
        yield "cable sensors", text
    elif camera.sensors:
        yield "cable sensors", "nothing moved enough to tell their clock from the camera's"
    yield "caps told apart", f"at {camera.begun_t_s:.2f} s" + (
        f", found again in {counted(camera.searched, 'frame')}" if camera.searched else "")  # fmt: skip
    for words, count in camera.modes.items():
        yield words.partition(":")[0], counted(count, "frame")


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
