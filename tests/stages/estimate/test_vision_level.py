"""The ground without the robot on it: what a noisy camera takes for floor does not lift it."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.stages.estimate.vision.frames import ImageFrame
from r2s2r_cli.stages.estimate.vision.lens import Lens
from r2s2r_cli.stages.estimate.vision.level import AROUND_PX, levelled_ground, robot_mask
from r2s2r_cli.stages.estimate.vision.noise import DepthNoise
from r2s2r_cli.stages.estimate.vision.plane import Ground

LENS = Lens(Intrinsics(320, 240, 300.0, 300.0, 160.0, 120.0))
SCALE, HIGH_M, TILT = 1e-4, 2.4, 0.1
CAPS_PX = np.array([[120.0, 80.0], [200.0, 80.0], [160.0, 160.0]])
NOISE = DepthNoise(white=0.0047, shared=1e-6)


def floor() -> tuple[np.ndarray, np.ndarray]:
    """Normal (3,) of a floor that is seen aslant, and 1 / z of it at every pixel."""
    normal = np.array([0.0, np.sin(TILT), -np.cos(TILT)])
    return normal, -(normal[0] * LENS.x + normal[1] * LENS.y + normal[2]) / HIGH_M


def frames(count: int, seed: int = 100) -> list[ImageFrame]:
    """The floor with a body of 35 mm over the hull of the caps; noise of 27 mm."""
    rng, (_, inverse) = np.random.default_rng(seed), floor()
    body = robot_mask(CAPS_PX, (240, 320))
    found = []
    for k in range(count):
        z = np.where(body, 1 / inverse - 0.035, 1 / inverse)
        z = 1 / (1 / z + NOISE.sd * rng.standard_normal(z.shape))
        found.append(ImageFrame(k, k / 30, None, np.round(z / SCALE).astype(np.uint16)))
    return found


def start(normal: np.ndarray) -> Ground:
    """What single pictures said: 4 mm too near, 0.2 degrees off."""
    turned = normal + np.array([0.0035, 0.0, 0.0])
    return Ground(turned / np.linalg.norm(turned), HIGH_M - 0.004, np.zeros((240, 320), bool), 0.9, 0.027)


def test_the_robot_lifts_no_floor() -> None:
    """Distance within four of its standard deviations and 0.3 mm; with the robot left in, a millimetre is missing."""
    normal, _ = floor()
    ground, sd = levelled_ground(start(normal), frames(8), [CAPS_PX] * 8, LENS, SCALE, NOISE)
    assert abs(ground.distance - HIGH_M) < min(4 * sd, 3e-4)
    assert np.arccos(ground.normal_C @ normal) < np.radians(0.02)
    naive, _ = levelled_ground(start(normal), frames(8), [np.zeros((0, 2))] * 8, LENS, SCALE, NOISE)
    assert HIGH_M - naive.distance > 1e-3


def test_the_mask_covers_what_lies_between_and_about_the_caps() -> None:
    """The hull of the caps and AROUND_PX about it; nothing where no cap was found."""
    mask = robot_mask(CAPS_PX, (240, 320))
    assert mask[110, 160]
    assert mask[80, 120 - AROUND_PX // 2]
    assert not mask[80, 120 - 2 * AROUND_PX]
    assert not robot_mask(np.zeros((0, 2)), (240, 320)).any()


def test_without_enough_floor_the_ground_stays() -> None:
    """Caps all over the picture, or no depth: the ground as it was, of unknown distance."""
    normal, _ = floor()
    corners = np.array([[0.0, 0.0], [319.0, 0.0], [319.0, 239.0], [0.0, 239.0]])
    for places, some in ((corners, frames(1)), (CAPS_PX, [ImageFrame(0, 0.0, None, np.zeros((240, 320), np.uint16))])):
        ground, sd = levelled_ground(start(normal), some, [places], LENS, SCALE, NOISE)
        assert ground.distance == pytest.approx(HIGH_M - 0.004)
        assert np.isnan(sd)
