"""The ground in frame C: RANSAC by open3d or its twin in NumPy, then least squares on the inliers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics

Method = Literal["open3d", "numpy"]

MIN_POINTS = 500
MIN_SHARE = 0.3
"""A plane with a smaller share of the pixels need not be the ground."""
SD_PER_M, SD_LEAST_M = 0.0013, 0.001
"""Noise taken for granted: sd = 0.0013 z^2 (Kinect family, measured on real frames), 1 mm at least; more where the
picture shows more."""
_SD_MOST_PER_M = 0.008
_CLEARLY = 1.5
"""Measured noise counts from this times the usual on: clutter passes for a little of it."""
_LAG_PX = 12
"""Between the pixels that are compared for noise; neighbours share some of theirs."""
_WIDTH = 3.0
"""Half width of the plane in standard deviations of depth."""
_HYPOTHESES = 200
_SAMPLE = 8000
_REFITS, _FITTED = 3, 80_000
"""More points than these would say nothing new: neighbours share half of their noise."""


@dataclass(frozen=True)
class Ground:
    """Points p of frame C with normal . p = -distance; normal: unit, towards the camera. distance [m]: of the camera.

    inlier: (v, u), which pixels lie on it. share: of the pixels with a depth. noise_sd [m]: of depth about the plane.
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

    def inverse_depth(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """1 / z [1/m] at which rays (x, y, 1) meet the plane; not positive where they do not."""
        n = self.normal_C
        return np.asarray(-(n[0] * x + n[1] * y + n[2]) / self.distance)


def points_C(depth: np.ndarray, lens: Intrinsics, depth_scale: float) -> np.ndarray:
    """Points of frame C [m], (v, u, 3), NaN where depth is unknown. Distortion is left out."""
    z = np.where(depth > 0, depth * depth_scale, np.nan)
    x = (np.arange(lens.width) + 0.5 - lens.cx) / lens.fx
    y = (np.arange(lens.height) + 0.5 - lens.cy) / lens.fy
    return np.stack([z * x[None, :], z * y[:, None], z], axis=-1)


def open3d_there() -> bool:
    """Whether open3d can be imported here; it needs libraries of the system that pip does not bring."""
    try:
        import open3d  # noqa: F401
    except (ImportError, OSError):
        return False
    return True


def noise_per_m(z: np.ndarray) -> float:
    """Noise of a depth picture z [m] (v, u), NaN where unknown: sd / z^2 [1/m], the usual SD_PER_M or clearly more.

    1 / z is linear along a row on every plane, so its second difference is noise alone, six times its variance; the
    median passes over edges and curved things.
    """
    inverse = 1.0 / z[::4]
    second = np.abs(inverse[:, 2 * _LAG_PX :] - 2 * inverse[:, _LAG_PX:-_LAG_PX] + inverse[:, : -2 * _LAG_PX])
    second = second[np.isfinite(second)]
    found = 1.4826 * float(np.median(second)) / np.sqrt(6.0) if len(second) else 0.0
    return min(found, _SD_MOST_PER_M) if found > _CLEARLY * SD_PER_M else SD_PER_M


def find_ground(p_C: np.ndarray, *, seed: int = 0, method: Method = "numpy") -> Ground | None:
    """The largest plane through points (v, u, 3) [m], NaN where unknown; None where there are too few or none fits.

    method: which library proposes the plane; both are seeded and refitted by the same weighted least squares, so that
    they differ by less than the noise (tests/stages/estimate/test_vision_survey.py).
    """
    known = np.isfinite(p_C[..., 2])
    points = p_C[known]
    if len(points) < MIN_POINTS:
        return None
    sd_per_m = noise_per_m(p_C[..., 2])
    best = _by_open3d(points, seed, sd_per_m) if method == "open3d" else _by_numpy(points, seed, sd_per_m)
    if best is None:
        return None
    some = points[:: max(len(points) // _FITTED, 1)]
    for _ in range(_REFITS):
        on = some[_near(some, *best, sd_per_m)]
        if len(on) < min(MIN_POINTS, len(some) // 2):
            return None
        best = _fitted(on)
    normal, distance = best
    near = _near(points, normal, distance, sd_per_m)
    inlier = np.zeros(known.shape, dtype=bool)
    inlier[known] = near
    # Along the ray: what the camera measures is z, and the plane is where the ray meets it.
    on = points[near]
    z_plane = -distance * on[:, 2] / (on @ normal)
    return Ground(normal, distance, inlier, float(near.mean()), float(np.std(on[:, 2] - z_plane)))


def _by_numpy(points: np.ndarray, seed: int, sd_per_m: float) -> tuple[np.ndarray, float] | None:
    rng = np.random.default_rng(seed)
    sample = points[rng.choice(len(points), size=min(_SAMPLE, len(points)), replace=False)]
    best, score = None, 0
    for three in rng.integers(0, len(sample), size=(_HYPOTHESES, 3)):
        plane = _through(sample[three])
        if plane is not None and (count := int(_near(sample, *plane, sd_per_m).sum())) > score:
            best, score = plane, count
    return best


def _by_open3d(points: np.ndarray, seed: int, sd_per_m: float) -> tuple[np.ndarray, float] | None:
    import open3d as o3d

    rng = np.random.default_rng(seed)
    sample = points[rng.choice(len(points), size=min(_SAMPLE, len(points)), replace=False)]
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(sample))
    o3d.utility.random.seed(seed)
    width = _WIDTH * max(sd_per_m * float(np.median(sample[:, 2])) ** 2, SD_LEAST_M)
    plane, _ = cloud.segment_plane(width, ransac_n=3, num_iterations=_HYPOTHESES)
    normal = np.asarray(plane[:3], dtype=float)
    size = float(np.linalg.norm(normal))
    if not np.isfinite(size) or size < 1e-9:
        return None
    normal = normal / size
    return _towards_camera(normal, -plane[3] / size * normal)


def _through(three: np.ndarray) -> tuple[np.ndarray, float] | None:
    normal = np.cross(three[1] - three[0], three[2] - three[0])
    size = float(np.linalg.norm(normal))
    return _towards_camera(normal / size, three[0]) if size > 1e-9 else None


def _fitted(points: np.ndarray) -> tuple[np.ndarray, float]:
    # Noise grows with z^2: far points count less.
    weight = 1.0 / np.square(np.square(points[:, 2:]))
    middle = (weight * points).sum(axis=0) / weight.sum()
    centred = (points - middle) * np.sqrt(weight)
    return _towards_camera(np.linalg.eigh(centred.T @ centred)[1][:, 0], middle)


def _towards_camera(normal: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, float]:
    d = float(normal @ point)
    return (normal, -d) if d < 0 else (-normal, d)


def _near(points: np.ndarray, normal: np.ndarray, distance: float, sd_per_m: float) -> np.ndarray:
    sd = np.maximum(sd_per_m * points[:, 2] ** 2, SD_LEAST_M)
    return np.asarray(np.abs(points @ normal + distance) < _WIDTH * sd)
