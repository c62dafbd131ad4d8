"""The rounds of the default fit: long windows with free starts, from afar; then short ones, filtered start states."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from r2s2r_cli.stages.identify.free.base import values_of
from r2s2r_cli.stages.identify.growing import BEFORE_POPULATION, EARLY_HORIZONS, problem_of, stages_of, started
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.residuals import CapResiduals
from r2s2r_cli.stages.identify.settled import settle, solution_at, spread_of
from r2s2r_cli.stages.identify.solve.found_twice import CHANCES, MANY_CHANCES, Begin, cool_growing
from r2s2r_cli.stages.identify.solve.horizon import Limits, solve_growing
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.loss import LOSSES
from r2s2r_cli.stages.identify.solve.population import MEMBERS, TRIED, Cooled, Cooling, cool, moving_of
from r2s2r_cli.stages.identify.solve.record import Checkpoint, Counts, Progress, Solution
from r2s2r_cli.stages.identify.solve.starts import multi_start, starts
from r2s2r_cli.stages.identify.windows import Window

FROM_AFAR = 1e-3
"""Relative gain at which the first round ends, whose minimum is not that of the later ones."""
EXACT = 1.5
"""Residuals of at most so many times the noise that was measured: the model is not what is wrong."""
START_SPREAD = 0.4
"""Starts are drawn this far from the first in coordinates without a prior: for a logarithm, a factor of 1.5."""
FIRST = 0.3
"""Of the first draw of a later round, in widths of the priors."""
LOOKS = 4
"""Generations after which the residuals tell how far they are from independent noise."""
ON_THE_WAY = 5
"""Generations of a later round that is not the last, as cold as that gets."""
HOTTER = 8.0
"""First temperature of a later round, in such inflations."""
LANES = 8
"""Simulations that the engine runs side by side on a core."""
MOST_UNKNOWNS = 40
"""With more, a population that could tell their effects apart costs more than derivatives that mislead a little."""


@dataclass(frozen=True)
class Fit:
    """A finished fit. problem: at its last start states; solution: in its unknowns; values: (n,), units. drawn: their
    covariance as candidates showed it, None where none were drawn. alike: held parameters that are as others of their
    kind are, with the number of these (`alike.py`)."""

    problem: CapResiduals
    solution: Solution
    values: np.ndarray
    drawn: np.ndarray | None = None
    alike: Mapping[str, int] = field(default_factory=dict)


def first_round(
    predictor: Predictor,
    windows: Sequence[Window],
    values: np.ndarray,
    recipe: Recipe,
    *,
    seed: int = 0,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Callable[[Checkpoint], None] | None = None,
    resume: Checkpoint | None = None,
) -> Fit:
    """From far off, over growing horizons: derivatives lead near, a population goes on where they mislead.

    With many start states that are free there is no population, and derivatives go on to the end. Raises as `fit`.
    """
    frees, loss = predictor.mapping.frees, LOSSES[recipe.loss]
    names, stages, count = stages_of(predictor, windows, recipe)
    problem = stages[-1]
    few = len(moving_of(problem)) <= MOST_UNKNOWNS
    smooth = count if few else len(stages)
    last = Limits(max_iterations=recipe.max_iterations, tolerance=FROM_AFAR, step_sd=0.05)
    solution = solve_growing(
        list(zip(names, stages, strict=True))[:smooth], started(problem, values), loss=loss, early=EARLY_HORIZONS,
        last=BEFORE_POPULATION if few else last, progress=progress, checkpoint=checkpoint, resume=resume,
    )  # fmt: skip
    if few:
        cooling = Cooling(members=members_for(problem))
        led = Begin(solution.z, solution.normal, min(smooth, len(stages) - 1))
        anew = Begin(started(problem, values), wide_about(problem, cooling), min(1, len(stages) - 1))
        begins = [led, anew]
        hear = None if progress is None else partial(_heard, progress, names, cooling.generations, len(begins))
        chances = CHANCES if problem.offsets == 0 else MANY_CHANCES
        ways = cool_growing(stages, begins, loss=loss, seed=seed, cooling=cooling, chances=chances, told=hear)
        return _settled(problem, ways.best, recipe, seed, cooling.generations, ways.others)
    if problem.misfit(solution.z) < EXACT:
        # The model explains the data to their noise: no filter knows these start states as well as the fit does.
        problem = problem_of(predictor, windows, recipe, noise=0.0)
        solution = levenberg_marquardt(
            problem, solution.z, loss=loss, max_iterations=recipe.max_iterations, tolerance=1e-4
        )
    return Fit(problem, solution, values_of(frees, solution.z[: len(frees)]))


def later_round(
    predictor: Predictor,
    windows: Sequence[Window],
    values: np.ndarray,
    recipe: Recipe,
    *,
    seed: int,
    final: bool = True,
    progress: Callable[[Progress], None] | None = None,
) -> Fit:
    """From filtered start states: a population, first to see how far residuals are from independent noise, then as cold
    as that makes sense; where it might have ended as well only in the final round. Raises as `fit`."""
    loss = LOSSES[recipe.loss]
    problem = problem_of(predictor, windows, recipe)
    z = started(problem, values)
    wide = wide_about(problem, Cooling(hottest=1.0), FIRST)
    members = members_for(problem)
    looks = Cooling(members, hottest=1.0, generations=LOOKS)
    ends = Cooling(members, generations=recipe.cooled_generations if final else ON_THE_WAY)
    both = looks.generations + ends.generations
    hear = (lambda offset, generation, cost: None) if progress is None else partial(_heard_later, progress, both)
    seen = cool(problem, z, wide, loss=loss, seed=seed, cooling=looks, told=partial(hear, 0))
    inflation = spread_of(problem, solution_at(problem, seen.z, seen, loss, looks.generations), loss).inflation
    own = replace(ends, hottest=HOTTER * inflation, coldest=inflation)
    found = cool(problem, seen.z, seen.normal, loss=loss, seed=seed, cooling=own, told=partial(hear, looks.generations))
    if final:
        return _settled(problem, found, recipe, seed, ends.generations)
    solution = solution_at(problem, found.z, found, loss, ends.generations)
    return Fit(problem, solution, values_of(problem.frees, solution.z[: len(problem.frees)]))


def more_starts(
    fitted: Fit, recipe: Recipe, count: int, seed: int, progress: Callable[[Progress], None]
) -> list[tuple[np.ndarray, Solution]]:
    """Fits of the same windows from `count` other starts (unknowns,), within a width of the priors of the first.

    Raises NumericalError where none can be evaluated.
    """
    problem, loss, n = fitted.problem, LOSSES[recipe.loss], len(fitted.problem.names)
    spread = np.zeros(len(problem.z0))
    spread[:n] = np.minimum(problem.prior_sd[:n], START_SPREAD)
    z0s = starts(problem.lower, problem.upper, problem.z0, n=count + 1, seed=seed, spread=spread)[1:]
    if len(moving_of(problem)) > MOST_UNKNOWNS:
        last = Limits(max_iterations=recipe.max_iterations // 2, tolerance=1e-4, step_sd=0.1)
        trials = multi_start([("all", problem)], z0s, loss=loss, seed=seed, last=last, progress=progress)
        return [(z0s[index], one) for one, index in zip(trials.solutions, trials.order, strict=True)]
    found = []
    inflation = spread_of(problem, fitted.solution, loss).inflation
    cooling = Cooling(
        members_for(problem), hottest=HOTTER * inflation, coldest=inflation, generations=recipe.cooled_generations
    )
    for number, z0 in enumerate(z0s):
        wide = wide_about(problem, cooling, FIRST)
        hear = partial(_heard, progress, ("all",), cooling.generations, len(z0s), number, 0)
        end = cool(problem, z0, wide, loss=loss, seed=seed + number + 1, cooling=cooling, told=hear)
        found.append((z0, solution_at(problem, end.z, end, loss, cooling.generations)))
    return found


def wide_about(problem: CapResiduals, cooling: Cooling, share: float = 1.0) -> np.ndarray:
    """A curvature (n, n) of which the first draw is as wide as this share of the priors, where those are flat of how
    starts are drawn."""
    prior = problem.prior_sd**-2.0
    return np.diag(prior + cooling.hottest * ((share * np.minimum(problem.prior_sd, START_SPREAD)) ** -2.0 - prior))


def members_for(problem: CapResiduals) -> int:
    """Candidates of a generation: more unknowns need more, or the regression cannot tell their effects apart."""
    return max(MEMBERS, LANES * math.ceil((3 * len(moving_of(problem)) + TRIED) / LANES) - TRIED)


def _settled(
    problem: CapResiduals,
    cooled: Cooled,
    recipe: Recipe,
    seed: int,
    generations: int,
    others: Sequence[np.ndarray] = (),
) -> Fit:
    found = settle(problem, cooled, LOSSES[recipe.loss], seed=seed, generations=generations, others=others)
    values = values_of(problem.frees, found.solution.z[: len(problem.frees)])
    return Fit(problem, found.solution, values, found.drawn)


def _heard(
    progress: Callable[[Progress], None], names: Sequence[str], generations: int, ways: int, way: int, stage: int,
    generation: int, cost: float,
) -> None:  # fmt: skip
    name = f"{names[stage]}, population" + (f", way {way + 1}" if way else "")
    progress(Progress(generation, generations, cost, 0.0, 0.0, Counts(), stage, len(names), name, way, ways))


def _heard_later(
    progress: Callable[[Progress], None], generations: int, offset: int, generation: int, cost: float
) -> None:
    progress(Progress(offset + generation, generations, cost, 0.0, 0.0, Counts(), stage_name="population"))
