"""Out of the first hollow: a fit is tried at points about it, each with a step of its own.

Costs are rough, and what goes downhill from one place soon stops. The refit nominal model is what everything else is
compared with: where it has stopped too early, any effect gains by leading it on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.fit import LEAST_GAIN, Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.rough import root_of

FAR_SD = (1.0, 3.0, 6.0)
"""How far from the fit points are, in the sd of its numbers, round after round: it is the sd of one hollow of many."""
ROUNDS = 6
POINTS, SETTLED = 12, 6
"""Of each round, and how many of them go on, settled and with a step; of the steps half are settled."""


def shaken(fits: Fits, fit: Fit) -> Fit:
    """The best that was found about a fit, its effect's numbers moved by steps alone; itself, if that is best."""
    rng = np.random.default_rng(0)
    arena, p = fits.arena, len(fit.z)
    for number in range(ROUNDS):
        root = root_of(fits.normal(fit)[0])[:p]
        drawn = fit.z + FAR_SD[number % len(FAR_SD)] * rng.standard_normal((POINTS, root.shape[1])) @ root.T
        about = [(fit.hypothesis, one, fit.x) for one in np.clip(drawn, arena.lower, arena.upper)]
        found = _held(fits, about, [fit.away] * POINTS, fit, SETTLED)
        stepped = [(one.hypothesis, *fits.moved(one, fits.step(one))) for one in found]
        found += _held(fits, stepped, [one.away for one in found], fit, SETTLED // 2)
        best = min(found, key=lambda one: one.cost)
        if best.cost < fit.cost - LEAST_GAIN:
            best.start = fit.start
            fit = best
    return fit


def _held(
    fits: Fits, points: Sequence[tuple[Hypothesis, np.ndarray, np.ndarray]], away: Sequence[np.ndarray], like: Fit,
    count: int,
) -> list[Fit]:  # fmt: skip
    """The first `count` of the fits at points, settled, with the derivatives of another one."""
    found = sorted(fits.begun(points, away, like), key=lambda one: one.cost)[:count]
    fits.settle(found)
    return found
