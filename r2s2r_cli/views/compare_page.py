"""The comparison as tables, those of the paper among them, and as a page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from r2s2r_cli.views.page import Page, PageTable, Picture, counted, render
from schemas.results_compare import CompareEnd, CompareMeasure, CompareReport, CompareRun

_NAMES = {
    "com_end_m": ("centre of mass at the end [mm]", 1e3), "heading_end_rad": ("turn at the end [deg]", math.degrees(1)),
    "keyframe_cap_m": ("caps at key frames, command replay [mm]", 1e3), "cap_m": ("caps along the run [mm]", 1e3),
    "path_m": ("centre of mass along the run [mm]", 1e3), "segment_s": ("duration of a target interval [s]", 1.0),
}  # fmt: skip


def comparison_tables(report: CompareReport) -> Iterator[PageTable]:
    """Every number with its unit, and beside its floor."""
    yield _simulators(report, heldout=False)
    if any(run.trained_on for run in report.runs):
        yield _simulators(report, heldout=True)
    yield _runs(report)
    if report.repeatability:
        yield _repeatability(report)
    yield _ends(report)
    ranked = [model for model in report.models if model.srcc_com is not None or model.srcc_turn is not None]
    if ranked:
        yield PageTable(
            "order of the gaits: rank correlation with the robot (1: the same order)",
            ["simulator", "gaits", "how far it came", "how far it turned"],
            [[m.model, str(m.gaits), _plain(m.srcc_com), _plain(m.srcc_turn)] for m in ranked],
        )


def comparison_page(report: CompareReport, pictures: Mapping[str, bytes]) -> bytes:
    """The HTML page: the verdict, the warnings, the tables, a picture a run."""
    return render(
        Page(
            title="Real and simulated", sentence=verdict(report), labels=list(report.warnings),
            tables=list(comparison_tables(report)), pictures=[Picture(run, png) for run, png in pictures.items()],
        )
    )  # fmt: skip


def verdict(report: CompareReport) -> str:
    """The end of the centre of mass under the first and the last simulator, in a sentence."""
    first, last = report.models[0], report.models[-1]
    runs = counted(len({run.run for run in report.runs}), "run")
    if "com_end_m" not in first.runs or "com_end_m" not in last.runs:
        return f"{runs}: not every simulator could be run."
    a, b = first.runs["com_end_m"], last.runs["com_end_m"]
    floor = "" if b.floor is None else f", where {1e3 * b.floor:.0f} mm is the floor"
    if first.model == last.model:
        return f"{runs}: the simulated centre of mass ends {1e3 * a.rms:.0f} mm from the real one{floor}."
    seen = "" if last.heldout else " All of these runs were trained on: no claim of accuracy rests on them."
    return (
        f"{runs}: the simulated centre of mass ends {1e3 * a.rms:.0f} mm from the real one with {first.model}, "
        f"{1e3 * b.rms:.0f} mm with {last.model}{floor}.{seen}"
    )


def _simulators(report: CompareReport, *, heldout: bool) -> PageTable:
    """One row a measure, a column a simulator: root mean square over runs, interval, and the gap above the floor."""
    sides = [(model.model, model.heldout if heldout else model.runs) for model in report.models]
    rows = []
    for name, (words, scale) in _NAMES.items():
        if not any(name in side for _, side in sides):
            continue
        floor = next((one.floor for _, side in sides if (one := side.get(name)) is not None), None)
        rows.append([words, "not known" if floor is None else f"{scale * floor:.3g}",
                     *(_measure(side.get(name), scale) for _, side in sides)])  # fmt: skip
    title = "runs that the simulator was not trained on" if heldout else "error over all runs"
    return PageTable(
        f"{title}: root mean square (95 % interval over runs), above the floor",
        ["measure", "floor", *(n for n, _ in sides)],
        rows,
    )


def _measure(one: CompareMeasure | None, scale: float) -> str:
    if one is None:
        return "not compared"
    text = f"{scale * one.rms:.3g}"
    if one.lower is not None and one.upper is not None:
        text += f" ({scale * one.lower:.3g} to {scale * one.upper:.3g})"
    return text if one.gap is None else f"{text}, {scale * one.gap:.3g} above"


def _runs(report: CompareReport) -> PageTable:
    columns = ["run", "simulator", "trained on it", "intervals", "end [mm]", "turn [deg]", "key frames [mm]",
               "caps [mm]", "path [mm]", "real / simulated [s]"]  # fmt: skip
    return PageTable("every run", columns, [_row(run) for run in report.runs])


def _row(run: CompareRun) -> list[str]:
    lasts = "-" if run.duration_s is None else f"{run.duration_s.real:.1f} / {run.duration_s.sim:.1f}"
    return [
        run.run, run.model, "yes" if run.trained_on else "no", str(run.intervals), _mm(run.com_end_error_m),
        _deg(run.heading_end_error_rad), _mm(run.keyframe_cap_rmse_m), _mm(run.cap_rmse_m), _mm(run.path_error_m),
        lasts,
    ]  # fmt: skip


def _repeatability(report: CompareReport) -> PageTable:
    """Table I of the paper."""
    rows = []
    for one in report.repeatability:
        (x, y), (sx, sy) = one.com_mean_m, one.com_sd_m
        turn = (
            "-"
            if one.turn_mean_rad is None or one.turn_sd_rad is None
            else f"{one.turn_mean_rad:.3f} ± {one.turn_sd_rad:.3f}"
        )
        rows.append([one.policy, str(len(one.runs)), f"[{x:.3f} ± {sx:.3f}, {y:.3f} ± {sy:.3f}]", turn,
                     f"{one.duration_mean_s:.2f} ± {one.duration_sd_s:.2f}"])  # fmt: skip
    return PageTable(
        "how the robot repeats itself, mean ± sd (Table I of the paper)",
        ["policy", "runs", "end of the centre of mass [m]", "turn [rad]", "duration [s]"], rows,
    )  # fmt: skip


def _ends(report: CompareReport) -> PageTable:
    """Table II of the paper: where real and simulated runs ended, and by how much they differ."""
    rows, seen = [], set()
    for run in report.runs:
        if run.run not in seen:
            rows.append([run.run, "real robot", _place(run.real_end), _turn(run.real_end), "", ""])
            seen.add(run.run)
        rows.append([run.run, run.model, _place(run.end), _turn(run.end), _metres(run.com_end_error_m),
                     _plain(run.heading_end_error_rad)])  # fmt: skip
    return PageTable(
        "ends (Table II of the paper); from the start, along and across the heading there",
        ["run", "by", "centre of mass [m]", "turn [rad]", "error [m]", "error [rad]"], rows,
    )  # fmt: skip


def _place(end: CompareEnd | None) -> str:
    return "-" if end is None else f"[{end.com_m[0]:.3f}, {end.com_m[1]:.3f}]"


def _turn(end: CompareEnd | None) -> str:
    return _plain(None if end is None else end.turn_rad)


def _mm(value: float | None) -> str:
    return "-" if value is None else f"{1e3 * value:.1f}"


def _deg(value: float | None) -> str:
    return "-" if value is None else f"{math.degrees(value):.1f}"


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _plain(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
