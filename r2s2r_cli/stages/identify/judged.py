"""Intervals predicted with given parameters, each from its own causal start and in a free run; nothing is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.start import starts_at
from r2s2r_cli.stages.identify.ways import Start
from r2s2r_cli.stages.identify.windows import Window, window
from r2s2r_cli.stages.measures.steps import Step, chains, steps_of
from r2s2r_cli.stages.measures.table import Predicted

if TYPE_CHECKING:
    from r2s2r_cli.engine import State

Starts = dict[tuple[str, int], Start]
"""Where intervals start, by run and interval, 1-based."""
MEMBERS = 32
"""Of the filter's ensemble, that predict what follows from a start."""


@dataclass(frozen=True)
class Replayed:
    """Simulated steps: simulated (frame, cap, 3) [m] of each, start frame first; free: the same of each chain of steps,
    from the start of its first; () where no free run was asked for. Means over what is not known of the start: how caps
    stick and slip from a start that is known to millimetres is chance, and of all predictions their mean errs least."""

    steps: tuple[Step, ...]
    simulated: tuple[np.ndarray, ...]
    free: tuple[np.ndarray, ...]

    @property
    def predicted(self) -> Predicted:
        """As the table of measures takes it."""
        if not self.steps:
            return Predicted(np.zeros((0, 0, 3)))
        return Predicted(np.array([path[-1] for path in self.simulated]), self.free)


def steps_from(runs: Sequence[RunData], selections: Sequence[Selection], *, smoothed: bool = False) -> tuple[Step, ...]:
    """The selected intervals as steps; smoothed: with the smoothed caps, which know later frames (training only)."""
    named = {run.name: run for run in runs}
    found: list[Step] = []
    for one in selections:
        run = named[one.run]
        found += steps_of(run, one.intervals, p_WE=run.p_WE if smoothed else None)
    return tuple(found)


def starts_of(
    runs: Sequence[RunData], selections: Sequence[Selection], predictor: Predictor, values: np.ndarray, recipe: Recipe
) -> Starts:
    """Causal starts of the selected intervals, and of those before them: one pass of the filter over each run.

    Raises as `starts_at`.
    """
    last: dict[str, int] = {}
    for one in selections:
        last[one.run] = max(*one.intervals, last.get(one.run, 1))
    return starts_at([run for run in runs if run.name in last], predictor, values, last, belief=recipe.belief)


def replayed(
    runs: Sequence[RunData],
    selections: Sequence[Selection],
    predictor: Predictor,
    values: np.ndarray,
    recipe: Recipe,
    *,
    free_run: bool = True,
    known: dict[str, State] | None = None,
    starts: Starts | None = None,
) -> Replayed:
    """Simulate the selected intervals by command replay. known: true states at the first frames of runs. starts: what
    `starts_of` says of these intervals, and maybe others, with the same values; None: found here.

    Raises NumericalError where the simulation leaves the finite numbers.
    """
    steps = steps_from(runs, selections)
    if not steps:
        return Replayed((), (), ())
    named = {run.name: run for run in runs}
    found = starts_of(runs, selections, predictor, values, recipe) if starts is None else dict(starts)
    found.update({(name, 1): Start(state) for name, state in (known or {}).items()})
    parts = [*((step,) for step in steps), *(chains(steps) if free_run else ())]
    paths = [
        mean_path(
            predictor, values, named[part[0].run], tuple(step.interval for step in part),
            found[part[0].run, part[0].interval],
        )
        for part in parts
    ]  # fmt: skip
    return Replayed(steps, tuple(paths[: len(steps)]), tuple(paths[len(steps) :]))


def mean_path(
    predictor: Predictor, values: np.ndarray, run: RunData, intervals: tuple[int, ...], start: Start
) -> np.ndarray:
    """End caps (frame, cap, 3) [m] of these intervals in a row, start frame first: the mean over MEMBERS of the start,
    those left out that cannot be simulated. Raises NumericalError where none can."""
    from r2s2r_cli.engine.flat import unpack_state

    own = window(run, intervals, start.state, whole=True)
    if start.members is None:
        return simulated_paths(predictor, values, [own])[0]
    many = [replace(own, state=unpack_state(predictor.structure, one[None])) for one in start.members[:MEMBERS]]
    try:
        paths = simulated_paths(predictor, values, many)
    except NumericalError:
        paths = [path for one in many for path in _or_none(predictor, values, one)]
        if not paths:
            raise
    return np.asarray(np.mean(paths, axis=0))


def _or_none(predictor: Predictor, values: np.ndarray, one: Window) -> list[np.ndarray]:
    try:
        return simulated_paths(predictor, values, [one])
    except NumericalError:
        return []


def simulated_paths(predictor: Predictor, values: np.ndarray, windows: Sequence[Window]) -> list[np.ndarray]:
    """End caps (frame, cap, 3) [m] at the frames of each window, its start before them."""
    import torch

    from r2s2r_cli.engine import end_caps

    seen = predictor.predict(windows, values)
    theta = predictor.mapping.theta(torch.as_tensor(values, dtype=torch.float64))
    up = np.array([0.0, 0.0, predictor.mapping.observation(values).ground_height])
    paths = []
    for k, one in enumerate(windows):
        start = end_caps(theta, one.state).numpy() + up
        paths.append(np.concatenate([start, seen.p_WE[seen.window == k]]))
    return paths
