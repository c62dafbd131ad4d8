"""What depth tells of a ball: which depths are on it, and where they have its centre, as normal equations.

f: focal length [px]. noise: of depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.estimate.vision.disc import Disc
from r2s2r_cli.stages.estimate.vision.noise import DepthNoise
from r2s2r_cli.stages.estimate.vision.patch import Patch
from r2s2r_cli.stages.estimate.vision.solids import ball_depth

CORE, FRAY_PX = 0.85, 1.5
"""Depths beyond this share of the disc's radius, or so close to its rim, are left out: edges fray."""
EDGES_PX, DEPTHS_ENOUGH = 2.2, 12
"""So close to the rim a depth may be one between ball and background. Where that leaves enough, it is left out too."""
DEPTHS = 64
"""Depths that are used at most; neighbours share most of their error, so more would tell nothing more."""
DEPTHS_LEAST = 5
"""Fewer depths on a ball could all be of something else: then only its colour counts."""
GATE_SD, GATE_RADII = 4.0, 0.05
"""A depth that differs from the median by more than these standard deviations and share of the radius is left out."""


@dataclass(frozen=True)
class Depths:
    """Depths on a ball: slopes x, y of their rays, z [m], (n,), and the inverse of the covariance of 1 / z (n, n)."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    weight: np.ndarray

    @classmethod
    def none(cls) -> Depths:
        """No depth at all."""
        return cls(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 0)))


def along_sight(patch: Patch, seen: np.ndarray, c: np.ndarray, radius: float) -> np.ndarray:
    """The centre c [m] moved along its line of sight to where the depths have it. seen: pixels that count, (v, u)."""
    off = patch.z - ball_depth(patch.zx, patch.zy, c, radius)
    off = off[seen & patch.known & np.isfinite(off)]
    return c * (1.0 + float(np.median(off)) / c[2]) if len(off) >= DEPTHS_LEAST else c


def depths_on(
    patch: Patch, seen: np.ndarray, c: np.ndarray, radius: float, disc: Disc, noise: DepthNoise, f: float
) -> Depths:
    """The depths on a ball about c [m], those that differ from the rest left out. seen: pixels that count, (v, u)."""
    rho = Disc.of(c, radius, patch.zx, patch.zy).rho
    on = seen & patch.known & (rho < _core(disc, FRAY_PX, f))
    if (inner := on & (rho < _core(disc, EDGES_PX, f))).sum() >= DEPTHS_ENOUGH:
        on = inner
    rows, columns = np.nonzero(on)
    if len(rows) < DEPTHS_LEAST:
        return Depths.none()
    x, y, z = patch.zx[rows, columns], patch.zy[rows, columns], patch.z[rows, columns]
    off = z - ball_depth(x, y, c, radius)
    good = np.abs(off - np.median(off)) < GATE_SD * (float(c[2]) ** 2 * noise.sd) + GATE_RADII * radius
    every = max(int(np.ceil(good.sum() / DEPTHS)), 1)
    pick = np.nonzero(good)[0][::every]
    if len(pick) < DEPTHS_LEAST:
        return Depths.none()
    x, y, z = x[pick], y[pick], z[pick]
    slope = _slopes(x, y, c, radius, noise.sideways_px / f)
    if slope is None:
        return Depths.none()
    model, J = slope
    sideways = np.hypot(*(J @ disc.E)[:, :2].T) * noise.sideways_px * model / f
    C = noise.covariance(columns[pick].astype(float), rows[pick].astype(float), sideways**2)
    return Depths(x, y, z, np.linalg.inv(C))


def depth_equations(
    depths: Depths, c: np.ndarray, radius: float, disc: Disc, noise: DepthNoise, f: float
) -> tuple[np.ndarray, np.ndarray]:
    """Normal matrix (3, 3) and right-hand side (3,) of the depths, for metres across, across and along."""
    found = _slopes(depths.x, depths.y, c, radius, noise.sideways_px / f) if len(depths.z) else None
    if found is None:
        return np.zeros((3, 3)), np.zeros(3)
    model, J = found[0], found[1] @ disc.E
    weighted = J.T @ depths.weight
    return weighted @ J, weighted @ (1.0 / depths.z - 1.0 / model)


def _core(disc: Disc, fray_px: float, f: float) -> float:
    """Radius of the part of the disc whose depths are used, as a slope."""
    return min(CORE * disc.rim, max(disc.rim - fray_px / f, 0.45 * disc.rim))


def _slopes(
    x: np.ndarray, y: np.ndarray, c: np.ndarray, radius: float, sideways: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Depths [m] (n,) that rays on a ball report on average, and d(1 / z) / dc [1/m^2] (n, 3); None if one misses.

    sideways: standard deviation by which a ray misses its pixel, as a slope. A ball curves away on all sides, so that
    what is seen there lies behind by half the variance times the Laplacian of its surface, (r^2 + q^2) / q^3 at a
    depth q before its middle.
    """
    z = ball_depth(x, y, c, radius)
    if not np.isfinite(z).all():
        return None
    ray = np.stack([x, y, np.ones_like(x)], axis=-1)
    n = ray * z[:, None] - c
    facing = -(n * ray).sum(axis=-1)
    q = np.maximum(facing / np.sqrt((ray * ray).sum(axis=-1)), 0.4 * radius)
    model = z + 0.5 * (sideways * z) ** 2 * (radius**2 + q**2) / q**3
    return model, n / (facing * z**2)[:, None]
