"""The score of a piece: either the simulator errs as its floor says, or it errs far more, as where it tips over at
another instant. Which of the two is not known, so both are summed.

A piece has some 200 numbers, but a fall that comes too early is one mistake, not 200. So what a piece costs beyond what
noise makes of it counts fully only up to ENOUGH nats, and by its logarithm above: many pieces decide, not one.
"""

from __future__ import annotations

import numpy as np

FACTORS = (1.0, 1.0, 6.0, 50.0)
"""Of the kinds of pieces, on the floor. Those of the first kind begin where the piece before them ended, the others
anywhere near where they were seen."""
SHARES = (0.62, 0.22, 0.13, 0.03)
"""How many pieces are of each kind, before anything is seen."""
ENOUGH = 15.0
"""[nats]"""


def minus_log(squares: np.ndarray, logdet: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Cost (..., piece) [nats] of sums of squares (..., piece, kind) of numbers that are white under each kind. logdet
    (piece, kind): of its covariance; size (piece,): how many numbers are data."""
    at_least = usual(logdet, size)
    excess = density(squares, logdet) - at_least
    return np.asarray(at_least + np.where(excess > 0, ENOUGH * np.log1p(np.maximum(excess, 0.0) / ENOUGH), excess))


def weight(squares: np.ndarray, logdet: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Weight of each kind in re-weighted least squares, (..., piece, kind): its probability, less for pieces that cost
    much."""
    excess = density(squares, logdet) - usual(logdet, size)
    probability = np.exp(_terms(squares, logdet) + (excess + usual(logdet, size))[..., None])
    return np.asarray(probability / (1.0 + np.maximum(excess, 0.0) / ENOUGH)[..., None])


def usual(logdet: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Cost of a piece that errs as noise and floor say."""
    return np.asarray(0.5 * (size + logdet[..., 0]))


def density(squares: np.ndarray, logdet: np.ndarray) -> np.ndarray:
    """-log density (..., piece) itself: what the size of floor and noise are learned from."""
    return np.asarray(-np.logaddexp.reduce(_terms(squares, logdet), axis=-1))


def _terms(squares: np.ndarray, logdet: np.ndarray) -> np.ndarray:
    return np.asarray(np.log(SHARES) - 0.5 * (squares + logdet))
