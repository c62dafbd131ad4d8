"""Whether an effect was there before: what it does to the healthy runs.

No simulator is quite the robot, and some effect of the catalogue always makes up for a little of that. What makes up
for the simulator does so in the healthy runs as well; what has gone wrong since makes these worse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.fit import Fit, Fits, unlikely
from r2s2r_cli.stages.diagnose.which.mixture import minus_log
from r2s2r_cli.stages.diagnose.which.score import ENOUGH


@dataclass(frozen=True)
class Healthy:
    """The healthy runs, refitted without any effect."""

    arena: Arena
    base: Fit


def chronic(arena: Arena, healthy: Healthy | None, fits: Sequence[Fit]) -> np.ndarray:
    """What of each fit's gain in `arena` is owed to what was there before [nats], (fit,): its gain in the healthy runs,
    by as many pieces as there are now; no piece says more than ENOUGH. 0 without healthy runs."""
    if healthy is None:
        return np.zeros(len(fits))
    more = max(1.0, len(arena.many) / len(healthy.arena.many))
    return more * np.maximum(before(healthy, fits), 0.0)


def before(healthy: Healthy, fits: Sequence[Fit]) -> np.ndarray:
    """Log density of the healthy runs with each fit's effects at the fitted sizes over that without them, nuisances
    following linearly, (fit,) [nats]."""
    arena, base = healthy.arena, healthy.base
    if not fits:
        return np.zeros(0)
    solver = Fits(arena)
    weights = solver.likely(base) ** 2
    own = _pieces(arena, base.residual[None])[0]
    z0 = np.repeat(base.z[None], len(fits), axis=0)
    there = arena.residuals(_values(solver, fits, z0), z0)
    z1 = np.array([_followed(solver, base, fit, residual, weights) for fit, residual in zip(fits, there, strict=True)])
    after = arena.residuals(_values(solver, fits, z1), z1)
    stayed, moved = (_gain(arena, own, base.z, z, r) for z, r in ((z0, there), (z1, after)))
    return np.maximum(stayed, moved)


def _values(solver: Fits, fits: Sequence[Fit], z: np.ndarray) -> np.ndarray:
    return np.concatenate([
        solver.values(fit.hypothesis, one[None], fit.x[None]) for fit, one in zip(fits, z, strict=True)
    ])  # fmt: skip


def _followed(solver: Fits, base: Fit, fit: Fit, residual: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Nuisances of the healthy runs after one Gauss-Newton step with the effect there."""
    arena = solver.arena
    J = base.jacobian[:, : len(base.z)].copy()
    J[:, solver.overruled(fit.hypothesis)] = 0.0
    normal = (J * weights[:, None]).T @ J + arena.precision
    pull = J.T @ (weights * residual) + arena.precision @ (base.z - arena.mean)
    return np.clip(base.z - np.linalg.solve(normal, pull), arena.lower, arena.upper)


def _pieces(arena: Arena, residuals: np.ndarray) -> np.ndarray:
    """Minus log densities, (hypothesis, piece)."""
    return np.asarray(minus_log(arena.squares(residuals), arena.logdets, arena.sizes))


def _gain(arena: Arena, own: np.ndarray, z_own: np.ndarray, z: np.ndarray, residuals: np.ndarray) -> np.ndarray:
    by_piece = np.clip(own[None] - _pieces(arena, residuals), -ENOUGH, ENOUGH).sum(axis=1)
    return np.asarray(by_piece + unlikely(arena, z_own[None]) - unlikely(arena, z))
