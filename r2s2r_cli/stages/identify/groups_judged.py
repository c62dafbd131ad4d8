"""How well train and test intervals are predicted, as groups of `schemas/identification.py`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from r2s2r_cli.artifact import Group, Scalar
from r2s2r_cli.stages.identify.columns import floats, texts
from r2s2r_cli.stages.identify.found import OURS, Found, FreeRunFound, SegmentFound
from r2s2r_cli.stages.measures.bootstrap import Interval
from r2s2r_cli.stages.measures.table import Row

_TRAIN, _TEST = 1, 2


def judged_groups(found: Found) -> dict[str, Group]:
    """Segments, measures, and of every run its replayed intervals and free runs; segments only where there are any."""
    segments = _segments(found)
    groups = {} if segments is None else {"segments": segments}
    repeating = _repeating(found)
    more = {} if repeating is None else {"repeating": repeating}
    return {**groups, "measures": _measures(found), **more, **_runs(found)}


def baselines(found: Found) -> tuple[str, ...]:
    """Names of all baselines, in the order in which they were first judged."""
    rows = [*found.train, *(found.test or {})]
    return tuple(name for name in dict.fromkeys(rows) if name != found.headline)


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
    return Group(
        {
            "run": texts([step.run for step in steps]),
            "interval": np.array([step.interval for step in steps], np.int64),
            "role": np.array([role for role, _, _ in rows], np.uint8),
            "t_first": floats([step.t[0] for step in steps]),
            "t_last": floats([step.t[-1] for step in steps]),
            "keyframe_error": np.array([segment.keyframe_error for _, segment, _ in rows]),
            "keyframe_cap_rmse": floats([segment.keyframe_cap_rmse for _, segment, _ in rows]),
            "cap_rmse": floats([segment.cap_rmse for _, segment, _ in rows]),
            "baseline_cap_rmse": np.array(
                [[others.get(name, math.nan) for name in baselines(found)] for _, _, others in rows]
            ).reshape(len(rows), -1),
            "lag1": np.array([segment.lag1 for _, segment, _ in rows], dtype=float),
            "white": np.array([segment.white for _, segment, _ in rows], dtype=bool),
        }
    )


def _measures(found: Found) -> Group:
    sides: list[tuple[int, Mapping[str, Row]]] = [(_TRAIN, found.train)] + ([(_TEST, found.test)] if found.test else [])
    names = baselines(found)
    table: list[tuple[int, str, list[float | None], list[Interval | None]]] = []
    for role, rows in sides:
        own = found.headline if role == _TEST else OURS
        picked = [rows.get(name) for name in (own, *names)]
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
    floor = math.nan if found.floor is None else found.floor.floor_m
    return Group(
        {
            "role": np.array([role for role, _, _, _ in table], np.uint8),
            "metric": texts([metric for _, metric, _, _ in table]),
            "value": value[:, 0],
            "interval": interval[:, 0],
            "floor": floats([floor if metric == "keyframe_cap_rmse" else math.nan for _, metric, _, _ in table]),
            "baseline": texts(names),
            "baseline_value": value[:, 1:],
            "baseline_interval": interval[:, 1:],
        },
        {"predictor": found.headline},
    )


def _repeating(found: Found) -> Group | None:
    own = found.repeats
    if own is None or own.made is None:
        return None
    error = own.made.predicted.key - np.array([one.step.key for one in found.test_segments])
    facts: dict[str, Scalar] = {
        "used": own.used, "gap": own.model.gap_m, "floor": own.model.floor.floor_m,
        "contrasts": own.model.floor.contrasts, "dof": own.model.dof,
    }  # fmt: skip
    if own.evidence is not None:
        facts |= {"left_out": own.evidence.with_m, "left_out_alone": own.evidence.alone_m,
                  "left_out_segments": own.evidence.intervals}  # fmt: skip
    return Group(
        {
            "run": texts([one.step.run for one in found.test_segments]),
            "interval": np.array([one.step.interval for one in found.test_segments], np.int64),
            "repeats": own.made.repeats.astype(np.int64),
            "weight": own.made.weights.astype(float),
            "keyframe_error": error,
            "keyframe_cap_rmse": np.sqrt(np.sum(error**2, axis=-1).mean(axis=-1)),
        },
        facts,
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
    more = [one.predicted for one in chains if one.predicted is not None]
    if more:
        table["predicted"] = np.concatenate(more)
    loops = [one.closed_loop for one in chains if one.closed_loop is not None]
    return Group({**table, "closed_loop": np.concatenate(loops)} if len(loops) == len(chains) else table)


def _nan(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _ends(interval: Interval | None) -> tuple[float, float]:
    return (math.nan, math.nan) if interval is None else (interval.lower, interval.upper)
