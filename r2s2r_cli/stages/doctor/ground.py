"""The largest plane of a depth frame: RANSAC, then least squares on what lies on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics

MIN_POINTS = 500
MIN_SHARE = 0.3
"""A plane with a smaller share of the pixels need not be the ground."""
_HYPOTHESES = 200
_SAMPLE = 8000
_WIDTH = 3.0
"""Half width of the plane in standard deviations of depth."""
_SD_PER_M, _SD_LEAST_M = 0.0013, 0.001
"""Noise taken for granted: sd = 0.0013 z^2 (reference/perception.md, section 5), 1 mm at least."""


@dataclass(frozen=True)
class Ground:
    """Points p of frame C with normal . p = -distance; normal: unit, towards the camera. distance [m]: of the camera.

    inlier: (v, u), which pixels lie on it. share: of the pixels with a depth. noise_sd [m]: about the plane.
    """

    normal_C: np.ndarray
    distance: float
    inlier: np.ndarray
    share: float
    noise_sd: float

    @property
    def tilt(self) -> float:
        """Angle between the optical axis and the normal [rad]."""
        return float(np.arccos(np.clip(-self.normal_C[2], -1.0, 1.0)))

    def height(self, p_C: np.ndarray) -> np.ndarray:
        """Heights over the plane [m] of points (..., 3) of frame C."""
        return np.asarray(p_C @ self.normal_C + self.distance)


def points_C(depth: np.ndarray, lens: Intrinsics, depth_scale: float) -> np.ndarray:
    """Points of frame C [m], (v, u, 3), NaN where depth is unknown. Distortion is left out."""
    z = np.where(depth > 0, depth * depth_scale, np.nan)
    x = (np.arange(lens.width) + 0.5 - lens.cx) / lens.fx
    y = (np.arange(lens.height) + 0.5 - lens.cy) / lens.fy
    return np.stack([z * x[None, :], z * y[:, None], z], axis=-1)


def find_ground(p_C: np.ndarray, *, seed: int = 0) -> Ground | None:
    """The largest plane through points (v, u, 3), None where there are too few or none lie on one."""
    known = np.isfinite(p_C[..., 2])
    points = p_C[known]
    if len(points) < MIN_POINTS:
        return None
    rng = np.random.default_rng(seed)
    sample = points[rng.choice(len(points), size=min(_SAMPLE, len(points)), replace=False)]
    best, score = None, 0
    for three in rng.integers(0, len(sample), size=(_HYPOTHESES, 3)):
        plane = _through(sample[three])
        if plane is not None and (count := int(_near(sample, *plane).sum())) > score:
            best, score = plane, count
    if best is None:
        return None
    for _ in range(3):
        on = points[_near(points, *best)]
        if len(on) < MIN_POINTS:
            return None
        best = _fitted(on)
    normal, distance = best
    near = _near(points, normal, distance)
    inlier = np.zeros(known.shape, dtype=bool)
    inlier[known] = near
    # Along the ray: what the camera measures is z, and the plane is where the ray meets it.
    on = points[near]
    z_plane = -distance * on[:, 2] / (on @ normal)
    return Ground(normal, distance, inlier, float(near.mean()), float(np.std(on[:, 2] - z_plane)))


def _through(three: np.ndarray) -> tuple[np.ndarray, float] | None:
    normal = np.cross(three[1] - three[0], three[2] - three[0])
    size = float(np.linalg.norm(normal))
    return _towards_camera(normal / size, three[0]) if size > 1e-9 else None


def _fitted(points: np.ndarray) -> tuple[np.ndarray, float]:
    # Noise grows with z^2: far points count less.
    weight = points[:, 2:] ** -4
    middle = (weight * points).sum(axis=0) / weight.sum()
    centred = (points - middle) * np.sqrt(weight)
    return _towards_camera(np.linalg.eigh(centred.T @ centred)[1][:, 0], middle)


def _towards_camera(normal: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, float]:
    d = float(normal @ point)
    return (normal, -d) if d < 0 else (-normal, d)


def _near(points: np.ndarray, normal: np.ndarray, distance: float) -> np.ndarray:
    sd = np.maximum(_SD_PER_M * points[:, 2] ** 2, _SD_LEAST_M)
    return np.asarray(np.abs(points @ normal + distance) < _WIDTH * sd)
