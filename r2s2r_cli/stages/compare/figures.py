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
    fields = tuple(RUN_VALUES.values())
    able = {field: {row.model for row in rows if getattr(row, field) is not None} for field in fields}
    blank: dict[str, dict[str, None]] = {run: dict.fromkeys(fields) for run in fallen}
    said = dict.fromkeys(_left_out(run, reason) for run, reason in fallen.items())
    for run in dict.fromkeys(row.run for row in rows if row.run not in fallen):
        mine = [row for row in rows if row.run == run]
        lost = {row.model for row in mine if all(getattr(row, field) is None for field in fields)}
        for name, field in RUN_VALUES.items():
            without = sorted(row.model for row in mine if getattr(row, field) is None and row.model in able[field])
            if not without or len(without) == len(able[field]):
                continue
            blank.setdefault(run, {})[field] = None
            if gone := [model for model in without if model in lost]:
                said[_left_out(run, f"{', '.join(gone)} could not be simulated in it")] = None
            else:
                of = f" of the {name.rpartition('_')[0].replace('_', ' ')}"
                said[_left_out(run, f"{', '.join(without)} has none in it", of)] = None
    return [row.model_copy(update=blank.get(row.run, {})) for row in rows], list(said)


def _left_out(run: str, why: str, of: str = "") -> str:
    return f"run {run} is left out of the figures{of} over several runs for all simulators: {why}"


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
