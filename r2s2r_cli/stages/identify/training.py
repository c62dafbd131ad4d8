"""Windows to train on, with the states that they start from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.start import states_at
from r2s2r_cli.stages.identify.windows import Window, begins_after_tip, selected, spans, window

if TYPE_CHECKING:
    from r2s2r_cli.engine import State


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
