"""What was found, as the report that is printed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from r2s2r_cli.stages.identify.doubts import contradicted, doubtful, outdone, ranging
from r2s2r_cli.stages.identify.found import OURS, Found, ParameterFound, SegmentFound
from r2s2r_cli.stages.measures.bootstrap import Interval
from r2s2r_cli.stages.measures.table import Row
from schemas.results_identify import (
    Baseline,
    Correlation,
    Direction,
    HeldOut,
    IdentifyReport,
    Intervals,
    Measures,
    ParameterFigures,
    ProfileFigures,
    RepeatsFigures,
    SegmentFigures,
    StartFigures,
)

CORRELATED = 0.7
"""Weaker correlations are not worth a line."""
_SHOWN = 5


def report_of(found: Found) -> IdentifyReport:
    """The report; the command adds how long it took."""
    return IdentifyReport(
        method=found.request.method,
        drive=found.request.drive,
        loss=found.loss,
        mask=found.mask,
        uncertainty=found.uncertainty,
        effects=found.request.effects,
        parameters={one.free.name: _parameter(one) for one in found.parameters},
        train=Measures(keyframe_cap_rmse_m=_rmse(found.train.get(OURS))),
        heldout=_heldout(found),
        repeating=_repeating(found),
        segments=_segments(found),
        weak=_weak(found),
        correlations=tuple(_correlations(found)),
        profiles=tuple(
            ProfileFigures(
                parameter=found.names[one.row],
                lower=_finite(one.interval[0]),
                upper=_finite(one.interval[1]),
                words=one.words,
            )
            for one in found.profiles
        ),
        starts=tuple(
            StartFigures(kind="start", cost=one.cost, iterations=one.iterations,
                         reason=one.reason)
            for one in found.starts
        ),
        cost=found.cost,
        residuals=found.residuals,
        converged=found.converged,
        reason=found.reason,
        rollouts=found.rollouts,
        computed_by="torch" if found.computed_by_torch else "machine code",
        warnings=(
            *found.warnings, *outdone(found.test or {}, found.closed_loop_m, found.headline),
            *doubtful(found.parameters), *ranging(found.parameters), *contradicted(found.parameters, found.profiles),
        ),
    )  # fmt: skip


def _parameter(one: ParameterFound) -> ParameterFigures:
    low, high = one.range
    sd, lower, upper = one.interval
    return ParameterFigures(
        value=one.value, sd=_finite(sd), lower=_finite(lower), upper=_finite(upper),
        range=(low, high) if math.isfinite(low) and math.isfinite(high) else None, unit=one.free.unit,
        identifiable=one.identifiable, trust="fixed" if one.trust is None else one.trust.value,
        reason=one.reason, start=one.free.start, bounds=(_finite(one.free.lower), _finite(one.free.upper)),
        what=one.free.what,
    )  # fmt: skip


def _heldout(found: Found) -> HeldOut | None:
    rows = found.test
    if not rows:
        return None
    ours = rows[found.headline]
    return HeldOut(
        predictor=found.headline,
        keyframe_cap_rmse_m=ours.key.rmse_m,
        free_run_cap_mean_m=ours.free_m,
        free_run_closed_loop_cap_mean_m=found.closed_loop_m,
        intervals=_intervals(ours),
        baselines={name: _baseline(ours, row) for name, row in rows.items() if name != found.headline},
        floor_m=None if found.floor is None else found.floor.floor_m,
    )


def _baseline(ours: Row, row: Row) -> Baseline:
    key, free = ours.against(row), ours.free_against(row)
    return Baseline(
        keyframe_cap_rmse_m=row.key.rmse_m, free_run_cap_mean_m=row.free_m, intervals=_intervals(row),
        difference=Intervals(
            keyframe_cap_rmse_m=_ends(key.interval) if key else None,
            free_run_cap_mean_m=_ends(free.interval) if free else None,
        ),
        ours_better=None if key is None else key.ours_better,
    )  # fmt: skip


def _intervals(row: Row) -> Intervals:
    return Intervals(keyframe_cap_rmse_m=_ends(row.key_interval), free_run_cap_mean_m=_ends(row.free_interval))


def _segments(found: Found) -> tuple[SegmentFigures, ...]:
    sides = [
        *_side("train", found.train_segments, found.train, OURS),
        *_side("test", found.test_segments, found.test or {}, found.headline),
    ]
    return tuple(sorted(sides, key=lambda one: (one.run, one.interval)))


def _side(role: str, segments: Sequence[SegmentFound], rows: Mapping[str, Row], own: str) -> list[SegmentFigures]:
    return [
        SegmentFigures(
            run=one.step.run, interval=one.step.interval, role=role,  # type: ignore[arg-type]
            keyframe_cap_rmse_m=one.keyframe_cap_rmse,
            cap_rmse_m=one.cap_rmse,
            predicted_cap_rmse_m=None if own == OURS else float(rows[own].key.per_segment_m[i]),
            baselines={name: _finite(row.key.per_segment_m[i]) for name, row in rows.items() if name != own},
            not_white=tuple(int(cap) for cap in np.flatnonzero(~np.asarray(one.white, dtype=bool))),
        )
        for i, one in enumerate(segments)
    ]  # fmt: skip


def _repeating(found: Found) -> RepeatsFigures | None:
    own = found.repeats
    if own is None:
        return None
    made, evidence = own.made, own.evidence
    return RepeatsFigures(
        used=own.used, gap_m=own.model.gap_m, floor_m=own.model.floor.floor_m, contrasts=own.model.floor.contrasts,
        weights=() if made is None else tuple(made.weights.tolist()),
        repeats=() if made is None else tuple(made.repeats.tolist()),
        left_out_alone_m=None if evidence is None else evidence.alone_m,
        left_out_m=None if evidence is None else evidence.with_m,
        left_out=0 if evidence is None else evidence.intervals,
    )  # fmt: skip


def _weak(found: Found) -> tuple[Direction, ...]:
    info = found.information
    if info is None:
        return ()
    rows = zip(info.eigenvalue.tolist(), info.words, info.weak.tolist(), strict=True)
    return tuple(Direction(eigenvalue=value, words=words) for value, words, weak in rows if weak)


def _correlations(found: Found) -> list[Correlation]:
    """The strongest, each pair once."""
    matrix = found.correlation
    if matrix is None:
        return []
    pairs = [(i, j) for i, j in zip(*np.triu_indices(len(matrix), 1), strict=True) if abs(matrix[i, j]) >= CORRELATED]
    pairs.sort(key=lambda pair: -abs(matrix[pair]))
    return [Correlation(one=found.names[i], other=found.names[j], value=float(matrix[i, j])) for i, j in pairs[:_SHOWN]]


def _rmse(row: Row | None) -> float | None:
    return None if row is None else row.key.rmse_m


def _ends(interval: Interval | None) -> tuple[float, float] | None:
    return None if interval is None else (interval.lower, interval.upper)


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
