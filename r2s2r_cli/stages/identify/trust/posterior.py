"""How far the parameters may lie from the best ones, from candidates about them: for costs that are rough.

Adaptive importance sampling (Cappe et al. 2004; all draws weighted by the mixture of what they were drawn from, as
Cornuet et al. 2012). Unlike a curvature it sees minima beside the best that are about as good.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.solve.loss import Loss
from r2s2r_cli.stages.identify.solve.population import Population, costs_of, drawn, moving_of

MEMBERS, ROUNDS = 32, 3
"""Of a draw, and draws; up to `MOST_ROUNDS` where few of the candidates count."""
MOST_ROUNDS = 8
ENOUGH = 20.0
"""Candidates that count (effective sample size)."""
KEPT = 0.4
"""Share of the first covariance in those drawn from: few candidates must not make the next draw too narrow."""


@dataclass(frozen=True)
class Posterior:
    """mean (n,), covariance (n, n): of all unknowns, 0 for those that are held. count: effective sample size. best:
    unknowns (n,) of the lowest cost that was met, and that cost. evaluations: spent."""

    mean: np.ndarray
    covariance: np.ndarray
    count: float
    best: np.ndarray
    cost: float
    evaluations: int


def posterior(
    problem: Population, z: np.ndarray, covariance: np.ndarray, *, loss: Loss, temperature: float = 1.0, seed: int = 0
) -> Posterior:
    """Mean and covariance of the likelihood raised to the power 1 / temperature, times the priors, about z (n,) with
    about this covariance (n, n). For unknowns, at least one, that are not many: or hardly any candidate counts.

    temperature: variance of the residuals over that of the noise as given, which makes a misfit count as noise.
    """
    moving = moving_of(problem)
    n = len(moving)
    rng = np.random.default_rng([seed, n, 7])
    first = covariance[np.ix_(moving, moving)] * temperature
    middle, about = z[moving], first
    points = np.zeros((0, n))
    cost, density = np.zeros(0), []
    best, lowest = z, np.inf
    for number in range(MOST_ROUNDS):
        wide = _wider(n) ** 2 * 0.5 * (about + about.T)
        root = np.linalg.cholesky(wide + 1e-14 * np.trace(wide) * np.eye(n))
        centre = z.copy()
        centre[moving] = middle
        new = drawn(rng, centre, moving, root, MEMBERS, problem)
        costs = costs_of(problem, new, problem.residuals(new), loss)
        if costs.total.min() < lowest:
            best, lowest = new[np.argmin(costs.total)], float(costs.total.min())
        points = np.vstack([points, new[:, moving]])
        cost = np.append(cost, costs.data / temperature + costs.prior)
        density.append((middle, root))
        mean, spread, count = _weighted(points, cost, density)
        if number + 1 >= ROUNDS and count >= ENOUGH:
            break
        middle, about = mean, (1.0 - KEPT) * spread + KEPT * first
    whole_mean, whole = z.copy(), np.zeros((len(z), len(z)))
    whole_mean[moving] = mean
    whole[np.ix_(moving, moving)] = spread
    return Posterior(whole_mean, whole, count, best, lowest, len(points))


def _wider(n: int) -> float:
    """Width of a draw in standard deviations: twice for five unknowns, less for more, or nothing would count."""
    return 1.0 + min(5.0 / n, 1.5)


def _weighted(
    points: np.ndarray, cost: np.ndarray, density: list[tuple[np.ndarray, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean (n,), covariance (n, n) and effective sample size of points (k, n) with costs (k,), drawn from normal
    densities (middle, root of the covariance)."""
    logs = []
    for middle, root in density:
        off = np.linalg.solve(root, (points - middle).T)
        logs.append(-0.5 * np.sum(off**2, axis=0) - np.sum(np.log(np.diag(root))))
    log = -cost - np.logaddexp.reduce(logs, axis=0)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    mean = weight @ points
    off = points - mean
    count = float(1.0 / np.sum(weight**2))
    return mean, off.T @ (off * weight[:, None]) * count / max(count - 1.0, 1.0), count
