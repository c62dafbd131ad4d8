"""The analysis step of an ensemble Kalman filter: how what is seen moves and narrows a set of simulated members.

The deterministic transform form with the symmetric square root (Bishop, Etherton and Majumdar 2001; Hunt, Kostelich and
Szunyogh 2007): nothing is drawn, and the mean and the covariance of the members become exactly those of the Kalman
update with the covariance that the members had.
"""

from __future__ import annotations

import numpy as np


def analysis(
    deviation: np.ndarray, seen: np.ndarray, innovation: np.ndarray, variance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Shift of the mean (n,) and the members' deviations from the shifted mean (E, n).

    deviation: of the members from their mean, (E, n), sums 0; seen: the same of what each member predicts for the
    sensor, (E, m); innovation: sensor minus mean prediction, (m,); variance: of the sensor's independent errors, (m,);
    infinite where the sensor says nothing.
    """
    # In the space of the sensor, which is smaller: (1 + A A^T)^(-1/2) = 1 - A V g V^T A^T with A^T A = V value V^T.
    scale = np.sqrt(variance * (len(deviation) - 1))
    a = seen / scale
    value, vector = np.linalg.eigh(a.T @ a)
    root = np.sqrt(1 + np.maximum(value, 0.0))
    along = vector.T @ (a.T @ deviation)
    shift = (vector.T @ (innovation / np.sqrt(variance)) / root**2) @ along / np.sqrt(len(deviation) - 1)
    return shift, deviation - a @ (vector @ (along / (root * (root + 1))[:, None]))


def student_weights(innovation: np.ndarray, seen: np.ndarray, variance: np.ndarray, dof: float) -> np.ndarray:
    """Weights (cap,) in (0, 1] of observed points with Student t errors: what a point's precision is multiplied by.

    innovation: (cap, 3) of each point; seen: the members' deviations of the predicted points, (E, cap, 3); variance:
    of the sensor, (cap, 3). A point counts in full as long as both together explain how far it is off.
    """
    covariance = np.einsum("eci,ecj->cij", seen, seen) / (len(seen) - 1)
    covariance[:, range(3), range(3)] += variance
    off = np.einsum("ci,ci->c", innovation, np.linalg.solve(covariance, innovation[..., None])[..., 0])
    return np.minimum((dof + 3) / (dof + off), 1.0)


def centred(rng: np.random.Generator, members: int, size: int) -> np.ndarray:
    """Standard normal draws (members, size) less their mean: members that scatter, about where they were."""
    draws = rng.standard_normal((members, size))
    return np.asarray(draws - draws.mean(axis=0))
