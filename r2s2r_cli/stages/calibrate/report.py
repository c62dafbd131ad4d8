"""The calibration in words and numbers: the models of schemas.results_calibrate."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Sequence

import numpy as np

from r2s2r_cli.stages.calibrate.drift import CARRIED_OVER, SHORT_S, SWAP, Change, Spread, WorkingRange, spread
from r2s2r_cli.stages.calibrate.history import GOOD, History, date_text
from r2s2r_cli.stages.calibrate.lines import DEAD, FALLING, rms
from r2s2r_cli.stages.calibrate.masses import MassProperties
from r2s2r_cli.stages.calibrate.sensors import Points, SetFit
from r2s2r_cli.stages.calibrate.tendons import Average, Curve, CurveFit, falls_from
from schemas.calibration import HISTORY_STATES, LINE_STATES
from schemas.results_calibrate import (
    DriftSpread,
    FailedFit,
    HistoryReport,
    RodMass,
    SensorLine,
    SensorSet,
    Swap,
    TendonCurve,
    TendonReport,
)

DAY_S = 86400.0
CHOOSE = "SET   # one of those that are listed: which one fits the robot of today, nobody else knows"
"""Behind `--use`, where no set is near to what was typed: a set is never guessed."""


def finite(value: float) -> float | None:
    """The number, or None where there is none: JSON has no NaN."""
    return float(value) if math.isfinite(value) else None


def choices(sets: Iterable[tuple[str, float | None]]) -> str:
    """Names of sets with their residual rms in length [m] (None: all of its sensors are dead), to choose from."""
    told = ((name, "all dead" if rms_m is None else f"{1e3 * rms_m:.1f} mm rms") for name, rms_m in sets)
    return " | ".join(f"{shlex.quote(name)} ({words})" for name, words in told)


def sensor_sets(points: Points, sets: Sequence[SetFit]) -> tuple[SensorSet, ...]:
    """One report per set."""
    return tuple(_sensor_set(points, fitted) for fitted in sets)


def _sensor_set(points: Points, fitted: SetFit) -> SensorSet:
    lines = tuple(
        SensorLine(
            sensor=i,
            name=points.names[i],
            points=fit.n,
            slope_f_per_m=fit.slope,
            slope_se_f_per_m=fit.slope_se,
            offset_f=fit.offset,
            rms_m=finite(fit.rms),
            worst_m=finite(fit.worst),
            loo_rms_m=finite(fit.loo_rms),
            quadratic_rms_m=finite(fit.quadratic_rms),
            state=LINE_STATES[fit.state],
        )
        for i, fit in enumerate(fitted.fits)
    )
    left = [fit.loo_residual for fit in fitted.fits if fit.state != DEAD]
    return SensorSet(
        name=fitted.name,
        rms_m=finite(fitted.rms),
        loo_rms_m=finite(rms(np.concatenate(left))) if left else None,
        dead=tuple(i for i, fit in enumerate(fitted.fits) if fit.state == DEAD),
        falling=tuple(i for i, fit in enumerate(fitted.fits) if fit.state == FALLING),
        lines=lines,
    )


def history_report(
    history: History, changes: tuple[Change, ...], ranges: WorkingRange, per_sensor: Sequence[Spread]
) -> HistoryReport:
    """Failed fits, swaps, and how far recalibrations move lengths."""
    swapped = tuple(c for c in changes if c.state == SWAP)
    return HistoryReport(
        entries=len(history.files),
        first=date_text(history.time.min()),
        last=date_text(history.time.max()),
        range_from=ranges.source,
        failed=tuple(
            FailedFit(
                file=history.files[entry],
                date=date_text(history.time[entry]),
                sensor=int(sensor),
                slope_f_per_m=float(history.slope[entry, sensor]),
                state=HISTORY_STATES[int(history.state[entry, sensor])],
            )
            for entry, sensor in np.argwhere(history.state != GOOD)
        ),
        carried_over=sum(c.state == CARRIED_OVER for c in changes),
        swaps=tuple(
            Swap(
                file=history.files[c.after],
                before=date_text(history.time[c.before]),
                after=date_text(history.time[c.after]),
                sensor=c.sensor,
                change_m=c.change,
            )
            for c in swapped
        ),
        overall=_spread(spread(changes)),
        without_swaps=_spread(spread(tuple(c for c in changes if c.state != SWAP))),
        short=_spread(spread(tuple(c for c in changes if c.elapsed <= SHORT_S))),
        per_sensor=tuple(_spread(one) for one in per_sensor),
    )


def _spread(one: Spread) -> DriftSpread:
    return DriftSpread(
        changes=one.n,
        swaps=one.swaps,
        median_m=finite(one.median),
        p90_m=finite(one.p90),
        median_m_per_day=finite(one.median_rate * DAY_S),
        median_days=finite(one.median_elapsed / DAY_S),
    )


def tendon_report(curves: Sequence[Curve], fits: Sequence[CurveFit], mean: Average) -> TendonReport:
    """The curves and their average."""
    return TendonReport(
        curves=tuple(
            TendonCurve(
                name=fit.name,
                points=len(curve.force),
                k1_n_per_m=float(fit.k[0]),
                k2_n_per_m2=float(fit.k[1]),
                k3_n_per_m3=float(fit.k[2]),
                rms_n=fit.rms,
                x_max_m=fit.x_max,
                stiffness_min_n_per_m=fit.stiffness_min,
                monotone=fit.monotone,
            )
            for curve, fit in zip(curves, fits, strict=True)
        ),
        k1_n_per_m=float(mean.k[0]),
        k2_n_per_m2=float(mean.k[1]),
        k3_n_per_m3=float(mean.k[2]),
        k1_sd_n_per_m=finite(mean.k_sd[0]),
        k2_sd_n_per_m2=finite(mean.k_sd[1]),
        k3_sd_n_per_m3=finite(mean.k_sd[2]),
        x_common_m=mean.x_common,
        force_sd_n=finite(mean.sd[-1]),
        stiffness_min_n_per_m=mean.stiffness_min,
        monotone=mean.monotone,
        falls_from_m=finite(falls_from(mean.k)),
    )


def rod_mass(name: str, parts: int, properties: MassProperties) -> RodMass:
    """One rod."""
    return RodMass(
        rod=name,
        parts=parts,
        mass_kg=properties.mass,
        com_m=properties.com,
        inertia_axial_kg_m2=properties.inertia_axial,
        inertia_transverse_kg_m2=properties.inertia_transverse,
    )
