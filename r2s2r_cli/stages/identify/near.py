"""The beginning of the default fit, made once: the choice of the cables rests on it, and the fit goes on from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.stages.identify.free.base import values_of
from r2s2r_cli.stages.identify.growing import BEFORE_POPULATION, EARLY_HORIZONS, stages_of, started
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.solve.horizon import solve_growing
from r2s2r_cli.stages.identify.solve.levenberg import ended_at
from r2s2r_cli.stages.identify.solve.loss import LOSSES
from r2s2r_cli.stages.identify.solve.record import Checkpoint, Progress, Solution
from r2s2r_cli.stages.identify.windows import Window


@dataclass(frozen=True)
class Mark:
    """A point on the way of a fit: where to go on, what was said and how many simulations were made until there."""

    checkpoint: Checkpoint
    said: int
    rollouts: int


@dataclass(frozen=True)
class Near:
    """What derivatives reach over the intervals that they can be trusted with, with what they said on the way, and how
    many simulations that took. windows: those of the first round. mark: where the first round went by on this way, with
    the wider limits of its early horizons; None where it would not have come by. predictor: that made it."""

    windows: Sequence[Window]
    solution: Solution
    said: tuple[Progress, ...]
    rollouts: int
    mark: Mark | None
    predictor: Predictor


def near_fit(predictor: Predictor, windows: Sequence[Window], values: np.ndarray, recipe: Recipe) -> Near:
    """The beginning of the first round alone. Raises as `fit`."""
    names, stages, count = stages_of(predictor, windows, recipe)
    said: list[Progress] = []
    marks: list[Mark] = []
    before = predictor.rollouts
    solution = solve_growing(
        list(zip(names, stages, strict=True))[:count], started(stages[-1], values), loss=LOSSES[recipe.loss],
        early=EARLY_HORIZONS, last=BEFORE_POPULATION, progress=said.append,
        checkpoint=lambda one: marks.append(Mark(one, len(said) + 1, predictor.rollouts - before)),
    )  # fmt: skip
    mark = _passed(marks, count - 1) if count < len(stages) else None
    return Near(tuple(windows), solution, tuple(said), predictor.rollouts - before, mark, predictor)


def reached(near: Near) -> np.ndarray:
    """The values of the parameters that it came to, (n,), in their units."""
    frees = near.predictor.mapping.frees
    return values_of(frees, near.solution.z[: len(frees)])


def _passed(marks: Sequence[Mark], stage: int) -> Mark | None:
    """The mark at which this stage would have ended as an early horizon does."""
    own = [mark for mark in marks if mark.checkpoint.stage == stage]
    if not own:
        return None
    limits, states = EARLY_HORIZONS, [mark.checkpoint.state for mark in own]
    end = ended_at(states, max_iterations=limits.max_iterations, tolerance=limits.tolerance)
    mark = own[[state.iteration for state in states].index(end.iteration)]
    return replace(mark, checkpoint=replace(mark.checkpoint, state=end))


def tell(said: Sequence[Progress], progress: Callable[[Progress], None] | None) -> None:
    """Say again what was said when it was made."""
    if progress is not None:
        for one in said:
            progress(one)
