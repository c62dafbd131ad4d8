"""The effects of the catalogue's first release as tables of the rig's world file, at a size that is asked for.

Written from the catalogue as it was designed (docs/reference/effects.md lists it today) and the rig's own reference,
without a look at `r2s2r_cli.effects`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from r2s2r_cli.blind.split import judged

Table = dict[str, Any]


@dataclass(frozen=True)
class Planted:
    """One effect. table: of the world file. channel: of the design. element: {"kind", "index", "xy_m"} as far as it
    has one. sizes: its main numbers in SI, by name. late: of a camera that is knocked: gait (0-based) and time [s]."""

    id: str
    table: Table
    channel: str
    sizes: dict[str, float]
    element: dict[str, Any] | None = None
    late: tuple[int, float] | None = None


@dataclass(frozen=True)
class Draw:
    """What an effect is drawn with. s: size, 1 usual. gaits: how many the set has."""

    rng: np.random.Generator
    s: float
    gaits: int
    sign: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "sign", float(self.rng.choice([-1.0, 1.0])))

    def one(self, n: int, first: int = 0) -> int:
        """An element of `first` .. `first + n - 1`."""
        return int(self.rng.integers(first, first + n))

    def way(self) -> np.ndarray:
        """A direction in the plane, (2,)."""
        a = self.rng.uniform(0, 2 * np.pi)
        return np.array([np.cos(a), np.sin(a)])


def _at(n: int, k: int, value: float, rest: float) -> list[float]:
    found = [rest] * n
    found[k] = value
    return found


def _dead_zone(d: Draw) -> Planted:
    start = min(0.5 * d.s, 0.95)
    return Planted("motor_dead_zone", {"start": start, "keep": 0.6 * start}, "command", {"start": start})


def _latency(d: Draw) -> Planted:
    delay = 0.1 * d.s
    return Planted("command_latency", {"delay_s": delay, "jitter_s": 0.15 * delay}, "command", {"delay_s": delay})


def _lag(d: Draw) -> Planted:
    start = 0.15 * d.s
    return Planted("motor_lag", {"start_s": start, "stop_s": 0.7 * start}, "motor", {"start_s": start})


def _mismatch(d: Draw) -> Planted:
    k, factor = d.one(6), 1 + d.sign * min(0.2 * d.s, 0.5)
    return Planted("motor_speed_mismatch", {"factors": _at(6, k, factor, 1.0)}, "motor", {"factor": factor},
                   {"kind": "motor", "index": k})  # fmt: skip


def _battery(d: Draw) -> Planted:
    fall = min(0.6 * d.s, 0.95)
    return Planted("battery_sag", {"motor_s": 40.0, "fall": fall, "per_motor": 0.012 * d.s}, "motor", {"fall": fall})


def _droop(d: Draw) -> Planted:
    stall = 40.0 / d.s
    return Planted("load_droop", {"stall_n": stall, "help_share": 0.3}, "motor", {"stall_n": stall})


def _spool(d: Draw) -> Planted:
    layer = 0.00025 * d.s
    return Planted("spool_buildup", {"layer_m": layer, "wraps": 1.5}, "motor", {"layer_m": layer})


def _backlash(d: Draw) -> Planted:
    play = 0.006 * d.s
    return Planted("backlash", {"play_m": play}, "cable", {"play_m": play})


def _stiffness(d: Draw) -> Planted:
    k, factor = d.one(3, 6), 1 + d.sign * min(0.3 * d.s, 0.7)
    return Planted("tendon_stiffness", {"factors": _at(9, k, factor, 1.0)}, "cable", {"factor": factor},
                   {"kind": "cable", "index": k})  # fmt: skip


def _relaxation(d: Draw) -> Planted:
    fast, slow = min(0.08 * d.s, 1.0), min(0.25 * d.s, 1.0)
    return Planted("tendon_relaxation", {"fast_share": fast, "slow_share": slow, "slow_s": 8.0}, "cable",
                   {"fast_share": fast, "slow_share": slow})  # fmt: skip


def _set(d: Draw) -> Planted:
    k, by = d.one(3, 6), 0.015 * d.s * d.sign
    slip = 0.0 if d.rng.random() < 0.7 else 8.0
    return Planted("tendon_set", {"lengths_m": _at(9, k, by, 0.0), "slip_n": slip}, "cable", {"by_m": by},
                   {"kind": "cable", "index": k})  # fmt: skip


def _com(d: Draw) -> Planted:
    rod, by = d.one(3), 0.02 * d.s * d.sign
    return Planted("com_offset", {"rod": rod, "by_m": [0.0, 0.0, by]}, "mass", {"along_m": by},
                   {"kind": "rod", "index": rod})  # fmt: skip


def _payload(d: Draw) -> Planted:
    rod, mass, at = d.one(3), 0.04 * d.s, float(d.rng.uniform(-0.1, 0.1))
    return Planted("payload", {"rod": rod, "mass_kg": mass, "at_m": [0.0, 0.0, at]}, "mass",
                   {"mass_kg": mass, "along_m": at}, {"kind": "rod", "index": rod})  # fmt: skip


def _field(d: Draw) -> Planted:
    if d.rng.random() < 0.4:
        g = 1.2 * d.s * d.way()
        return Planted("friction_field", {"gradient_per_m": g.tolist()}, "contact",
                       {"gradient_x_per_m": float(g[0]), "gradient_y_per_m": float(g[1])})  # fmt: skip
    center = float(d.rng.uniform(0.05, 0.16)) * d.way()
    factor = float(np.clip(1 - 0.55 * d.s, 0.1, 1.0)) if d.sign < 0 else 1 + 0.6 * d.s
    radius = float(d.rng.uniform(0.08, 0.12))
    patch = {"center_m": center.tolist(), "radius_m": radius, "factor": factor}
    return Planted("friction_field", {"patches": [patch]}, "contact", {"factor": factor, "radius_m": radius},
                   {"kind": "place", "xy_m": center.tolist()})  # fmt: skip


def _rolling(d: Draw) -> Planted:
    rolling = 0.003 * d.s
    return Planted("rolling_resistance", {"rolling_m": rolling, "turning_m": 0.7 * rolling}, "contact",
                   {"rolling_m": rolling})  # fmt: skip


def _soft(d: Draw) -> Planted:
    time, depth = 0.006 + 0.02 * d.s, 0.001 + 0.006 * d.s
    return Planted("soft_ground", {"time_s": time, "depth_m": depth}, "contact", {"time_s": time, "depth_m": depth})


def _grip(d: Draw) -> Planted:
    cap, factor = d.one(6), max(1 - 0.45 * d.s, 0.05) if d.sign < 0 else 1 + 0.6 * d.s
    return Planted("cap_friction", {"factors": _at(6, cap, factor, 1.0)}, "contact", {"factor": factor},
                   {"kind": "cap", "index": cap})  # fmt: skip


def _radius(d: Draw) -> Planted:
    by = -0.0018 * d.s if d.rng.random() < 0.7 else 0.0018 * d.s
    if d.rng.random() < 0.25:
        return Planted("cap_radius", {"by_m": [by] * 6}, "contact", {"by_m": by})
    cap = d.one(6)
    return Planted("cap_radius", {"by_m": _at(6, cap, by, 0.0)}, "contact", {"by_m": by},
                   {"kind": "cap", "index": cap})  # fmt: skip


def _slope(d: Draw) -> Planted:
    x, y = (np.deg2rad(2.0) * d.s * d.way()).tolist()
    return Planted("ground_slope", {"angle_x_rad": x, "angle_y_rad": y}, "world", {"angle_x_rad": x, "angle_y_rad": y})


def _tether(d: Draw) -> Planted:
    rod, pull, way = d.one(3), 0.2 * d.s, d.way()
    table = {"anchor_m": [*way.tolist(), 0.3], "free_m": 0.6, "weight_n": 0.03 * d.s, "stiffness_n_per_m": 0.6 * d.s,
             "largest_n": 2 * pull, "rod": rod}  # fmt: skip
    return Planted("tether_drag", table, "world", {"pull_n": pull}, {"kind": "rod", "index": rod})


def _bias(d: Draw) -> Planted:
    k, by = d.one(6), 0.008 * d.s * d.sign
    settles = None if d.rng.random() < 0.5 else float(d.rng.uniform(1.5, 4.0))
    table: Table = {"lengths_m": _at(9, k, by, 0.0)}
    return Planted("sensor_bias", table if settles is None else {**table, "settles_s": settles}, "sensing",
                   {"by_m": by}, {"kind": "sensor", "index": k})  # fmt: skip


def _gain(d: Draw) -> Planted:
    factor = 1 + 0.06 * d.s * d.sign
    if d.rng.random() < 0.5:
        return Planted("sensor_gain", {"factors": [factor] * 9}, "sensing", {"factor": factor})
    k = d.one(6)
    return Planted("sensor_gain", {"factors": _at(9, k, 1 + 1.5 * (factor - 1), 1.0)}, "sensing",
                   {"factor": 1 + 1.5 * (factor - 1)}, {"kind": "sensor", "index": k})  # fmt: skip


def _pose(d: Draw) -> Planted:
    turn = np.deg2rad(1.0) * d.s * d.rng.standard_normal(3) / np.sqrt(3)
    by = 0.008 * d.s * d.way()
    late = (d.one(d.gaits - judged(d.gaits)), float(d.rng.uniform(2.5, 6.0)))
    return Planted("camera_pose", {"turn_rad": turn.tolist(), "by_m": [*by.tolist(), 0.0]}, "observation",
                   {"turn_rad": float(np.linalg.norm(turn))}, {"kind": "camera"}, late)  # fmt: skip


def _scale(d: Draw) -> Planted:
    depth, focal = 0.02 * d.s * d.sign, 0.012 * d.s * d.sign
    return Planted("camera_scale", {"depth_error": depth, "focal_error": focal}, "observation",
                   {"factor": (1 + depth) * (1 + focal)}, {"kind": "camera"})  # fmt: skip


def _delay(d: Draw) -> Planted:
    delay = 0.1 * d.s * (1.0 if d.rng.random() < 0.7 else -1.0)
    return Planted("camera_delay", {"delay_s": delay}, "observation", {"delay_s": delay}, {"kind": "camera"})


def _dropout(d: Draw) -> Planted:
    frames, pixels = min(0.25 * d.s, 0.7), min(0.06 * d.s, 0.2)
    return Planted("dropout", {"frames": frames, "pixels": pixels}, "observation", {"frames": frames},
                   {"kind": "camera"})  # fmt: skip


STARRED: dict[str, Callable[[Draw], Planted]] = {
"motor_dead_zone": _dead_zone, "command_latency": _latency, "motor_lag": _lag, "motor_speed_mismatch": _mismatch,
    "battery_sag": _battery, "load_droop": _droop, "spool_buildup": _spool, "backlash": _backlash,
    "tendon_stiffness": _stiffness, "tendon_relaxation": _relaxation, "tendon_set": _set, "com_offset": _com,
    "payload": _payload, "friction_field": _field, "rolling_resistance": _rolling, "soft_ground": _soft,
    "cap_friction": _grip, "cap_radius": _radius, "ground_slope": _slope, "tether_drag": _tether,
    "sensor_bias": _bias, "sensor_gain": _gain, "camera_pose": _pose, "camera_scale": _scale, "camera_delay": _delay,
    "dropout": _dropout,
}  # fmt: skip
"""By id. The rig's usual size (1) is about that of the pilot that the catalogue was designed with."""
USUAL = {"motor_dead_zone": 1.6, "cap_friction": 1.6, "cap_radius": 1.8, "sensor_bias": 1.5, "sensor_gain": 1.5,
         "camera_pose": 1.6}  # fmt: skip
"""Effects whose size 1 tells less than that of the others (tested by d): by how much their usual size is larger."""
