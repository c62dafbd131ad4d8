"""The ground once more, when the robot on it is known: one plane through the depths of many frames, without the robot.

A single picture of a noisy camera cannot tell the low parts of the robot from the floor: what lies within its noise
pulls the plane up by half a millimetre. And the noise of a stereo camera is even in 1 / z, not in z: there a plane is
linear in the slopes of the rays, and what is cut off on both sides alike moves nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from r2s2r_cli.stages.estimate.vision.frames import ImageFrame
from r2s2r_cli.stages.estimate.vision.lens import Lens
from r2s2r_cli.stages.estimate.vision.noise import DepthNoise
from r2s2r_cli.stages.estimate.vision.plane import MIN_POINTS, Ground

WIDTH_SD = 3.0
"""Depths that differ from the plane by more are of something else."""
AROUND_PX = 12
"""So far about the caps of a frame everything counts as robot, and all that lies between them."""
MOST = 0.5
"""Where robots would cover more than this share of a picture, it is something else, and the plane stays."""
_ROUNDS = 3
_EVERY = 2
"""Pixels that are used, per row and column: neighbours share most of their error."""


def levelled_ground(
    ground: Ground, frames: Sequence[ImageFrame], caps_px: Sequence[np.ndarray], lens: Lens, scale: float,
    noise: DepthNoise,
) -> tuple[Ground, float]:  # fmt: skip
    """The plane through all frames, and the standard deviation of the camera's distance from it [m].

    caps_px: places (cap, 2) [px] of the caps found in each frame. Too few depths left: the ground as it was, NaN.
    """
    x, y = lens.x[::_EVERY, ::_EVERY], lens.y[::_EVERY, ::_EVERY]
    rays, inverse = [], []
    for frame, px in zip(frames, caps_px, strict=True):
        away = ~robot_mask(px, (lens.height, lens.width))[::_EVERY, ::_EVERY]
        if frame.depth is None or away.mean() < MOST:
            continue
        on = away & (frame.depth[::_EVERY, ::_EVERY] > 0)
        rays.append(np.stack([x[on], y[on], np.ones(int(on.sum()))], axis=-1))
        inverse.append(1.0 / (frame.depth[::_EVERY, ::_EVERY][on] * scale))
    plane: np.ndarray = -ground.normal_C / ground.distance
    used = 0
    for _ in range(_ROUNDS):
        A, b, used = np.zeros((3, 3)), np.zeros(3), 0
        for ray, seen in zip(rays, inverse, strict=True):
            near = np.abs(seen - ray @ plane) < WIDTH_SD * noise.sd
            A, b, used = A + ray[near].T @ ray[near], b + ray[near].T @ seen[near], used + int(near.sum())
        if used < MIN_POINTS or np.linalg.matrix_rank(A) < 3:
            return ground, float("nan")
        plane = np.linalg.solve(A, b)
    distance = 1.0 / float(np.linalg.norm(plane))
    # Pixels within length_px share an error, and a sensor may show some of it in every picture alike.
    alike = max(np.pi * noise.length_px**2 / _EVERY**2, 1.0) * len(rays)
    sd = np.sqrt((noise.white**2 + noise.shared**2 * alike) / used)
    return replace(ground, normal_C=-plane * distance, distance=distance), float(distance**2 * sd)


def robot_mask(caps_px: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Pixels between and about caps at (cap, 2) [px], bool (v, u)."""
    import cv2

    found = np.zeros(shape, dtype=np.uint8)
    if len(caps_px):
        hull = cv2.convexHull(np.rint(caps_px).astype(np.int32).reshape(-1, 1, 2))
        cv2.fillConvexPoly(found, hull, 1)
        cv2.polylines(found, [hull], True, 1, thickness=2 * AROUND_PX)
    return found.astype(bool)
