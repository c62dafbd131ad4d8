"""The runs of `bench estimate`: the rig's robot under the rig's camera, what a host would have recorded, and the truth.

The tracker gets `Case.robot`, `Case.streams` and `Case.frames`; `Case.truth` is for the scorer alone.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.commands.bench_estimate_motion import LOOK_S, Motion, moved, robot_of

if TYPE_CHECKING:
    from r2s2r_cli.artifact import Group
    from r2s2r_cli.rig.camera.settings import CameraSettings, Occluder
    from r2s2r_cli.rig.world import World
    from r2s2r_cli.stages.estimate.images import DecodedFrames
    from schemas.robot import Robot

REPORT_SEEDS = range(10)
"""For the figures that are reported; never looked at while anything is tuned."""
TUNING_SEEDS = range(100, 110)
"""For everything else."""
RUN_S = 20.0
D435_SD_PER_M = 4.7e-3
"""sigma = z^2 0.1 px / (f baseline) of the D435: 90 degrees over 848 px, 50 mm; 4.7 mm at 1 m
(gazebo `depth_noise_model`, perception.md section 5, without its squaring)."""
HIDE_S = 1.0
"""So long a cap is hidden, and then so long seen again."""
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


class PictureFile:
    """Encoded pictures one after the other in a file, by their number."""

    def __init__(self, path: Path, offset: np.ndarray) -> None:
        self._file, self._offset = os.open(path, os.O_RDONLY), offset

    def __len__(self) -> int:
        return len(self._offset) - 1

    def __getitem__(self, index: int) -> bytes:
        start, stop = int(self._offset[index]), int(self._offset[index + 1])
        return os.pread(self._file, stop - start, start)

    def __del__(self) -> None:
        os.close(self._file)


def make_case(seed: int, folder: Path, *, run_s: float = RUN_S, robot: str = "threebar", **asked: Any) -> Case:
    """The case of a seed; asked: fields of `Setting`. Pictures that lie in `folder` are used again.

    The same arguments make the same run, to the last bit.
    """
    setting = Setting(**asked)
    described = robot_of(robot)
    stem = _stem(folder, setting, seed, run_s, robot)
    world, delay = _world(setting, seed)
    motion = moved(described, world, seed, run_s)
    camera = _camera(setting, motion, seed)
    exposures = _exposures(camera, seed, run_s)
    if not stem.with_suffix(".npz").exists():
        folder.mkdir(parents=True, exist_ok=True)
        _draw(stem, described, camera, motion, exposures, seed)
    kept = np.load(stem.with_suffix(".npz"))
    t = exposures[:, 1]
    caps = _at(t, motion.t, motion.p_WE)
    streams = {name: group for name, group in motion.streams.items() if setting.cables or name not in ("sensors",)}
    late = delay - world.sensors.lag_s
    return Case(
        setting=setting, seed=seed, robot=described, streams=streams,
        frames=_frames(stem, camera, t - late, kept),
        truth=Truth(
            t=t - late, p_WE=caps, force=_at(t, motion.t, motion.force), weight=motion.weight, X_WC=_pose(camera),
            length=_at(t, motion.t, motion.length), delay_s=delay, hidden=_hidden(camera, t, caps),
            blind=_blind(camera, t, caps),
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


def _camera(setting: Setting, motion: Motion, seed: int) -> CameraSettings:
    from r2s2r_cli.rig.camera.settings import CameraSettings

    depth: dict[str, Any] = {"misregistration_px": (0.0, 0.0), "disparity_step_px": 0.0}
    if setting.model == "full":
        depth = {"sd_per_m": D435_SD_PER_M, "misregistration_px": (1.0, -0.5)}
    middle = motion.p_WE[0].mean(axis=0)
    camera = CameraSettings.model_validate({
        "position_m": (float(middle[0]), float(middle[1]), setting.height_m),
        "look_at_m": (float(middle[0]), float(middle[1]), 0.0), "depth": depth,
    })  # fmt: skip
    exposures = _exposures(camera, seed, float(motion.t[-1]))[:, 1]
    occluders: list[Occluder] = []
    if setting.hide_cap:
        occluders += _hide_one(camera, motion, seed % motion.p_WE.shape[1], exposures)
    if setting.blind_s:
        occluders += _hide_all(camera, motion, setting.blind_s, exposures)
    return camera.model_copy(update={"occluders": tuple(occluders)})


def _hide_one(camera: CameraSettings, motion: Motion, cap: int, exposures: np.ndarray) -> Iterator[Occluder]:
    """Balls that follow a cap for HIDE_S, four fifths of the way from camera to cap, every other HIDE_S."""
    from r2s2r_cli.rig.camera.settings import Occluder

    eye, share, radius = np.array(camera.position_m), 0.8, 0.0175
    start = HIDE_S
    while start < motion.t[-1]:
        first, last = _between(start, exposures), _between(start + HIDE_S, exposures)
        span = (motion.t >= first) & (motion.t <= last)
        t, p = motion.t[span] - first, motion.p_WE[span, cap]
        way = eye + share * (p - eye)
        if len(t) > 1:
            line = np.polynomial.polynomial.polyfit(t, way, 1)
            off = np.linalg.norm(way - (line[0] + t[:, None] * line[1]), axis=1).max()
            yield Occluder(a_m=_point(line[0]), b_m=_point(line[0]), v_m_per_s=_point(line[1]), from_s=first,
                           until_s=last, radius_m=float(1.25 * share * radius + off + 0.004))  # fmt: skip
        start += 2 * HIDE_S


def _hide_all(camera: CameraSettings, motion: Motion, seconds: float, exposures: np.ndarray) -> Iterator[Occluder]:
    """A ball half-way to the robot, when its caps go farthest in so long a time, in the middle of the run."""
    from r2s2r_cli.rig.camera.settings import Occluder

    eye, share = np.array(camera.position_m), 0.5
    n = round(seconds / LOOK_S)
    gone = np.linalg.norm(motion.p_WE[n:] - motion.p_WE[:-n], axis=-1).mean(axis=1)
    where = (motion.t[: len(gone)] > 0.3 * motion.t[-1]) & (motion.t[: len(gone)] < 0.7 * motion.t[-1])
    first = int(np.argmax(np.where(where, gone, -1.0)))
    p = motion.p_WE[first : first + n + 1]
    centre = p.mean(axis=(0, 1))
    a = _point(eye + share * (centre - eye))
    reach = np.linalg.norm((p - centre)[..., :2], axis=-1).max() + 0.06
    come, go = (_between(float(motion.t[first]) + wait, exposures) for wait in (0.0, seconds))
    yield Occluder(a_m=a, b_m=a, radius_m=float(1.3 * share * reach), from_s=come, until_s=go)


def _between(t: float, exposures: np.ndarray) -> float:
    """The instant midway between the exposures before and after t [s]: nothing comes or goes in the midst of one."""
    after = int(np.clip(np.searchsorted(exposures, t), 1, len(exposures) - 1))
    return float(exposures[after - 1] + exposures[after]) / 2


def _point(p: np.ndarray) -> tuple[float, float, float]:
    return float(p[0]), float(p[1]), float(p[2])


def _exposures(camera: CameraSettings, seed: int, run_s: float) -> np.ndarray:
    """Number and instant [s] of every frame that leaves the camera, (frame, 2)."""
    from r2s2r_cli.rig.camera.clock import Shutter

    shutter = Shutter(camera, seed=seed)
    found = []
    while shutter.next.t < run_s - 2 * LOOK_S:
        if not shutter.next.lost and shutter.next.t > 2 * LOOK_S:
            found.append((shutter.next.number, shutter.next.t))
        shutter.advance()
    return np.array(found, dtype=float)


def _draw(stem: Path, robot: Robot, camera: CameraSettings, motion: Motion, exposures: np.ndarray, seed: int) -> None:
    """Pictures as `record` keeps them: JPEG and 16-bit PNG."""
    from r2s2r_cli.rig.camera.camera import RigCamera
    from r2s2r_cli.stages.record.camera import encode_color, encode_depth
    from schemas.config import RecordSettings

    eye, settings = RigCamera(robot, camera, seed=seed), RecordSettings()
    speed = np.gradient(motion.p_WE, LOOK_S, axis=0)
    sizes: dict[str, list[int]] = {"color": [0], "depth": [0]}
    with stem.with_suffix(".color").open("wb") as color, stem.with_suffix(".depth").open("wb") as depth:
        for number, t in exposures:
            at = np.array([t])
            p, v = _at(at, motion.t, motion.p_WE)[0], _at(at, motion.t, speed)[0]
            picture = eye.capture(int(number), float(t), p, v)
            sizes["color"].append(color.write(encode_color(picture.color, settings)))
            sizes["depth"].append(depth.write(encode_depth(picture.depth)))
    part = stem.with_suffix(".part.npz")
    np.savez(part, color=np.cumsum(sizes["color"]), depth=np.cumsum(sizes["depth"]))
    part.replace(stem.with_suffix(".npz"))


def _frames(stem: Path, camera: CameraSettings, t: np.ndarray, kept: Any) -> DecodedFrames:
    from r2s2r_cli.devices.camera import Intrinsics
    from r2s2r_cli.stages.estimate.images import DecodedFrames

    lens = Intrinsics(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
    return DecodedFrames(
        lens=lens, depth_scale=camera.depth_scale, t=t, color=PictureFile(stem.with_suffix(".color"), kept["color"]),
        depth=PictureFile(stem.with_suffix(".depth"), kept["depth"]), pair=np.arange(len(t)), where="runs/case/camera",
    )  # fmt: skip


def _pose(camera: CameraSettings) -> np.ndarray:
    from r2s2r_cli.rig.camera import pinhole

    return pinhole.pose(camera)


def _at(t: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n, ...) at times t, straight lines in between."""
    after = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
    share = ((t - times[after - 1]) / (times[after] - times[after - 1])).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1 - share) * values[after - 1] + share * values[after])


def _hidden(camera: CameraSettings, t: np.ndarray, p_WE: np.ndarray) -> np.ndarray:
    """Whether the line from the camera to a cap's centre meets an occluder, bool (frame, cap)."""
    eye = np.array(camera.position_m)
    ray = p_WE - eye
    far = np.linalg.norm(ray, axis=-1)
    hidden = np.zeros(p_WE.shape[:2], dtype=bool)
    for ball in camera.occluders:
        there = (t >= ball.from_s) & (t < (np.inf if ball.until_s is None else ball.until_s))
        to = np.array(ball.a_m) + (t - ball.from_s)[:, None] * np.array(ball.v_m_per_s) - eye
        along = np.einsum("tci,ti->tc", ray, to) / far
        beside = np.sqrt(np.maximum(np.sum(to**2, axis=-1)[:, None] - along**2, 0.0))
        hidden |= there[:, None] & (beside < ball.radius_m) & (along > 0) & (along < far)
    return hidden


def _blind(camera: CameraSettings, t: np.ndarray, p_WE: np.ndarray) -> np.ndarray:
    return np.asarray(_hidden(camera, t, p_WE).all(axis=1))
