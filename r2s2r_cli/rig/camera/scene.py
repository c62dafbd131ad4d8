"""What stands before the camera: the robot's caps, rods and motors, and whatever gets in the way, as simple solids."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.rig.camera.settings import CameraSettings, Occluder
from schemas.robot import HsvRange, Robot

DARK = (58, 58, 64)
"""Rods, motors, housings: anodised and black plastic."""
_HUES = (172.5, 69.0, 111.5, 20.0, 145.0, 90.0)
"""OpenCV hues of rods that `robot.toml` gives no colour: red, green, blue first."""
_SATURATION = 0.85
_THIN = 1e-4
"""A part of a smaller radius [m] is not seen."""


@dataclass(frozen=True)
class Solids:
    """Spheres and cylinders in one frame. Spheres come first: solid i < len(center) is a sphere.

    center (sphere, 3), radius (sphere,) [m]; middle, axis (unit) (cylinder, 3), half length, girth (radius) (cylinder,)
    [m]; rgb 0 .. 255 (solid, 3).
    """

    center: np.ndarray
    radius: np.ndarray
    middle: np.ndarray
    axis: np.ndarray
    half: np.ndarray
    girth: np.ndarray
    rgb: np.ndarray

    def seen_from(self, X_WC: np.ndarray) -> Solids:
        """The same in the camera's frame, given in the world."""
        R_CW, p_WC = X_WC[:3, :3].T, X_WC[:3, 3]
        return Solids((self.center - p_WC) @ R_CW.T, self.radius, (self.middle - p_WC) @ R_CW.T, self.axis @ R_CW.T,
                      self.half, self.girth, self.rgb)  # fmt: skip


class Scene:
    """The robot's shape, taken once from `robot.toml`; `solids` puts it where its caps are."""

    def __init__(self, robot: Robot, settings: CameraSettings) -> None:
        self._occluders = settings.occluders
        colors = {color.rod: color for color in robot.colors}
        cap_rgb, cap_radius, self._parts = [], [], []
        for i, rod in enumerate(robot.rods):
            rgb = cap_color(colors.get(rod.name), i, settings.cap_value)
            cap_rgb += [rgb, rgb]
            cap_radius += [rod.cap_radius_m] * 2
            self._parts.append((i, 0.0, rod.length_m / 2, rod.radius_m))
            for part in rod.parts:
                if part.shape in ("cylinder", "tube") and part.radius_m > max(_THIN, rod.radius_m):
                    self._parts.append((i, part.offset_m, part.length_m / 2, part.radius_m))
        self._cap_rgb, self._cap_radius = np.array(cap_rgb, dtype=float), np.array(cap_radius)
        self._rod = np.array([part[0] for part in self._parts])
        self._offset, self._half, self._girth = (np.array([part[k] for part in self._parts]) for k in (1, 2, 3))

    def solids(self, p_WE: np.ndarray, t: float) -> Solids:
        """Everything in the world frame; p_WE: cap centres [m], (cap, 3); t: rig time [s], for what gets in the way.

        Rods are round: their roll cannot be seen, and two caps say where all of a rod is.
        """
        even, odd = p_WE[0::2], p_WE[1::2]
        along = odd - even
        z_R = along / np.maximum(np.linalg.norm(along, axis=1), 1e-12)[:, None]
        middle = ((even + odd) / 2)[self._rod] + self._offset[:, None] * z_R[self._rod]
        there = [o for o in self._occluders if o.from_s <= t and (o.until_s is None or t < o.until_s)]
        balls, bars = _capsules(there, t)
        rgb = [self._cap_rgb, balls[2], np.tile(np.array(DARK, dtype=float), (len(middle), 1)), bars[4]]
        return Solids(
            np.concatenate([p_WE, balls[0]]), np.concatenate([self._cap_radius, balls[1]]),
            np.concatenate([middle, bars[0]]), np.concatenate([z_R[self._rod], bars[1]]),
            np.concatenate([self._half, bars[2]]), np.concatenate([self._girth, bars[3]]), np.concatenate(rgb),
        )  # fmt: skip


def cap_color(color: HsvRange | None, rod: int, value: float) -> tuple[float, float, float]:
    """RGB 0 .. 255 in full light: the middle of the range of `robot.toml`, or red, green, blue by number."""
    hue = _HUES[rod % len(_HUES)]
    if color is not None:
        low, high = color.hue
        hue = (low + (high - low + (180.0 if low > high else 0.0)) / 2) % 180.0
    r, g, b = colorsys.hsv_to_rgb(hue / 180.0, _SATURATION, value)
    return (255 * r, 255 * g, 255 * b)


def _capsules(occluders: list[Occluder], t: float) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Two balls each, and the cylinder between them where they are apart."""
    center, radius, ball_rgb = [], [], []
    bars: list[tuple[np.ndarray, np.ndarray, float, float, tuple[int, int, int]]] = []
    for occluder in occluders:
        gone = np.array(occluder.v_m_per_s) * (t - occluder.from_s)
        a, b = np.array(occluder.a_m) + gone, np.array(occluder.b_m) + gone
        length = float(np.linalg.norm(b - a))
        ends = [a, b] if length > 0 else [a]
        center += ends
        radius += [occluder.radius_m] * len(ends)
        ball_rgb += [occluder.rgb] * len(ends)
        if length > 0:
            bars.append(((a + b) / 2, (b - a) / length, length / 2, occluder.radius_m, occluder.rgb))
    balls = (np.reshape(np.array(center, dtype=float), (-1, 3)), np.array(radius, dtype=float),
             np.reshape(np.array(ball_rgb, dtype=float), (-1, 3)))  # fmt: skip
    lists = [[bar[k] for bar in bars] for k in range(5)]
    sizes: tuple[tuple[int, ...], ...] = ((-1, 3), (-1, 3), (-1,), (-1,), (-1, 3))
    return balls, tuple(np.reshape(np.array(x, dtype=float), size) for x, size in zip(lists, sizes, strict=True))
