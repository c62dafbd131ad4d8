"""What was found, as the groups of `schemas/identification.py`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group, Scalar
from r2s2r_cli.stages.identify.columns import floats, texts
from r2s2r_cli.stages.identify.found import Course, Found, ParameterFound
from r2s2r_cli.stages.identify.free.base import Coordinate
from r2s2r_cli.stages.identify.groups_judged import judged_groups
from r2s2r_cli.stages.identify.trust.identifiability import THRESHOLD, Trust

_COORDINATES = {Coordinate.LINEAR: 0, Coordinate.LOG: 1, Coordinate.LOGIT: 2}
_TRUST = {Trust.IDENTIFIED: 0, Trust.WEAK: 1, Trust.NOT_IDENTIFIABLE: 2, Trust.ON_BOUND: 3, None: 4}
_NAN = math.nan


def identification(found: Found) -> ArtifactData:
    """The artifact; groups of parts that were not made are left out."""
    groups: dict[str, Group | None] = {
        "fit": _fit(found),
        "parameters": _parameters(found.parameters, found.course),
        "covariance": _covariance(found),
        "identifiability": _identifiability(found),
        "trace": _trace(found),
        "starts": _starts(found),
        "profiles": _profiles(found),
        "windows": _windows(found),
        **judged_groups(found),
        "sites": None if found.p_RS is None else Group({"p_RS": found.p_RS}),
        "sensing": _sensing(found),
        "history": _history(found),
    }
    return ArtifactData("identification", {path: group for path, group in groups.items() if group is not None})


def _fit(found: Found) -> Group:
    facts: dict[str, Scalar] = {
        "method": found.request.method, "drive": found.request.drive, "loss": found.loss, "robot": found.robot,
        "engine": found.engine, "effects": " ".join(found.request.effects), "step": float(found.step),
        "seed": int(found.request.seed), "rollouts": int(found.rollouts), "cost": float(found.cost),
        "residuals": int(found.residuals), "converged": bool(found.converged), "reason": found.reason,
    }  # fmt: skip
    return Group({}, facts if found.mask is None else {**facts, "mask": found.mask})


def _sensing(found: Found) -> Group | None:
    if found.sensing is None:
        return None
    facts: dict[str, Scalar] = {
        "camera_delay": float(found.sensing.camera_delay), "command_delay": float(found.command_delay),
        "arrivals": int(found.sensing.arrivals), "by_camera": found.sensing.by_camera,
    }  # fmt: skip
    return Group({"bias": found.sensing.bias}, facts)


def _parameters(parameters: Sequence[ParameterFound], course: Course | None) -> Group:
    frees = [one.free for one in parameters]
    bounds = np.array([[free.lower, free.upper] for free in frees]).reshape(-1, 2)
    intervals = floats([one.interval for one in parameters]).reshape(-1, 3)
    intervals = np.where(np.isfinite(intervals), intervals, _NAN)
    flat = np.array([not math.isfinite(free.prior_sd) for free in frees], dtype=bool)
    return Group(
        {
            "name": texts([free.name for free in frees]),
            "unit": texts([free.unit for free in frees]),
            "what": texts([free.what for free in frees]),
            "value": floats([one.value for one in parameters]),
            **dict(zip(("sd", "lower", "upper"), intervals.T, strict=True)),
            "range": floats([one.range for one in parameters]).reshape(-1, 2),
            "bounds": np.where(np.isfinite(bounds), bounds, _NAN),
            "start": floats([free.start for free in frees]),
            "prior_mean": np.where(flat, _NAN, floats([free.mean for free in frees])),
            "prior_sd": np.where(flat, _NAN, floats([free.prior_sd for free in frees])),
            "coordinate": np.array([_COORDINATES[free.coordinate] for free in frees], np.uint8),
            "identifiable": np.array([one.identifiable for one in parameters], dtype=bool),
            "trust": np.array([_TRUST[one.trust] for one in parameters], np.uint8),
            "reason": texts([one.reason for one in parameters]),
            **({} if course is None else _course(course, [free.name for free in frees])),
        }
    )


def _course(course: Course, names: Sequence[str]) -> dict[str, np.ndarray]:
    columns = {"first_mean": course.first_mean, "first_sd": course.first_sd, "known": course.value,
               "known_sd": course.sd_z}  # fmt: skip
    return {
        column: np.array([value if math.isfinite(value := by_name.get(name, _NAN)) else _NAN for name in names])
        for column, by_name in columns.items()
    }


def _covariance(found: Found) -> Group | None:
    correlation = found.correlation
    if found.covariance is None or correlation is None:
        return None
    known = np.where(np.isfinite(found.covariance), found.covariance, _NAN)
    return Group({"covariance": known, "correlation": correlation})


def _identifiability(found: Found) -> Group | None:
    info = found.information
    if info is None:
        return None
    fixed = len(found.parameters) - len(info.names)
    return Group(
        {
            "column_norm": np.pad(info.column_norm, (0, fixed)),
            "eigenvalue": info.eigenvalue,
            "eigenvector": np.pad(info.eigenvector, ((0, 0), (0, fixed))),
            "weak": info.weak,
            "words": texts(info.words),
        },
        {"threshold": THRESHOLD, "condition": info.condition if math.isfinite(info.condition) else 0.0},
    )


def _trace(found: Found) -> Group | None:
    steps = found.trace
    if not steps:
        return None
    table = {
        "start": np.array([step.start for step in steps], np.int64),
        "stage": texts([step.stage for step in steps]),
        "iteration": np.array([step.iteration for step in steps], np.int64),
        "cost": floats([step.cost for step in steps]),
    }
    values = [_with_fixed(found, step.value) for step in steps if step.value is not None]
    return Group({**table, "value": np.array(values)} if len(values) == len(steps) else table)


def _starts(found: Found) -> Group | None:
    if not found.starts:
        return None
    return Group(
        {
            "kind": np.zeros(len(found.starts), np.uint8),
            "first": np.array([_with_fixed(found, one.first) for one in found.starts]),
            "last": np.array([_with_fixed(found, one.last) for one in found.starts]),
            "cost": floats([one.cost for one in found.starts]),
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
            "interval": floats([one.interval for one in found.profiles]).reshape(-1, 2),
            "threshold": floats([one.threshold for one in found.profiles]),
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
            **{name: floats([getattr(one, name) for one in windows]) for name in ("t_first", "t_last")},
            **{name: np.array([getattr(one, name) for one in windows]) for name in ("p_WE", "v_WE", "shift")},
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


def _with_fixed(found: Found, values: np.ndarray) -> np.ndarray:
    """Values of the free parameters (k,), and behind them those of the fixed ones, (n,)."""
    return np.array([*values.tolist(), *(one.value for one in found.parameters[len(values) :])])
