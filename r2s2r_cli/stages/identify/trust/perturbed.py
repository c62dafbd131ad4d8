"""How far the parameters may lie from the best ones where there are many unknowns: fits of perturbed observations.

Randomised maximum likelihood (Kitanidis 1995; Oliver, He and Reynolds 1996): the minimum for observations and priors
that are moved by a draw of their noise is a draw from the posterior, exactly so where residuals are linear. Members of
an ensemble each look for their own minimum with slopes that are regressed on all of them together, as in ensemble
smoothers (Chen and Oliver 2012). They begin further off than the curvature at the best says: where that is the
curvature of a narrow valley beside a plain, those that find the plain stay on it.
"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.identify.solve.loss import Loss, robust_sum
from r2s2r_cli.stages.identify.solve.population import RIDGE, Population, costs_of, moving_of
from r2s2r_cli.stages.identify.solve.problem import Evaluation
from r2s2r_cli.stages.identify.trust.posterior import Posterior

MEMBERS = 64
"""Of the ensemble: two and a half times the unknowns of a window whose start is free, in eights."""
STEPS = 14
"""Of each member; after ten, means and variances change little."""
FURTHER = 3.0
"""Of the first ensemble, in standard deviations by the curvature at the best."""
LONGER, SHORTER, SHORTEST = 1.5, 0.4, 0.05
"""A member's next step, as a share of the one to its minimum: after a step that lowered its cost, after one that did
not, and at least."""


def perturbed(
    problem: Population, z: np.ndarray, covariance: np.ndarray, *, loss: Loss, temperature: float = 1.0, seed: int = 0
) -> Posterior:
    """Mean and covariance as in `posterior`, about z (n,) with about this covariance (n, n) by curvature.

    Raises NumericalError where z cannot be simulated.
    """
    moving = moving_of(problem)
    n = len(moving)
    rng = np.random.default_rng([seed, n, 11])
    at = problem.residuals(z[None])
    _, weight = robust_sum(loss, Evaluation(at[0], None, problem.block))
    weight = weight / temperature
    ensemble = _Ensemble(problem, weight, rng)
    narrow = covariance[np.ix_(moving, moving)] * temperature
    narrow = 0.5 * (narrow + narrow.T)
    root = np.linalg.cholesky(narrow + 1e-9 * np.diag(np.diag(narrow)))
    points = np.tile(z, (MEMBERS, 1))
    points[:, moving] += FURTHER * rng.standard_normal((MEMBERS, n)) @ root.T
    points = np.clip(points, problem.lower, problem.upper)
    residual = problem.residuals(points)
    lost = ~np.isfinite(residual).all(axis=1)
    points[lost], residual[lost] = z, at[0]
    cost = ensemble.costs(points, residual)
    best, lowest = z, float(costs_of(problem, z[None], at, loss).total[0])
    share = np.ones(MEMBERS)
    seen, seen_residual = points, residual
    for _ in range(STEPS):
        slopes = _slopes(seen[:, moving], seen_residual, np.sqrt(np.diag(narrow)))
        new = points.copy()
        new[:, moving] += share[:, None] * ensemble.steps(points, residual, slopes)
        new = np.clip(new, problem.lower, problem.upper)
        new_residual = problem.residuals(new)
        new_cost = ensemble.costs(new, new_residual)
        plain = costs_of(problem, new, new_residual, loss).total
        if plain.min() < lowest:
            best, lowest = new[np.argmin(plain)], float(plain.min())
        lower = new_cost < cost
        seen, seen_residual = np.vstack([points, new]), np.vstack([residual, new_residual])
        points = np.where(lower[:, None], new, points)
        residual = np.where(lower[:, None], new_residual, residual)
        cost = np.where(lower, new_cost, cost)
        share = np.where(lower, np.minimum(1.0, LONGER * share), np.maximum(SHORTEST, SHORTER * share))
    mean, whole = z.copy(), np.zeros((len(z), len(z)))
    mean[moving] = points[:, moving].mean(axis=0)
    whole[np.ix_(moving, moving)] = np.cov(points[:, moving].T)
    return Posterior(mean, whole, float(MEMBERS), best, lowest, 1 + (1 + STEPS) * MEMBERS)


class _Ensemble:
    """Least-squares costs of members, each with observations and priors of its own. weight: (m,), of the residuals, the
    robust ones at the best: a member's draw of noise is no outlier."""

    def __init__(self, problem: Population, weight: np.ndarray, rng: np.random.Generator) -> None:
        self.moving = moving_of(problem)
        self.weight = weight
        self.noise = rng.standard_normal((MEMBERS, len(weight))) / np.sqrt(weight)
        self.precision = problem.prior_sd[self.moving] ** -2.0
        mean = np.where(self.precision > 0, problem.prior_mean[self.moving], 0.0)
        wide = np.where(self.precision > 0, problem.prior_sd[self.moving], 0.0)
        self.mean = mean + wide * rng.standard_normal((MEMBERS, len(mean)))

    def costs(self, z: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """(member,) at points (member, n) with residuals (member, m)."""
        prior = self.precision * (z[:, self.moving] - self.mean) ** 2
        found = 0.5 * ((residual + self.noise) ** 2 @ self.weight + prior.sum(axis=1))
        return np.where(np.isfinite(found), found, np.inf)

    def steps(self, z: np.ndarray, residual: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """To the minima that slopes (m, moving) foretell, (member, moving)."""
        weighted = slopes * self.weight[:, None]
        pull = (residual + self.noise) @ weighted + self.precision * (z[:, self.moving] - self.mean)
        return np.asarray(-np.linalg.solve(weighted.T @ slopes + np.diag(self.precision), pull.T).T)


def _slopes(z: np.ndarray, residual: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Regression of residuals (k, m) on points (k, moving): (m, moving). scale: (moving,), sizes of the unknowns."""
    good = np.isfinite(residual).all(axis=1)
    off = (z[good] - z[good].mean(axis=0)) / scale
    wide = off.std(axis=0)
    off = off / wide
    ridge = RIDGE * len(off) * np.eye(off.shape[1])
    found = np.linalg.solve(off.T @ off + ridge, off.T @ (residual[good] - residual[good].mean(axis=0)))
    return np.asarray((found / (wide * scale)[:, None]).T)
