"""One hidden world: friction, motor speed, sensors of the day, what is wrong in it, and how it is observed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from r2s2r_cli.blind.make.effects import STARRED, USUAL, Draw, Planted
from r2s2r_cli.blind.make.outside import OUTSIDE, Outside, outside
from r2s2r_cli.blind.split import AR1, GAITS, NOISE_M, RATES_HZ, Bank, Kind, judged, size
from r2s2r_cli.rig.effects.base import Law, Scene
from r2s2r_cli.rig.world import World

DAY_SD_M = 0.001
"""Every sensor is calibrated on the day: what is left of its offset."""
OFFSET_SHARE = 0.3
"""A tracker's error that stays over a target interval, as a part of its noise."""
CAMERA_HZ = 10.0
"""Pictures a second of sets that have them: at 30 a set of eight gaits would take more than a gigabyte."""
TRACKED_M, TRACKED_AR1 = 0.001, 0.0
"""What our tracker's caps are about as good as (measured: half within 0.8 mm of the truth, a tenth off by 1.7 mm and
more): `d` of a set with pictures is reckoned with this noise."""


WITHOUT_RIG = frozenset({"rolling_resistance", "soft_ground", "tether_drag"})
"""Effects that need a force inside the step: tier A has no other form for them than the catalogue's."""
STRANGE_WITHOUT_RIG = ("motor_cogging", "cable_snag", "sensor_crosstalk", "gravity_sway")


@dataclass(frozen=True)
class Hidden:
    """A world that nobody but the maker knows.

    bank, seed, kind. friction: coefficient of the floor. speed: of the motors, as a factor of robot.toml's. tolerance:
    of the controller (in robot.toml, so no secret). day: offset of every sensor [m], (cable,). planted: effects.
    strange: what no catalogue has, by name, and the gait (0-based) to which it is limited, None: all. noise_m: sd of a
    cap's coordinate [m], ar1 its correlation from frame to frame, rate_hz of the camera. gaits: how many.
    commissioning: how many runs of the healthy robot.
    """

    bank: Bank
    seed: int
    kind: Kind
    friction: float
    speed: float
    tolerance: float
    day: np.ndarray
    noise_m: float
    ar1: float
    rate_hz: float
    gaits: int
    commissioning: int
    planted: tuple[Planted, ...] = ()
    strange: tuple[str, Outside, int | None] | None = None
    tier: Literal["A", "B"] = "B"
    """A: our engine, B: the rig."""
    camera: bool = False
    """Observed in pictures, which the tracker has to make caps of; noise_m and ar1 are then TRACKED_M, TRACKED_AR1."""
    factor: float | None = None
    """Size of what is wrong, 1 usual; of pairs that of the first."""

    def healthy(self) -> Hidden:
        """The same with nothing wrong."""
        return replace(self, planted=(), strange=None)

    def world(self, gait: int, position: np.ndarray, heading: float) -> World:
        """The rig's, for one gait (0-based) begun at a place [m] and heading [rad]."""
        effects = {one.id: one.table for one in self.planted if one.late is None or gait >= one.late[0]}
        for one in self.planted:
            if one.late is not None and gait >= one.late[0]:
                at = one.late[1] if gait == one.late[0] else 0.0
                effects[one.id] = {**one.table, "at_s": at}
        tables: dict[str, Any] = {
            "seed": self.seed * 64 + gait,
            "floor": {"friction": self.friction},
            "start": {"position_m": [float(x) for x in position], "heading_rad": heading, "settle_s": 2.0},
            "sensors": {"day_sd_m": 0.0, "bow_sd_m": 0.0, "drift_sd_m": 0.0003},
            "camera": {"clock": {"rate_hz": self.rate_hz}},
            "effects": effects,
        }  # fmt: skip
        return World.model_validate(tables)

    def laws(self, scene: Scene, gait: int) -> tuple[Law, ...]:
        """Those that the rig does not have: the sensors' offsets of the day, and what is strange."""
        found: list[Law] = [_Day(self.day)]
        if self.strange is not None and self.strange[2] in (None, gait):
            found.append(self.strange[1].law(scene))
        return tuple(found)


class _Day(Law):
    def __init__(self, by: np.ndarray) -> None:
        self._by = by

    def sense(self, t: float, length: np.ndarray) -> np.ndarray:
        return length + self._by


def hidden(
    bank: Bank, seed: int, kind: Kind, *, effects: tuple[str, ...] = (), strange: str | None = None,
    commissioning: int = 2, gaits: int | None = None, factor: float | None = None, tier: Literal["A", "B"] = "B",
    noise_m: float | None = None, camera: bool = False,
) -> Hidden:  # fmt: skip
    """The world of a seed. effects, strange, gaits, factor, noise_m: instead of what the seed would draw. camera: the
    same, seen in pictures."""
    rng = np.random.default_rng([seed, 10])
    count = int(rng.choice(GAITS)) if gaits is None else gaits
    plain = Hidden(
        bank=bank, seed=seed, kind=kind, friction=float(rng.uniform(0.45, 1.0)), speed=float(rng.uniform(0.85, 1.15)),
        tolerance=round(float(rng.uniform(0.05, 0.12)), 3), day=DAY_SD_M * rng.standard_normal(9),
        noise_m=float(rng.choice(NOISE_M)), ar1=float(rng.choice(AR1)), rate_hz=float(rng.choice(RATES_HZ)),
        gaits=count, commissioning=commissioning, tier=tier,
    )  # fmt: skip
    if noise_m is not None:
        plain = replace(plain, noise_m=noise_m)
    if camera:
        plain = replace(plain, noise_m=TRACKED_M, ar1=TRACKED_AR1, rate_hz=CAMERA_HZ, camera=True)
    wrong = np.random.default_rng([seed, 11])
    s = size(bank, wrong, plain.noise_m) if factor is None else factor
    if kind is Kind.OUTSIDE:
        name = strange or str(wrong.choice(OUTSIDE if tier == "B" else STRANGE_WITHOUT_RIG))
        once = name in ("cable_snag", "lateral_push")
        limited = int(wrong.integers(count - judged(count))) if once else None
        # What happens once must be larger to be seen at all.
        return replace(plain, strange=(name, outside(name, wrong, 1.5 * s if once else s), limited), factor=s)
    number = {Kind.NONE: 0, Kind.SINGLE: 1, Kind.PAIR: 2}[kind]
    known = [name for name in STARRED if tier == "B" or name not in WITHOUT_RIG]
    names = effects or tuple(str(name) for name in wrong.choice(known, size=number, replace=False))
    sizes = [s if i == 0 or factor is not None else size(bank, wrong, plain.noise_m) for i in range(len(names))]
    planted = tuple(
        STARRED[name](Draw(wrong, USUAL.get(name, 1.0) * one, count)) for name, one in zip(names, sizes, strict=True)
    )
    return replace(plain, planted=planted, factor=s if planted else None)
