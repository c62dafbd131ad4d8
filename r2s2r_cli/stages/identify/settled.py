"""What a population ended in, as a solution with the statistics that follow, and where else it might have been."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.residuals import CapResiduals
from r2s2r_cli.stages.identify.solve.linearised import cost_of
from r2s2r_cli.stages.identify.solve.loss import Loss
from r2s2r_cli.stages.identify.solve.population import Cooled
from r2s2r_cli.stages.identify.solve.problem import Evaluation
from r2s2r_cli.stages.identify.solve.record import Counts, Reason, Solution, names_on_bound
from r2s2r_cli.stages.identify.trust.covariance import Covariance, covariance
from r2s2r_cli.stages.identify.trust.posterior import posterior

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

    Ends of ways show where else the best may lie: their scatter comes to what was drawn about the best, and, with too
    many unknowns to draw for, to the curvature that the population saw, as flat as its last draw was rough. Raises
    NumericalError where the mean cannot be simulated.
    """
    own = solution_at(problem, cooled.z, cooled, loss, generations)
    inflation = spread_of(problem, own, loss).inflation
    narrow = np.linalg.inv(cooled.normal)
    found = posterior(problem, cooled.z, narrow, loss=loss, temperature=inflation, seed=seed)
    off = np.array([cooled.z, *others]) - np.mean([cooled.z, *others], axis=0)
    scatter = off.T @ off / max(len(others), 1)
    if found is None:
        return Settled(own, inflation * max(cooled.rough, 1.0) * narrow + scatter)
    best = cooled.z if cooled.cost <= found.cost else found.best
    lowest = min(cooled.cost, found.cost)
    mean = np.clip(found.mean, problem.lower, problem.upper)
    at_mean = solution_at(problem, mean, cooled, loss, generations)
    if at_mean.cost <= lowest + AS_GOOD * inflation * len(problem.names):
        return Settled(at_mean, found.covariance + scatter)
    return Settled(solution_at(problem, best, cooled, loss, generations), found.covariance + scatter)


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
