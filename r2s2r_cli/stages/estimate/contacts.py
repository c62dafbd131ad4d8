"""Which caps touch the ground, as far as heights and vertical speeds can tell."""

from __future__ import annotations

import numpy as np

SUPPORT = 3
"""Caps that a robot at rest stands on."""
MAX_HEIGHT_ERROR = 0.010
"""[m] Trackers of this robot are accurate to 10 mm (Lu et al. 2022). Where the third lowest cap is higher, the robot
does not stand on three, and its height says nothing about the tracker."""
HIGH, LOW = 0.5, 0.2
"""A contact begins where it is likelier than not, and holds on to both sides while its probability stays above LOW, so
that one noisy frame does not break it."""


def height_error(height: np.ndarray) -> float | None:
    """How far the heights themselves can be trusted [m]: the usual height of the third lowest cap.

    height: of the caps above the ground [m], shape (frame, cap). A robot that is not falling stands on three caps, so
    in most frames the third lowest one touches; where a tracker shows it higher, that is the tracker's error, which no
    smoothing takes away. With fewer than three caps, the highest one counts. None where the robot does not stand on
    three.
    """
    third = np.sort(height, axis=1)[:, min(SUPPORT, height.shape[1]) - 1]
    error = max(float(np.median(third)), 0.0)
    return error if error <= MAX_HEIGHT_ERROR else None


def contact_probability(
    height: np.ndarray, height_sd: np.ndarray, speed: np.ndarray, speed_sd: np.ndarray, *, clearance: float, lift: float
) -> np.ndarray:
    """Probability that a cap is lower than `clearance` and moves up or down slower than `lift`, Gaussian in both.

    height: of the lowest point of the cap above the ground [m]; speed: of the cap, vertical [m/s]; both with their
    standard deviation (that of the height with `height_error`); any shape. The two probabilities are multiplied as if
    the errors of height and vertical speed were independent. They are not quite: one smoother makes both, and their
    correlation is left out. This says nothing about force: a cap that hovers 1 mm above the floor looks the same as one
    that carries the robot.
    """
    from scipy.special import ndtr

    low = ndtr((clearance - height) / height_sd)
    still = ndtr((lift - speed) / speed_sd) - ndtr((-lift - speed) / speed_sd)
    return np.asarray(low * still)


def contacts(probability: np.ndarray) -> np.ndarray:
    """Contact flags from probabilities, shape (frame, cap): hysteresis that works alike in both directions of time.

    A stretch of frames above LOW is a contact if it holds at least one frame above HIGH.
    """
    flags = np.zeros(probability.shape, dtype=bool)
    for cap in range(probability.shape[1]):
        above = probability[:, cap] > LOW
        edges = np.flatnonzero(np.diff(np.concatenate([[False], above, [False]]).astype(np.int8)))
        for start, stop in edges.reshape(-1, 2):
            flags[start:stop, cap] = bool(np.any(probability[start:stop, cap] > HIGH))
    return flags
