"""Whether an effect was there before: what it does to the healthy runs.

No simulator is quite the robot, and some effect of the catalogue always makes up for a little of that. What makes up
for the simulator does so in the healthy runs as well; what has gone wrong since makes these worse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.bounded import ENOUGH
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.mixture import minus_log
from r2s2r_cli.stages.diagnose.which.prior import unlikely
from r2s2r_cli.stages.diagnose.which.rough import DRAWS, around, root_of
from r2s2r_cli.stages.diagnose.which.score import Score, groups_of, scores

FOLLOWED = 1
"""Steps in which the nuisances follow an effect."""


@dataclass(frozen=True)
class Healthy:
    """The healthy runs, refitted without any effect."""

    arena: Arena
    base: Fit

    @cached_property
    def score(self) -> Score:
        """Of their own refit, nothing left out: with a run or two that would be the error of a fit to half of them."""
        (own,) = scores(self.arena, [self.base], groups_of(self.arena), held_out=False)
        return own


def chronic(arena: Arena, healthy: Healthy | None, fits: Sequence[Fit]) -> np.ndarray:
    """What of each fit's gain in `arena` is owed to what was there before [nats], (fit,): its gain in the healthy runs,
    by as many pieces as there are now; no piece says more than ENOUGH. 0 without healthy runs."""
    if healthy is None:
        return np.zeros(len(fits))
    more = max(1.0, len(arena.many) / len(healthy.arena.many))
    return more * np.maximum(before(healthy, fits), 0.0)


def before(healthy: Healthy, fits: Sequence[Fit]) -> np.ndarray:
    """Log density of the healthy runs with each fit's effects at the fitted sizes over that without them, nuisances
    following linearly, (fit,) [nats]. All of them are simulated at a few points close together (`rough`). Starts and
    nuisances that follow gain something by themselves where the healthy fit had stopped early: what no effect at all
    gains in the same way is taken off."""
    arena, base = healthy.arena, healthy.base
    if not fits:
        return np.zeros(0)
    solver = Fits(arena)
    weights = solver.likely(base) ** 2
    root = root_of(solver.normal(base)[0])
    nominal = replace(base, hypothesis=Hypothesis(), x=np.zeros(0))
    own = _costs(solver, [nominal], base, root)[0]
    now = solver.begun([(one.hypothesis, base.z, one.x) for one in (nominal, *fits)])
    solver.settle(now)
    gain = _gain(arena, own, base.z, now, _costs(solver, now, base, root))
    for _ in range(FOLLOWED):
        z = [_followed(solver, base, fit, weights) for fit in now]
        points = [(fit.hypothesis, own, fit.x) for fit, own in zip(now, z, strict=True)]
        now = solver.begun(points, [fit.away for fit in now])
        solver.settle(now)
        gain = np.maximum(gain, _gain(arena, own, base.z, now, _costs(solver, now, base, root)))
    return np.asarray(gain[1:] - max(gain[0], 0.0))


def _costs(solver: Fits, fits: Sequence[Fit], base: Fit, root: np.ndarray) -> np.ndarray:
    """Minus log densities of the pieces (fit, piece) with the nuisances about those of each fit."""
    arena = solver.arena
    points = np.array([around(fit.z, root, arena.lower, arena.upper) for fit in fits])
    flat = points.reshape(-1, points.shape[-1])
    values = np.concatenate([
        solver.values(fit.hypothesis, own, np.repeat(fit.x[None], DRAWS, axis=0))
        for fit, own in zip(fits, points, strict=True)
    ])  # fmt: skip
    away = np.repeat(np.array([fit.away for fit in fits]), DRAWS, axis=0)
    found = arena.residuals(values, flat, away=away).reshape(len(fits), DRAWS, -1)
    for fit, residual, own in zip(fits, found, points, strict=True):
        residual -= (own - own[0]) @ _derivatives(solver, base, fit).T
    costs = minus_log(arena.squares(found.reshape(len(flat), -1)), arena.logdets, arena.sizes)
    return np.asarray(costs.reshape(len(fits), DRAWS, -1).mean(axis=1))


def _derivatives(solver: Fits, base: Fit, fit: Fit) -> np.ndarray:
    """By the nuisances (M, p + q), 0 by those that the fit's effects set."""
    J = base.jacobian[:, : len(base.z)].copy()
    J[:, solver.overruled(fit.hypothesis)] = 0.0
    return J


def _followed(solver: Fits, base: Fit, fit: Fit, weights: np.ndarray) -> np.ndarray:
    """Nuisances of the healthy runs after one Gauss-Newton step with the effect there."""
    arena = solver.arena
    J = _derivatives(solver, base, fit)
    normal = (J * weights[:, None]).T @ J + arena.precision
    pull = J.T @ (weights * fit.residual) + arena.precision @ (fit.z - arena.mean)
    return np.clip(fit.z - np.linalg.solve(normal, pull), arena.lower, arena.upper)


def _gain(arena: Arena, own: np.ndarray, z_own: np.ndarray, fits: Sequence[Fit], costs: np.ndarray) -> np.ndarray:
    by_piece = np.clip(own[None] - costs, -ENOUGH, ENOUGH).sum(axis=1)
    z = np.array([fit.z for fit in fits])
    return np.asarray(by_piece + unlikely(arena, z_own[None]) - unlikely(arena, z))
