"""The comparison as the groups of `schemas/compare.py`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.stages.compare.predicted import Model
from r2s2r_cli.stages.compare.report import Compared
from r2s2r_cli.stages.compare.runs import RealRun
from r2s2r_cli.stages.compare.walk import POINTS
from schemas.results_compare import CompareReport


def comparison_groups(
    runs: Sequence[RealRun], models: Sequence[Model], compared: Sequence[Compared], report: CompareReport
) -> dict[str, Group]:
    """All groups by path."""
    floor = {"com_end": report.floor.com_end_m, "heading_end": report.floor.heading_end_rad,
             "segment": report.floor.segment_s, "keyframe_cap": report.floor.keyframe_cap_m,
             "path": report.floor.path_m, "cap": report.floor.cap_m, "gait": report.floor.gait_m}  # fmt: skip
    groups = {
        "models": Group({
            "name": _texts([model.name for model in models]),
            "words": _texts([model.numbers.words for model in models]),
            "srcc_com": _floats([one.srcc_com for one in report.models]),
            "srcc_turn": _floats([one.srcc_turn for one in report.models]),
        }),
        "floor": Group(attributes={name: value for name, value in floor.items() if value is not None}),
    }  # fmt: skip
    for run in runs:
        mine = [one for one in compared if one.real.name == run.name]
        root = f"runs/{run.name}"
        robot = mine[0].model.numbers.robot.name if mine else ""
        known = {"opening": run.opening.duration, "opening_moved": run.opening.moved,
                 "opening_travel": run.opening.travel} if run.opening.intervals else {}  # fmt: skip
        known = {name: value for name, value in known.items() if np.isfinite(value)}
        groups[root] = Group(attributes={"policy": run.policy, "robot": robot, "iteration": run.iteration, **known})
        groups[f"{root}/real"] = _real(run)
        groups[f"{root}/simulated"] = _simulated(run, mine)
    return groups


def _real(run: RealRun) -> Group:
    walk = run.walk
    return Group({
        "target": walk.intervals.target, "duration": walk.durations, "p_WE_start": walk.p_WE[0], "p_WE": walk.at_phase,
        "com": np.einsum("c,ipcx->ipx", walk.share, walk.at_phase),
    })  # fmt: skip


def _simulated(run: RealRun, mine: Sequence[Compared]) -> Group:
    n, m, caps = len(run.walk.intervals), len(mine), run.walk.p_WE.shape[1]
    p_WE = np.full((m, n, POINTS, caps, 3), np.nan)
    by_interval = {name: np.full((m, n), np.nan) for name in ("duration", "segment_end", "gait", "keyframe")}
    whole = {name: np.full(m, np.nan) for name in ("com_end_error", "heading_end_error", "path_error", "cap_rmse")}
    compared = np.zeros(m, dtype=np.int64)
    for k, one in enumerate(mine):
        key = one.predicted.keyframes
        if key is not None:
            by_interval["keyframe"][k] = key.per_segment_m
        if one.errors is None or one.predicted.walk is None or one.predicted.real is None:
            continue
        laid = one.predicted.walk.laid_on(one.predicted.real)
        count = compared[k] = len(laid.intervals)
        p_WE[k, :count] = laid.at_phase
        by_interval["duration"][k, :count] = one.errors.duration_sim
        by_interval["segment_end"][k, :count] = one.errors.segment_end
        by_interval["gait"][k, :count] = one.errors.gait
        whole["com_end_error"][k], whole["path_error"][k] = one.errors.com_end, one.errors.path
        whole["cap_rmse"][k] = one.errors.cap
        whole["heading_end_error"][k] = np.nan if one.errors.heading_end is None else one.errors.heading_end
    return Group({
        "compared": compared, "trained_on": np.array([one.trained_on for one in mine], dtype=bool), "p_WE": p_WE,
        "com": np.einsum("c,mipcx->mipx", run.walk.share, p_WE), **by_interval, **whole,
    })  # fmt: skip


def _texts(words: Sequence[str]) -> np.ndarray:
    return np.array([word.encode() for word in words])


def _floats(values: Sequence[float | None]) -> np.ndarray:
    return np.array([np.nan if value is None else value for value in values], dtype=float)
