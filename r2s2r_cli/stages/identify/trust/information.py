"""What data say about parameters when everything else is free: normal matrices with the nuisances marginalised."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.solve.problem import Problem

RELATIVE_ZERO = 1e-12
"""Eigenvalues of a scaled normal matrix below this share of the largest are rounding, not information."""
LOGISTIC_SD = math.pi / math.sqrt(3.0)
"""Standard deviation of the logit of a number that is uniform between its bounds."""


def widths(problem: Problem, frees: Sequence[Free]) -> np.ndarray:
    """What is thought possible before the data, as a standard deviation in z, (p,): a change that matters.

    The smaller of the prior's and that of the bounds, taken as uniform in z (their distance / sqrt(12); for a logit
    coordinate uniform in the value). Without either: a factor e in a log coordinate, else the start's own size.
    """
    found = np.empty(len(problem.names))
    for i, free in enumerate(frees):
        low, high = float(problem.lower[i]), float(problem.upper[i])
        if math.isfinite(high - low):
            box = (high - low) / math.sqrt(12.0)
        elif free.coordinate is Coordinate.LINEAR:
            box = abs(free.start) or 1.0
        else:
            box = LOGISTIC_SD if free.coordinate is Coordinate.LOGIT else 1.0
        found[i] = min(box, float(problem.prior_sd[i]))
    return found


def held(problem: Problem) -> np.ndarray:
    """(n,) bool: unknowns that cannot move, because their bounds are equal or their prior has no width."""
    fixed: np.ndarray = (problem.lower >= problem.upper) | (problem.prior_sd <= 0)
    return fixed


def precision(problem: Problem) -> np.ndarray:
    """Of the priors, (n,): 0 where flat, and where an unknown is held (it takes no part)."""
    sd = np.where(held(problem), np.inf, problem.prior_sd)
    found: np.ndarray = sd**-2.0
    return found


def marginal(normal: np.ndarray, p: int) -> np.ndarray:
    """Normal matrix (p, p) of the first p unknowns of `normal` (n, n), all others free: the Schur complement.

    Others that nothing constrains, or that cannot be told apart, take what they can explain and no more.
    """
    across = normal[:p, p:]
    if across.shape[1] == 0:
        return normal.copy()
    reduced = normal[:p, :p] - across @ inverse(normal[p:, p:]) @ across.T
    found: np.ndarray = 0.5 * (reduced + reduced.T)
    return found


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Of a symmetric matrix that is nowhere negative, scaled by its diagonal; directions without information get 0."""
    if matrix.shape[0] == 0:
        return matrix.copy()
    size = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    size[size == 0.0] = 1.0
    value, vector = np.linalg.eigh(matrix / np.outer(size, size))
    known = value > RELATIVE_ZERO * max(float(value[-1]), 0.0)
    part = vector[:, known] / size[:, None]
    found: np.ndarray = (part / value[known]) @ part.T
    return found


def spectrum(scaled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues, rising, rounding cut to 0, and eigenvectors as rows, largest component positive."""
    value, vector = np.linalg.eigh(scaled)
    value = np.where(value > RELATIVE_ZERO * max(float(value[-1]), 0.0), value, 0.0)
    rows = vector.T.copy()
    largest = np.argmax(np.abs(rows), axis=1)
    rows *= np.sign(rows[np.arange(len(rows)), largest])[:, None]
    return value, rows


def sd_flat(value: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Standard deviation of each coordinate (p,) with all others free and no priors; inf where the data say nothing."""
    share = rows**2
    known = value > 0
    variance = (share[known] / value[known, None]).sum(axis=0)
    found: np.ndarray = np.sqrt(np.where(share[~known].sum(axis=0) > RELATIVE_ZERO, np.inf, variance))
    return found


def sd_given_others(scaled: np.ndarray) -> np.ndarray:
    """Standard deviation of each coordinate (p,) from data, itself flat and the others within 1 of where they were.

    The posterior variance c of a coordinate under unit priors on all holds its own prior's precision 1: the rest,
    1/c - 1, is what the data say.
    """
    c = np.diag(np.linalg.inv(scaled + np.eye(len(scaled))))
    own = np.maximum(1.0 / c - 1.0, 0.0)
    # Below, the difference is rounding of a number of size 1.
    found: np.ndarray = np.where(own > RELATIVE_ZERO, 1.0 / np.sqrt(np.maximum(own, RELATIVE_ZERO)), np.inf)
    return found
