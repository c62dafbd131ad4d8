"""Which effects a finding speaks for, with the size that a fit of them may start from."""

from __future__ import annotations

import math
from collections.abc import Callable

from r2s2r_cli.stages.diagnose.parity.finding import Suspicion

USUAL_N = 5.0
"""[N] of an actuated cable at the robot's usual tension: what turns a loss at that tension into a loss per newton."""
TILT = 0.25
"""Share of a tilt that speaks for the camera: what a robot does on a slope the replay can tell, and what it does before
a camera that leans it cannot, so that the camera is left with what the slope does not gain. By hand."""

Sizes = Callable[[float, int | None], tuple[Suspicion, ...]]


def suspicions(check: str, difference: float, index: int | None) -> tuple[Suspicion, ...]:
    """Of a finding: value less expected value, in its unit; index of its element. Unknown checks speak for nothing."""
    made = _OF.get(check)
    return () if made is None or not math.isfinite(difference) else made(difference, index)


def _indexed(name: str, index: int | None, value: float) -> dict[str, float]:
    return {name if index is None else f"{name}.{index}": value}


_OF: dict[str, Sizes] = {
    "camera_scale": lambda d, k: (Suspicion("camera_scale", {"factor": 1 + d}),),
    "rod_length": lambda d, k: (Suspicion("camera_scale", {"factor": 1 + d}, 0.3), Suspicion("dropout", {}, 0.3)),
    "dropout": lambda d, k: (Suspicion("dropout", {"lost": d}),),
    "camera_delay": lambda d, k: (Suspicion("camera_delay", {"tau_s": d}),),
    "sensor_bias": lambda d, k: (Suspicion("sensor_bias", _indexed("bias_m", k, d)),
                                 Suspicion("sensor_gain", {}, 0.3)),
    "sensor_gain": lambda d, k: (Suspicion("sensor_gain", _indexed("gain", k, 1 + d)),
                                 Suspicion("sensor_bias", {}, 0.3)),
    "sensor_drift": lambda d, k: (Suspicion("sensor_bias", {}, 0.8),),
    "slope_x": lambda d, k: (Suspicion("ground_slope", {"angle_x_rad": d}), Suspicion("camera_pose", {}, TILT)),
    "slope_y": lambda d, k: (Suspicion("ground_slope", {"angle_y_rad": d}), Suspicion("camera_pose", {}, TILT)),
    "knock": lambda d, k: (Suspicion("camera_pose", {}),),
    "slope_change": lambda d, k: (Suspicion("camera_pose", {}), Suspicion("ground_slope", {}, 0.3)),
    "cap_height": lambda d, k: (Suspicion("cap_radius", _indexed("change_m", k, 1.5 * d)),),
    "winch_speed": lambda d, k: (
        # Wound cable makes winches faster than they were; batteries and loads make them slower.
        (Suspicion("spool_buildup", {}, 0.6),) if d > 0 else
        (Suspicion("battery_sag", {}, 0.5), Suspicion("load_droop", {}, 0.4))
    ),
    "winch_rate": lambda d, k: (Suspicion("motor_speed_mismatch", _indexed("factor", k, math.exp(d))),),
    "in_over_out": lambda d, k: (Suspicion("load_droop", {"per_newton": max(-d, 0.0) / USUAL_N}),),
    "latency": lambda d, k: (Suspicion("command_latency", {"tau_s": max(d, 0.0)}),),
    "lag": lambda d, k: (Suspicion("motor_lag", {"tau_s": max(d, 0.0)}),),
    "play": lambda d, k: (Suspicion("backlash", {"play_m": max(d, 0.0)}),),
    "sag": lambda d, k: (Suspicion("battery_sag", {"fade_per_s": max(d, 0.0)}),),
    "load": lambda d, k: (Suspicion("battery_sag", {"drop": max(d, 0.0)}),),
    "droop": lambda d, k: (Suspicion("load_droop", {"per_newton": max(d, 0.0) / USUAL_N}),),
    "spool": lambda d, k: (Suspicion("spool_buildup", {"per_metre": d}),),
}  # fmt: skip
