"""What a recording says: tables for the terminal and the page, with units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from r2s2r_cli.views.page import Page, PageTable, Picture, counted, render
from schemas.policy import PolicyFile
from schemas.results_record import RecordReport, RecordRun
from schemas.robot import Robot


class Planned(Protocol):
    """A run that is to be recorded."""

    @property
    def name(self) -> str:
        """Of the run."""

    @property
    def policy(self) -> PolicyFile:
        """What it does."""

    @property
    def rest(self) -> float:
        """Time in the rest shape before and after [s]."""


def plan_table(runs: Sequence[Planned], robot: Robot) -> PageTable:
    """Runs, their targets and the longest that each can take."""
    rows = []
    for run in runs:
        timeouts = [robot.pid.step_timeout_s if s.timeout_s is None else s.timeout_s for s in run.policy.steps]
        once = sum(timeouts) + sum(step.hold_s for step in run.policy.steps)
        rest = 2 * (run.rest + robot.pid.step_timeout_s) if run.rest > 0 else 0.0
        targets = len(run.policy.steps) * run.policy.repeat
        rows.append((run.name, str(targets), f"{once * run.policy.repeat + rest:.0f}", run.policy.description))
    return PageTable("to record", ["run", "targets", "at most [s]", "policy"], rows)


def look_tables(facts: Any, statistics: Any, sample: Any, robot: Robot) -> list[PageTable]:
    """A link and its sensors, from a look at the robot (`devices.link`: LinkFacts, LinkStatistics, Sample or None)."""
    stop = "the device, by itself" if facts.stops_by_itself else "the host alone: it cannot be guaranteed"
    rows = [
        ("port", facts.port), ("protocol", facts.protocol), ("robot", facts.robot or "does not say"),
        ("stopped by", stop), ("samples", f"{statistics.received} received, {statistics.corrupt} corrupt"),
        ("battery", "does not say" if sample is None or sample.voltage is None else f"{sample.voltage:.2f} V"),
    ]  # fmt: skip
    found = [PageTable("link", ["what", "found"], rows)]
    if sample is not None:
        sensors = [
            (str(i), str(sensor.cable), _number(1e12 * value, 2), _length(sensor, value))
            for i, (sensor, value) in enumerate(zip(robot.sensors, sample.capacitance, strict=True))
        ]
        found.append(PageTable("sensors", ["sensor", "cable", "capacitance [pF]", "length [mm]"], sensors))
    return found


def report_tables(report: RecordReport) -> list[PageTable]:
    """How the runs went, and how link and camera kept up."""
    went = ["run", "targets", "time [s]", "control [Hz]", "late ticks", "battery [V]", "frames", "frames lost", "ended"]
    link = ["run", "samples", "lost", "repeated", "corrupt", "longest gap [ms]", "latency [ms]", "clock drift [ppm]"]
    return [
        PageTable(f"recorded at {report.port}, protocol {report.protocol}", went, list(map(_went, report.runs))),
        PageTable("link", link, list(map(_link, report.runs))),
    ]


def record_page(report: RecordReport, pictures: Mapping[str, bytes]) -> bytes:
    """The HTML page of a recording."""
    return render(
        Page(
            title="Recording",
            sentence=_sentence(report),
            labels=list(_labels(report)),
            tables=report_tables(report),
            pictures=[Picture(f"run {run}", png) for run, png in pictures.items()],
        )
    )


def _sentence(report: RecordReport) -> str:
    whole = sum(run.complete for run in report.runs)
    time = sum(run.duration_s for run in report.runs)
    return f"{counted(len(report.runs), 'run')}, {whole} of them complete, {time:.0f} s of the robot in all."


def _labels(report: RecordReport) -> Iterator[str]:
    if not report.stops_by_itself:
        yield f"protocol {report.protocol}: the robot does not stop by itself when the host falls silent"
    if report.not_begun:
        yield f"not begun: {', '.join(report.not_begun)}"
    for run in report.runs:
        yield from (f"{run.run}: {text}" for text in run.warnings)


def _went(run: RecordRun) -> tuple[str, ...]:
    camera = run.camera
    volts = (run.voltage_first_v, run.voltage_last_v)
    battery = "" if None in volts else f"{volts[0]:.2f} to {volts[1]:.2f}"
    return (
        run.run, f"{run.targets_done} of {run.targets}", f"{run.duration_s:.1f}", _number(run.rate_hz, 1),
        str(run.late), battery, "" if camera is None else str(camera.frames),
        "" if camera is None else str(camera.lost), run.ended,
    )  # fmt: skip


def _link(run: RecordRun) -> tuple[str, ...]:
    latency = None if run.latency_median_s is None else 1e3 * run.latency_median_s
    drift = None if run.clock_drift is None else 1e6 * run.clock_drift
    return (
        run.run, str(run.samples), _count(run.lost), _count(run.repeated), str(run.corrupt),
        f"{1e3 * run.gap_max_s:.0f}", _number(latency, 1), _number(drift, 0),
    )  # fmt: skip


def _count(value: int | None) -> str:
    return "?" if value is None else str(value)


def _number(value: float | None, digits: int) -> str:
    return "" if value is None or not np.isfinite(value) else f"{value:.{digits}f}"


def _length(sensor: Any, capacitance: float) -> str:
    if not sensor.slope_f_per_m or sensor.offset_f is None:
        return "not calibrated"
    return _number(1e3 * (capacitance - sensor.offset_f) / sensor.slope_f_per_m, 1)
