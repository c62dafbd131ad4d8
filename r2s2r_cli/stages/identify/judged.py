"""Intervals predicted with given parameters, each from its own causal start and in a free run; nothing is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.start import states_at
from r2s2r_cli.stages.identify.windows import Window, window
from r2s2r_cli.stages.measures.steps import Step, chains, steps_of
from r2s2r_cli.stages.measures.table import Predicted

if TYPE_CHECKING:
    from r2s2r_cli.engine import State

Starts = dict[tuple[str, int], "State"]
"""Start states (batch of 1) by run and interval, 1-based."""


@dataclass(frozen=True)
class Replayed:
    """Simulated steps: simulated (frame, cap, 3) [m] of each, start frame first; free: the same of each chain of steps,
    from the start of its first; () where no free run was asked for."""

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
    """Causal start states of the selected intervals, and of those before them: one pass of the filter over each run.

    Raises as `states_at`.
    """
    last: dict[str, int] = {}
    for one in selections:
        last[one.run] = max(*one.intervals, last.get(one.run, 1))
    return states_at([run for run in runs if run.name in last], predictor, values, last, belief=recipe.belief)


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
    states = starts_of(runs, selections, predictor, values, recipe) if starts is None else dict(starts)
    states.update({(name, 1): state for name, state in (known or {}).items()})
    windows = [window(named[step.run], (step.interval,), states[step.run, step.interval], whole=True) for step in steps]
    runs_free = [
        window(
            named[chain[0].run], tuple(s.interval for s in chain), states[chain[0].run, chain[0].interval], whole=True
        )
        for chain in (chains(steps) if free_run else ())
    ]
    paths = simulated_paths(predictor, values, [*windows, *runs_free])
    return Replayed(steps, tuple(paths[: len(windows)]), tuple(paths[len(windows) :]))


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
