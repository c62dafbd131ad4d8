"""The quadratic that stands for the cost near one point, and its damped minimum inside a box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.solve.loss import Loss, robust_sum
from r2s2r_cli.stages.identify.solve.problem import Evaluation, Problem

SCALE_FLOOR = 1e-12
"""Least diagonal of the scaling, as a share of the greatest: keeps unknowns that nothing constrains in place."""
LARGEST = 1e150
"""Of residuals and derivatives: beyond, squares leave the finite numbers. A simulation that explodes comes by here."""


@dataclass(frozen=True)
class Linearised:
    """Cost, gradient (n,) and re-weighted normal matrix (n, n) at z, with and without priors."""

    z: np.ndarray
    cost: float
    gradient: np.ndarray
    normal: np.ndarray
    normal_data: np.ndarray
    weight: np.ndarray
    evaluation: Evaluation

    def frozen(self, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """(n,) bool: on a bound, and the cost falls outwards."""
        fixed: np.ndarray = ((self.z <= lower) & (self.gradient >= 0)) | ((self.z >= upper) & (self.gradient <= 0))
        return fixed

    def scale(self) -> np.ndarray:
        """Marquardt's scaling (n,): roots of the diagonal of the normal matrix, priors included, with a floor."""
        diagonal = np.diag(self.normal)
        floor = SCALE_FLOOR * float(diagonal.max(initial=0.0))
        return np.sqrt(np.maximum(diagonal, floor if floor > 0 else 1.0))

    def step(self, damping: float, lower: np.ndarray, upper: np.ndarray) -> np.ndarray | None:
        """Minimum of the damped quadratic in the box (n,), or None where the matrix is not positive definite.

        Unknowns that the step would carry over a bound are set on it, and the others are solved again with that known.
        """
        scale = self.scale()
        moving = ~self.frozen(lower, upper)
        step = np.zeros_like(self.z)
        while moving.any():
            at = np.flatnonzero(moving)
            pull = self.gradient[at] + self.normal[np.ix_(at, ~moving)] @ step[~moving]
            part = solve_scaled(self.normal[np.ix_(at, at)], -pull, scale[at], damping)
            if part is None:
                return None
            step[at] = part
            low, high = (lower - self.z)[at], (upper - self.z)[at]
            over = (part <= low) | (part >= high)
            step[at] = np.clip(part, low, high)
            if not over.any():
                break
            moving[at[over]] = False
        return step

    def decrease(self, step: np.ndarray) -> float:
        """How far the quadratic falls along a step."""
        return float(-(self.gradient @ step + 0.5 * step @ self.normal @ step))

    def length(self, step: np.ndarray) -> float:
        """The step in posterior standard deviations: no combination of unknowns moves by more of its own."""
        return float(np.sqrt(max(step @ self.normal @ step, 0.0)))


def solve_scaled(matrix: np.ndarray, right: np.ndarray, scale: np.ndarray, damping: float) -> np.ndarray | None:
    """(S^-1 matrix S^-1 + damping 1) S x = S^-1 right by Cholesky; None where that is not positive definite."""
    from scipy.linalg import LinAlgError, cho_factor, cho_solve

    scaled = matrix / np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += damping
    try:
        x: np.ndarray = cho_solve(cho_factor(scaled, lower=True, check_finite=False), right / scale, check_finite=False)
    except LinAlgError:
        return None
    return x / scale if np.all(np.isfinite(x)) else None


def cost_of(problem: Problem, z: np.ndarray, evaluation: Evaluation, loss: Loss) -> tuple[float, np.ndarray]:
    """Half the robust sum plus half the squared prior residuals, and the weights (m,).

    Raises NumericalError where a residual is not finite, or so large that its square is not.
    """
    if not np.all(np.abs(evaluation.residual) < LARGEST):
        raise not_finite("a residual of the fit is not finite", evaluation.residual)
    total, weight = robust_sum(loss, evaluation)
    prior = (z - problem.prior_mean)[np.isfinite(problem.prior_sd)] / problem.prior_sd[np.isfinite(problem.prior_sd)]
    return 0.5 * (total + float(prior @ prior)), weight


def linearise(problem: Problem, z: np.ndarray, loss: Loss) -> Linearised:
    """Evaluate with the Jacobian and form the normal equations. Raises NumericalError where anything is not finite."""
    evaluation = problem.evaluate(z, jacobian=True)
    cost, weight = cost_of(problem, z, evaluation, loss)
    jacobian = evaluation.jacobian
    if jacobian is None or not np.all(np.abs(jacobian) < LARGEST):
        raise not_finite("a derivative of the fit is not finite", np.array([]) if jacobian is None else jacobian)
    weighted = jacobian * weight[:, None]
    normal_data = weighted.T @ jacobian
    normal_data = 0.5 * (normal_data + normal_data.T)
    precision = problem.prior_sd**-2.0
    pull = np.where(precision > 0, precision * np.where(precision > 0, z - problem.prior_mean, 0.0), 0.0)
    gradient = weighted.T @ evaluation.residual + pull
    return Linearised(z, cost, gradient, normal_data + np.diag(precision), normal_data, weight, evaluation)


def not_finite(what: str, values: np.ndarray) -> NumericalError:
    """The error of a point where the simulation left the finite numbers."""
    bad = int(np.count_nonzero(~(np.abs(values) < LARGEST)))
    return NumericalError(what, expected="finite numbers", received=f"{bad} of {values.size} are not",
                          hint="start nearer to the robot, or narrow the bounds: r2s2r identify --help")  # fmt: skip
