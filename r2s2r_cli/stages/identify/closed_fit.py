"""The fit with the controller in the loop: samples from far off, planes through samples near the minimum."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.identify.closed_residuals import ClosedResiduals
from r2s2r_cli.stages.identify.closed_surface import Surface, planes, posterior
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.free.base import values_of
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.rounds import EXACT
from r2s2r_cli.stages.identify.solve.cma_es import cma_es
from r2s2r_cli.stages.identify.solve.linearised import cost_of
from r2s2r_cli.stages.identify.solve.loss import LOSSES, Loss
from r2s2r_cli.stages.identify.solve.record import Progress, Solution
from r2s2r_cli.stages.identify.training import training_windows

if TYPE_CHECKING:
    from r2s2r_cli.engine import State

POPULATION = 32
"""Closed loops side by side in a generation."""
ENOUGH = 0.1
"""Differences of the cost within a generation below which sampling ends: a small share of what one sd is worth."""
WIDE = 0.4
"""Sd of the first samples in coordinates without a narrower prior: for a logarithm, a factor of 1.5."""
FIRST = 0.1
"""Of the samples about the best of CMA-ES, in widths of the priors."""
SAMPLING, PLANES, LAST = "CMA-ES", "planes", "planes at the last start states"
"""Stages, as the trace calls them."""
Generations = Sequence[Sequence[float]]
Keep = Callable[[Generations], None]


@dataclass(frozen=True)
class ClosedFit:
    """problem: with the last start states; surface: the plane at the minimum; solution: of it; values (n,), units."""

    problem: ClosedResiduals
    surface: Surface
    solution: Solution
    values: np.ndarray


def fit_closed(
    runs: Sequence[RunData], train: Sequence[Selection], predictor: Predictor, recipe: Recipe, *, seed: int = 0,
    known: dict[str, State] | None = None, progress: Callable[[str, Progress], None] | None = None,
    checkpoint: Keep | None = None, resume: Generations = (),
) -> ClosedFit:  # fmt: skip
    """Fit the free parameters of `predictor` to the training intervals with the controller in the loop.

    CMA-ES finds the minimum from robot.toml's values; start states are made again there; planes through samples
    (`closed_surface`) finish it. Where the model explains the data to their noise, that is what they are weighed with.
    progress hears the stage and how far it is; checkpoint and resume: as of `cma_es`. Raises NumericalError where
    nothing can be simulated.
    """
    frees, loss = predictor.mapping.frees, LOSSES[recipe.loss]
    n = len(frees)

    def problem_at(values: np.ndarray, noise: float) -> ClosedResiduals:
        windows = training_windows(runs, train, predictor, values, recipe, known)
        return ClosedResiduals(predictor, windows, values, spread=recipe.spread, noise=noise, held=recipe.held)

    def hear(stage: str) -> Callable[[Progress], None] | None:
        return None if progress is None else partial(progress, stage)

    problem = problem_at(np.array([free.start for free in frees]), recipe.noise)
    z = sampled(problem, loss, recipe.max_iterations, seed, hear(SAMPLING), checkpoint, resume)
    spread = np.diag((FIRST * problem.widths) ** 2)
    problem = problem_at(values_of(frees, z), recipe.noise)
    _, solution = planes(problem, z, spread, loss, seed, hear(PLANES))
    problem = problem_at(values_of(frees, solution.z[:n]), recipe.noise)
    if problem.misfit(solution.z[: len(problem.z0)]) < EXACT:
        problem = ClosedResiduals(
            predictor, problem.windows, problem.at, spread=recipe.spread, noise=0.0, held=recipe.held
        )
    surface, solution = planes(problem, solution.z[:n], posterior(solution, problem), loss, seed + 1, hear(LAST))
    return ClosedFit(problem, surface, solution, values_of(frees, solution.z[:n]))


def sampled(
    problem: ClosedResiduals, loss: Loss, generations: int, seed: int, progress: Callable[[Progress], None] | None,
    checkpoint: Keep | None = None, resume: Generations = (),
) -> np.ndarray:  # fmt: skip
    """The best parameters (n,), z, of CMA-ES from robot.toml's values: a generation is one batch of closed loops.

    The cost is rough where a robot rolls or a motor stops a tick later: from far off, differences lead nowhere.
    """
    n = len(problem.frees)
    problem.predictor.rollouts += len(problem.windows) * sum(map(len, resume))  # those were simulated before
    return cma_es(
        problem, problem.z0, sd0=np.minimum(problem.prior_sd[:n], WIDE), seed=seed, loss=loss,
        tolerance=ENOUGH, budget=POPULATION * generations, population=POPULATION,
        batch=lambda points: costs_of(problem, points[:, :n], loss), progress=progress,
        checkpoint=checkpoint, resume=resume,
    ).z[:n]  # fmt: skip


def costs_of(problem: ClosedResiduals, points: np.ndarray, loss: Loss) -> list[float]:
    """Costs of parameters (k, n), with the other unknowns that suit them; inf where the simulation is not finite."""
    found = []
    for z, residual in zip(points, problem.batch(points), strict=True):
        if not np.isfinite(residual).all():
            found.append(np.inf)
            continue
        whole, moved = problem.with_best_others(z, residual)
        found.append(cost_of(problem, whole, moved, loss)[0])
    return found
