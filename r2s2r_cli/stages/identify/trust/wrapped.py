"""A problem with other bounds or other observations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from r2s2r_cli.stages.identify.solve.problem import Evaluation, Problem


class Wrapped:
    """`problem` with its box replaced and `shift` (m,) added to its residuals: observations moved by -shift standard
    deviations. Evaluations are those of the problem, errors too."""

    def __init__(
        self,
        problem: Problem,
        *,
        lower: np.ndarray | None = None,
        upper: np.ndarray | None = None,
        shift: np.ndarray | float = 0.0,
    ) -> None:
        self.problem = problem
        self.names = problem.names
        self.lower = problem.lower if lower is None else lower
        self.upper = problem.upper if upper is None else upper
        self.prior_mean = problem.prior_mean
        self.prior_sd = problem.prior_sd
        self.shift = shift

    def evaluate(self, z: np.ndarray, *, jacobian: bool = True) -> Evaluation:
        """At z."""
        found = self.problem.evaluate(z, jacobian=jacobian)
        return replace(found, residual=found.residual + self.shift)
