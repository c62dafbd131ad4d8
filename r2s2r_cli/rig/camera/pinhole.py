"""Where the rig's camera stands, and where a point of its frame C lies in the picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.rig.camera.settings import CameraSettings


@dataclass(frozen=True)
class Pinhole:
    """u = fx x / z + cx, v = fy y / z + cy for (x, y, z) in frame C.

    Pixel (i, j) is centred at u = i + 0.5, v = j + 0.5. width, height, fx, fy, cx, cy [px].
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def rays(self) -> tuple[np.ndarray, np.ndarray]:
        """Slopes x / z of every column (width,) and y / z of every row (height,), at the pixel centres."""
        x = (np.arange(self.width) + 0.5 - self.cx) / self.fx
        y = (np.arange(self.height) + 0.5 - self.cy) / self.fy
        return x, y

    def shifted(self, du: float, dv: float) -> Pinhole:
        """The same camera with everything (du, dv) pixels further right and down."""
        return replace(self, cx=self.cx + du, cy=self.cy + dv)


def stated(settings: CameraSettings) -> Pinhole:
    """The camera as it describes itself."""
    return Pinhole(settings.width, settings.height, settings.fx, settings.fy, settings.cx, settings.cy)


def true(settings: CameraSettings) -> Pinhole:
    """The camera as it is."""
    share = 1.0 + settings.focal_error
    return replace(stated(settings), fx=settings.fx * share, fy=settings.fy * share)


def pose(settings: CameraSettings) -> np.ndarray:
    """X_WC (4, 4) before it is knocked."""
    p_WC = np.array(settings.position_m, dtype=float)
    z = _unit(np.array(settings.look_at_m) - p_WC)
    x = _unit(np.cross(z, np.array(settings.picture_up, dtype=float)))
    return _matrix(np.column_stack([x, np.cross(z, x), z]), p_WC)


def knocked(settings: CameraSettings) -> np.ndarray:
    """X_WC (4, 4) afterwards."""
    X_WC = pose(settings)
    turn = np.array(settings.turn_rad, dtype=float)
    return _matrix(X_WC[:3, :3] @ _rotation(turn), X_WC[:3, 3] + np.array(settings.shift_m))


def into(X_WC: np.ndarray, p_W: np.ndarray) -> np.ndarray:
    """Points (..., 3) of the world in frame C."""
    return np.asarray((np.asarray(p_W, dtype=float) - X_WC[:3, 3]) @ X_WC[:3, :3])


def _rotation(turn: np.ndarray) -> np.ndarray:
    """Rotation matrix of a rotation vector [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(turn))
    if angle == 0.0:
        return np.eye(3)
    k = turn / angle
    K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)


def _unit(v: np.ndarray) -> np.ndarray:
    return np.asarray(v / np.linalg.norm(v))


def _matrix(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = R, p
    return X
