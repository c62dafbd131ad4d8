"""Several starts: whether the minimum that a fit found is the only one in reach."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.solve.horizon import relabel, solve_growing
from r2s2r_cli.stages.identify.solve.levenberg import solution_at
from r2s2r_cli.stages.identify.solve.loss import LOSSES, Loss
from r2s2r_cli.stages.identify.solve.problem import Problem
from r2s2r_cli.stages.identify.solve.record import Checkpoint, Progress, Solution, State

CLOSE = 0.5
"""Difference of costs (negative logarithms of likelihood) of two fits that explain the data about equally well: that of
a point one standard deviation from the minimum."""


def starts(
    lower: np.ndarray, upper: np.ndarray, z0: np.ndarray, *, n: int, seed: int, spread: float | np.ndarray = np.inf
) -> np.ndarray:
    """Starts, (n, len(z0)): z0 itself and a Latin hypercube in the box, no further than spread from z0.

    spread: in z, one number or (len(z0),); 0 leaves an unknown where it is, inf takes the whole box.
    Raises ValueError where an unknown has neither a finite box nor a finite spread.
    """
    z0 = np.clip(np.asarray(z0, dtype=float), lower, upper)
    low, high = np.maximum(lower, z0 - spread), np.minimum(upper, z0 + spread)
    if not np.all(np.isfinite(low) & np.isfinite(high)):
        raise ValueError("starts need finite bounds or a finite spread for every unknown")
    draw = np.random.default_rng(seed)
    others = max(n - 1, 0)
    cell = draw.permuted(np.tile(np.arange(others), (len(z0), 1)), axis=1).T
    share = (cell + draw.random((others, len(z0)))) / max(others, 1)
    return np.vstack([z0, low + share * (high - low)])[:n]


@dataclass(frozen=True)
class MultiStart:
    """Solutions from several starts, best first.

    order: number of each one's start. failed: starts without a finite simulation. close: how many reached the best cost
    within `CLOSE`. low, high: range over those, of the parameters.
    """

    solutions: tuple[Solution, ...]
    order: tuple[int, ...]
    failed: tuple[int, ...]
    close: int
    low: np.ndarray
    high: np.ndarray

    @property
    def best(self) -> Solution:
        """The solution of least cost."""
        return self.solutions[0]

    @property
    def share(self) -> float:
        """Share of all starts that reached the best cost."""
        return self.close / (len(self.solutions) + len(self.failed))


def multi_start(
    problems: Sequence[tuple[str, Problem]],
    z0s: np.ndarray,
    *,
    loss: Loss = LOSSES["none"],
    close: float = CLOSE,
    seed: int | None = None,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Callable[[Checkpoint], None] | None = None,
    resume: Checkpoint | None = None,
    **options: Any,
) -> MultiStart:
    """`solve_growing` from every start (k, n) with the same options. seed: of their draw, kept in the checkpoints.

    Raises NumericalError where no start can be evaluated.
    """
    finished = list(resume.finished) if resume is not None else []
    while len(finished) < len(z0s):
        index = len(finished)
        place = {"start": index, "finished": tuple(finished), "seed": seed}
        try:
            solution = solve_growing(
                problems,
                z0s[index],
                loss=loss,
                progress=relabel(progress, {"start": index, "starts": len(z0s)}),
                checkpoint=relabel(checkpoint, place),
                resume=resume,
                **options,
            )
        except NumericalError as error:
            finished.append(None)
            if not any(finished) and index == len(z0s) - 1:
                raise error
        else:
            finished.append(_finished(solution))
        resume = None
    return _summary(problems[-1][1], finished, loss, close)


def _finished(solution: Solution) -> Checkpoint:
    state = State(
        tuple(solution.z.tolist()),
        damping=0.0,
        iteration=solution.iterations,
        costs=solution.costs,
        counts=solution.counts,
        reason=solution.reason,
    )
    return Checkpoint(state, dropped=solution.dropped)


def _summary(problem: Problem, finished: Sequence[Checkpoint | None], loss: Loss, close: float) -> MultiStart:
    """Solutions are made again from their checkpoints, so that a resumed run and a plain one end alike."""
    kept = [(one.state.costs[-1], index) for index, one in enumerate(finished) if one is not None]
    order = tuple(index for _, index in sorted(kept))
    solutions = []
    for index in order:
        one = finished[index]
        assert one is not None  # noqa: S101 - by construction of `order`
        solutions.append(replace(solution_at(problem, one.state, loss), dropped=one.dropped))
    near = [solution for solution in solutions if solution.cost <= solutions[0].cost + close]
    z = np.array([solution.z[: len(problem.names)] for solution in near])
    failed = tuple(index for index, one in enumerate(finished) if one is None)
    return MultiStart(tuple(solutions), order, failed, len(near), z.min(axis=0), z.max(axis=0))
