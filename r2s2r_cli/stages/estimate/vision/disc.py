"""The disc as which a ball is seen.

A ball about c is seen under the cone of half angle asin(r / |c|) about c, so in slopes about the direction of c its rim
is a circle wherever it lies in the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class Disc:
    """The disc of a ball as rays see it. E (3, 3): columns across, across, along the line of sight, in frame C.
    D: distance of the centre [m]. a, b: slopes of the rays about its direction, rho: their length, each of the rays'
    shape. rim: radius of the disc, as a slope."""

    E: np.ndarray
    D: float
    a: np.ndarray
    b: np.ndarray
    rho: np.ndarray
    rim: float

    @classmethod
    def of(cls, center: np.ndarray, radius: float, x: np.ndarray, y: np.ndarray) -> Disc:
        """Of a ball at `center` [m] (3,) of this radius [m], for rays (x, y, 1) of frame C."""
        D = float(np.linalg.norm(center))
        along = center / D
        across = np.hypot(along[0], along[2])
        i, k = along[2] / across, -along[0] / across
        E = np.array([
            [i, along[1] * k, along[0]], [0.0, along[2] * i - along[0] * k, along[1]], [k, -along[1] * i, along[2]]
        ])  # fmt: skip
        q = x * along[0] + y * along[1] + along[2]
        a = (x * E[0, 0] + y * E[1, 0] + E[2, 0]) / q
        b = (x * E[0, 1] + y * E[1, 1] + E[2, 1]) / q
        return cls(E, D, a, b, np.hypot(a, b), radius / float(np.sqrt(max(D * D - radius**2, 1e-9))))
