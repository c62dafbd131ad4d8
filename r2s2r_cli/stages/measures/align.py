"""Planar alignment: the move over the ground (x, y, yaw) that brings one set of end caps closest to another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PlanarMove:
    """p -> R p + t with R a turn about the vertical and t horizontal: height and tilt stay as they are.

    yaw [rad]; translation (3,) [m], its z is 0.
    """

    yaw: float
    translation: np.ndarray

    @property
    def rotation(self) -> np.ndarray:
        """The turn about z, (3, 3)."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def move(self, p: np.ndarray) -> np.ndarray:
        """Points (..., 3) [m], moved."""
        return self.turn(p) + self.translation

    def turn(self, d: np.ndarray) -> np.ndarray:
        """Displacements (..., 3), turned."""
        return d @ self.rotation.T


def planar(source: np.ndarray, onto: np.ndarray) -> PlanarMove:
    """The planar move of `source` that leaves the least sum of squares to `onto`, both (cap, 3) [m].

    Closed form of Kabsch's problem in the plane: of centred coordinates, tan(yaw) = sum of cross over sum of dot
    products. Where the caps have no extent in the plane every yaw is as good, and 0 is returned.
    """
    a, b = source[:, :2] - source[:, :2].mean(axis=0), onto[:, :2] - onto[:, :2].mean(axis=0)
    cross = float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    move = PlanarMove(float(np.arctan2(cross, float(np.sum(a * b)))), np.zeros(3))
    shift = onto.mean(axis=0) - move.turn(source.mean(axis=0))
    return PlanarMove(move.yaw, np.array([shift[0], shift[1], 0.0]))
