"""What of the robot's own parts hides a cap: spheres and cylinders about the predicted caps, as rays meet them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from schemas.robot import Robot


@dataclass(frozen=True)
class Part:
    """A cylinder along a rod. rod: its number. offset: of its middle from the rod's, towards the odd cap [m];
    half: of its length [m]; radius [m]."""

    rod: int
    offset: float
    half: float
    radius: float


class Body:
    """The robot's shape, taken once from `robot.toml`: balls at the caps, and the rods and motors between them."""

    def __init__(self, robot: Robot) -> None:
        self.cap_radius = np.array([rod.cap_radius_m for rod in robot.rods for _ in range(2)])
        parts = []
        for i, rod in enumerate(robot.rods):
            parts.append(Part(i, 0.0, rod.length_m / 2, rod.radius_m))
            parts += [
                Part(i, lump.offset_m, lump.length_m / 2, lump.radius_m)
                for lump in rod.parts
                if lump.shape in ("cylinder", "tube") and lump.radius_m > rod.radius_m
            ]
        self.parts = tuple(parts)

    def nearest(self, x: np.ndarray, y: np.ndarray, p_C: np.ndarray, cap: int, margin: np.ndarray) -> np.ndarray:
        """Depth [m] at which rays (x, y, 1) meet what of the robot may hide cap `cap`; inf where they miss it.

        p_C: all caps [m] (cap, 3); one with a NaN is left out, and so are the parts of its rod. margin: by which each
        cap is taken for larger [m], (cap,), as its position is not exact; parts of rods by what lies between their
        caps'.
        """
        z = np.full(x.shape, np.inf)
        last = (x.shape[0] - 1, x.shape[1] - 1)
        slope = ((x[0, 0] + x[last]) / 2, (y[0, 0] + y[last]) / 2)
        reach = math.hypot(x[last] - x[0, 0], y[last] - y[0, 0]) / 2
        behind = float(p_C[cap, 2])
        for i, center in enumerate(p_C):
            radius = float(self.cap_radius[i] + margin[i])
            if i != cap and center[2] - radius < behind and _touches(center, radius, slope, reach):
                np.fmin(z, ball_depth(x, y, center, radius), out=z)
        for part in self.parts:
            even, odd = p_C[2 * part.rod], p_C[2 * part.rod + 1]
            along = odd - even
            length = math.sqrt(float(along @ along))
            if not length > 1e-6:
                continue
            share = 0.5 + part.offset / length
            spare = float((1 - share) * margin[2 * part.rod] + share * margin[2 * part.rod + 1])
            w = along / length
            middle = (even + odd) / 2 + part.offset * w
            half, radius = part.half + spare, part.radius + spare
            if part.half >= length / 2 - 1e-3:
                half = length / 2  # the rod itself ends in its caps
            nearest = middle[2] - half * abs(w[2]) - radius * math.sqrt(max(1 - w[2] ** 2, 0.0))
            if nearest < behind and _touches(middle, math.hypot(half, radius), slope, reach):
                np.fmin(z, _cylinder_depth(x, y, middle, w, half, radius), out=z)
        return z


def ball_depth(x: np.ndarray, y: np.ndarray, center: np.ndarray, radius: float) -> np.ndarray:
    """Depth z [m] of the near side of a ball along rays (x, y, 1), NaN where they miss it."""
    dd = x * x + y * y + 1.0
    dc = x * center[0] + y * center[1] + center[2]
    under = dc * dc - dd * (center @ center - radius**2)
    return np.asarray((dc - np.sqrt(np.where(under >= 0, under, np.nan))) / dd)


def _cylinder_depth(
    x: np.ndarray, y: np.ndarray, a: np.ndarray, w: np.ndarray, half: float, radius: float
) -> np.ndarray:
    """Depth z [m] of a closed cylinder about a along w, NaN where rays (x, y, 1) miss it."""
    aw = float(a @ w)
    dd = x * x + y * y + 1.0
    da = x * a[0] + y * a[1] + a[2]
    dw = x * w[0] + y * w[1] + w[2]
    across = np.maximum(dd - dw * dw, 1e-12)
    towards = da - dw * aw
    under = towards**2 - across * (a @ a - aw * aw - radius**2)
    z = (towards - np.sqrt(np.where(under >= 0, under, np.nan))) / across
    z[~(np.abs(z * dw - aw) <= half)] = np.nan
    end = aw - np.sign(aw) * half  # the end that faces the camera lies on its side of the middle
    if aw * end > 0:
        flat = end / np.where(np.abs(dw) > 1e-9, dw, np.nan)
        off = flat * flat * dd - 2 * flat * da + a @ a - (end - aw) ** 2
        z = np.fmin(z, np.where((flat > 0) & (off <= radius**2), flat, np.nan))
    return z


def _touches(center: np.ndarray, radius: float, slope: tuple[float, float], reach: float) -> bool:
    """Whether a ball may be seen within `reach` (in slope) of a direction; not where it is not known or too close."""
    x, y, z = (float(value) for value in center)
    if not z > radius + 0.02:
        return False
    off = math.hypot(x / z - slope[0], y / z - slope[1])
    return off < reach + (1.0 + (x * x + y * y) / z**2) * radius / (z - radius)
