"""The comparison in figures: each run under each simulator, and each simulator over all runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.compare.errors import RunErrors
from r2s2r_cli.stages.compare.predicted import Model, PredictedRun
from r2s2r_cli.stages.compare.ranking import LEAST, ranking
from r2s2r_cli.stages.compare.repeats import Floors, Repeatability, ended, floors, repeatability, turned
from r2s2r_cli.stages.compare.runs import RealRun, policies_of
from r2s2r_cli.stages.compare.walk import Walk
from r2s2r_cli.stages.measures.bootstrap import bootstrap
from r2s2r_cli.stages.measures.gap import corrected_gap
from schemas.results_compare import (
    CompareEnd,
    CompareFloor,
    CompareMeasure,
    CompareModel,
    CompareRepeatability,
    CompareReport,
    CompareRun,
    Durations,
)

MEASURES = ("com_end_m", "heading_end_rad", "keyframe_cap_m", "cap_m", "path_m", "segment_s")


@dataclass(frozen=True)
class Compared:
    """One run under one simulator; errors None: it could not be simulated."""

    real: RealRun
    model: Model
    predicted: PredictedRun
    errors: RunErrors | None

    @property
    def trained_on(self) -> bool:
        """Whether the numbers were learned from this run."""
        return self.real.name in self.model.trained_on


def report_of(
    runs: Sequence[RealRun], models: Sequence[Model], compared: Sequence[Compared], keyframe_floor_m: float | None
) -> CompareReport:
    """See `schemas/results_compare.py`."""
    walks, policies = {run.name: run.walk for run in runs}, policies_of(runs)
    known = floors(walks, policies)
    floor = _floor(known, keyframe_floor_m)
    repeats = {one.policy: _repeatability(one) for one in repeatability(walks, policies)}
    warnings = [text for one in compared for text in one.predicted.warnings]
    if known.com is None:
        warnings.append(
            "no policy was run twice: where the floor of an end is unknown, an error may be the robot's own scatter"
        )
    return CompareReport(
        runs=tuple(_run(one, floor, repeats.get(one.real.policy)) for one in compared),
        models=tuple(_model(model, compared, walks, floor) for model in models),
        repeatability=tuple(repeats.values()),
        floor=floor,
        warnings=tuple(dict.fromkeys(warnings)),
    )


def end_of(walk: Walk) -> CompareEnd:
    """Where a run ended and how far it turned."""
    along, across = ended(walk)
    return CompareEnd(com_m=(float(along), float(across)), turn_rad=turned(walk))


def _run(one: Compared, floor: CompareFloor, repeats: CompareRepeatability | None) -> CompareRun:
    errors, seen = one.errors, one.predicted
    return CompareRun(
        run=one.real.name, policy=one.real.policy, model=one.model.name, trained_on=one.trained_on,
        intervals=0 if seen.real is None else len(seen.real.intervals),
        com_end_error_m=None if errors is None else errors.com_end,
        heading_end_error_rad=None if errors is None else errors.heading_end,
        keyframe_cap_rmse_m=None if seen.keyframes is None else seen.keyframes.rmse_m,
        cap_rmse_m=None if errors is None else errors.cap,
        path_error_m=None if errors is None else errors.path,
        segment_s=None if errors is None else _segment(errors),
        duration_s=None if errors is None else Durations(
            real=float(errors.duration_real.sum()), sim=float(errors.duration_sim.sum())
        ),
        end=None if seen.walk is None else end_of(seen.walk),
        real_end=end_of(seen.real or one.real.walk),
        floor=floor, repeatability=repeats,
    )  # fmt: skip


def _segment(errors: RunErrors) -> float:
    """Root mean square difference of the durations [s]."""
    return float(np.sqrt(np.mean((errors.duration_sim - errors.duration_real) ** 2)))


def _model(model: Model, compared: Sequence[Compared], walks: dict[str, Walk], floor: CompareFloor) -> CompareModel:
    mine = [one for one in compared if one.model.name == model.name]
    simulated = {one.real.name: one.predicted.walk for one in mine if one.predicted.walk is not None}
    policies = policies_of([one.real for one in mine if one.real.name in simulated])
    ranks = ranking({name: walks[name] for name in simulated}, simulated, policies)
    return CompareModel(
        model=model.name, words=model.numbers.words, runs=_measures(mine, floor),
        heldout=_measures([one for one in mine if not one.trained_on], floor),
        srcc_com=None if ranks is None else ranks.com, srcc_turn=None if ranks is None else ranks.turn,
        gaits=len(set(policies.values())) if ranks is None else max(ranks.gaits, LEAST),
    )  # fmt: skip


def _measures(mine: Sequence[Compared], floor: CompareFloor) -> dict[str, CompareMeasure]:
    """Each measure that is known of at least one run."""
    found = {}
    for name in MEASURES:
        values = [value for one in mine if (value := _value(one, name)) is not None]
        if values:
            found[name] = _measure(np.array(values), _floor_for(name, floor))
    return found


def _value(one: Compared, name: str) -> float | None:
    """One measure of one run."""
    if name == "keyframe_cap_m":
        return None if one.predicted.keyframes is None else one.predicted.keyframes.rmse_m
    if one.errors is None:
        return None
    if name == "segment_s":
        return _segment(one.errors)
    return {
        "com_end_m": one.errors.com_end, "heading_end_rad": one.errors.heading_end, "cap_m": one.errors.cap,
        "path_m": one.errors.path,
    }[name]  # fmt: skip


def _measure(values: np.ndarray, floor: float | None) -> CompareMeasure:
    mse = float(np.mean(values**2))
    interval = bootstrap(values**2)
    return CompareMeasure(
        rms=float(np.sqrt(mse)), lower=None if interval is None else interval.lower,
        upper=None if interval is None else interval.upper, floor=floor,
        gap=None if floor is None else corrected_gap(mse, floor), runs=len(values),
    )  # fmt: skip


def _floor_for(name: str, floor: CompareFloor) -> float | None:
    """The floor of a measure. A run is compared with one simulation, so that of the mean over repeats is not lower."""
    return {
        "com_end_m": floor.com_end_m, "heading_end_rad": floor.heading_end_rad, "segment_s": floor.segment_s,
        "keyframe_cap_m": floor.keyframe_cap_m,
    }.get(name)  # fmt: skip


def _floor(known: Floors, keyframe_m: float | None) -> CompareFloor:
    return CompareFloor(
        com_end_m=known.com, heading_end_rad=known.heading, segment_s=known.segment, keyframe_cap_m=keyframe_m
    )


def _repeatability(one: Repeatability) -> CompareRepeatability:
    return CompareRepeatability(
        policy=one.policy, runs=one.runs, com_mean_m=(float(one.com_mean[0]), float(one.com_mean[1])),
        com_sd_m=(float(one.com_sd[0]), float(one.com_sd[1])), turn_mean_rad=one.turn_mean, turn_sd_rad=one.turn_sd,
        duration_mean_s=one.duration_mean, duration_sd_s=one.duration_sd,
    )  # fmt: skip
