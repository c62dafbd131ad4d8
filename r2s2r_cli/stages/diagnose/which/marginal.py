"""How much better all gaits together are explained with an effect: the log of the ratio of marginal likelihoods.

What is left out (`score`) cannot flatter an effect, but with three gaits it throws a third of the data away each time,
and one fall that comes at the right instant is bounded. All data together say more, as long as numbers that were free
to fit them are paid for: Laplace's approximation (MacKay, Information Theory, Inference and Learning Algorithms, ch.
28), in which a number that the data tell a hundred times better than its prior costs ln 100 nats. What counts of that
is `bounded` piece by piece: one fall that a fit has hit says no more than the next piece.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.bounded import gains_over_first
from r2s2r_cli.stages.diagnose.which.fit import PRIOR_SCALES, Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit


@dataclass(frozen=True)
class Gains:
    """Of fits over the refit nominal model, (fit,) [nats]. counted: what counts; whole: with all that single pieces
    say."""

    counted: np.ndarray
    whole: np.ndarray

    def less(self, owed: np.ndarray) -> Gains:
        """Without what is owed to something else (fit,) [nats]."""
        return Gains(self.counted - owed, self.whole - owed)

    def with_pairs(self, first: int, pairs: np.ndarray) -> Gains:
        """Then pairs of effects that gain so much in all (pair,): of a pair counts what its first effect, the fit
        `first`, counts, and all that the second adds."""
        added = pairs - self.whole[first]
        return Gains(np.concatenate([self.counted, self.counted[first] + added]), np.concatenate([self.whole, pairs]))


def marginal_gains(arena: Arena, base: Fit, fits: Sequence[Fit]) -> Gains:
    """Of each fit over the refit nominal model."""
    solver = Fits(arena)
    nominal = _log_marginal(solver, base)
    whole = np.array([_log_marginal(solver, fit) - nominal for fit in fits])
    pieces = -solver.nats(np.array([base.residual, *(fit.residual for fit in fits)]))
    kept = np.isfinite(pieces).all(axis=1)  # the others break off at a piece
    kept[0] = True
    counted = np.full(len(fits), -np.inf)
    own = pieces[kept]
    counted[kept[1:]] = whole[kept[1:]] + gains_over_first(own) - (own[1:] - own[0]).sum(axis=1)
    return Gains(counted, whole)


def _log_marginal(solver: Fits, fit: Fit) -> float:
    """Up to a constant that all fits of the arena share."""
    H, _ = solver.normal(fit)
    own = -2.0 * np.log(PRIOR_SCALES * fit.hypothesis.stack("scale")).sum()  # of the prior's precision
    return float(-fit.cost + 0.5 * (own - np.linalg.slogdet(H)[1]))
