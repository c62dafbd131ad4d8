"""From the evidence to an arena at the refit nominal model: start states, healthy runs, floor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.diagnose.evidence import Evidence, FloorGiven, Run
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.fit import Fit, Fits, Hypothesis
from r2s2r_cli.stages.diagnose.which.replay import Replayer
from r2s2r_cli.stages.diagnose.which.robust import minus_log
from r2s2r_cli.stages.diagnose.which.stretches import stretches
from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.identify.start import Filter, states_at
from r2s2r_cli.stages.measures.floor import floor_of
from r2s2r_cli.stages.measures.steps import steps_of

NUMERICS_M = 3e-3
"""[m] What two good engines differ by at the end of a step of this robot, beside noise (tier B without an effect)."""
FLOORS = (0.4, 0.6, 0.8, 1.0, 1.3, 1.7, 2.3, 3.0, 4.0)
"""Factors on the floor that healthy runs are tried with."""
NOISES = (1.0, 1.4, 2.0, 2.8)
ROUNDS = 2
"""Times that start states are made anew with the refitted numbers."""
AGED = 0.5
"""Of a nuisance's own prior: how far it may have moved since the healthy runs."""

Told = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Refit:
    """The arena with the refit nominal model. floor: that everything is judged by."""

    arena: Arena
    base: Fit
    floor: FloorGiven
    warnings: tuple[str, ...] = ()


def refit(
    evidence: Evidence,
    replayer: Replayer,
    *,
    belief: Filter,
    told: Told,
    kept: Mapping[str, Any] | None = None,
    keep: Callable[[str, Any], None] = lambda name, value: None,
) -> Refit:
    """The nominal model fitted again to the intervals of `fit`, its nuisances alone. kept, keep: nuisances that were
    reached before an interruption, and where to keep them.

    With healthy runs these are fitted first: they say what the numbers were, how large the floor is and how wrong the
    stated noise. Raises NumericalError where nothing can be simulated, InputError where nothing is left to fit.
    """
    floor, warnings = floor_for(evidence)
    simulator = np.sqrt(max(floor.rmse**2 - floor.sensor**2, (0.25 * floor.rmse) ** 2))
    kept = kept or {}
    begin = prior = None
    noise = 1.0
    if evidence.healthy:
        told("healthy runs", 0, 1)
        part = tuple(
            Selection(run.name, tuple(i + 1 for i, whole in enumerate(run.caps.intervals.complete.tolist()) if whole))
            for run in evidence.healthy
        )
        arena, base = _fitted(evidence.healthy, part, replayer, simulator, 1.0, None, belief, _known(kept, "healthy"))
        simulator, noise = _calibrated(arena, base)
        arena.whiten(floor_m=simulator, noise=noise)
        prior = _posterior(arena, base)
        begin = base.z
        keep("healthy", base.z.tolist())
        if evidence.floor is None:
            sensor = float(np.sqrt(np.mean([np.sum(one.noise[-1] ** 2, axis=-1).mean() for one in arena.many])))
            ends = Fits(arena)
            key = arena.ends(ends.values(base.hypothesis, base.z[None], np.zeros((1, 0))), base.z[None])[0]
            rmse = float(np.sqrt(np.mean(np.sum(key**2, axis=-1))))
            floor = FloorGiven(rmse, min(sensor, rmse), "the healthy runs, refitted", True)
        told("healthy runs", 1, 1)
    arena, base = _fitted(evidence.runs, evidence.fit, replayer, simulator, noise, prior, belief,
                          begin if "refit" not in kept else _known(kept, "refit"), told)  # fmt: skip
    keep("refit", base.z.tolist())
    return Refit(arena, base, floor, tuple(warnings))


def _known(kept: Mapping[str, Any], name: str) -> np.ndarray | None:
    return np.array(kept[name], dtype=float) if name in kept else None


def floor_for(evidence: Evidence) -> tuple[FloorGiven, list[str]]:
    """The floor that was given; else of repeats among the runs; else of noise and a foreign engine's numerics, which is
    said."""
    if evidence.floor is not None:
        return evidence.floor, []
    sensor = _sensor(evidence.runs)
    steps = [
        step for run in evidence.runs
        for one in evidence.fit if one.run == run.name for step in steps_of(run.caps, one.intervals)
    ]  # fmt: skip
    found = floor_of(steps)
    if found is not None and found.contrasts >= 2:
        given = FloorGiven(found.floor_m, found.sensor_m, "repeats within the diagnosed runs", False)
    else:
        given = FloorGiven(
            float(np.hypot(NUMERICS_M, sensor)),
            sensor,
            "the noise of the caps and 3 mm for the numerics of engines",
            False,
        )
    said = [] if evidence.healthy else [f"no floor was given: taken from {given.words}, {1e3 * given.rmse:.1f} mm"]
    return given, said


def _sensor(runs: Sequence[Run]) -> float:
    """What noise alone makes of the cap RMSE at a key frame that was started from a frame [m]: the start is filtered."""
    return float(np.sqrt(np.mean([np.sum(run.caps.noise**2, axis=-1).mean() for run in runs])))


def _fitted(
    runs: Sequence[Run], part: Sequence[Selection], replayer: Replayer, simulator: float, noise: float,
    prior: tuple[np.ndarray, np.ndarray] | None, belief: Filter, begin: np.ndarray | None, told: Told | None = None,
) -> tuple[Arena, Fit]:  # fmt: skip
    """Nuisances and start states in turns."""
    model = replayer.model
    named = {run.name: run for run in runs}
    last = {one.run: max(one.intervals) for one in part if one.intervals}
    z = begin
    for number in range(ROUNDS):
        if told is not None:
            told("refit", number, ROUNDS)
        values = model.values0.copy()
        if z is not None:
            values[list(model.nuisances)] = z[: len(model.nuisances)]
        states = states_at([named[name].caps for name in last], replayer, values, last, belief=belief)
        many = stretches(runs, part, states)
        if not many:
            raise InputError(
                "the robot tips over in every interval: nothing can be fitted", where="--train",
                expected="an interval without a tip-over", received="none", hint="r2s2r diagnose --also N",
            )  # fmt: skip
        arena = Arena(replayer, many, floor_m=simulator, noise=noise, prior=prior)
        z = arena.mean.copy() if z is None or len(z) != len(arena.mean) else z
        arena.prepare(z)
        fits = Fits(arena)
        residual = arena.residuals(arena.values(z[None]), z[None])[0]
        base = fits.begin(Hypothesis(), z, np.zeros(0), residual)
        fits.run([base])
        z = base.z
    if told is not None:
        told("refit", ROUNDS, ROUNDS)
    return arena, base


def _calibrated(arena: Arena, base: Fit) -> tuple[float, float]:
    """Floor [m] and factor on the noise under which healthy residuals are most likely."""
    own = arena.floor_m
    values = arena.values(base.z[None])
    found: dict[tuple[float, float], float] = {}
    for factor in FLOORS:
        for noise in NOISES:
            arena.whiten(floor_m=factor * own, noise=noise)
            squares = arena.squares(arena.residuals(values, base.z[None]))[0]
            density = -minus_log(squares, arena.sizes) - 0.5 * np.array([white.logdet for white in arena.white])
            found[factor * own, noise] = float(density.sum())
    return max(found, key=lambda one: found[one])


def _posterior(arena: Arena, base: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Mean and precision of the nuisances after the healthy runs, a little wider: a robot ages."""
    fits = Fits(arena)
    again = fits.begin(
        base.hypothesis, base.z, base.x, arena.residuals(arena.values(base.z[None]), base.z[None])[0]
    )  # fmt: skip
    H, _ = fits.normal(again)
    aged = AGED**2 * np.diag(1.0 / np.diag(arena.precision))
    return base.z, np.linalg.inv(np.linalg.inv(H) + aged)
