"""What a solver sees of a fit: unknowns with bounds and priors, and residuals with their derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

HELD = 1e-6
"""An unknown with a narrower prior does not move."""


@dataclass(frozen=True)
class Evaluation:
    """Residuals at one point.

    residual: (m,), each divided by its standard deviation, priors not included. jacobian: d residual / d z, (m, n);
    None where it was not asked for. block: (m,) int, residuals with one number share one robust weight (the three axes
    of one cap at one frame).
    """

    residual: np.ndarray
    jacobian: np.ndarray | None
    block: np.ndarray


class Problem(Protocol):
    """Unknowns z (n,): coordinates of the parameters first, then nuisances (start states of training windows).

    names: of the parameters, the first len(names) unknowns. lower, upper: box (n,), infinite where there is none.
    prior_mean, prior_sd: normal priors (n,), sd inf where flat.
    """

    names: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    prior_mean: np.ndarray
    prior_sd: np.ndarray

    def evaluate(self, z: np.ndarray, *, jacobian: bool = True) -> Evaluation:
        """Residuals at z. Raises NumericalError where the simulation is not finite: a step to be refused."""
        ...


def still_of(problem: Problem) -> np.ndarray:
    """Which of the parameters do not move since they are held, ascending: they stay where they are to the last bit."""
    found: np.ndarray = np.flatnonzero(problem.prior_sd[: len(problem.names)] <= HELD)
    return found
