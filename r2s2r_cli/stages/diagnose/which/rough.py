"""Simulations at a few points close together, because one alone is luck.

Contacts make what is simulated rough: a thousandth more friction, and a cap that slipped sticks. One simulation of a
piece is then worth some nats more or less than its neighbours, 20 in a set with nothing wrong. So it is made at points
that lie closer together than the numbers are known, each brought back along the derivatives: what differs is roughness.
Log densities are averaged, not densities: the mean of those is about the luckiest one, and as much luck as one alone.
"""

from __future__ import annotations

import numpy as np

DRAWS, JITTER = 6, 0.3
"""Points, the first where the middle is; how far from it the others are, in the sd of the numbers."""


def root_of(precision: np.ndarray) -> np.ndarray:
    """Of the covariance, (n, n): root @ root.T = inverse of the precision."""
    value, vector = np.linalg.eigh(precision)
    return np.asarray(vector / np.sqrt(np.maximum(value, 1e-12 * value.max())))


def around(middle: np.ndarray, root: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The middle (n,) and the other points, within bounds, (DRAWS, n); the same ones whenever it is asked."""
    drawn = np.random.default_rng(0).standard_normal((DRAWS - 1, len(middle)))
    return np.clip(np.concatenate([middle[None], middle + JITTER * drawn @ root.T]), lower, upper)
