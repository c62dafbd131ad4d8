"""The runs of `bench estimate`: the rig's robot under the rig's camera, what a host would have recorded, and the truth.

The tracker gets `Case.robot`, `Case.streams` and `Case.frames`; `Case.truth` is for the scorer alone.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.commands.bench_estimate_camera import (
    at_times,
    camera_of,
    draw_pictures,
    exposures_of,
    frames_of,
    hidden_caps,
    pose_of,
)
from r2s2r_cli.commands.bench_estimate_motion import moved, robot_of

if TYPE_CHECKING:
    from r2s2r_cli.artifact import Group
    from r2s2r_cli.rig.world import World
    from r2s2r_cli.stages.estimate.images import DecodedFrames
    from schemas.robot import Robot

REPORT_SEEDS = range(10)
"""For the figures that are reported; never looked at while anything is tuned."""
TUNING_SEEDS = range(100, 110)
"""For everything else."""
RUN_S = 20.0
CLOCK_S = 0.05
"""Camera and robot clocks differ by up to this."""
_VERSION = 4
"""Of kept cases: raise it when the same settings make another run."""


@dataclass(frozen=True)
class Setting:
    """What is asked of a case.

    height_m: of the camera [m]. hide_cap: one cap is hidden half of the time. blind_s: all caps are hidden so long
    during motion [s]. bias_m: standard deviation of the sensors' bias [m]. cables: whether the recording has cable
    sensors. model: "plain" (depth noise 1.2 mm z^2, half correlated, flying pixels, holes; sensors with bias and 3 mm
    of white noise) or "full" (depth of the D435, misregistration, all faults of the sensors).
    """

    height_m: float = 1.44
    hide_cap: bool = False
    blind_s: float = 0.0
    bias_m: float = 0.004
    cables: bool = True
    model: str = "plain"


SETTINGS: dict[str, Setting] = {
    "1.44 m": Setting(),
    "2.4 m": Setting(height_m=2.4),
    "cap hidden": Setting(hide_cap=True),
    "all hidden 1 s": Setting(blind_s=1.0),
    "bias 10 mm": Setting(hide_cap=True, bias_m=0.010),
    "no sensors": Setting(cables=False),
    "full 1.44 m": Setting(model="full"),
    "full 2.4 m": Setting(model="full", height_m=2.4),
    "full, cap hidden": Setting(model="full", hide_cap=True),
    "full, no sensors": Setting(model="full", cables=False),
}
"""By the name that the tables give them."""


@dataclass(frozen=True)
class Truth:
    """What is, at the frames' exposures.

    t: as the recording stamps the frames [s], (frame,). p_WE: [m], (frame, cap, 3); W of the rig. force: of the ground
    on the caps [N], (frame, cap). weight: of the robot [N]. X_WC: the camera's pose (4, 4). length: of the cables [m],
    (frame, cable). delay_s: by which the sensors' lengths are later than the pictures', lag of the sensors and offset
    of the clocks together. hidden: caps behind something that is not robot, bool (frame, cap). blind: frames in which
    all are.
    """

    t: np.ndarray
    p_WE: np.ndarray
    force: np.ndarray
    weight: float
    X_WC: np.ndarray
    length: np.ndarray
    delay_s: float
    hidden: np.ndarray
    blind: np.ndarray


@dataclass(frozen=True)
class Case:
    """One run. streams: by name, as in `schemas/recording.py`, without pictures. frames: those."""

    setting: Setting
    seed: int
    robot: Robot
    streams: dict[str, Group]
    frames: DecodedFrames
    truth: Truth


def make_case(seed: int, folder: Path, *, run_s: float = RUN_S, robot: str = "threebar", **asked: Any) -> Case:
    """The case of a seed; asked: fields of `Setting`. Pictures that lie in `folder` are used again.

    The same arguments make the same run, to the last bit.
    """
    setting = Setting(**asked)
    described = robot_of(robot)
    stem = _stem(folder, setting, seed, run_s, robot)
    world, delay = _world(setting, seed)
    motion = moved(described, world, seed, run_s)
    camera = camera_of(setting, motion, seed)
    exposures = exposures_of(camera, seed, run_s)
    if not stem.with_suffix(".npz").exists():
        folder.mkdir(parents=True, exist_ok=True)
        draw_pictures(stem, described, camera, motion, exposures, seed)
    kept = np.load(stem.with_suffix(".npz"))
    t = exposures[:, 1]
    caps = at_times(t, motion.t, motion.p_WE)
    streams = {name: group for name, group in motion.streams.items() if setting.cables or name not in ("sensors",)}
    hidden = hidden_caps(camera, t, caps)
    late = delay - world.sensors.lag_s
    return Case(
        setting=setting, seed=seed, robot=described, streams=streams,
        frames=frames_of(stem, camera, t - late, kept),
        truth=Truth(
            t=t - late, p_WE=caps, force=at_times(t, motion.t, motion.force), weight=motion.weight,
            X_WC=pose_of(camera), length=at_times(t, motion.t, motion.length), delay_s=delay, hidden=hidden,
            blind=np.all(hidden, axis=1),
        ),
    )  # fmt: skip


def _stem(folder: Path, setting: Setting, seed: int, run_s: float, robot: str) -> Path:
    key = json.dumps([_VERSION, asdict(setting), seed, run_s, robot], sort_keys=True)
    return folder / f"case-{sha256(key.encode()).hexdigest()[:16]}"


def _world(setting: Setting, seed: int) -> tuple[World, float]:
    """The world, and by how much its sensors are later than its pictures [s]."""
    from r2s2r_cli.rig.world import World

    late = float(np.random.default_rng([seed, 2]).uniform(-CLOCK_S, CLOCK_S))
    heading = float(np.random.default_rng([seed, 3]).uniform(0.0, 2.0 * np.pi))
    sensors: dict[str, Any] = {"day_sd_m": setting.bias_m}
    if setting.model == "plain":
        sensors |= {"noise_sd_m": 0.003, "drift_sd_m": 0.0, "bow_sd_m": 0.0, "converter": "exact", "dropout_share": 0.0}
    world = World.model_validate({"seed": seed, "start": {"heading_rad": heading}, "sensors": sensors})
    return world, late + world.sensors.lag_s
