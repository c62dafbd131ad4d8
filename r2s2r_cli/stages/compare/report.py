"""The comparison in figures: each run, each policy and each simulator, and how the gap went over the iterations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.compare.errors import RunErrors
from r2s2r_cli.stages.compare.figures import floor_of, in_common, measures
from r2s2r_cli.stages.compare.opening import Opening
from r2s2r_cli.stages.compare.predicted import Model, PredictedRun
from r2s2r_cli.stages.compare.ranking import LEAST, ranking
from r2s2r_cli.stages.compare.repeats import SAME_START_M, Repeatability, ended, repeatability, turned
from r2s2r_cli.stages.compare.runs import RealRun, policies_of
from r2s2r_cli.stages.compare.walk import Walk
from r2s2r_cli.stages.measures.upright import fallen
from schemas.results_compare import (
    CompareEnd,
    CompareFloor,
    CompareHistory,
    CompareModel,
    CompareOpening,
    ComparePolicy,
    CompareRepeatability,
    CompareReport,
    CompareRun,
    Durations,
)


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
    """See `schemas/results_compare.py`. runs: those of the iteration first."""
    walks, policies = {run.name: run.walk for run in runs}, policies_of(runs)
    numbers = list(dict.fromkeys(run.iteration for run in runs))
    floor = {number: _floor(runs, number, keyframe_floor_m) for number in numbers}
    repeats = [_repeatability(one) for one in repeatability(walks, policies)]
    by_run = {run: one for one in repeats for run in one.runs}
    rows = [_run(one, floor[one.real.iteration], by_run.get(one.real.name)) for one in compared]
    flat = fallen({run.name: run.fallen for run in runs})
    even, left_out = in_common(rows, flat)
    warnings = [*_unsettled(runs), *left_out, *(text for one in compared for text in one.predicted.warnings)]
    if floor[numbers[0]].com_end_m is None:
        warnings.append(
            "no policy was run twice from the same shape on the same side: where the floor of an end is unknown, "
            "an error may be the robot's own scatter"
        )
    seen = {name for model in models for name in model.trained_on}
    told = tuple(_model(model, models[0], compared, even, seen, floor[numbers[0]], flat) for model in models)
    return CompareReport(
        iteration=numbers[0], runs=tuple(rows),
        models=told,
        policies=tuple(_policies(runs, models, even)),
        history=tuple(
            _history(number, model, models[0], even, floor[number]) for number in sorted(numbers) for model in models
        ),
        repeatability=tuple(repeats), floor=floor[numbers[0]], srcc={one.model: one.srcc_com for one in told},
        warnings=tuple(dict.fromkeys(warnings)),
    )  # fmt: skip


def end_of(walk: Walk) -> CompareEnd:
    """Where a run ended and how far it turned."""
    along, across = ended(walk)
    return CompareEnd(com_m=(float(along), float(across)), turn_rad=turned(walk))


def _floor(runs: Sequence[RealRun], iteration: int, keyframe_m: float | None) -> CompareFloor:
    """From the repeats of that iteration; of a measure that has none there, from the repeats of all iterations."""
    own, every = (
        floor_of({run.name: run.walk for run in part}, policies_of(part), keyframe_m)
        for part in ([run for run in runs if run.iteration == iteration], runs)
    )
    known = {name: value for name, value in own.model_dump().items() if value is not None}
    return every.model_copy(update=known)


def _run(one: Compared, floor: CompareFloor, repeats: CompareRepeatability | None) -> CompareRun:
    errors, seen = one.errors, one.predicted
    return CompareRun(
        run=one.real.name, policy=one.real.policy, iteration=one.real.iteration, model=one.model.name,
        trained_on=one.trained_on, intervals=0 if seen.real is None else len(seen.real.intervals),
        of_intervals=one.real.intervals,
        com_end_error_m=None if errors is None else errors.com_end,
        heading_end_error_rad=None if errors is None else errors.heading_end,
        keyframe_cap_rmse_m=None if seen.keyframes is None else seen.keyframes.rmse_m,
        cap_rmse_m=None if errors is None else errors.cap,
        path_error_m=None if errors is None else errors.path,
        gait_m=None if errors is None else float(np.sqrt(np.mean(errors.gait**2))),
        segment_s=None if errors is None else float(
            np.sqrt(np.mean((errors.duration_sim - errors.duration_real) ** 2))
        ),
        duration_s=None if errors is None else Durations(
            real=float(errors.duration_real.sum()), sim=float(errors.duration_sim.sum())
        ),
        end=None if seen.walk is None else end_of(seen.walk),
        real_end=end_of(seen.real or one.real.walk),
        floor=floor, repeatability=repeats, opening=_opening(one.real.opening),
    )  # fmt: skip


def _opening(one: Opening) -> CompareOpening | None:
    if not one.intervals:
        return None
    moved, travel = (value if np.isfinite(value) else None for value in (one.moved, one.travel))
    return CompareOpening(duration_s=one.duration, moved_m=moved, travel_m=travel)


def _unsettled(runs: Sequence[RealRun]) -> Iterator[str]:
    """Runs that were put down in another shape than they came to rest in: nothing of the policy, but good to know."""
    for run in runs:
        if run.opening.moved >= SAME_START_M:
            yield (
                f"run {run.name}: its caps moved by {1e3 * run.opening.moved:.0f} mm in the rest before the policy "
                "(put down in another shape, or tipped); the comparison begins after it"
            )


def _model(
    model: Model, first: Model, compared: Sequence[Compared], rows: Sequence[CompareRun], seen: set[str],
    floor: CompareFloor, flat: Mapping[str, str],
) -> CompareModel:  # fmt: skip
    """Over the runs of the iteration; the order of the gaits over those of all iterations but fallen ones (flat). seen:
    runs that some simulator was trained on."""
    number = rows[0].iteration
    own, others = ([row for row in rows if row.iteration == number and row.model == one.name] for one in (model, first))
    others = own if model is first else others
    fresh, fresh_others = ([row for row in side if row.run not in seen] for side in (own, others))
    mine = [one for one in compared if one.model is model and one.real.name not in flat]
    simulated = {one.real.name: one.predicted.walk for one in mine if one.predicted.walk is not None}
    # Of a run that is compared in part the same part: the rest of it would be the simulator's fault.
    real = {one.real.name: one.predicted.real for one in mine if one.predicted.real is not None}
    known = [one.real for one in mine if one.real.name in simulated]
    ranks = ranking(real, simulated, policies_of(known))
    return CompareModel(
        model=model.name, words=model.numbers.words, runs=measures(own, others, floor),
        heldout=measures(fresh, fresh if model is first else fresh_others, floor),
        srcc_com=None if ranks is None else ranks.com, srcc_turn=None if ranks is None else ranks.turn,
        gaits=len({run.policy for run in known}) if ranks is None else max(ranks.gaits, LEAST),
    )  # fmt: skip


def _history(
    iteration: int, model: Model, first: Model, rows: Sequence[CompareRun], floor: CompareFloor
) -> CompareHistory:
    own, others = ([row for row in rows if row.iteration == iteration and row.model == one.name]
                   for one in (model, first))  # fmt: skip
    return CompareHistory(
        iteration=iteration, model=model.name, trained_on=any(row.trained_on for row in own),
        runs=measures(own, own if model is first else others, floor),
    )  # fmt: skip


def _policies(runs: Sequence[RealRun], models: Sequence[Model], rows: Sequence[CompareRun]) -> Iterator[ComparePolicy]:
    """The real robot, then every simulator, policy by policy."""
    for policy in dict.fromkeys(run.policy for run in runs):
        mine = [row for row in rows if row.policy == policy]
        once = [row for row in mine if row.model == models[0].name]
        yield _policy("", once, [row.real_end for row in once])
        for model in models:
            part = [row for row in mine if row.model == model.name]
            yield _policy(model.name, part, [row.end for row in part if row.end is not None])


def _policy(model: str, rows: Sequence[CompareRun], ends: Sequence[CompareEnd]) -> ComparePolicy:
    turns = [end.turn_rad for end in ends if end.turn_rad is not None]
    along, across = np.mean([end.com_m for end in ends], axis=0) if ends else (np.nan, np.nan)
    return ComparePolicy(
        policy=rows[0].policy, iteration=rows[0].iteration, model=model, runs=len(rows),
        in_part=sum(row.intervals < row.of_intervals for row in rows),
        trained_on=bool(model) and any(row.trained_on for row in rows),
        com_m=(float(along), float(across)) if ends else None,
        turn_rad=float(np.mean(turns)) if turns else None,
        com_error_m=_rms([row.com_end_error_m for row in rows]) if model else None,
        turn_error_rad=_rms([row.heading_end_error_rad for row in rows]) if model else None,
    )  # fmt: skip


def _rms(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.sqrt(np.mean(np.square(known)))) if known else None


def _repeatability(one: Repeatability) -> CompareRepeatability:
    return CompareRepeatability(
        policy=one.policy, runs=one.runs, com_mean_m=(float(one.com_mean[0]), float(one.com_mean[1])),
        com_sd_m=(float(one.com_sd[0]), float(one.com_sd[1])), turn_mean_rad=one.turn_mean, turn_sd_rad=one.turn_sd,
        duration_mean_s=one.duration_mean, duration_sd_s=one.duration_sd,
    )  # fmt: skip
