"""A report of `identify` as a value, in step with `tests.support.identified`."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.artifact import ArtifactData
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
    SegmentFigures,
    StartFigures,
)
from tests.support.identified import BASELINES, NAMES

TRUST = ("identified", "weak", "not identifiable", "on a bound", "fixed")


def report(data: ArtifactData) -> IdentifyReport:
    """What the artifact of `tests.support.identified` says."""
    table, segments = data.groups["parameters"], data.groups["segments"]

    def one(k: int) -> ParameterFigures:
        lower, upper, sd = (_number(table[name][k]) for name in ("lower", "upper", "sd"))
        wide = tuple(table["range"][k].tolist()) if np.isfinite(table["range"][k]).all() else None
        return ParameterFigures(
            value=float(table["value"][k]), sd=sd, lower=lower, upper=upper, range=wide, unit=table["unit"][k].decode(),
            identifiable=bool(table["identifiable"][k]), trust=TRUST[int(table["trust"][k])],
            reason=table["reason"][k].decode(), start=float(table["start"][k]),
            bounds=(_number(table["bounds"][k, 0]), _number(table["bounds"][k, 1])),
        )  # fmt: skip

    measures = data.groups["measures"]
    others = {
        name: Baseline(keyframe_cap_rmse_m=_number(measures["baseline_value"][1, k]),
                       free_run_cap_mean_m=_number(measures["baseline_value"][2, k]),
                       difference=Intervals(keyframe_cap_rmse_m=(-0.06, -0.02)), ours_better=1.0)
        for k, name in enumerate(BASELINES)
    }  # fmt: skip
    held = HeldOut(
        keyframe_cap_rmse_m=0.008, free_run_cap_mean_m=0.011, intervals=Intervals(keyframe_cap_rmse_m=(0.0064, 0.0104)),
        baselines=others, floor_m=0.005,
    )  # fmt: skip
    roles = {1: "train", 2: "test"}
    rows = tuple(
        SegmentFigures(
            run="walk", interval=int(segments["interval"][i]), role=roles[int(segments["role"][i])],
            keyframe_cap_rmse_m=float(segments["keyframe_cap_rmse"][i]), cap_rmse_m=float(segments["cap_rmse"][i]),
            baselines=dict(zip(BASELINES, map(_number, segments["baseline_cap_rmse"][i]), strict=True)), not_white=(5,),
        )
        for i in range(2)
    )  # fmt: skip
    return IdentifyReport(
        method="default", drive="command replay", loss="key frames, robust beyond 3 sd",
        parameters={name: one(k) for k, name in enumerate(NAMES)}, train=Measures(keyframe_cap_rmse_m=0.006),
        heldout=held, segments=rows, weak=(Direction(eigenvalue=0.0, words="restitution alone"),),
        correlations=(Correlation(one="motor_speed", other="damping", value=0.97),),
        profiles=(ProfileFigures(parameter="damping", lower=None, upper=None),),
        starts=(StartFigures(kind="start", cost=21.0, iterations=4, reason="the step is small"),), cost=21.0,
        residuals=36, converged=True, reason="the step is small", rollouts=120, wall_s=3.5,
        seconds={"fit": 3.0, "ranges": 0.5},
        warnings=("cap 5 of walk is <noisy>",),
    )  # fmt: skip


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
