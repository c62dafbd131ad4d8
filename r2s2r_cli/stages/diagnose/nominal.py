"""The refit nominal model of an arena, which every hypothesis is compared with: fitted until new derivatives gain
nothing any more.

Where it stops early any effect gains by leading it on; where the fit of the healthy runs does, what is wrong with the
robot as it was looks like something that has changed (ADR 23).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from r2s2r_cli.stages.diagnose.floors import NUMERICS_M
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.shake import shaken

FLOORS_M = (0.8e-3, 1.6e-3, 3.2e-3, 6.4e-3, 13e-3)
"""Floors that healthy runs are tried with."""
NOISES = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8)
LASTING = (0.0, 0.1, 0.3)
"""[s] Times that errors of the caps may last."""
NEAR = (0.7, 1.0, 1.4)
"""Factors on the floor and the noise, where something is known of them."""
FLOOR_SPREAD = 0.5
"""Of the logarithm of the floor, before healthy runs are looked at: noisy ones say little of it."""
JACOBIANS, MOST_JACOBIANS = 2, 6
"""Times that derivatives are taken anew with the last start states: at least, and, while that gains, at most."""
GOES_ON = 5.0
"""[nats] What a fit with new derivatives gains that goes on."""
LONG = 20
"""Steps between two derivatives, for the one fit that all others are compared with."""
CALIBRATED = 3
"""Derivatives after which floor and noise are looked for no more: they turn to and fro between neighbours."""


def nominal(arena: Arena, z: np.ndarray, *, calibrate: bool, first: bool, ends: bool) -> Fit:
    """From nuisances z (p + q,): fitted, and where this ends (`ends`) shaken once, and fitted with derivatives and
    starts taken anew while that gains. calibrate: floor and noise are found with it, of healthy runs: under a noise
    that is too small every piece looks like a fall, and a fit of falls learns nothing. first: nothing is known of them.
    The arena is left with the last derivatives, and its stretches beginning where those of the fit do."""
    for again in range(MOST_JACOBIANS if ends else 1):
        if again:
            arena.move_starts(arena.away)
        arena.prepare(z)
        if calibrate and again < CALIBRATED:
            calibrated(arena, z, first=first)
        fit = begun(arena, z)
        cost = fit.cost
        solver = Fits(arena)
        solver.run([fit], iterations=LONG)
        gained = cost - fit.cost
        # Before the last derivatives: they are to be those of the best place.
        if ends and not again:
            fit = shaken(solver, fit)
        z, arena.away = fit.z, fit.away
        if again + 1 >= JACOBIANS and gained < GOES_ON:
            break
    return fit


def begun(arena: Arena, z: np.ndarray) -> Fit:
    """The refit nominal model at nuisances z, not moved yet."""
    return Fits(arena).begun([(Hypothesis(), z, np.zeros(0))])[0]


def calibrated(arena: Arena, z: np.ndarray, *, first: bool = False) -> None:
    """Whitens with the floor, the factor on the noise and how long it lasts under which healthy residuals at z are most
    likely. first: nothing is known of them; else near what they are."""
    raw = arena.raw(arena.values(z[None]), z[None])

    def best(some: Iterable[tuple[float, float, float]]) -> tuple[float, float, float]:
        found = {}
        for floor, noise, lasts in some:
            arena.whiten(floor_m=floor, noise=noise, lasts=lasts, trial=True)
            unusual = np.log(floor / NUMERICS_M) / FLOOR_SPREAD
            found[floor, noise, lasts] = float(arena.log_densities(raw).sum()) - 0.5 * unusual**2
        return max(found, key=lambda one: found[one])

    floor, noise, lasts = best((floor, arena.noise, arena.lasts) for floor in FLOORS_M)
    around = NOISES if first else tuple(factor * noise for factor in NEAR)
    floor, noise, lasts = best((floor, noise, lasts) for noise in around for lasts in LASTING)
    floor, noise, lasts = best((factor * floor, noise, lasts) for factor in NEAR)
    arena.whiten(floor_m=floor, noise=noise, lasts=lasts)
