"""Growing horizon: fit the beginning first, then more, so that a far start does not lose its way in a long free run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, TypeVar

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.linearised import cost_of
from r2s2r_cli.stages.identify.solve.loss import LOSSES, Loss
from r2s2r_cli.stages.identify.solve.problem import Problem
from r2s2r_cli.stages.identify.solve.record import Checkpoint, Counts, Progress, Solution

Record = TypeVar("Record", Progress, Checkpoint)


@dataclass(frozen=True)
class Limits:
    """When Levenberg-Marquardt may end: its arguments of the same names."""

    max_iterations: int = 40
    tolerance: float = 1e-6
    step_sd: float = 0.01
    gradient_sd: float = 0.01


FULL = Limits()
EARLY = Limits(max_iterations=8, tolerance=1e-3, step_sd=0.3, gradient_sd=0.1)
"""Of all horizons but the last: they only have to come near."""


def solve_growing(
    problems: Sequence[tuple[str, Problem]],
    z0: np.ndarray,
    *,
    loss: Loss = LOSSES["none"],
    early: Limits = EARLY,
    last: Limits = FULL,
    damping0: float = 1e-2,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Callable[[Checkpoint], None] | None = None,
    resume: Checkpoint | None = None,
) -> Solution:
    """Solve named problems over the same unknowns, short horizon first, each from the solution before.

    A stage is dropped, and the next begins where it began, if it cannot be evaluated at its start or if its solution
    fits the next horizon worse than its start did. The solution is that of the last problem; its counts are those of
    all stages together. progress, checkpoint, resume: as in `levenberg_marquardt`.

    Raises NumericalError where the last problem cannot be evaluated at its start.
    """
    stages = len(problems)
    stage, spent, z = 0, Counts(), np.asarray(z0, dtype=float)
    dropped: tuple[str, ...] = ()
    if resume is not None:
        stage, dropped, spent, z = resume.stage, resume.dropped, resume.spent, np.array(resume.entered)
    while True:
        name, problem = problems[stage]
        final = stage == stages - 1
        place = {"stage": stage, "dropped": dropped, "spent": spent, "entered": tuple(z.tolist())}
        at = {"stage": stage, "stages": stages, "stage_name": name}
        try:
            solution = levenberg_marquardt(
                problem,
                z,
                loss=loss,
                damping0=damping0,
                progress=relabel(progress, at),
                checkpoint=relabel(checkpoint, place),
                resume=resume,
                **asdict(last if final else early),
            )
        except NumericalError:
            if final:
                raise
            spent, dropped = _add(spent, Counts(jacobian=1)), (*dropped, name)
        else:
            spent = _add(spent, solution.counts)
            if final:
                return replace(solution, counts=spent, dropped=dropped)
            spent = _add(spent, Counts(plain=2))
            following = problems[stage + 1][1]
            after, before = (_cost(following, one, loss) for one in (solution.z, z))
            if after <= before and np.isfinite(after):
                z = solution.z
            else:
                dropped = (*dropped, name)
        stage, resume = stage + 1, None


def relabel(tell: Callable[[Record], None] | None, fields: dict[str, Any]) -> Callable[[Record], None] | None:
    """The same listener, for an inner solver that does not know where in the outer one it stands."""
    return None if tell is None else lambda one: tell(replace(one, **fields))


def _cost(problem: Problem, z: np.ndarray, loss: Loss) -> float:
    try:
        z = np.clip(z, problem.lower, problem.upper)
        return cost_of(problem, z, problem.evaluate(z, jacobian=False), loss)[0]
    except NumericalError:
        return np.inf


def _add(one: Counts, other: Counts) -> Counts:
    return Counts(one.plain + other.plain, one.jacobian + other.jacobian)
