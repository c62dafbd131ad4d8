"""Where a resting robot stands, in which direction, and as which of its symmetric selves.

A pose is mapped to the reference pose (at rest, principal axis along x, centre above the origin) by the symmetry and
the motion over the ground (a shift, a turn about the vertical) after which its end caps lie closest to those of the
reference: paper, section "Developing Policies with Symmetry Reduction". The turns of a symmetry about the principal
axis give the triangles of one type, its half-turns those of the other: after a half-turn the principal axis points the
other way, which is the paper's turn by pi about the ground normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.plan.symmetry import SymmetryGroup, principal_axis, support_caps

LYING = 0.05
"""Least horizontal part of the mean of unit rod axes that has a direction over the ground."""


@dataclass(frozen=True)
class Placement:
    """Poses in the terms of the reference, one a row.

    element: symmetry of the group that the robot has undergone, (B,): it now stands on the triangle where that takes
    the reference's. xy: where the reference's origin has come [m], (B, 2); yaw: its turn about the vertical [rad],
    (B,). error: root mean square distance of the caps from the reference moved there [m], (B,).
    """

    element: np.ndarray
    xy: np.ndarray
    yaw: np.ndarray
    error: np.ndarray


@dataclass(frozen=True)
class Reference:
    """The reference pose. p: caps (cap, 3) [m], principal axis along x, centroid above the origin; group: symmetries of
    the robot; origin, angle: where it was taken from: its place [m] (2,) and direction [rad] in the world."""

    p: np.ndarray
    group: SymmetryGroup
    origin: np.ndarray
    angle: float

    @property
    def support(self) -> tuple[int, ...]:
        """The triangle that it stands on."""
        return support_caps(self.p)

    def axis_angles(self) -> np.ndarray:
        """Direction of the principal axis over the ground [rad] of the reference after each symmetry, (element,)."""
        axis = self._axes()
        return np.asarray(np.arctan2(axis[:, 1], axis[:, 0]))

    def upright(self) -> int:
        """After how many symmetries the principal axis has no such direction: what a gait turns by is not known when it
        ends there. None of a prism's; a robot of six bars has some."""
        axis = self._axes()
        return int((np.hypot(axis[:, 0], axis[:, 1]) < LYING).sum())

    def _axes(self) -> np.ndarray:
        return principal_axis(np.stack([self.p[np.argsort(element.caps)] for element in self.group.elements]))

    def place(self, p_WE: np.ndarray) -> Placement:
        """The placement of poses p_WE (B, cap, 3) [m]."""
        shown = np.asarray(p_WE)[:, self.group.caps()]  # (B, element, cap, 3): cap i of the reference is played by this
        centre = shown[..., :2].mean(axis=2)
        a, b = self.p[:, :2] - self.p[:, :2].mean(axis=0), shown[..., :2] - centre[:, :, None]
        sine = (a[:, 0] * b[..., 1] - a[:, 1] * b[..., 0]).sum(axis=-1)
        yaw = np.arctan2(sine, (a * b).sum(axis=(-1, -2)))
        moved = turned(a, yaw[..., None])
        left = ((moved - b) ** 2).sum(axis=(-1, -2)) + ((shown[..., 2] - self.p[:, 2]) ** 2).sum(axis=-1)
        best, row = left.argmin(axis=1), np.arange(len(shown))
        shift = turned(self.p[:, :2].mean(axis=0), yaw[row, best])
        error = np.sqrt(left[row, best] / shown.shape[2])
        return Placement(best, centre[row, best] - shift, yaw[row, best], error)


def reference_of(p_WE: np.ndarray, group: SymmetryGroup) -> Reference:
    """The reference from a resting pose (cap, 3) [m]. Raises InputError where its principal axis stands upright."""
    p_WE = np.asarray(p_WE, dtype=float)
    axis = principal_axis(p_WE)
    if float(np.hypot(axis[0], axis[1])) < LYING:
        raise InputError(
            "the mean of the rods' axes has no direction in the ground plane: nothing to turn or roll about",
            where="robot.toml: rest_caps_m", expected="a principal axis that lies", received=f"({axis[0]:.3g}, "
            f"{axis[1]:.3g}, {axis[2]:.3g})", hint="rest the robot on another triangle in robot.toml",
        )  # fmt: skip
    angle, origin = float(np.arctan2(axis[1], axis[0])), p_WE[:, :2].mean(axis=0)
    flat = turned(p_WE[:, :2] - origin, -angle)
    return Reference(np.concatenate([flat, p_WE[:, 2:]], axis=1), group, origin, angle)


def turned(xy: np.ndarray, yaw: np.ndarray | float) -> np.ndarray:
    """Points xy (..., 2) turned by yaw (...) about the vertical; both are broadcast."""
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = xy[..., 0], xy[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles [rad] in (-pi, pi]."""
    return np.asarray(-((-np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi))
