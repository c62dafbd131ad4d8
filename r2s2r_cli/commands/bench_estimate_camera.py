"""The camera of a case of `bench estimate`: where it is, what gets in its way, and its pictures as they are kept."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.commands.bench_estimate_motion import LOOK_S, Motion

if TYPE_CHECKING:
    from r2s2r_cli.commands.bench_estimate_case import Setting
    from r2s2r_cli.rig.camera.settings import CameraSettings, Occluder
    from r2s2r_cli.stages.estimate.images import DecodedFrames
    from schemas.robot import Robot

D435_SD_PER_M = 4.7e-3
"""sigma = z^2 0.1 px / (f baseline) of the D435: 90 degrees over 848 px, 50 mm; 4.7 mm at 1 m
(gazebo `depth_noise_model`, perception.md section 5, without its squaring)."""
HIDE_S = 1.0
"""So long a cap is hidden, and then so long seen again."""


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


def camera_of(setting: Setting, motion: Motion, seed: int) -> CameraSettings:
    """Above where the robot starts, with what hides it, which depends on where it goes."""
    from r2s2r_cli.rig.camera.settings import CameraSettings

    depth: dict[str, Any] = {"misregistration_px": (0.0, 0.0), "disparity_step_px": 0.0}
    if setting.model == "full":
        depth = {"sd_per_m": D435_SD_PER_M, "misregistration_px": (1.0, -0.5)}
    middle = motion.p_WE[0].mean(axis=0)
    camera = CameraSettings.model_validate({
        "position_m": (float(middle[0]), float(middle[1]), setting.height_m),
        "look_at_m": (float(middle[0]), float(middle[1]), 0.0), "depth": depth,
    })  # fmt: skip
    exposures = exposures_of(camera, seed, float(motion.t[-1]))[:, 1]
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


def exposures_of(camera: CameraSettings, seed: int, run_s: float) -> np.ndarray:
    """Number and instant [s] of every frame that leaves the camera, (frame, 2)."""
    from r2s2r_cli.rig.camera.clock import Shutter

    shutter = Shutter(camera, seed=seed)
    found = []
    while shutter.next.t < run_s - 2 * LOOK_S:
        if not shutter.next.lost and shutter.next.t > 2 * LOOK_S:
            found.append((shutter.next.number, shutter.next.t))
        shutter.advance()
    return np.array(found, dtype=float)


def draw_pictures(
    stem: Path, robot: Robot, camera: CameraSettings, motion: Motion, exposures: np.ndarray, seed: int
) -> None:
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
            p, v = at_times(at, motion.t, motion.p_WE)[0], at_times(at, motion.t, speed)[0]
            picture = eye.capture(int(number), float(t), p, v)
            sizes["color"].append(color.write(encode_color(picture.color, settings)))
            sizes["depth"].append(depth.write(encode_depth(picture.depth)))
    part = stem.with_suffix(".part.npz")
    np.savez(part, color=np.cumsum(sizes["color"]), depth=np.cumsum(sizes["depth"]))
    part.replace(stem.with_suffix(".npz"))


def frames_of(stem: Path, camera: CameraSettings, t: np.ndarray, kept: Any) -> DecodedFrames:
    """The pictures of `stem` at stamps t [s]; kept: where each begins, `color` and `depth`."""
    from r2s2r_cli.devices.camera import Intrinsics
    from r2s2r_cli.stages.estimate.images import DecodedFrames

    lens = Intrinsics(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
    return DecodedFrames(
        lens=lens, depth_scale=camera.depth_scale, t=t, color=PictureFile(stem.with_suffix(".color"), kept["color"]),
        depth=PictureFile(stem.with_suffix(".depth"), kept["depth"]), pair=np.arange(len(t)), where="runs/case/camera",
    )  # fmt: skip


def pose_of(camera: CameraSettings) -> np.ndarray:
    """X_WC (4, 4) in the rig's world."""
    from r2s2r_cli.rig.camera import pinhole

    return pinhole.pose(camera)


def at_times(t: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n, ...) at times t, straight lines in between."""
    after = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
    share = ((t - times[after - 1]) / (times[after] - times[after - 1])).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1 - share) * values[after - 1] + share * values[after])


def hidden_caps(camera: CameraSettings, t: np.ndarray, p_WE: np.ndarray) -> np.ndarray:
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
