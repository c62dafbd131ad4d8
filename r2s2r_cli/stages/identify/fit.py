"""The default fit in rounds (recipe.py): each makes its start states with the parameters of the one before."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.rounds import Fit, first_round, later_round
from r2s2r_cli.stages.identify.solve.record import Checkpoint, Progress
from r2s2r_cli.stages.identify.training import filtered_windows, training_windows

if TYPE_CHECKING:
    from r2s2r_cli.engine import State

Told = Callable[[int, int, Progress], None]
"""Called with the round, their number, and the solver's own."""
Kept = Callable[[int, np.ndarray, "Checkpoint | None"], None]
"""Called with the round, the values that its start states are made with, and the solver's own."""


def fit(
    runs: Sequence[RunData],
    train: Sequence[Selection],
    predictor: Predictor,
    recipe: Recipe,
    *,
    seed: int = 0,
    known: dict[str, State] | None = None,
    begin: np.ndarray | None = None,
    progress: Told | None = None,
    checkpoint: Kept | None = None,
    resume: tuple[int, np.ndarray, Checkpoint | None] | None = None,
) -> Fit:
    """Fit the free parameters of `predictor` to the training intervals.

    begin: values (n,) to start from, default those of the free parameters. known: see `training_windows`; where every
    window starts known there is one round. resume is what the last checkpoint was called with.

    Raises NumericalError where nothing can be simulated, InputError for runs that cannot be started.
    """
    frees = predictor.mapping.frees
    values = np.array([free.start for free in frees]) if begin is None else np.asarray(begin, dtype=float)
    rounds = 1 + recipe.filtered
    at, inner = 0, None
    if resume is not None:
        at, values, inner = resume
    found = None
    for number in range(at, rounds):
        if checkpoint is not None and inner is None:
            checkpoint(number, values, None)
        make = training_windows if number == 0 else filtered_windows
        windows = make(runs, train, predictor, values, recipe, known)
        if inner is not None:
            predictor.rollouts -= len(windows)  # the evaluation at the checkpoint is made again
        hear = None if progress is None else partial(progress, number, rounds)
        keep = None if checkpoint is None else partial(checkpoint, number, values)
        if number == 0:
            found = first_round(predictor, windows, values, recipe, seed=seed, progress=hear, checkpoint=keep,
                                resume=inner)  # fmt: skip
            if found.problem.exact or all(one.known for one in windows):
                break  # the model explains the data, or there is nothing to make again
        else:
            found = later_round(
                predictor, windows, values, recipe, seed=seed + number, final=number + 1 == rounds, progress=hear
            )
        inner, values = None, found.values
    assert found is not None  # noqa: S101 - there is a round
    return found
