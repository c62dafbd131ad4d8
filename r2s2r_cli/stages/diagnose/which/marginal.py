"""How much better all gaits together are explained with an effect: the log of the ratio of marginal likelihoods.

What is left out (`score`) cannot flatter an effect, but with three gaits it throws a third of the data away each time,
and one fall that comes at the right instant is bounded. All data together say more, as long as numbers that were free
to fit them are paid for: Laplace's approximation (MacKay, Information Theory, Inference and Learning Algorithms, ch.
28), in which a number that the data tell a hundred times better than its prior costs ln 100 nats.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.fit import PRIOR_SCALES, Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit


def marginal_gains(arena: Arena, base: Fit, fits: Sequence[Fit]) -> np.ndarray:
    """Of each fit over the refit nominal model, (fit,) [nats]."""
    solver = Fits(arena)
    nominal = _log_marginal(solver, base)
    return np.array([_log_marginal(solver, fit) - nominal for fit in fits])


def _log_marginal(solver: Fits, fit: Fit) -> float:
    """Up to a constant that all fits of the arena share."""
    H, _ = solver.normal(fit)
    own = -2.0 * np.log(PRIOR_SCALES * fit.hypothesis.stack("scale")).sum()  # of the prior's precision
    return float(-fit.cost + 0.5 * (own - np.linalg.slogdet(H)[1]))
