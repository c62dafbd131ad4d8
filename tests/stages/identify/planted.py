"""A whole `Found` with numbers that can be checked by hand: two runs' worth of steps on a straight line."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.identify.found import (
    OURS,
    Found,
    FreeRunFound,
    ParameterFound,
    ProfileFound,
    SegmentFound,
    StartFound,
    TraceStep,
    Update,
    WindowFound,
)
from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.request import Request
from r2s2r_cli.stages.identify.trust.identifiability import Identifiability, Trust
from r2s2r_cli.stages.measures.steps import Step
from r2s2r_cli.stages.measures.table import Predicted, judge

FRAMES, CAPS = 5, 6
SPEED = Free("motor_speed", "1", 1.0, 0.1, 2.0, Coordinate.LOG, 0.3, "speed of all motors")
BOUNCE = Free("restitution", "1", 0.3, 0.0, 0.95, Coordinate.LOGIT, math.inf, "restitution")


def step(interval: int) -> Step:
    """Caps at their number along x [m], moving 10 mm along y in an interval of 1 s."""
    t = interval + np.linspace(0.0, 1.0, FRAMES)
    p_WE = np.zeros((FRAMES, CAPS, 3))
    p_WE[..., 0] = np.arange(CAPS)
    p_WE[..., 1] = 0.01 * np.linspace(0, 1, FRAMES)[:, None] + 0.01 * (interval - 1)
    return Step(run="line", interval=interval, t=t, p_WE=p_WE, t_next=None, p_next=None, target=np.zeros(6),
                before=None, noise=np.full((CAPS, 3), 0.001), faulty=False)  # fmt: skip


def segment(interval: int, off: float) -> SegmentFound:
    """Simulated `off` [m] too far along z at the key frame, growing from 0."""
    one = step(interval)
    simulated = one.p_WE.copy()
    simulated[..., 2] += off * np.linspace(0, 1, FRAMES)[:, None]
    return SegmentFound(one, simulated, np.full(CAPS, 0.1), np.arange(CAPS) != 2)


def found(**changes: Any) -> Found:
    """Trained on interval 1 and 2, tested on 3 and 4: 3 mm and 4 mm off at the key frames, the baseline 10 mm."""
    train, test = (segment(1, 0.001), segment(2, 0.001)), (segment(3, 0.003), segment(4, 0.004))

    def rows(segments: tuple[SegmentFound, ...]) -> Any:
        ours = Predicted(np.array([one.simulated[-1] for one in segments]))
        still = Predicted(np.array([one.step.start for one in segments]))
        return judge([one.step for one in segments], {OURS: ours, "nothing moves": still})

    information = Identifiability(
        names=("motor_speed", "restitution"), z=np.zeros(2), width=np.ones(2), column_norm=np.array([50.0, 0.0]),
        secant_norm=np.full(2, np.nan), normal=np.diag([2500.0, 0.0]), eigenvalue=np.array([0.0, 2500.0]),
        eigenvector=np.array([[0.0, 1.0], [1.0, 0.0]]), weak=np.array([True, False]),
        words=("restitution alone", "motor_speed alone"), sd_z=np.array([0.02, np.inf]), sd=np.array([0.02, np.inf]),
        sd_flat_z=np.array([0.02, np.inf]), trust=(Trust.IDENTIFIED, Trust.NOT_IDENTIFIABLE), reason=("", "no effect"),
        no_effect=("restitution",), stalled=(), rough=(),
    )  # fmt: skip
    values: dict[str, Any] = {
        "request": Request((Selection("line", (1, 2)),), (Selection("line", (3, 4)),), effects=("motor_lag",)),
        "robot": "threebar", "engine": "r2s2r 0", "step": 0.001, "loss": "key frames",
        "parameters": (
            ParameterFound(SPEED, 0.8, 0.01, 0.78, 0.82, (0.79, 0.81), Trust.IDENTIFIED),
            ParameterFound(BOUNCE, 0.3, 0.001, 0.299, 0.301, (math.nan, math.nan), Trust.NOT_IDENTIFIABLE, "no effect"),
        ),
        "train_segments": train, "train": rows(train), "test_segments": test, "test": rows(test), "cost": 12.0,
        "residuals": 36, "converged": True, "reason": "small step", "rollouts": 40, "information": information,
        "covariance": np.array([[1e-4, 0.9e-4], [0.9e-4, 1e-4]]), "closed_loop_m": 0.02,
        "trace": (TraceStep(0, "all", 0, 50.0, np.array([1.0, 0.3])),
                  TraceStep(0, "all", 1, 12.0, np.array([0.8, 0.3]))),
        "starts": (StartFound(np.array([1.0, 0.3]), np.array([0.8, 0.3]), 12.0, 1, "small step"),
                   StartFound(np.array([0.8, 0.3]), np.array([0.81, 0.3]), 13.0, 1, "small step")),
        "profiles": (ProfileFound(0, np.array([0.7, 0.8, 0.9]), np.array([2.0, 0.0, 2.0]), (0.71, 0.89)),
                     ProfileFound(1, np.array([0.2, 0.4]), np.zeros(2), (math.nan, math.nan))),
        "windows": (WindowFound("line", 1, 1.0, 2.0, *[np.zeros((CAPS, 3))] * 3),),
        "free_runs": (FreeRunFound("line", test[0].step.t, test[0].step.p_WE, test[0].simulated, test[0].simulated),
                      FreeRunFound("line", test[1].step.t, test[1].step.p_WE, test[1].simulated, test[1].simulated)),
        "updates": (Update("line", np.array([0.8, 0.3]), np.array([0.01, np.nan])),),
        "natures": {"line": "simulated"}, "warnings": ("a remark",),
    }  # fmt: skip
    return Found(**{**values, **changes})
