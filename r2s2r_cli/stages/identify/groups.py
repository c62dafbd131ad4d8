"""What was found, as the groups of `schemas/identification.py`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group, Scalar
from r2s2r_cli.stages.identify.found import OURS, Found, FreeRunFound, ParameterFound, SegmentFound
from r2s2r_cli.stages.identify.free.base import Coordinate
from r2s2r_cli.stages.identify.trust.identifiability import THRESHOLD, Trust
from r2s2r_cli.stages.measures.bootstrap import Interval
from r2s2r_cli.stages.measures.keyframes import frame_rmse
from r2s2r_cli.stages.measures.table import Row

_COORDINATES = {Coordinate.LINEAR: 0, Coordinate.LOG: 1, Coordinate.LOGIT: 2}
_TRUST = {Trust.IDENTIFIED: 0, Trust.WEAK: 1, Trust.NOT_IDENTIFIABLE: 2, Trust.ON_BOUND: 3, None: 4}
_TRAIN, _TEST = 1, 2
_NAN = math.nan


def identification(found: Found) -> ArtifactData:
    """The artifact; groups of parts that were not made are left out."""
    groups: dict[str, Group | None] = {
        "fit": _fit(found),
        "parameters": _parameters(found.parameters),
        "covariance": _covariance(found),
        "identifiability": _identifiability(found),
        "trace": _trace(found),
        "starts": _starts(found),
        "profiles": _profiles(found),
        "windows": _windows(found),
        "segments": _segments(found),
        "measures": _measures(found),
        "sites": None if found.p_RS is None else Group({"p_RS": found.p_RS}),
        "history": _history(found),
        **_runs(found),
    }
    return ArtifactData("identification", {path: group for path, group in groups.items() if group is not None})


def texts(words: Sequence[str]) -> np.ndarray:
    """Words as an artifact holds them: fixed-length UTF-8."""
    return np.char.encode(np.array(words, dtype=str), "utf-8") if len(words) else np.zeros(0, "S1")


def baselines(found: Found) -> tuple[str, ...]:
    """Names of all baselines, in the order in which they were first judged."""
    rows = [*found.train, *(found.test or {})]
    return tuple(name for name in dict.fromkeys(rows) if name != OURS)


def _fit(found: Found) -> Group:
    facts: dict[str, Scalar] = {
        "method": found.request.method, "drive": found.request.drive, "loss": found.loss, "robot": found.robot,
        "engine": found.engine, "effects": " ".join(found.request.effects), "step": float(found.step),
        "seed": int(found.request.seed), "rollouts": int(found.rollouts), "cost": float(found.cost),
        "residuals": int(found.residuals), "converged": bool(found.converged), "reason": found.reason,
    }  # fmt: skip
    return Group({}, facts if found.mask is None else {**facts, "mask": found.mask})


def _parameters(parameters: Sequence[ParameterFound]) -> Group:
    frees = [one.free for one in parameters]
    bounds = np.array([[free.lower, free.upper] for free in frees]).reshape(-1, 2)
    intervals = _floats([one.interval for one in parameters]).reshape(-1, 3)
    intervals = np.where(np.isfinite(intervals), intervals, _NAN)
    flat = np.array([not math.isfinite(free.prior_sd) for free in frees], dtype=bool)
    return Group(
        {
            "name": texts([free.name for free in frees]),
            "unit": texts([free.unit for free in frees]),
            "what": texts([free.what for free in frees]),
            "value": _floats([one.value for one in parameters]),
            **dict(zip(("sd", "lower", "upper"), intervals.T, strict=True)),
            "range": _floats([one.range for one in parameters]).reshape(-1, 2),
            "bounds": np.where(np.isfinite(bounds), bounds, _NAN),
            "start": _floats([free.start for free in frees]),
            "prior_mean": np.where(flat, _NAN, _floats([free.start for free in frees])),
            "prior_sd": np.where(flat, _NAN, _floats([free.prior_sd for free in frees])),
            "coordinate": np.array([_COORDINATES[free.coordinate] for free in frees], np.uint8),
            "identifiable": np.array([one.identifiable for one in parameters], dtype=bool),
            "trust": np.array([_TRUST[one.trust] for one in parameters], np.uint8),
            "reason": texts([one.reason for one in parameters]),
        }
    )


def _covariance(found: Found) -> Group | None:
    correlation = found.correlation
    if found.covariance is None or correlation is None:
        return None
    known = np.where(np.isfinite(found.covariance), found.covariance, _NAN)
    return Group({"covariance": known, "correlation": np.clip(correlation, -1.0, 1.0)})


def _identifiability(found: Found) -> Group | None:
    info = found.information
    if info is None:
        return None
    positive = info.eigenvalue[info.eigenvalue > 0]
    condition = float(positive.max() / positive.min()) if len(positive) else 0.0
    fixed = len(found.parameters) - len(info.names)
    return Group(
        {
            "column_norm": np.pad(info.column_norm, (0, fixed)),
            "eigenvalue": info.eigenvalue,
            "eigenvector": np.pad(info.eigenvector, ((0, 0), (0, fixed))),
            "weak": info.weak,
            "words": texts(info.words),
        },
        {"threshold": THRESHOLD, "condition": condition},
    )


def _trace(found: Found) -> Group | None:
    steps = found.trace
    if not steps:
        return None
    table = {
        "start": np.array([step.start for step in steps], np.int64),
        "stage": texts([step.stage for step in steps]),
        "iteration": np.array([step.iteration for step in steps], np.int64),
        "cost": _floats([step.cost for step in steps]),
    }
    values = [_with_fixed(found, step.value) for step in steps if step.value is not None]
    return Group({**table, "value": np.array(values)} if len(values) == len(steps) else table)


def _starts(found: Found) -> Group | None:
    if not found.starts:
        return None
    return Group(
        {
            "kind": np.array([one.redrawn for one in found.starts], np.uint8),
            "first": np.array([_with_fixed(found, one.first) for one in found.starts]),
            "last": np.array([_with_fixed(found, one.last) for one in found.starts]),
            "cost": _floats([one.cost for one in found.starts]),
            "reason": texts([one.reason for one in found.starts]),
        }
    )


def _profiles(found: Found) -> Group | None:
    if not found.profiles:
        return None
    longest = max(len(one.value) for one in found.profiles)

    def padded(values: np.ndarray) -> np.ndarray:
        return np.pad(values.astype(float), (0, longest - len(values)), constant_values=_NAN)

    return Group(
        {
            "parameter": np.array([one.row for one in found.profiles], np.int64),
            "value": np.array([padded(one.value) for one in found.profiles]),
            "cost": np.array([padded(one.cost) for one in found.profiles]),
            "interval": _floats([one.interval for one in found.profiles]).reshape(-1, 2),
            "threshold": _floats([one.threshold for one in found.profiles]),
            "words": texts([one.words for one in found.profiles]),
        }
    )


def _windows(found: Found) -> Group | None:
    windows = found.windows
    if not windows:
        return None
    return Group(
        {
            "run": texts([one.run for one in windows]),
            "interval": np.array([one.interval for one in windows], np.int64),
            **{name: _floats([getattr(one, name) for one in windows]) for name in ("t_first", "t_last")},
            **{name: np.array([getattr(one, name) for one in windows]) for name in ("p_WE", "v_WE", "shift")},
        }
    )


def _sides(found: Found) -> list[tuple[int, SegmentFound, dict[str, float]]]:
    """(role, segment, key-frame error of each baseline [m]), in order of run and time."""
    rows = []
    for role, segments, table in (
        (_TRAIN, found.train_segments, found.train), (_TEST, found.test_segments, found.test or {}),
    ):  # fmt: skip
        for i, segment in enumerate(segments):
            rows.append((role, segment, {name: float(row.key.per_segment_m[i]) for name, row in table.items()}))
    return sorted(rows, key=lambda row: (row[1].step.run, row[1].step.interval))


def _segments(found: Found) -> Group | None:
    rows = _sides(found)
    if not rows:
        return None
    steps = [segment.step for _, segment, _ in rows]
    error = np.array([segment.simulated[-1] - segment.step.key for _, segment, _ in rows])
    return Group(
        {
            "run": texts([step.run for step in steps]),
            "interval": np.array([step.interval for step in steps], np.int64),
            "role": np.array([role for role, _, _ in rows], np.uint8),
            "t_first": _floats([step.t[0] for step in steps]),
            "t_last": _floats([step.t[-1] for step in steps]),
            "keyframe_error": error,
            "keyframe_cap_rmse": np.sqrt(np.sum(error**2, axis=-1).mean(axis=1)),
            "cap_rmse": _floats([whole_error(segment) for _, segment, _ in rows]),
            "baseline_cap_rmse": np.array(
                [[others.get(name, _NAN) for name in baselines(found)] for _, _, others in rows]
            ).reshape(len(rows), -1),
            "lag1": np.array([segment.lag1 for _, segment, _ in rows], dtype=float),
            "white": np.array([segment.white for _, segment, _ in rows], dtype=bool),
        }
    )


def whole_error(segment: SegmentFound) -> float:
    """Root mean square over frames and caps of the distance [m]."""
    return float(np.sqrt(np.mean(frame_rmse(segment.step.p_WE, segment.simulated) ** 2)))


def _measures(found: Found) -> Group:
    sides: list[tuple[int, Mapping[str, Row]]] = [(_TRAIN, found.train)] + ([(_TEST, found.test)] if found.test else [])
    names = baselines(found)
    table: list[tuple[int, str, list[float | None], list[Interval | None]]] = []
    for role, rows in sides:
        picked = [rows.get(name) for name in (OURS, *names)]
        keys = [(row.key.rmse_m, row.key_interval) if row else (None, None) for row in picked]
        table.append((role, "keyframe_cap_rmse", [value for value, _ in keys], [interval for _, interval in keys]))
        if role == _TEST:
            free = [(row.free_m, row.free_interval) if row else (None, None) for row in picked]
            table.append((role, "free_run_cap_mean", [value for value, _ in free], [interval for _, interval in free]))
    if found.closed_loop_m is not None:
        nothing: list[None] = [None] * len(names)
        table.append((_TEST, "free_run_closed_loop_cap_mean", [found.closed_loop_m, *nothing], [None, *nothing]))
    value = np.array([[_nan(one) for one in values] for _, _, values, _ in table])
    interval = np.array([[_ends(one) for one in intervals] for _, _, _, intervals in table])
    floor = _NAN if found.floor is None else found.floor.floor_m
    return Group(
        {
            "role": np.array([role for role, _, _, _ in table], np.uint8),
            "metric": texts([metric for _, metric, _, _ in table]),
            "value": value[:, 0],
            "interval": interval[:, 0],
            "floor": _floats([floor if metric == "keyframe_cap_rmse" else _NAN for _, metric, _, _ in table]),
            "baseline": texts(names),
            "baseline_value": value[:, 1:],
            "baseline_interval": interval[:, 1:],
        }
    )


def _history(found: Found) -> Group | None:
    if not found.updates:
        return None
    return Group(
        {
            "run": texts([one.run for one in found.updates]),
            "value": np.array([_with_fixed(found, one.value) for one in found.updates]),
            "sd": np.array(
                [np.pad(one.sd, (0, len(found.names) - len(one.sd)), constant_values=_NAN) for one in found.updates]
            ),
        }
    )


def _runs(found: Found) -> dict[str, Group]:
    groups: dict[str, Group] = {}
    rows = [segment for _, segment, _ in _sides(found)]
    for run in dict.fromkeys(segment.step.run for segment in rows):
        own = [segment for segment in rows if segment.step.run == run]
        facts: dict[str, Scalar] = {"robot": found.robot}
        nature = found.natures.get(run)
        groups[f"runs/{run}"] = Group({}, {**facts, "nature": nature} if nature else facts)
        groups[f"runs/{run}/fit"] = Group(
            {
                "t": np.concatenate([one.step.t for one in own]),
                "interval": np.concatenate([np.full(len(one.step.t), one.step.interval, np.int64) for one in own]),
                "observed": np.concatenate([one.step.p_WE for one in own]),
                "simulated": np.concatenate([one.simulated for one in own]),
            }
        )
        free = [one for one in found.free_runs if one.run == run]
        if free:
            groups[f"runs/{run}/free_run"] = _free_run(free)
    return groups


def _free_run(chains: Sequence[FreeRunFound]) -> Group:
    table = {
        "t": np.concatenate([one.t for one in chains]),
        "chain": np.concatenate([np.full(len(one.t), i, np.int64) for i, one in enumerate(chains)]),
        "observed": np.concatenate([one.observed for one in chains]),
        "simulated": np.concatenate([one.simulated for one in chains]),
    }
    loops = [one.closed_loop for one in chains if one.closed_loop is not None]
    return Group({**table, "closed_loop": np.concatenate(loops)} if len(loops) == len(chains) else table)


def _with_fixed(found: Found, values: np.ndarray) -> np.ndarray:
    """Values of the free parameters (k,), and behind them those of the fixed ones, (n,)."""
    return np.array([*values.tolist(), *(one.value for one in found.parameters[len(values) :])])


def _floats(values: Sequence[object]) -> np.ndarray:
    return np.array(values, dtype=float)


def _nan(value: float | None) -> float:
    return _NAN if value is None else float(value)


def _ends(interval: Interval | None) -> tuple[float, float]:
    return (_NAN, _NAN) if interval is None else (interval.lower, interval.upper)
