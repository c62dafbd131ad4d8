"""A problem with one of its unknowns held."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.identify.solve.population import Population
from r2s2r_cli.stages.identify.solve.problem import Evaluation, Problem


class HeldAt:
    """`problem` with unknown `index` at a value, as bounds that leave it nowhere else to go. Its prior still counts;
    evaluations are those of the problem, errors too."""

    def __init__(self, problem: Problem, index: int, at: float) -> None:
        self.problem = problem
        self.names = problem.names
        self.lower, self.upper = problem.lower.copy(), problem.upper.copy()
        self.lower[index] = self.upper[index] = at
        self.prior_mean = problem.prior_mean
        self.prior_sd = problem.prior_sd

    def evaluate(self, z: np.ndarray, *, jacobian: bool = True) -> Evaluation:
        """At z."""
        return self.problem.evaluate(z, jacobian=jacobian)


class PopulationHeldAt(HeldAt):
    """The same of a problem whose residuals can be had for many points at once."""

    def __init__(self, problem: Population, index: int, at: float) -> None:
        super().__init__(problem, index, at)
        self._residuals = problem.residuals
        self.block = problem.block

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Residuals (k, m) at points (k, n)."""
        return self._residuals(z)
