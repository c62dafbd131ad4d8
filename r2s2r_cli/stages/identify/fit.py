"""The default fit in rounds (recipe.py): long windows with free starts, then short ones from filtered start states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.free.base import values_of
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.residuals import CapResiduals
from r2s2r_cli.stages.identify.solve.horizon import Limits
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.loss import LOSSES
from r2s2r_cli.stages.identify.solve.record import Checkpoint, Progress as SolverProgress, Solution
from r2s2r_cli.stages.identify.solve.starts import MultiStart, multi_start, starts
from r2s2r_cli.stages.identify.start import states_at
from r2s2r_cli.stages.identify.windows import Window, begins_after_tip, selected, spans, window

if TYPE_CHECKING:
    from r2s2r_cli.engine import State

EARLY_HORIZONS = Limits(max_iterations=4, tolerance=1e-2, step_sd=0.3, gradient_sd=0.1)
"""Of all horizons but the last: they only have to come near."""
EXACT = 1.5
"""Residuals of at most so many times the noise that was measured: the model is not what is wrong."""
FILTERED_TOLERANCE = 1e-3
"""Of the later rounds: their start states change from round to round by more than that."""
START_SPREAD = 0.4
"""Starts are drawn this far from the first in coordinates without a prior: for a logarithm, a factor of 1.5."""


@dataclass(frozen=True)
class Fit:
    """A finished fit. problem: at its last start states; solution: in its unknowns; values: (n,), units. trials: of the
    first round, from all starts. first: (k, n), where these began, units."""

    problem: CapResiduals
    solution: Solution
    values: np.ndarray
    trials: MultiStart | None
    first: np.ndarray


def training_windows(
    runs: Sequence[RunData], train: Sequence[Selection], predictor: Predictor, values: np.ndarray, recipe: Recipe,
    known: dict[str, State] | None = None,
) -> list[Window]:  # fmt: skip
    """Training windows with start states at `values`. known: true states at the first frames of runs, for planted data:
    a window that begins there starts from it and has no offsets."""
    known = known or {}
    chosen = selected(runs, train, recipe.window)
    guessed = [run for run, numbers in chosen if not (run.name in known and numbers[0] == 1)]
    last = {run.name: max(numbers[0] for other, numbers in chosen if other is run) for run in guessed}
    unknown = list({run.name: run for run in guessed}.values())
    states = states_at(unknown, predictor, values, last, belief=recipe.belief) if unknown else {}
    found = [
        window(run, numbers, known[run.name], known=True)
        if run.name in known and numbers[0] == 1
        else window(run, numbers, states[run.name, numbers[0]])
        for run, numbers in chosen
    ]
    kept = [one for one in found if len(one.frames)]
    if not kept:
        raise InputError(
            "the robot tips over in every training interval: nothing can be fitted", where="--train",
            expected="an interval without a tip-over", received="none", hint="r2s2r identify --train RUN",
        )  # fmt: skip
    return kept


def filtered_windows(
    runs: Sequence[RunData], train: Sequence[Selection], predictor: Predictor, values: np.ndarray, recipe: Recipe,
    known: dict[str, State] | None = None,
) -> list[Window]:  # fmt: skip
    """Windows of the lengths in `recipe.short` from every training interval on, none across a tip-over.

    They start where the filter says, or in the known state; either way the start is not free.
    """
    named = {run.name: run for run in runs}
    last: dict[str, int] = {}
    for one in train:
        last[one.run] = max(*one.intervals, last.get(one.run, 1))
    states = states_at([named[name] for name in last], predictor, values, last, belief=recipe.belief)
    states.update({(name, 1): state for name, state in (known or {}).items()})
    found = []
    for one in train:
        run = named[one.run]
        breaks = begins_after_tip(run)
        for stretch in spans(one.intervals, len(run.intervals), breaks):
            lengths = [length for length in recipe.short if length <= len(stretch)] or [len(stretch)]
            for length in lengths:
                for first in range(len(stretch) - length + 1):
                    numbers = stretch[first : first + length]
                    found.append(window(run, numbers, states[run.name, numbers[0]], known=True))
    return [one for one in found if len(one.frames)]


def fit(
    runs: Sequence[RunData],
    train: Sequence[Selection],
    predictor: Predictor,
    recipe: Recipe,
    *,
    count: int = 1,
    seed: int = 0,
    known: dict[str, State] | None = None,
    begin: np.ndarray | None = None,
    progress: Callable[[int, int, SolverProgress], None] | None = None,
    checkpoint: Callable[[int, np.ndarray, Checkpoint], None] | None = None,
    resume: tuple[int, np.ndarray, Checkpoint | None] | None = None,
) -> Fit:
    """Fit the free parameters of `predictor` to the training intervals.

    count: starts of the first round. begin: values (n,) to start from, default those of the free parameters. known: see
    `training_windows`; where every window starts known there is one round. progress is called with the round, their
    number and the solver's own; checkpoint with the round, the values its start states are made with, and the
    solver's; resume is what the last checkpoint was called with.

    Raises NumericalError where nothing can be simulated, InputError for runs that cannot be started.
    """
    frees = predictor.mapping.frees
    values = np.array([free.start for free in frees]) if begin is None else np.asarray(begin, dtype=float)
    rounds = 1 + recipe.filtered
    trials, first = None, values[None]
    at, inner = 0, None
    if resume is not None:
        at, values, inner = resume
    for number in range(at, rounds):
        make = training_windows if number == 0 else filtered_windows
        windows = make(runs, train, predictor, values, recipe, known)
        problem = CapResiduals(
            predictor, windows, spread=recipe.spread, noise=recipe.noise, key_only=recipe.key_only, held=recipe.held
        )
        z0 = problem.z0.copy()
        z0[: len(frees)] = [free.to_z(float(value)) for free, value in zip(frees, values, strict=True)]
        longest = max(len(one.intervals) for one in windows)
        horizons = recipe.horizons(longest) if number == 0 else (longest,)
        z0s = _starts(problem, z0, count if number == 0 else 1, seed)
        iterations = recipe.max_iterations if number == 0 else recipe.filtered_iterations
        found = multi_start(
            _stages(problem, horizons, recipe), z0s, loss=LOSSES[recipe.loss], seed=seed, early=EARLY_HORIZONS,
            last=Limits(max_iterations=iterations, tolerance=1e-4 if number == 0 else FILTERED_TOLERANCE, step_sd=0.05),
            progress=None if progress is None else _with_round(progress, number, rounds),
            checkpoint=None if checkpoint is None else _kept(checkpoint, number, values), resume=inner,
        )  # fmt: skip
        inner = None
        if number == 0:
            trials, first = found, np.array([values_of(frees, z[: len(frees)]) for z in z0s])
        solution = found.best
        values = values_of(frees, solution.z[: len(frees)])
        if number == 0 and all(one.known for one in windows):
            break  # nothing to make again
        if number == 0 and problem.misfit(solution.z) < EXACT:
            # The model explains the data to their noise: no filter knows these start states as well as the fit does.
            problem = CapResiduals(
                predictor, windows, spread=recipe.spread, noise=0.0, key_only=recipe.key_only, held=recipe.held
            )
            solution = levenberg_marquardt(
                problem, solution.z, loss=LOSSES[recipe.loss], max_iterations=iterations, tolerance=1e-4
            )
            values = values_of(frees, solution.z[: len(frees)])
            break
    return Fit(problem, solution, values, trials, first)


def more_starts(
    fitted: Fit, recipe: Recipe, count: int, seed: int, progress: Callable[[SolverProgress], None]
) -> tuple[MultiStart, np.ndarray]:
    """Fits of the same windows from `count` other starts, growing; and these starts (count, unknowns).

    Raises NumericalError where none can be evaluated.
    """
    problem = fitted.problem
    z0s = _starts(problem, problem.z0, count + 1, seed)[1:]
    stages = _stages(problem, recipe.horizons(max(len(one.intervals) for one in problem.windows)), recipe)
    last = Limits(max_iterations=recipe.max_iterations // 2, tolerance=1e-4, step_sd=0.1)
    return multi_start(stages, z0s, loss=LOSSES[recipe.loss], seed=seed, last=last, progress=progress), z0s


def _problem(predictor: Predictor, windows: Sequence[Window], recipe: Recipe, noise: float) -> CapResiduals:
    return CapResiduals(
        predictor, windows, spread=recipe.spread, noise=noise, key_only=recipe.key_only, held=recipe.held
    )


def _stages(problem: CapResiduals, horizons: tuple[int, ...], recipe: Recipe) -> list[tuple[str, CapResiduals]]:
    """The problem cut to each horizon; the last is the problem itself."""
    found = []
    for length in horizons[:-1]:
        cut = _problem(problem.predictor, [one.until(length) for one in problem.windows], recipe, recipe.noise)
        found.append((f"{length} intervals", cut))
    return [*found, ("all", problem)]


def _starts(problem: CapResiduals, z0: np.ndarray, count: int, seed: int) -> np.ndarray:
    """z0 and others about it: parameters within one sd of their priors, offsets as they are."""
    if count == 1:
        return z0[None]
    n = len(problem.names)
    spread = np.zeros(len(z0))
    spread[:n] = np.minimum(problem.prior_sd[:n], START_SPREAD)
    return starts(problem.lower, problem.upper, z0, n=count, seed=seed, spread=spread)


def _with_round(
    progress: Callable[[int, int, SolverProgress], None], number: int, rounds: int
) -> Callable[[SolverProgress], None]:
    return lambda one: progress(number, rounds, one)


def _kept(
    checkpoint: Callable[[int, np.ndarray, Checkpoint], None], number: int, values: np.ndarray
) -> Callable[[Checkpoint], None]:
    return lambda one: checkpoint(number, values, one)
