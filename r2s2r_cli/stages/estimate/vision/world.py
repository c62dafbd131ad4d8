"""Frame W for a camera that knows only the ground: z up, ground at 0, origin under the camera, x along the picture."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.stages.estimate.vision.plane import Ground

TILT_RAD, HEIGHT_M = np.radians(1.0), 0.010
"""A stated camera pose that differs by more from the ground that is seen is warned of."""


def camera_pose(ground: Ground) -> np.ndarray:
    """X_WC (4, 4): z_W is the ground's normal, the origin is the point of the ground under the camera.

    x_W is the camera's x axis along the ground. Which way x points and where the origin lies are choices: the ground
    tells neither.
    """
    z = ground.normal_C / np.linalg.norm(ground.normal_C)
    # A camera that lies on its side sees its own x axis upright: then its y axis tells the direction.
    along = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = along - (along @ z) * z
    x /= np.linalg.norm(x)
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.stack([x, np.cross(z, x), z])
    X_WC[2, 3] = ground.distance
    return X_WC


def levelled(X_WC: np.ndarray, ground: Ground) -> np.ndarray:
    """A stated pose (4, 4) with the ground that is seen: place over the ground and heading as stated, height, roll and
    pitch as seen. A camera sees its floor to a millimetre; a pose that was measured once is off by several."""
    own = camera_pose(ground)
    both = X_WC[:3, :3] @ own[:3, :3].T
    yaw = np.arctan2(both[1, 0] - both[0, 1], both[0, 0] + both[1, 1])
    c, s = np.cos(yaw), np.sin(yaw)
    found = np.eye(4)
    found[:3, :3] = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ own[:3, :3]
    found[:3, 3] = [X_WC[0, 3], X_WC[1, 3], ground.distance]
    return found


def disagreement(X_WC: np.ndarray, ground: Ground) -> tuple[float, float]:
    """How far a stated pose X_WC and the ground that is seen are apart: angle [rad], height of the camera [m]."""
    cosine = float(np.clip(X_WC[2, :3] @ ground.normal_C, -1.0, 1.0))
    return float(np.arccos(cosine)), float(X_WC[2, 3] - ground.distance)


def sees_floor(X_WC: np.ndarray, lens: Intrinsics) -> bool:
    """Whether a camera with a stated pose (4, 4) is above the floor and has some of it in its picture.

    Distortion is left out: it moves a corner of the picture by a few degrees.
    """
    x = (np.array([0.0, lens.width]) - lens.cx) / lens.fx
    y = (np.array([0.0, lens.height]) - lens.cy) / lens.fy
    # How far a ray (x, y, 1) rises is linear in x and y, so the one that falls most goes through a corner.
    rise = X_WC[2, 0] * x[None, :] + X_WC[2, 1] * y[:, None] + X_WC[2, 2]
    return bool(X_WC[2, 3] > 0 and rise.min() < 0)


def to_world(X_WC: np.ndarray, p_C: np.ndarray, cov_C: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Points (..., 3) [m] and covariances (..., 3, 3) [m^2] of frame C in frame W; no covariance: zeros."""
    R = X_WC[:3, :3]
    cov = np.zeros((*p_C.shape, 3)) if cov_C is None else cov_C
    return p_C @ R.T + X_WC[:3, 3], R @ cov @ R.T


def from_world(X_WC: np.ndarray, p_W: np.ndarray, cov_W: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The way back: points (..., 3) [m] and covariances (..., 3, 3) [m^2] of frame W in frame C."""
    R = X_WC[:3, :3]
    cov = np.zeros((*p_W.shape, 3)) if cov_W is None else cov_W
    return (p_W - X_WC[:3, 3]) @ R, R.T @ cov @ R
