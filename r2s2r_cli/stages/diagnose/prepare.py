"""From the evidence to an arena at the refit nominal model: start states, healthy runs, floor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.diagnose.evidence import Evidence, FloorGiven, Run, whole
from r2s2r_cli.stages.diagnose.floors import floor_for, healthy_floor
from r2s2r_cli.stages.diagnose.nominal import begun, calibrated, nominal
from r2s2r_cli.stages.diagnose.parity.fitted import unheard
from r2s2r_cli.stages.diagnose.parity.lengths import late_readings
from r2s2r_cli.stages.diagnose.starts import Starts, as_known
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.before import Healthy
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit
from r2s2r_cli.stages.diagnose.which.numbers import SENSOR_LAG
from r2s2r_cli.stages.diagnose.which.pieces import pieces
from r2s2r_cli.stages.diagnose.which.replay import Replayer
from r2s2r_cli.stages.diagnose.which.stretches import stretches
from r2s2r_cli.stages.identify.data import Selection

ROUNDS = 2
"""Times that start states are made anew with the refitted numbers, where nothing is known of these to begin with."""
NO_FLOOR_M = 1e-4
FROZEN = 1e8
"""Times its prior's precision that a nuisance has which is not fitted."""
AGED = 0.35
"""Of a nuisance's own prior: how far it may have moved since the healthy runs, and how wrong their fit may be: where
robots fall over, two fits of the same runs differ by as much."""
AGED_NUMERICS = 0.1
"""The same of effects that are nuisances because another engine has a little of them: numerics do not age, and what
has grown since is the effect."""
AGELESS = ("stiffness", SENSOR_LAG)
"""Other nuisances of that kind: how an engine pulls its cables taut, and what filters and converters take."""

Told = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Refit:
    """The arena with the refit nominal model. floor: that everything is judged by."""

    arena: Arena
    base: Fit
    floor: FloorGiven
    warnings: tuple[str, ...] = ()
    healthy: Healthy | None = None


def refit(
    evidence: Evidence,
    replayer: Replayer,
    *,
    starts: Starts,
    told: Told,
    again: bool = True,
    with_floor: bool = True,
) -> Refit:
    """The nominal model fitted again to the intervals of `fit`, its nuisances alone. again: False, they stay as they
    were, with_floor: False, the simulator is taken to be perfect (ablations).

    With healthy runs these are fitted first: they say what the numbers were, how large the floor is and how wrong the
    stated noise. Raises NumericalError where nothing can be simulated, InputError where nothing is left to fit.
    """
    floor, warnings = floor_for(evidence)
    simulator = np.sqrt(max(floor.rmse**2 - floor.sensor**2, (0.25 * floor.rmse) ** 2))
    simulator = simulator if with_floor else NO_FLOOR_M
    begin = prior = healthy = None
    noise, lasts = 1.0, 0.0
    late = late_readings(evidence)
    if evidence.healthy:
        told("healthy runs", 0, 1)
        arena, base = _fitted(
            evidence.healthy, whole(evidence.healthy), replayer, simulator, (1.0, 0.0), None, starts, None, late,
            calibrate=with_floor,
        )  # fmt: skip
        simulator, noise, lasts = arena.floor_m, arena.noise, arena.lasts
        prior = _posterior(arena, base)
        healthy, begin = Healthy(arena, base), base.z[: arena.shared]
        floor = floor if evidence.floor is not None else healthy_floor(healthy)
        told("healthy runs", 1, 1)
    arena, base = _fitted(
        unheard(evidence), evidence.fit, replayer, simulator, (noise, lasts), prior, starts, begin, late, told
    )
    if not again:
        arena, base = _frozen(arena)
    asked = sum(len(one.intervals) for one in evidence.fit)
    if len(arena.whole) < asked:
        warnings.append(
            f"{asked - len(arena.whole)} of {asked} intervals have no key frame: the robot tips over as they begin"
        )
    return Refit(arena, base, floor, tuple(warnings), healthy)


def _fitted(
    runs: Sequence[Run], part: Sequence[Selection], replayer: Replayer, simulator: float, errs: tuple[float, float],
    prior: tuple[np.ndarray, np.ndarray] | None, starts: Starts, begin: np.ndarray | None, late: float,
    told: Told | None = None, calibrate: bool = False,
) -> tuple[Arena, Fit]:  # fmt: skip
    """Nuisances and start states in turns. errs: factor on the noise, and how long it lasts [s]. begin: nuisances to
    begin with; late: of the sensors [s], where there are none. calibrate: with them the floor and the noise."""
    model = replayer.model
    noise, lasts = errs
    named = {run.name: run for run in runs}
    last = {one.run: max(one.intervals) for one in part if one.intervals}
    z = begin
    rounds = ROUNDS if begin is None else 1
    for number in range(rounds):
        if told is not None:
            told("refit", number, rounds)
        values = model.values0.copy()
        if z is not None:
            values[list(model.nuisances)] = z[: len(model.nuisances)]
        states = starts.at([named[name] for name in last], replayer, values, last)
        states = as_known(states, runs, replayer, values)
        intervals = stretches(runs, part, states)
        many = pieces(runs, part, states, replayer, values)
        if not intervals:
            raise InputError(
                "the robot tips over in every interval: nothing can be fitted", where="--train",
                expected="an interval without a tip-over", received="none",
                hint="r2s2r record --random 15 --port /dev/ttyUSB0   # other shapes",
            )  # fmt: skip
        arena = Arena(replayer, many, floor_m=simulator, noise=noise, lasts=lasts, prior=prior, whole=intervals)
        z = _first(arena, z, late)
        base = nominal(arena, z, calibrate=calibrate, first=number == 0, ends=number == rounds - 1)
        z = base.z
        simulator, noise, lasts = arena.floor_m, arena.noise, arena.lasts
    if calibrate:
        calibrated(arena, base.z)
        base = begun(arena, base.z)
    if told is not None:
        told("refit", rounds, rounds)
    return arena, base


def _frozen(arena: Arena) -> tuple[Arena, Fit]:
    """The arena in which no nuisance can move from its prior."""
    z = arena.mean.copy()
    arena.precision = FROZEN * arena.precision
    arena.prepare(z)
    return arena, begun(arena, z)


def _first(arena: Arena, z: np.ndarray | None, late: float) -> np.ndarray:
    """Nuisances to begin with: those of before, as far as they are the same ones; else the prior's, with sensors that
    are late by so much [s]."""
    found = arena.mean.copy()
    if z is None:
        found[arena.names.index(SENSOR_LAG)] = late
    else:
        count = len(z) if len(z) == len(found) else arena.shared
        found[:count] = z[:count]
    return np.clip(found, arena.lower, arena.upper)


def _posterior(arena: Arena, base: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Mean and precision of the nuisances after the healthy runs, a little wider: a robot ages."""
    H, _ = Fits(arena).normal(base)
    n = arena.shared
    own = {arena.model.names[k] for k in arena.engine if arena.model.numbers[k].kind == "own"}
    share = np.array([AGED_NUMERICS if name in own or name in AGELESS else AGED for name in arena.names[:n]])
    aged = np.diag(share**2 / np.diag(arena.precision)[:n])
    return base.z[:n], np.linalg.inv(np.linalg.inv(H)[:n, :n] + aged)
