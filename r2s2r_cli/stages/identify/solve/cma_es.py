"""CMA-ES: the gradient-free cross-check of a fit (ADR 9)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.solve.linearised import cost_of, not_finite
from r2s2r_cli.stages.identify.solve.loss import LOSSES, Loss
from r2s2r_cli.stages.identify.solve.problem import Problem, still_of
from r2s2r_cli.stages.identify.solve.record import Counts, Progress, names_on_bound


@dataclass(frozen=True)
class Sampled:
    """The best point that was sampled.

    z: (n,), its nuisances as given. cost: robust, priors included. costs: the best so far after each generation.
    reason: the package's own word for why it ended, 'budget' where that was the cause.
    """

    z: np.ndarray
    cost: float
    costs: tuple[float, ...]
    counts: Counts
    reason: str
    seed: int
    on_bound: tuple[str, ...]


def cma_es(
    problem: Problem,
    z0: np.ndarray,
    *,
    sd0: float | np.ndarray,
    budget: int,
    seed: int,
    loss: Loss = LOSSES["none"],
    tolerance: float = 1e-6,
    population: int | None = None,
    batch: Callable[[np.ndarray], list[float]] | None = None,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Callable[[Sequence[Sequence[float]]], None] | None = None,
    resume: Sequence[Sequence[float]] = (),
) -> Sampled:
    """Minimise the same cost as `levenberg_marquardt` over the parameters, without derivatives.

    The nuisances, hundreds of unknowns about which the parameters hardly disagree, stay at z0: give the solution of
    Levenberg-Marquardt, and this says whether other parameters explain the data better with the same start states. A
    lower cost found here is a defect there; an equal one says nothing about minima further than the samples reach.
    So do parameters that are held.

    z0: (n,). sd0: of the first samples, in z, one number or (parameters,). budget: evaluations at most. Points where
    the simulation is not finite are worse than all others. tolerance: of the cost, ends the search. population: samples
    of a generation, default the package's. batch: costs of points (k, n), instead of one evaluation after the other.
    checkpoint is called after every generation with the costs of all samples so far, (generation, sample), inf where
    the simulation was not finite; then progress; what either raises goes through. resume: such costs are told to the
    search instead of computed: with the same seed and problem its samples are theirs, and it goes on bit by bit.
    Uses no global random numbers, writes no file and prints nothing. Raises NumericalError where no sample is finite,
    ValueError where `resume` is not of generations of this size.
    """
    import warnings

    import cma

    moving = np.setdiff1d(np.arange(len(problem.names)), still_of(problem))
    count = len(moving)
    z0 = np.clip(np.asarray(z0, dtype=float), problem.lower, problem.upper)
    unit = np.broadcast_to(np.asarray(sd0, dtype=float), (len(problem.names),))[moving]
    lower, upper = problem.lower[moving], problem.upper[moving]
    draw = np.random.default_rng(seed)

    def whole(u: np.ndarray) -> np.ndarray:
        z: np.ndarray = z0.copy()
        z[moving] = np.clip(z0[moving] + unit * u, lower, upper)
        return z

    def cost(u: np.ndarray) -> float:
        try:
            return cost_of(problem, whole(u), problem.evaluate(whole(u), jacobian=False), loss)[0]
        except NumericalError:
            return np.inf

    def together(samples: list[np.ndarray]) -> list[float]:
        if batch is None:
            return [cost(u) for u in samples]
        return batch(np.array([whole(u) for u in samples]))

    options: dict[str, Any] = {
        "bounds": [_list((lower - z0[moving]) / unit), _list((upper - z0[moving]) / unit)],
        "maxfevals": budget,
        **({} if population is None else {"popsize": population}),
        "tolfun": tolerance,
        "seed": np.nan,  # do not seed numpy's global generator
        "randn": lambda *shape: draw.standard_normal(shape),
        "verbose": -9,
        "verb_log": 0,
        "verb_disp": 0,
        "signals_filename": None,
    }
    if not count:
        (alone,) = together([np.zeros(0)])
        return Sampled(z0, alone, (alone,), Counts(plain=1), "nothing moves", seed, ())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # its parser of options stumbles over one of its own defaults
        search = cma.CMAEvolutionStrategy(np.zeros(count), 1.0, options)
    best_u, best, costs, spent = np.zeros(count), np.inf, [], 0
    generations: list[list[float]] = []
    while not search.stop() and spent < budget:
        samples = search.ask()
        again = len(generations) < len(resume)
        values = list(resume[len(generations)]) if again else together(samples)
        search.tell(samples, values)
        generations.append(values)
        spent += len(samples)
        least = int(np.argmin(values))
        if values[least] < best:
            best_u, best = np.array(samples[least]), values[least]
        costs.append(best)
        if checkpoint is not None and not again:
            checkpoint(generations)
        if progress is not None:
            most = max(budget // len(samples), 1)
            progress(Progress(len(costs), most, best, 0.0, float(search.sigma), Counts(plain=spent)))
    if not np.isfinite(best):
        raise not_finite("no sample of the parameters gives a finite simulation", np.full(spent, np.nan))
    z = whole(best_u)
    reason = "budget" if spent >= budget else ", ".join(search.stop())
    on_bound = names_on_bound(z, problem.lower, problem.upper, problem.names)
    return Sampled(z, best, tuple(costs), Counts(plain=spent), reason, seed, on_bound)


def _list(bounds: np.ndarray) -> list[float | None]:
    """The package's way to write bounds: None where there is none."""
    return [float(one) if np.isfinite(one) else None for one in bounds]
