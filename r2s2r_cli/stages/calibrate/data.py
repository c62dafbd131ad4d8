"""The calibration as an artifact: the tables of schemas.calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from r2s2r_cli.artifact import Group, Scalar
from r2s2r_cli.stages.calibrate.drift import Change, Spread, WorkingRange
from r2s2r_cli.stages.calibrate.history import History
from r2s2r_cli.stages.calibrate.lines import DEAD
from r2s2r_cli.stages.calibrate.masses import MassProperties
from r2s2r_cli.stages.calibrate.sensors import Points, SetFit
from r2s2r_cli.stages.calibrate.tendons import Average, Curve, CurveFit
from schemas.robot import Lump


def sensor_groups(points: Points, sets: Sequence[SetFit], used: str | None) -> dict[str, Group]:
    """Groups `points` and `lines`."""
    residual, loo = np.full(len(points.length), np.nan), np.full(len(points.length), np.nan)
    for number, fitted in enumerate(sets):
        for sensor, fit in enumerate(fitted.fits):
            rows = (points.set == number) & (points.sensor == sensor)
            if fit.state != DEAD:
                residual[rows], loo[rows] = fit.residual, fit.loo_residual
    fields = ("slope", "slope_se", "offset", "rms", "worst", "loo_rms", "quadratic_rms")
    lines: dict[str, np.ndarray] = {
        name: np.array([[getattr(fit, name) for fit in fitted.fits] for fitted in sets]) for name in fields
    }
    lines["name"] = texts(points.sets)
    lines["rms_set"] = np.array([fitted.rms for fitted in sets])
    lines["count"] = np.array([[fit.n for fit in fitted.fits] for fitted in sets], dtype=np.int64)
    lines["state"] = np.array([[fit.state for fit in fitted.fits] for fitted in sets], dtype=np.uint8)
    table = {
        "set": points.set.astype(np.int64),
        "sensor": points.sensor,
        "length": points.length,
        "capacitance": points.capacitance,
        "residual": residual,
        "loo_residual": loo,
        "source_row": points.line.astype(np.int64),
    }
    return {"points": Group(table), "lines": Group(lines, {"used": used} if used is not None else {})}


def history_groups(
    history: History,
    changes: Sequence[Change],
    ranges: WorkingRange,
    per_sensor: Sequence[Spread],
    swap_threshold: float,
) -> dict[str, Group]:
    """Groups `history` and `drift`."""
    entries = {
        "file": texts(history.files),
        "commit": texts(history.commits),
        "time": history.time,
        "slope": history.slope,
        "offset": history.offset,
        "state": history.state,
        "range": ranges.lengths,
        "median_change": np.array([spread.median for spread in per_sensor]),
        "p90_change": np.array([spread.p90 for spread in per_sensor]),
        "median_rate": np.array([spread.median_rate for spread in per_sensor]),
    }
    drift = {
        **{name: np.array([getattr(c, name) for c in changes], np.int64) for name in ("sensor", "before", "after")},
        **{name: np.array([getattr(c, name) for c in changes], float) for name in ("elapsed", "change", "change_max")},
        "state": np.array([c.state for c in changes], dtype=np.uint8),
    }
    attributes: dict[str, Scalar] = {"range_from": ranges.source, "swap_threshold": swap_threshold}
    return {"history": Group(entries, attributes), "drift": Group(drift)}


def tendon_groups(curves: Sequence[Curve], fits: Sequence[CurveFit], mean: Average) -> dict[str, Group]:
    """Groups `tendon_points` and `tendons`."""
    points = {
        "curve": np.concatenate([np.full(len(c.force), i, dtype=np.int64) for i, c in enumerate(curves)]),
        "displacement": np.concatenate([c.displacement for c in curves]),
        "force": np.concatenate([c.force for c in curves]),
    }
    table = {
        "name": texts([fit.name for fit in fits]),
        **{f"k{i + 1}": np.array([fit.k[i] for fit in fits]) for i in range(3)},
        **{name: np.array([getattr(fit, name) for fit in fits]) for name in ("rms", "x_max", "stiffness_min")},
        "monotone": np.array([fit.monotone for fit in fits], dtype=bool),
        "x": mean.x,
        "mean": mean.mean,
        "sd": mean.sd,
    }
    averages: dict[str, Scalar] = {f"k{i + 1}_mean": float(mean.k[i]) for i in range(3)}
    averages |= {"x_common": mean.x_common, "monotone": mean.monotone}
    return {"tendon_points": Group(points), "tendons": Group(table, averages)}


def mass_groups(parts: Mapping[int, Sequence[Lump]], properties: Mapping[int, MassProperties]) -> dict[str, Group]:
    """Groups `mass_parts` and `masses`, by the number of the rod."""
    rows = [(rod, part) for rod, some in parts.items() for part in some]
    table = {
        "rod": np.array([rod for rod, _ in rows], dtype=np.int64),
        "name": texts([part.name for _, part in rows]),
        "shape": texts([part.shape for _, part in rows]),
        "mass": np.array([part.mass_kg for _, part in rows]),
        "offset": np.array([part.offset_m for _, part in rows]),
        "radius": np.array([part.radius_m for _, part in rows]),
        "length": np.array([part.length_m for _, part in rows]),
        "inner_radius": np.array([part.inner_radius_m for _, part in rows]),
    }
    fields = ("mass", "com", "inertia_axial", "inertia_transverse")
    rods = {name: np.array([float(getattr(p, name)) for p in properties.values()]) for name in fields}
    return {"mass_parts": Group(table), "masses": Group({"rod": np.array(list(properties), dtype=np.int64), **rods})}


def texts(values: Sequence[str]) -> np.ndarray:
    """Texts as fixed-length UTF-8 bytes, as `schemas` has them."""
    return np.array([value.encode() for value in values], dtype=np.bytes_)
