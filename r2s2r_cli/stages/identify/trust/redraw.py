"""Range of parameters over noise that is drawn anew: fits of observations as they might have been."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.free.base import Free, values_of
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.loss import LOSSES, Loss
from r2s2r_cli.stages.identify.solve.problem import Problem
from r2s2r_cli.stages.identify.solve.record import Solution
from r2s2r_cli.stages.identify.trust.clusters import owners
from r2s2r_cli.stages.identify.trust.information import held, inverse
from r2s2r_cli.stages.identify.trust.parts import parts_of, scores_of
from r2s2r_cli.stages.identify.trust.wrapped import Wrapped

SIX = np.sqrt([1.5, 1.0, 0.5])
"""Sizes of the factors of windows: either sign, equally likely, mean square 1 (Webb 2023). With signs alone, few
windows would give few different draws."""
MANY = 40
"""Draws from which a range is the middle 95 %; of fewer it is all of them."""


@dataclass(frozen=True)
class Redrawn:
    """z: parameters of each draw, (draw, p); solutions: of the full fits, () for linearised ones. failed: draws without
    a fit."""

    z: np.ndarray
    solutions: tuple[Solution, ...] = ()
    failed: int = 0

    @property
    def sd_z(self) -> np.ndarray:
        """Standard deviation over draws, (p,)."""
        found: np.ndarray = np.std(self.z, axis=0, ddof=1)
        return found


def redraw_linear(
    problem: Problem,
    solution: Solution,
    cluster: np.ndarray | None = None,
    *,
    loss: Loss = LOSSES["none"],
    block: np.ndarray | None = None,
    draws: int = 1000,
    seed: int = 0,
) -> Redrawn:
    """One step of each fit, with the derivatives of the solution: no simulation at all.

    cluster: (m,) int, windows; the score of each is multiplied by a random factor of mean square 1 (wild cluster
    bootstrap: Kline and Santos 2012), so that what residuals of a window share stays shared. Leverage is made up for as
    in `covariance`. None: independent normal noise as given.
    """
    p = len(problem.names)
    rng = np.random.default_rng(seed)
    parts = parts_of(problem, solution, loss, block)
    if cluster is None:
        value, vector = np.linalg.eigh(parts.normal * parts.information)
        score = rng.normal(size=(draws, p)) @ (vector * np.sqrt(np.maximum(value, 0.0))).T
    else:
        found = scores_of(problem, solution, parts, cluster)
        kept = float(np.einsum("sij,ji->", found.expected, parts.bread))
        full = float(np.trace(parts.information @ parts.bread))
        score = _factors(rng, (draws, found.count)) @ found.score * np.sqrt(full / kept if kept > 0 else 1.0)
    return Redrawn(np.clip(solution.z[:p] - score @ parts.bread, problem.lower[:p], problem.upper[:p]))


def redraw(
    problem: Problem,
    solution: Solution,
    cluster: np.ndarray | None = None,
    *,
    loss: Loss = LOSSES["none"],
    inflation: float = 1.0,
    draws: int = 20,
    seed: int = 0,
    max_iterations: int = 12,
    progress: Callable[[float], None] | None = None,
) -> Redrawn:
    """Fits of observations made from the solution, each started at the solution: on a rough cost they stay near it.

    cluster: (m,) int, windows; residuals and start offsets of each are multiplied by a random factor of mean square 1
    (wild cluster bootstrap), raised by what the fit took out of them. None: start offsets from their priors, noise
    normal with variance `inflation`. progress is told the share that is done.

    Raises NumericalError where no draw can be fitted.
    """
    rng = np.random.default_rng(seed)
    make = _Maker(problem, solution, cluster, inflation)
    found, failed = [], 0
    for k in range(draws):
        try:
            drawn = make(rng)
            found.append(
                levenberg_marquardt(drawn, solution.z, loss=loss, max_iterations=max_iterations, tolerance=1e-5)
            )
        except NumericalError:
            failed += 1
        if progress is not None:
            progress((k + 1) / draws)
    if not found:
        raise NumericalError(
            "no fit of re-drawn noise could be made", expected="finite simulations",
            received=f"{failed} of {draws} draws failed", hint="narrow the bounds: r2s2r identify --help",
        )  # fmt: skip
    return Redrawn(np.array([one.z[: len(problem.names)] for one in found]), tuple(found), failed)


def spans(frees: Sequence[Free], draws: np.ndarray | None = None, starts: np.ndarray | None = None) -> np.ndarray:
    """Smallest and largest value (p, 2) in units: of starts (k, p) all, of draws (k, p) the middle 95 % if many."""
    ends = []
    if starts is not None:
        ends += [starts.min(axis=0), starts.max(axis=0)]
    if draws is not None:
        share = (0.025, 0.975) if len(draws) >= MANY else (0.0, 1.0)
        ends += list(np.quantile(draws, share, axis=0))
    z = np.stack(ends)
    return np.stack([values_of(tuple(frees), z.min(axis=0)), values_of(tuple(frees), z.max(axis=0))], axis=1)


class _Maker:
    """Problems with observations drawn anew."""

    def __init__(self, problem: Problem, solution: Solution, cluster: np.ndarray | None, inflation: float) -> None:
        self.problem, self.solution, self.cluster, self.inflation = problem, solution, cluster, inflation
        self.p = len(problem.names)
        self.loose = ~held(problem) & (np.arange(len(solution.z)) >= self.p) & np.isfinite(problem.prior_sd)
        if cluster is not None:
            self.owner = owners(solution.jacobian, cluster, self.p)
            self.place = np.unique(cluster, return_inverse=True)[1]
            used = float(np.sum(inverse(solution.normal) * solution.normal_data))
            self.raised = np.sqrt(len(cluster) / max(len(cluster) - used, 1.0))

    def __call__(self, rng: np.random.Generator) -> Wrapped:
        problem, z = self.problem, self.solution.z.copy()
        if self.cluster is None:
            spread = np.where(self.loose, problem.prior_sd, 0.0)
            z[self.loose] = problem.prior_mean[self.loose]
            z += np.where(self.loose, spread, 0.0) * rng.normal(size=len(z))
            noise = np.sqrt(self.inflation) * rng.normal(size=len(self.solution.residual))
        else:
            factor = _factors(rng, (int(self.place.max()) + 1,))
            away = np.where(self.loose, z - problem.prior_mean, 0.0)
            z += np.where(self.loose, (factor[self.owner] - 1.0) * away, 0.0)
            noise = self.raised * factor[self.place] * self.solution.residual
        z = np.clip(z, problem.lower, problem.upper)
        return Wrapped(problem, shift=noise - problem.evaluate(z, jacobian=False).residual)


def _factors(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    factors: np.ndarray = rng.choice(np.concatenate([-SIX, SIX]), size=shape)
    return factors
