"""The floor in a picture, tables and a page."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.figure import BLUE, RED, new_figure, png_bytes
from r2s2r_cli.views.page import Page, PageTable, Picture, counted, render
from schemas.results_floor import FloorReport

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDTH, _HEIGHT = 11.0, 3.0
_DOT, _LINE, _NOISE = BLUE, RED, "#999999"
SIDE_BY_SIDE = 0.06
"""Of the way to the next phase, between the repeats of one."""


def draw_floor(data: ArtifactData) -> bytes:
    """One diagram a part: key frames about the mean of their phase, lengths of each cable, engine against rig."""
    parts: dict[str, Callable[[Axes, Group], None]] = {"caps": _caps, "lengths": _lengths, "numerics": _numerics}
    there = [name for name in parts if name in data.groups]
    figure = new_figure(_WIDTH, _HEIGHT * len(there))
    for axes, name in zip(figure.subplots(len(there), 1, squeeze=False)[:, 0], there, strict=True):
        parts[name](axes, data.groups[name])
    return png_bytes(figure)


def _caps(axes: Axes, group: Group) -> None:
    phase, floor = group["phase"], 1e3 * float(group.attributes["floor"])
    x, off = repeats_drawn(phase, 1e3 * group["deviation"])
    axes.plot(x, off, "o", color=_DOT, ms=5, label="a repeat: about the mean of its n, times √(n / (n − 1))")
    axes.axhline(floor, color=_LINE, label=f"floor {floor:.1f} mm")
    if "lower" in group.attributes:
        low, high = 1e3 * float(group.attributes["lower"]), 1e3 * float(group.attributes["upper"])
        axes.axhspan(low, high, color=_LINE, alpha=0.15, lw=0, label=f"{float(group.attributes['level']):.0%} interval")
    axes.axhline(1e3 * float(group.attributes["sensor"]), color=_NOISE, ls="--", label="noise of the caps")
    axes.set(xlabel="phase of the gait", ylabel="end caps of a repeat\n[mm]", ylim=(0, None))
    axes.set_xticks(np.unique(phase) + 1)
    axes.legend(fontsize=8)


def repeats_drawn(phase: np.ndarray, deviation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where repeats (repeat,) of phases are drawn: side by side about the phase's number, from 1 on, as two of one
    phase lie equally far off; and how far off, so that their mean square is the floor's: n of them lie nearer to their
    own mean than to that of many."""
    x, off = phase + 1.0, np.array(deviation, dtype=float)
    for one in np.unique(phase):
        own = np.flatnonzero(phase == one)
        x[own] += SIDE_BY_SIDE * (np.arange(len(own)) - (len(own) - 1) / 2)
        off[own] *= np.sqrt(len(own) / max(len(own) - 1, 1))
    return x, off


def _lengths(axes: Axes, group: Group) -> None:
    x, floor = np.arange(len(group["cable"])), 1e3 * float(group.attributes["floor"])
    axes.bar(x, np.nan_to_num(1e3 * group["sd"]), 0.6, color=_DOT, label="about the mean of the phase (sd)")
    axes.plot(x, 1e3 * group["noise"], "_", color=_NOISE, ms=18, mew=2, label="noise of one reading (sd)")
    axes.axhline(floor, color=_LINE, label=f"floor {floor:.1f} mm")
    axes.set(xlabel="cable", ylabel="sensor length at the end\nof an interval [mm]", ylim=(0, None))
    axes.set_xticks(x, [str(cable) for cable in group["cable"]])
    axes.legend(fontsize=8)


def _numerics(axes: Axes, group: Group) -> None:
    axes.plot(1e3 * group["way"], 1e3 * group["error"], "o", color=_DOT, ms=5, label="a gait step of 1 s")
    floor = 1e3 * float(group.attributes["floor"])
    axes.axhline(floor, color=_LINE, label=f"floor {floor:.2f} mm")
    axes.set(xlabel="way of the caps [mm]", ylabel="engine to rig\nat its end [mm]", ylim=(0, None))
    axes.legend(fontsize=8)


def floor_tables(report: FloorReport) -> list[PageTable]:
    """The numbers, with units."""
    found = []
    caps, lengths, numerics = report.caps, report.lengths, report.numerics
    if report.runs:
        used = [("runs", ", ".join(report.used) or "none"), ("without a phase that comes twice", _unused(report))]
        found.append(PageTable("measured on", ["what", "found"], used))
    if caps is not None:
        interval = "too few comparisons" if caps.lower_m is None or caps.upper_m is None or caps.level is None else (
            f"{1e3 * caps.lower_m:.1f} to {1e3 * caps.upper_m:.1f} mm ({caps.level:.0%})")  # fmt: skip
        found.append(PageTable("end caps at key frames", ["what", "found"], [
            ("floor", f"{1e3 * caps.floor_m:.1f} mm"), ("interval", interval),
            ("noise of the caps", f"{1e3 * caps.sensor_m:.1f} mm of it"),
            ("repeatability", f"{1e3 * caps.repeatability_m:.1f} mm"),
            ("from", f"{_compared(caps.repeats, caps.phases, caps.contrasts)}: {caps.basis}"),
        ]))  # fmt: skip
    if lengths is not None:
        title = f"cable lengths: floor {1e3 * lengths.floor_m:.2f} mm, {lengths.basis}"
        rows = [(str(c.cable), _mm(c.sd_m), _mm(c.noise_m)) for c in lengths.cables]
        found.append(PageTable(title, ["cable", "sd at the end [mm]", "noise of a reading [mm]"], rows))
    if numerics is not None:
        way = f"{1e3 * numerics.moved_m:.0f} mm in the median"
        found.append(PageTable("engine and rig, all effects off", ["what", "found"], [
            ("floor", f"{1e3 * numerics.floor_m:.2f} mm after a gait step of 1 s"),
            ("median, worst", f"{1e3 * numerics.median_m:.2f} mm, {1e3 * numerics.worst_m:.2f} mm"),
            ("the caps move", f"{way} of {counted(numerics.gaits, 'gait step')}"),
        ]))  # fmt: skip
    return found


def floor_page(report: FloorReport, picture: bytes) -> bytes:
    """The HTML page of the floor."""
    said = []
    if report.caps is not None:
        said.append(f"end caps {1e3 * report.caps.floor_m:.1f} mm")
    if report.lengths is not None:
        said.append(f"cable lengths {1e3 * report.lengths.floor_m:.2f} mm")
    if report.numerics is not None:
        said.append(f"numerics {1e3 * report.numerics.floor_m:.2f} mm")
    return render(
        Page(
            title="Floor", sentence=f"What remains when nothing is wrong: {', '.join(said)}.",
            labels=list(report.warnings), tables=floor_tables(report), pictures=[Picture("floor", picture)],
        )
    )  # fmt: skip


def _compared(intervals: int, phases: int, comparisons: int) -> str:
    """How the numbers go together: of the intervals of one phase the first is what the others are compared with."""
    found = f"{counted(intervals, 'interval')} in {counted(phases, 'phase')}"
    return f"{found}, so {counted(comparisons, 'comparison')} (in each phase one fewer than its intervals)"


def _unused(report: FloorReport) -> str:
    return ", ".join(run for run in report.runs if run not in report.used) or "none"


def _mm(value: float | None) -> str:
    return "not known" if value is None else f"{1e3 * value:.2f}"
