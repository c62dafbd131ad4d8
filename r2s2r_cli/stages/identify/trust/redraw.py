"""Range of parameters over noise that is drawn anew: where fits of observations as they might have been would end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.free.base import Free, values_of
from r2s2r_cli.stages.identify.solve.loss import LOSSES, Loss
from r2s2r_cli.stages.identify.solve.problem import Problem
from r2s2r_cli.stages.identify.solve.record import Solution
from r2s2r_cli.stages.identify.trust.parts import parts_of, scores_of

SIX = np.sqrt([1.5, 1.0, 0.5])
"""Sizes of the factors of windows: either sign, equally likely, mean square 1 (Webb 2023). With signs alone, few
windows would give few different draws."""
MANY = 40
"""Draws from which a range is the middle 95 %; of fewer it is all of them."""


@dataclass(frozen=True)
class Redrawn:
    """z: parameters of each draw, (draw, p)."""

    z: np.ndarray

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


def _factors(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    factors: np.ndarray = rng.choice(np.concatenate([-SIX, SIX]), size=shape)
    return factors
