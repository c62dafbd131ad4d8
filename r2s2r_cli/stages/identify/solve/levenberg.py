"""Bounded Levenberg-Marquardt with priors and robust weights; it can be interrupted after every iteration (ADR 8)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.solve.linearised import Linearised, cost_of, linearise
from r2s2r_cli.stages.identify.solve.loss import LOSSES, Loss
from r2s2r_cli.stages.identify.solve.problem import Problem, still_of
from r2s2r_cli.stages.identify.solve.record import (
    Checkpoint,
    Counts,
    Progress,
    Reason,
    Solution,
    State,
    names_on_bound,
)

LEAST_DAMPING = 1e-9
"""Keeps the scaled normal matrix positive definite in rounding where two unknowns cannot be told apart."""
MOST_DAMPING = 1e12
FASTEST = 0.2
"""Of the damping, after a step that came out as predicted. Nielsen's 1/3 took about one Jacobian more in ten."""
TOO_SHORT = 0.01
"""Share of `step_sd`: a refused step as short as that could not have mattered."""
IDLE = 3
"""Steps in a row that gain no more than the tolerance, which damping keeps short: the cost is rough there."""
ROUNDING = 1e-15
"""Predicted relative decrease of the cost that double precision cannot see."""


def levenberg_marquardt(
    problem: Problem,
    z0: np.ndarray,
    *,
    loss: Loss = LOSSES["none"],
    max_iterations: int = 40,
    tolerance: float = 1e-6,
    step_sd: float = 0.01,
    gradient_sd: float = 0.01,
    damping0: float = 1e-2,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Callable[[Checkpoint], None] | None = None,
    resume: Checkpoint | None = None,
) -> Solution:
    """Minimise the robust cost plus priors in the box, from z0 (n,) moved into it.

    Damping follows the gain ratio (Nielsen 1999), scaled by the diagonal of the normal matrix (Marquardt 1963). Steps
    to where the simulation is not finite are refused like steps that raise the cost. An iteration is an accepted step.

    tolerance: relative decrease of the cost, step_sd: length of two steps in a row, gradient_sd: length of the undamped
    step that is left, both in posterior standard deviations. checkpoint is called before progress; what either raises
    goes through. resume: the same problem and options give the same bits as without the interruption.

    Raises NumericalError where the start cannot be evaluated.
    """
    lower, upper = problem.lower, problem.upper
    if resume is None:
        at = linearise(problem, np.clip(np.asarray(z0, dtype=float), lower, upper), loss)
        damping = max(damping0, LEAST_DAMPING)
        state = State(tuple(at.z.tolist()), damping, costs=(at.cost,), counts=Counts(jacobian=1))
    else:
        state = resume.state
        at = linearise(problem, np.array(state.z), loss)
    while state.reason is None and (reason := _at_rest(at, state, problem, gradient_sd, max_iterations)) is None:
        done = state.iteration
        state, at, length = _iterate(problem, at, state, loss, (tolerance, step_sd))
        if state.iteration == done:
            break
        if checkpoint is not None:
            checkpoint(Checkpoint(state))
        if progress is not None:
            progress(Progress(state.iteration, max_iterations, at.cost, state.damping, length, state.counts))
    return _solution(problem, at, state if state.reason else replace(state, reason=reason))


def solution_at(problem: Problem, state: State, loss: Loss) -> Solution:
    """The solution that a finished state stands for; its evaluation is made again and not counted."""
    return _solution(problem, linearise(problem, np.array(state.z), loss), state)


def _at_rest(at: Linearised, state: State, problem: Problem, gradient_sd: float, max_iterations: int) -> Reason | None:
    newton = at.step(LEAST_DAMPING, problem.lower, problem.upper)
    if newton is not None and at.length(newton) <= gradient_sd:
        return Reason.GRADIENT
    return Reason.ITERATIONS if state.iteration >= max_iterations else None


def _iterate(
    problem: Problem, at: Linearised, state: State, loss: Loss, limits: tuple[float, float]
) -> tuple[State, Linearised, float]:
    """One accepted step, or the same point with the reason why there is none."""
    damping, growth, counts = state.damping, state.growth, state.counts
    tolerance, step_sd = limits
    still = still_of(problem)
    while damping <= MOST_DAMPING:
        step = at.step(damping, problem.lower, problem.upper)
        predicted = 0.0 if step is None else at.decrease(step)
        if step is not None and predicted <= ROUNDING * at.cost:
            reason = Reason.COST if damping <= 1.0 else Reason.STUCK
            return replace(state, damping=damping, growth=growth, counts=counts, reason=reason), at, 0.0
        new = None
        if step is not None and predicted > 0:
            z = np.clip(at.z + step, problem.lower, problem.upper)
            z[still] = at.z[still]
            new, gain, counts = _try(problem, z, at, predicted, loss, counts)
        length = 0.0 if step is None else at.length(step)
        if new is None:
            if step is not None and length <= TOO_SHORT * step_sd:
                break
            damping, growth = damping * growth, growth * 2.0
            continue
        # A short step says that the minimum is near only where it was not the damping that made it short.
        free = damping <= 1.0
        small = state.small_steps + 1 if free and length <= step_sd else 0
        gained = (at.cost - new.cost) / at.cost
        idle = state.idle_steps + 1 if gained <= tolerance else 0
        least = max(gained, predicted / at.cost) if free else 1.0
        reason_now = _done(least <= tolerance, small, idle)
        damping = max(damping * max(FASTEST, 1.0 - (2.0 * gain - 1.0) ** 3), LEAST_DAMPING)
        costs = (*state.costs, new.cost)
        z_now = tuple(new.z.tolist())
        done = state.iteration + 1
        return State(z_now, damping, 2.0, done, small, costs, counts, reason_now, idle), new, length
    return replace(state, damping=damping, growth=growth, counts=counts, reason=Reason.STUCK), at, 0.0


def _done(still: bool, small: int, idle: int) -> Reason | None:
    return Reason.COST if still else Reason.STEP if small >= 2 else Reason.STUCK if idle >= IDLE else None


def _try(
    problem: Problem,
    z: np.ndarray,
    at: Linearised,
    predicted: float,
    loss: Loss,
    counts: Counts,
) -> tuple[Linearised | None, float, Counts]:
    """The linearisation at z if its cost is lower than at `at`, the gain ratio, and the evaluations spent."""
    try:
        counts = replace(counts, plain=counts.plain + 1)
        cost, _ = cost_of(problem, z, problem.evaluate(z, jacobian=False), loss)
        if not cost < at.cost:
            return None, 0.0, counts
        counts = replace(counts, jacobian=counts.jacobian + 1)
        new = linearise(problem, z, loss)
    except NumericalError:
        return None, 0.0, counts
    return (new if new.cost < at.cost else None), min((at.cost - new.cost) / predicted, 1.0), counts


def _solution(problem: Problem, at: Linearised, state: State) -> Solution:
    jacobian, reason = at.evaluation.jacobian, state.reason
    assert jacobian is not None and reason is not None  # noqa: S101 - linearise and the loop see to it
    return Solution(
        z=at.z,
        cost=at.cost,
        costs=state.costs,
        residual=at.evaluation.residual,
        jacobian=jacobian,
        weight=at.weight,
        normal_data=at.normal_data,
        normal=at.normal,
        gradient=at.gradient,
        reason=reason,
        iterations=state.iteration,
        counts=state.counts,
        on_bound=names_on_bound(at.z, problem.lower, problem.upper, problem.names),
    )
