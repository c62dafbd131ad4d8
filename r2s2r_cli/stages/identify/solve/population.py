"""Gauss-Newton on what a population sees of the cost, cooling: for costs that are rough.

Where caps stick and slip, the end of a long run depends on its parameters by small jumps. Derivatives at a point follow
the piece between two jumps and say little about a step as long as a standard deviation. So candidates are drawn about
the best one, the residuals (not the cost) are regressed on them, and the regression's slopes take the place of the
derivatives: the least-squares form of ensemble Kalman inversion (Iglesias, Law and Stuart 2013), or Gauss-Newton with
statistical linearisation. The draw begins as wide as a likelihood raised to the power 1/T would be, T from `hottest`
down to 1: what is rough on a small scale is smooth on that of the draw, and is resolved as T falls.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.solve.loss import Loss, robust_sum
from r2s2r_cli.stages.identify.solve.problem import HELD, Evaluation, Problem

RIDGE = 1e-3
"""Of the regression, on slopes in standard deviations of the draw: with few good candidates it stays defined."""
CLOSE = 1.0
"""[nats] The regression foretells the cost of its own minimum to that: nothing is rough on the scale of the draw."""
MEMBERS = 26
"""Candidates of a generation, with the `TRIED` ones a multiple of what the engine simulates side by side."""
TRIED = 6
"""Points on the way to the minimum of a regression, tried beside the next draw."""
NARROWEST = 1e-3
"""Of a draw, in standard deviations of the prior. Candidates on both sides of a jump (a cap that tips over or does not)
give slopes that are the steeper the narrower the draw, which would make the next one narrower still."""
UNTOLD = 10.0
"""The width that counts as the prior's where there is none."""
GAIN = 0.5
"""[nats] A generation at the end that gains less is the last but one."""


class Population(Problem, Protocol):
    """A problem whose residuals can be had for many points at once. block: (m,), as in Evaluation, ascending."""

    block: np.ndarray

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Residuals (k, m) at points (k, n); nan where one cannot be evaluated."""
        ...


@dataclass(frozen=True)
class Cooling:
    """members: candidates of a generation. hottest: first temperature; coldest: last. generations: at most. rate: what
    is left of the temperature after a generation that gains little for it."""

    members: int = MEMBERS
    hottest: float = 40.0
    coldest: float = 1.0
    generations: int = 16
    rate: float = 0.5


@dataclass(frozen=True)
class Cooled:
    """z: best unknowns (n,), of that cost. jacobian: (m, n), slopes of the regression over the last draw, 0 for
    unknowns that are held; normal: J^T W J with priors, (n, n), weights of the robust loss at the regression's middle.
    residual: (m,), at z. generations, evaluations: spent. rough: temperature at which the last draw was as good as its
    third: 1 where the cost is what the regression says. costs: after each generation."""

    z: np.ndarray
    cost: float
    residual: np.ndarray
    jacobian: np.ndarray
    normal: np.ndarray
    generations: int
    evaluations: int
    rough: float
    costs: tuple[float, ...]


@dataclass(frozen=True)
class Costs:
    """Of k candidates: data (k,), prior (k,); infinite where one cannot be evaluated."""

    data: np.ndarray
    prior: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """(k,)."""
        return np.asarray(self.data + self.prior)


def cool(
    problem: Population,
    z0: np.ndarray,
    normal: np.ndarray,
    *,
    loss: Loss,
    seed: int,
    cooling: Cooling = Cooling(),
    told: Callable[[int, float], None] | None = None,
) -> Cooled:
    """From z0 (n,) with the curvature of the cost there as far as it is known, normal (n, n) with priors.

    told is called with the number of each generation, from 1, and the best cost so far.
    Raises NumericalError where not even a few candidates can be evaluated.
    """
    rng = np.random.default_rng([seed, len(z0)])
    moving = moving_of(problem)
    prior = np.diag(problem.prior_sd[moving] ** -2.0)
    data = normal[np.ix_(moving, moving)] - prior
    temperature, best, best_cost = cooling.hottest, z0.copy(), np.inf
    residual, extra, foretold = None, z0[None], np.inf
    costs: list[float] = []
    spent = still = 0
    while True:
        root = np.linalg.cholesky(covariance_at(data, prior, temperature))
        z = np.vstack([extra, drawn(rng, best, moving, root, cooling.members, problem)])
        r = problem.residuals(z)
        cost = costs_of(problem, z, r, loss)
        spent += len(z)
        first = int(np.argmin(cost.total))
        better = cost.total[first] < best_cost
        gain = best_cost - cost.total[first] if better else 0.0
        if better:
            best, best_cost, residual = z[first], float(cost.total[first]), r[first]
        if residual is None or np.count_nonzero(np.isfinite(cost.total)) < 4:
            raise NumericalError(
                "hardly any candidate of a fit can be simulated", where="identify",
                expected="finite numbers about the start", received=f"{np.isfinite(cost.total).sum()} of {len(z)}",
                hint="narrow the bounds: --free NAME=START,LOWER..UPPER",
            )  # fmt: skip
        missed = abs(cost.total[min(1, len(extra) - 1)] - foretold)
        costs.append(best_cost)
        if told is not None:
            told(len(costs), best_cost)
        least = max(1.5 * len(moving), cooling.members / 3)
        rough = temperature_of(cost, least, cooling.coldest)
        middle, at, slopes = regressed(z[:, moving], r, weights_at(cost, rough), root)
        _, weight = robust_sum(loss, Evaluation(at, None, problem.block))
        data = (slopes * weight[:, None]).T @ slopes
        pull = (slopes * weight[:, None]).T @ at + prior @ (middle - problem.prior_mean[moving])
        step = -np.linalg.solve(data + prior + tiny(data + prior), pull)
        extra = _tried(problem, best, moving, middle, step)
        foretold = costs_of(problem, extra[1:2], (at + slopes @ step)[None], loss).total[0]
        cold = temperature <= cooling.coldest
        still = still + 1 if cold and gain < GAIN * cooling.coldest else 0
        if len(costs) >= cooling.generations or still > 1 or (still and missed < CLOSE * cooling.coldest):
            break
        if len(costs) == 1 or gain <= len(moving) * temperature:
            tame = missed < CLOSE * cooling.coldest and gain < CLOSE * cooling.coldest
            temperature = cooling.coldest if tame else max(cooling.coldest, temperature * cooling.rate)
    jacobian = np.zeros((r.shape[1], len(z0)))
    jacobian[:, moving] = slopes
    whole = np.diag(problem.prior_sd**-2.0)
    whole[np.ix_(moving, moving)] += data
    return Cooled(best, best_cost, residual, jacobian, whole, len(costs), spent, rough, tuple(costs))


def moving_of(problem: Problem) -> np.ndarray:
    """Numbers of the unknowns that neither prior nor bounds hold, ascending."""
    return np.flatnonzero((problem.prior_sd > HELD) & (problem.lower < problem.upper))


def tiny(normal: np.ndarray) -> np.ndarray:
    """What makes (n, n) regular where a draw at a bound tells nothing of an unknown that has no prior."""
    return np.asarray((1e-12 * float(np.trace(normal)) + 1e-300) * np.eye(len(normal)))


def covariance_at(data: np.ndarray, prior: np.ndarray, temperature: float) -> np.ndarray:
    """Covariance (n, n) of a likelihood with curvature `data` raised to the power 1 / temperature, times the prior; in
    no direction narrower than NARROWEST of the prior."""
    precision = np.diag(prior)
    width = np.where(precision > 0, precision, UNTOLD**-2.0) ** -0.5
    scaled = np.outer(width, width) * (data / temperature)
    curvature, direction = np.linalg.eigh(0.5 * (scaled + scaled.T))
    variance = 1.0 / (np.clip(curvature, 0.0, NARROWEST**-2.0) + 1.0)
    found = (direction * variance) @ direction.T * np.outer(width, width)
    return np.asarray(0.5 * (found + found.T))


def drawn(
    rng: np.random.Generator, middle: np.ndarray, moving: np.ndarray, root: np.ndarray, members: int, problem: Problem
) -> np.ndarray:
    """Points (members, n) about the middle (n,), in pairs on both sides of it, inside the box."""
    half = rng.standard_normal((members // 2, len(moving)))
    z = np.tile(middle, (2 * len(half), 1))
    z[:, moving] += np.vstack([half, -half]) @ root.T
    return np.clip(z, problem.lower, problem.upper)


def costs_of(problem: Population, z: np.ndarray, residual: np.ndarray, loss: Loss) -> Costs:
    """Half the robust sums over blocks, and half the squared prior residuals, of points (k, n), residuals (k, m)."""
    first = np.flatnonzero(np.diff(problem.block, prepend=problem.block[:1] - 1))
    size = np.diff(first, append=residual.shape[1])
    with np.errstate(over="ignore", invalid="ignore"):
        square = np.add.reduceat(residual**2, first, axis=1)
        data = np.array([0.5 * float(np.sum(loss.rho(row, size))) for row in square])
    off = np.where(np.isfinite(problem.prior_sd), (z - problem.prior_mean) / problem.prior_sd, 0.0)
    return Costs(np.where(np.isfinite(data), data, np.inf), 0.5 * np.sum(off**2, axis=1))


def weights_at(cost: Costs, temperature: float) -> np.ndarray:
    """(k,), of sum 1: likelihoods raised to the power 1 / temperature, times priors."""
    log = -cost.data / temperature - cost.prior
    weight = np.exp(log - log.max())
    return np.asarray(weight / weight.sum())


def temperature_of(cost: Costs, least: float, coldest: float) -> float:
    """The lowest temperature, not below the coldest, at which `least` candidates count (effective sample size)."""

    def enough(temperature: float) -> bool:
        weight = weights_at(cost, temperature)
        return bool(1.0 / np.sum(weight**2) >= least)

    low, high = coldest, 1e9
    if enough(low) or not enough(high):
        return low if enough(low) else high
    while high > 1.01 * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


def regressed(
    z: np.ndarray, residual: np.ndarray, weight: np.ndarray, root: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middle (n,) of weighted points (k, n), the regression of residuals (k, m) there (m,), and its slopes (m, n)."""
    used = weight > 1e-12 * weight.max()
    z, residual, weight = z[used], residual[used], weight[used]
    middle = weight @ z
    scaled = np.linalg.solve(root, (z - middle).T).T
    columns = np.hstack([np.ones((len(z), 1)), scaled])
    ridge = RIDGE * np.diag([0.0, *np.ones(z.shape[1])])
    found = np.linalg.solve(columns.T @ (columns * weight[:, None]) + ridge, columns.T @ (residual * weight[:, None]))
    return middle, found[0], np.linalg.solve(root.T, found[1:]).T


def _tried(problem: Problem, best: np.ndarray, moving: np.ndarray, middle: np.ndarray, step: np.ndarray) -> np.ndarray:
    """The best point, the minimum of the regression, and points on the ways there, (TRIED, n)."""
    found = np.tile(best, (TRIED, 1))
    from_best = middle + step - best[moving]
    found[1:, moving] = [
        middle + step, middle + 0.5 * step, middle, best[moving] + 0.5 * from_best, best[moving] + 0.2 * from_best,
    ]  # fmt: skip
    return np.clip(found, problem.lower, problem.upper)
