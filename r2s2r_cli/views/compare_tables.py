"""The comparison as tables, those of the paper among them, each number with its unit and beside its floor."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from r2s2r_cli.views.page import PageTable
from schemas.results_compare import CompareMeasure, CompareRepeatability, CompareReport, CompareRun

MEASURES = {
    "com_end_m": ("centre of mass at the end [mm]", 1e3), "heading_end_rad": ("turn at the end [deg]", math.degrees(1)),
    "keyframe_cap_m": ("caps at key frames, command replay [mm]", 1e3), "cap_m": ("caps along the run [mm]", 1e3),
    "path_m": ("centre of mass along the run [mm]", 1e3),
    "gait_m": ("caps at the end of each interval, laid on at its start [mm]", 1e3),
    "segment_s": ("duration of a target interval [s]", 1.0),
}  # fmt: skip
"""Measures with their words and what SI is multiplied by."""
_DEG = math.degrees(1)
"""Of one radian: people read degrees, JSON and HDF5 hold radians."""
TRAINED = "†"
IN_PART = "‡"
"""Behind a policy of which a run is compared in part."""


def comparison_tables(report: CompareReport) -> Iterator[PageTable]:
    """Every number of the report."""
    yield _overall(report)
    for iteration in sorted({one.iteration for one in report.history} - {report.iteration}):
        yield _earlier(report, iteration)
    for iteration in sorted({run.iteration for run in report.runs}):
        yield table_two(report, iteration)
    if report.repeatability:
        yield table_one(report.repeatability)
    ranked = [model for model in report.models if model.srcc_com is not None or model.srcc_turn is not None]
    if ranked:
        yield PageTable(
            "order of the gaits of all iterations: rank correlation with the robot (1: the same order)",
            ["simulator", "gaits", "how far it came", "how far it turned"],
            [[m.model, str(m.gaits), _plain(m.srcc_com), _plain(m.srcc_turn)] for m in ranked],
        )
    yield _runs(report)


def table_one(repeats: Sequence[CompareRepeatability]) -> PageTable:
    """How the robot repeats itself, in the paper's layout: a column a policy, mean ± sd."""
    return PageTable(
        "Table I: how the robot repeats itself, mean ± sd of one run, each up to where it was seen",
        ["metric", *(one.policy for one in repeats)],
        [
            ["end CoM position (m)", *(_spread(one) for one in repeats)],
            ["end orientation (degree)", *(_turned(one) for one in repeats)],
            ["duration (s)", *(f"{one.duration_mean_s:.2f} ± {one.duration_sd_s:.2f}" for one in repeats)],
            ["runs", *(str(len(one.runs)) for one in repeats)],
        ],
    )


def table_two(report: CompareReport, iteration: int) -> PageTable:
    """Simulated and real ends of one iteration's runs and their errors, in the paper's layout; all runs together, with
    their interval, in a column of their own."""
    mine = [one for one in report.policies if one.iteration == iteration]
    policies = list(dict.fromkeys(one.policy for one in mine))
    by = {(one.policy, one.model): one for one in mine}
    over = {one.model: one for one in report.history if one.iteration == iteration}
    cut = {one.policy for one in mine if one.in_part}
    short = [policy.removeprefix(f"{iteration:03d}-") + f" {IN_PART}" * (policy in cut) for policy in policies]
    rows = []
    for model in ("", *over):
        cells = [by[policy, model] for policy in policies]
        name = f"{model} simulation" if model else "real robot"
        rows.append([name, *(_place(one.com_m) for one in cells), "", *(_degrees(one.turn_rad) for one in cells), ""])
    for model, whole in over.items():
        cells = [by[policy, model] for policy in policies]
        marks = [f" {TRAINED}" if one.trained_on else "" for one in cells]
        every = f" {TRAINED}" if whole.trained_on else ""
        rows.append([
            f"{model} error",
            *(_number(one.com_error_m, 3) + mark for one, mark in zip(cells, marks, strict=True)),
            _interval(whole.runs.get("com_end_m"), 3) + every,
            *(_degrees(one.turn_error_rad) + mark for one, mark in zip(cells, marks, strict=True)),
            _interval(whole.runs.get("heading_end_rad"), 1, _DEG) + every,
        ])  # fmt: skip
    blank = [""] * len(policies)
    known = [next(iter(over.values())).runs.get(name) for name in ("com_end_m", "heading_end_rad")]
    rows.append(["floor", *blank, _floor(known[0], 3), *blank, _floor(known[1], 1, _DEG)])
    return PageTable(
        f"Table II, runs of iteration {iteration}: ends from the start, along and across the heading there; errors are"
        f" root mean squares over repeats, of all runs with a 95 % interval; {TRAINED} the simulator learned from them"
        + f"; {IN_PART} some runs in part, up to where all is known: their real ends are of there" * bool(cut),
        ["metric", *(f"CoM [m], {name}" for name in short), "all runs [m]",
         *(f"turn [deg], {name}" for name in short), "all runs [deg]"],
        rows,
    )  # fmt: skip


def _overall(report: CompareReport) -> PageTable:
    """One row a measure, a column a simulator, over the runs of the iteration: those nobody was trained on, if any."""
    held = all(model.heldout for model in report.models)
    sides = {model.model: model.heldout if held else model.runs for model in report.models}
    left_out = {run.run for run in report.runs if run.iteration == report.iteration and run.trained_on}
    what = "no simulator was trained on them" if held else "some simulator was trained on them"
    rest = f" (without {', '.join(sorted(left_out))})" if held and left_out else ""
    return _measures(f"runs of iteration {report.iteration}{rest}, {what}", sides)


def _earlier(report: CompareReport, iteration: int) -> PageTable:
    mine = [one for one in report.history if one.iteration == iteration]
    sides = {f"{one.model}{f' {TRAINED}' if one.trained_on else ''}": one.runs for one in mine}
    return _measures(f"runs of iteration {iteration} ({TRAINED} the simulator learned from them)", sides)


def _measures(title: str, sides: Mapping[str, Mapping[str, CompareMeasure]]) -> PageTable:
    rows = []
    for name, (words, scale) in MEASURES.items():
        known = [one for side in sides.values() if (one := side.get(name)) is not None]
        if known:
            floor = known[0].floor
            rows.append([words, "not known" if floor is None else f"{scale * floor:.3g}",
                         *(_measure(side.get(name), scale) for side in sides.values())])  # fmt: skip
    return PageTable(
        f"{title}: root mean square error (95 % interval over runs), gap above the floor", ["measure", "floor", *sides],
        rows,
    )  # fmt: skip


def _measure(one: CompareMeasure | None, scale: float) -> str:
    if one is None:
        return "not compared"
    text = f"{scale * one.rms:.3g}"
    if one.lower is not None and one.upper is not None:
        text += f" ({scale * one.lower:.3g} to {scale * one.upper:.3g})"
    if one.gap is not None:
        text += ", at the floor" if one.gap == 0 else f", gap {scale * one.gap:.3g}"
    return text


def _runs(report: CompareReport) -> PageTable:
    columns = ["run", "simulator", "trained on it", "intervals", "end [mm]", "turn [deg]", "key frames [mm]",
               "caps [mm]", "path [mm]", "real / simulated [s]",
               "rest before: caps moved [mm]"]  # fmt: skip
    return PageTable("every run", columns, [_row(run) for run in report.runs])


def _row(run: CompareRun) -> list[str]:
    lasts = "-" if run.duration_s is None else f"{run.duration_s.real:.1f} / {run.duration_s.sim:.1f}"
    return [
        run.run, run.model, "yes" if run.trained_on else "no", _share(run), _scaled(run.com_end_error_m, 1e3),
        _scaled(run.heading_end_error_rad, math.degrees(1)), _scaled(run.keyframe_cap_rmse_m, 1e3),
        _scaled(run.cap_rmse_m, 1e3), _scaled(run.path_error_m, 1e3), lasts,
        "-" if run.opening is None else _scaled(run.opening.moved_m, 1e3),
    ]  # fmt: skip


def _share(run: CompareRun) -> str:
    """Target intervals that are compared; of how many, where those are more."""
    return f"{run.intervals} of {run.of_intervals}" if run.intervals < run.of_intervals else str(run.intervals)


def _spread(one: CompareRepeatability) -> str:
    (x, y), (sx, sy) = one.com_mean_m, one.com_sd_m
    return f"[{x:.3f} ± {sx:.3f}, {y:.3f} ± {sy:.3f}]"


def _turned(one: CompareRepeatability) -> str:
    mean, sd = one.turn_mean_rad, one.turn_sd_rad
    return "-" if mean is None or sd is None else f"{_degrees(mean)} ± {_degrees(sd)}"


def _degrees(value: float | None) -> str:
    return "-" if value is None else f"{_DEG * value:.1f}"


def _place(com: tuple[float, float] | None) -> str:
    return "-" if com is None else f"[{com[0]:.3f}, {com[1]:.3f}]"


def _interval(one: CompareMeasure | None, digits: int, scale: float = 1.0) -> str:
    if one is None:
        return "-"
    text = f"{scale * one.rms:.{digits}f}"
    if one.lower is None or one.upper is None:
        return text
    return f"{text} ({scale * one.lower:.{digits}f} to {scale * one.upper:.{digits}f})"


def _floor(one: CompareMeasure | None, digits: int, scale: float = 1.0) -> str:
    return "not known" if one is None or one.floor is None else f"{scale * one.floor:.{digits}f}"


def _scaled(value: float | None, scale: float) -> str:
    return "-" if value is None else f"{scale * value:.1f}"


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _plain(value: float | None) -> str:
    return _number(value, 2)
