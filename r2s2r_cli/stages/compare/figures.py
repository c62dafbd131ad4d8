"""Root mean squares over runs, by measure: with interval, floor, and against the first simulator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from r2s2r_cli.stages.compare.repeats import Floors, floors
from r2s2r_cli.stages.compare.walk import Walk
from r2s2r_cli.stages.measures.bootstrap import bootstrap, paired
from r2s2r_cli.stages.measures.gap import corrected_gap
from schemas.results_compare import CompareFloor, CompareMeasure, CompareRun

RUN_VALUES = {
    "com_end_m": "com_end_error_m", "heading_end_rad": "heading_end_error_rad", "keyframe_cap_m": "keyframe_cap_rmse_m",
    "cap_m": "cap_rmse_m", "path_m": "path_error_m", "gait_m": "gait_m", "segment_s": "segment_s",
}  # fmt: skip
"""Measures by name, and where a run has them."""


def measures(mine: Sequence[CompareRun], first: Sequence[CompareRun], floor: CompareFloor) -> dict[str, CompareMeasure]:
    """Each measure that at least one run has. first: the same runs in the same order under the first simulator."""
    found = {}
    for name in RUN_VALUES:
        values, others = (_column(side, name) for side in (mine, first))
        if np.isfinite(values).any():
            found[name] = _measure(values, None if mine is first else others, getattr(floor, name))
    return found


def in_common(rows: Sequence[CompareRun], fallen: Mapping[str, str]) -> tuple[list[CompareRun], list[str]]:
    """The same rows, without the measures of a run that one simulator has and another has not: what they err by is
    compared over the same runs. A simulator that has a measure of no run takes nothing from the others. fallen: runs
    that have none for anybody, and why. And what is to be said of each run that lost a measure."""
    blank: dict[str, dict[str, None]] = {run: dict.fromkeys(RUN_VALUES.values()) for run in fallen}
    missing: dict[str, set[str]] = {}
    for field in RUN_VALUES.values():
        has = [(row.model, row.run) for row in rows if getattr(row, field) is not None]
        models = dict.fromkeys(model for model, _ in has)
        runs = dict.fromkeys(run for _, run in has if run not in fallen)
        for run in runs:
            if without := {model for model in models if (model, run) not in has}:
                blank.setdefault(run, {})[field] = None
                missing.setdefault(run, set()).update(without)
    why = {run: f"{', '.join(sorted(models))} could not be simulated in it" for run, models in missing.items()} | dict(
        fallen
    )
    said = [f"run {run} is left out of the figures over several runs for all simulators: {why[run]}" for run in why]
    return [row.model_copy(update=blank.get(row.run, {})) for row in rows], said


def floor_of(walks: Mapping[str, Walk], policies: Mapping[str, str], keyframe_m: float | None) -> CompareFloor:
    """From repeats among these runs; that of key frames is of caps at the end of an interval, laid on each other at its
    start, and where nothing repeats that of floor.h5 (keyframe_m). A run is compared with one simulation, so that the
    floor of the mean over repeats is not lower."""
    known: Floors = floors(walks, policies)
    keyframe_m = keyframe_m if known.gait is None else known.gait
    return CompareFloor(
        com_end_m=known.com, heading_end_rad=known.heading, segment_s=known.segment, keyframe_cap_m=keyframe_m,
        path_m=known.path, cap_m=known.cap, gait_m=known.gait,
    )  # fmt: skip


def _column(runs: Sequence[CompareRun], name: str) -> np.ndarray:
    """One number a run, NaN where it is not known."""
    values = [getattr(run, RUN_VALUES[name]) for run in runs]
    return np.array([np.nan if value is None else value for value in values], dtype=float)


def _measure(values: np.ndarray, first: np.ndarray | None, floor: float | None) -> CompareMeasure:
    known = values[np.isfinite(values)]
    mse = float(np.mean(known**2))
    interval = bootstrap(known**2)
    change = lower = upper = None
    if first is not None and (both := np.isfinite(values) & np.isfinite(first)).any():
        change = float(np.sqrt(np.mean(values[both] ** 2)) - np.sqrt(np.mean(first[both] ** 2)))
        if (difference := paired(values[both] ** 2, first[both] ** 2)) is not None:
            lower, upper = difference.interval.lower, difference.interval.upper
    return CompareMeasure(
        rms=float(np.sqrt(mse)), lower=None if interval is None else interval.lower,
        upper=None if interval is None else interval.upper, floor=floor,
        gap=None if floor is None else corrected_gap(mse, floor), change=change, change_lower=lower,
        change_upper=upper, runs=len(known),
    )  # fmt: skip
