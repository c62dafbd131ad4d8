"""The diagnosis as the report that is printed, stored and drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.diagnosis import Diagnosis
from r2s2r_cli.stages.diagnose.parity.finding import Element
from r2s2r_cli.stages.diagnose.which.found import Ranked
from r2s2r_cli.stages.diagnose.which.numbers import NUISANCES
from r2s2r_cli.stages.diagnose.which.shifts import CAMERA
from r2s2r_cli.stages.diagnose.words import sentence
from r2s2r_cli.stages.effects import all_effects
from schemas.parity import ParityFound, columns
from schemas.results_diagnose import (
    DiagnoseReport,
    ElementFound,
    NextGaitFound,
    PairFound,
    RankedName,
    SegmentFound,
    ShrinkageFound,
    WhereFound,
)

FINDINGS = 8
"""Findings of the parity stage that are told."""
MOST_SD = 1e6
"""Farther than this nothing stands out: an error of 0 is no number that a report can hold."""


def diagnose_report(found: Diagnosis) -> DiagnoseReport:
    """Of a diagnosis; wall time and files are added by the command."""
    which = found.which
    return DiagnoseReport(
        verdict=which.verdict, sentence=sentence(found), effects=which.effects, probability=which.probability,  # type: ignore[arg-type]
        set90=which.set90, ranking=tuple(_ranked(one) for one in which.ranking),
        pairs=tuple(
            PairFound(effects=one.effects, elpd_gain=one.gain, marginal_nats=_finite(one.marginal, 0.0))
            for one in which.pairs if math.isfinite(one.gain)
        ),
        where=_where(found),
        shrinkage=_shrinkage(found), not_testable=which.not_testable,
        confusable=tuple(one for one in which.confusable if math.isfinite(one[2])), next_gait=_next(found),
        robot=found.robot, floor_m=found.floor.rmse, floor_from=found.floor.words, floor_given=found.floor.given,
        refit_rmse_m=which.no_gap.rmse, refit_upper_m=which.no_gap.upper, refit_floor_m=which.no_gap.floor,
        refit_kept=which.no_gap.kept, chance_nats=which.chance,
        gap_nats=_known(which.left.refit), left_nats=_known(which.left.best), left_sd_nats=_known(which.left.sd),
        stranger_sd2=None if which.stranger is None else which.stranger.left,
        calibrated=which.calibrated, left_out=which.within, segments=_segments(found),
        hidden=tuple(shift.words for shift in which.shifts), missing=_missing(found),
        refit=found.refit, refit_units={name: _unit(name) for name in found.refit}, rollouts=found.rollouts,
        within_run=found.within_run, warnings=found.warnings,
        **columns(_parity(found)),
    )  # fmt: skip


def _where(found: Diagnosis) -> WhereFound:
    element = found.seat.element
    onset = None if found.where is None else found.where.onset
    return WhereFound(
        segments=tuple(f"{one.run}:{one.interval}" for one in found.segments if one.gap),
        onset_segment=None if onset is None else onset.order + 1,
        onset=None if onset is None else f"{onset.run}:{onset.interval}",
        channel=found.channel, element=None if element is None else _element(element),
    )  # fmt: skip


def _element(one: Element) -> ElementFound:
    return ElementFound(kind=one.kind, index=one.index, xy_m=one.xy_m)  # type: ignore[arg-type]


def _ranked(one: Ranked) -> RankedName:
    return RankedName(
        effect=one.effect, elpd_gain=_finite(one.gain, -1e9),
        elpd_gain_sd=one.gain_sd if one.gain_sd is not None and math.isfinite(one.gain_sd) else None,
        marginal_nats=_finite(one.marginal, 0.0), parity_nats=one.parity, fitted=one.fitted,
        probability=one.probability, size=dict(one.size),
        ci90=dict(one.ci90), units=dict(one.units), channel=one.channel,
        element=None if one.element is None else _element(one.element),
        rmse_m=None if one.rmse is None or not math.isfinite(one.rmse) else one.rmse, moved=one.moved,
        on_bound=one.on_bound, seen_sd=_known(one.seen),
        strain_nats=_known(one.strain),
    )  # fmt: skip


def _shrinkage(found: Diagnosis) -> ShrinkageFound | None:
    much = found.much
    if much is None:
        return None
    return ShrinkageFound(
        effects=much.effects, nominal=much.rmse("nominal"), refit=much.rmse("refit"),
        refit_plus_effect=much.rmse("effect"), ceiling=much.rmse("ceiling"), floor=much.floor, own_share=much.share,
        ci90=much.ci90, predicted=much.predicted, judged_on=much.names, set_aside=much.set_aside,
        within_run=much.within_run,
    )  # fmt: skip


def _next(found: Diagnosis) -> NextGaitFound | None:
    one = found.next_gait
    if one is None:
        return None
    candidates = (one.separates[0][0], *(other for _, other, _ in one.separates)) if one.separates else ()
    return NextGaitFound(
        name=one.name,
        file=None,
        targets=one.targets,
        nats=one.nats,
        now=one.now,
        candidates=candidates,
        narrows=one.narrows,
    )


def _segments(found: Diagnosis) -> tuple[SegmentFound, ...]:
    return tuple(
        SegmentFound(
            run=one.run, interval=one.interval, gait=one.gait, rmse_m=_finite(one.refit, 0.0),
            with_effect_m=None if one.effect is None or not math.isfinite(one.effect) else one.effect,
            misfit=_finite(one.misfit, 1e9), gap=one.gap, t_s=one.t,
        )
        for one in found.segments
    )  # fmt: skip


def _parity(found: Diagnosis) -> list[ParityFound]:
    """The findings that are told."""
    told = () if found.parity is None else found.parity.significant[:FINDINGS]
    return [
        ParityFound(
            f"{one.what} ({one.z:+.1f} sd)", float(np.clip(one.z, -MOST_SD, MOST_SD)),
            one.suspicions[0].effect if one.suspicions else "",
        )
        for one in told
    ]  # fmt: skip


def _missing(found: Diagnosis) -> tuple[str, ...]:
    parts: list[Sequence[str]] = [
        () if found.parity is None else found.parity.missing, () if found.where is None else found.where.missing,
        () if found.much is None else found.much.missing,
    ]  # fmt: skip
    return tuple(dict.fromkeys(one for part in parts for one in part))


def _unit(name: str) -> str:
    """Of a number of the refit nominal model."""
    known = {one.name: one.unit for one in NUISANCES} | {name: unit for name, unit, _ in CAMERA}
    known |= {f"{effect.name}.{own.name}": own.unit for effect in all_effects() for own in effect.own}
    return known.get(name, "m" if name.startswith("sensor_bias") else "")


def _finite(value: float, instead: float) -> float:
    return float(value) if np.isfinite(value) else instead


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
