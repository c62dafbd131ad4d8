"""What a population ended in, as a solution with the statistics that follow, and where else it might have been."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.residuals import CapResiduals
from r2s2r_cli.stages.identify.solve.linearised import cost_of
from r2s2r_cli.stages.identify.solve.loss import Loss
from r2s2r_cli.stages.identify.solve.population import Cooled, moving_of
from r2s2r_cli.stages.identify.solve.problem import Evaluation
from r2s2r_cli.stages.identify.solve.record import Counts, Reason, Solution, names_on_bound
from r2s2r_cli.stages.identify.trust.covariance import Covariance, covariance
from r2s2r_cli.stages.identify.trust.perturbed import perturbed
from r2s2r_cli.stages.identify.trust.posterior import posterior

MOST_UNKNOWNS = 16
"""With more, hardly any candidate drawn from a normal distribution counts by its weight."""
ROUNDING = 1e-10
"""Of a normal matrix with a diagonal of ones, ten thousand times that of its eigenvalues."""
AS_GOOD = 1.0
"""[nats per parameter, noise counted with the misfit] The mean of the posterior is taken where it costs no more than
that above the best candidate: it is the better estimate, unless it lies between two minima."""


@dataclass(frozen=True)
class Settled:
    """solution: at the mean of the posterior, or at the best candidate. drawn: covariance of the unknowns (n, n) as
    candidates showed it."""

    solution: Solution
    drawn: np.ndarray


def settle(
    problem: CapResiduals, cooled: Cooled, loss: Loss, *, seed: int, generations: int, others: Sequence[np.ndarray] = ()
) -> Settled:
    """generations: that were allowed. others: unknowns where other ways ended that are about as good.

    Candidates about the best say how far it may lie, by their weights, or with many unknowns by fits of perturbed
    observations. Ends of ways show where else it may lie: their scatter comes to that, and so does how far the mean of
    the candidates is from what is reported. Raises NumericalError where the mean cannot be simulated.
    """
    own = solution_at(problem, cooled.z, cooled, loss, generations)
    inflation = spread_of(problem, own, loss).inflation
    moving = moving_of(problem)
    narrow = np.zeros_like(cooled.normal)
    narrow[np.ix_(moving, moving)] = _inverse(cooled.normal[np.ix_(moving, moving)])
    if not len(moving):
        return Settled(own, narrow)
    look = posterior if len(moving) <= MOST_UNKNOWNS else perturbed
    found = look(problem, cooled.z, narrow, loss=loss, temperature=inflation, seed=seed)
    best = cooled.z if cooled.cost <= found.cost else found.best
    lowest = min(cooled.cost, found.cost)
    mean = np.clip(found.mean, problem.lower, problem.upper)
    solution = solution_at(problem, mean, cooled, loss, generations)
    if solution.cost > lowest + AS_GOOD * inflation * len(problem.names):
        solution = solution_at(problem, best, cooled, loss, generations)
    ends = np.array([cooled.z, *others]) - np.mean([cooled.z, *others], axis=0)
    off = found.mean - solution.z
    return Settled(solution, found.covariance + ends.T @ ends / max(len(others), 1) + np.outer(off, off))


def _inverse(normal: np.ndarray) -> np.ndarray:
    """Of a normal matrix (n, n), scaled by its diagonal: rounding does not leave it indefinite."""
    size = np.sqrt(np.diag(normal))
    found = np.linalg.inv(normal / np.outer(size, size) + ROUNDING * np.eye(len(normal))) / np.outer(size, size)
    return np.asarray(0.5 * (found + found.T))


def spread_of(problem: CapResiduals, solution: Solution, loss: Loss, drawn: np.ndarray | None = None) -> Covariance:
    """Covariance of the parameters, residuals of a target interval counted together; no less than what was drawn."""
    return covariance(
        problem, solution, problem.frees, loss=loss, block=problem.block, cluster=problem.cluster,
        drawn=drawn,
    )  # fmt: skip


def solution_at(problem: CapResiduals, z: np.ndarray, cooled: Cooled, loss: Loss, generations: int) -> Solution:
    """The solution at z (n,) with the slopes that the last population saw."""
    residual = problem.evaluate(z, jacobian=False).residual
    cost, weight = cost_of(problem, z, Evaluation(residual, None, problem.block), loss)
    weighted = cooled.jacobian * weight[:, None]
    normal = weighted.T @ cooled.jacobian
    precision = problem.prior_sd**-2.0
    return Solution(
        z=z, cost=cost, costs=cooled.costs, residual=residual, jacobian=cooled.jacobian, weight=weight,
        normal_data=normal, normal=normal + np.diag(precision),
        gradient=weighted.T @ residual + precision * (z - problem.prior_mean),
        reason=Reason.COOLED if cooled.generations < generations else Reason.ITERATIONS,
        iterations=cooled.generations, counts=Counts(plain=cooled.evaluations),
        on_bound=names_on_bound(z, problem.lower, problem.upper, problem.names),
    )  # fmt: skip
