"""Frames of the rig's camera with known caps, for tests of the tracker's eyes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.rig.camera import pinhole, render
from r2s2r_cli.rig.camera.camera import RigCamera
from r2s2r_cli.rig.camera.scene import Scene
from r2s2r_cli.rig.camera.settings import CameraSettings
from r2s2r_cli.stages.estimate.vision.frames import ImageFrame
from r2s2r_cli.stages.estimate.vision.known import Survey
from r2s2r_cli.stages.estimate.vision.noise import DepthNoise
from r2s2r_cli.stages.estimate.vision.plane import Ground
from r2s2r_cli.stages.estimate.vision.world import camera_pose
from tests.support.rig_robots import known

ROBOT = known()
REST = np.array(ROBOT.rest_caps_m)
TUNING = 100
"""Seeds of test frames begin here: 0 .. 9 are kept for the figures that are reported."""


def settings(height: float = 1.44, **changed: Any) -> CameraSettings:
    """The camera of the figures: straight above, noise 1.2 mm z^2, half of it correlated, flying pixels, holes."""
    depth = {"disparity_step_px": 0.0, "misregistration_px": (0.0, 0.0)} | changed.pop("depth", {})
    return CameraSettings.model_validate({"position_m": (0.0, 0.0, height), "depth": depth} | changed)


def lens_of(camera: CameraSettings) -> Intrinsics:
    """What the camera states."""
    return Intrinsics(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)


def told(camera: CameraSettings, noise: DepthNoise | None = None) -> Survey:
    """What a survey of this camera would find, without one: the camera looks straight down."""
    height = camera.position_m[2]
    nothing = np.zeros((camera.height, camera.width), dtype=bool)
    ground = Ground(np.array([0.0, 0.0, -1.0]), height, nothing, 0.9, 0.0012 * height**2)
    return Survey(camera_pose(ground), ground, noise or DepthNoise())


def tumbled(rng: np.random.Generator) -> np.ndarray:
    """The robot at rest turned at random, its lowest cap on the ground, somewhere below the camera; (cap, 3) [m]."""
    w, x, y, z = (q := rng.standard_normal(4)) / np.linalg.norm(q)
    R = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    p = (REST - REST.mean(axis=0)) @ R.T
    p[:, 2] += ROBOT.rods[0].cap_radius_m - p[:, 2].min()
    p[:, :2] += rng.uniform(-0.2, 0.2, 2)
    return p


def seen_share(camera: CameraSettings, p_W: np.ndarray, t: float = 0.0) -> np.ndarray:
    """Share of every cap's disc that nothing hides, (cap,)."""
    lens, X = pinhole.true(camera), pinhole.pose(camera)
    label = render.draw(lens, Scene(ROBOT, camera).solids(p_W, t).seen_from(X)).label
    radius = lens.fx * ROBOT.rods[0].cap_radius_m / pinhole.into(X, p_W)[:, 2]
    return np.array([(label == cap).sum() for cap in range(len(p_W))]) / (np.pi * radius**2)


@dataclass(frozen=True)
class Recorded:
    """A FrameSource in memory, with the truth beside it: p_C (frame, cap, 3) [m]."""

    lens: Intrinsics
    depth_scale: float
    frames: Sequence[ImageFrame]
    p_C: np.ndarray
    X_WC: np.ndarray | None = None

    @property
    def t(self) -> np.ndarray:
        return np.array([frame.t for frame in self.frames])

    def __len__(self) -> int:
        return len(self.frames)

    def __iter__(self) -> Iterator[ImageFrame]:
        return iter(self.frames)

    def frame(self, index: int) -> ImageFrame:
        return self.frames[index]


def record(camera: CameraSettings, poses: Sequence[np.ndarray], *, seed: int = TUNING, speed: float = 0.0) -> Recorded:
    """One frame a pose (cap, 3) [m] of the world. speed: all caps move so fast [m/s], each frame another way."""
    eye, rng, frames = RigCamera(ROBOT, camera, seed=seed), np.random.default_rng(seed), []
    for i, p in enumerate(poses):
        way = rng.standard_normal(3)
        v = np.tile(speed * way / np.linalg.norm(way), (len(p), 1)) if speed else None
        picture = eye.capture(i, i / 30, p, v)
        frames.append(ImageFrame(i, i / 30, picture.color, picture.depth))
    p_C = np.array([pinhole.into(pinhole.pose(camera), p) for p in poses])
    return Recorded(lens_of(camera), camera.depth_scale, tuple(frames), p_C)


@lru_cache
def tumbling(height: float = 1.44, count: int = 6) -> Recorded:
    """A recording of tumbled robots, made once a session."""
    rng = np.random.default_rng(TUNING)
    return record(settings(height), [tumbled(rng) for _ in range(count)])
