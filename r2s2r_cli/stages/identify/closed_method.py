"""`--drive closed-loop`: the controller inside the simulation, Levenberg-Marquardt on key frames by differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify.closed_residuals import ClosedResiduals
from r2s2r_cli.stages.identify.conclude import Fitted, concluded, start_found
from r2s2r_cli.stages.identify.fit import START_SPREAD, Fit, training_windows
from r2s2r_cli.stages.identify.found import Found, TraceStep
from r2s2r_cli.stages.identify.free.base import values_of
from r2s2r_cli.stages.identify.request import Step
from r2s2r_cli.stages.identify.solve.cma_es import cma_es
from r2s2r_cli.stages.identify.solve.horizon import Limits
from r2s2r_cli.stages.identify.solve.linearised import cost_of
from r2s2r_cli.stages.identify.solve.loss import LOSSES, Loss
from r2s2r_cli.stages.identify.solve.problem import Evaluation
from r2s2r_cli.stages.identify.solve.record import Checkpoint as SolverCheckpoint, Progress as SolverProgress
from r2s2r_cli.stages.identify.solve.starts import CLOSE, multi_start
from r2s2r_cli.stages.identify.task import Task, free_parameters
from r2s2r_cli.stages.identify.trust.identifiability import identifiability

LOSS = (
    "end caps at the key frame of each interval and its duration, controller in the loop, windows of {window} "
    "intervals, Student t, start states as estimated, derivatives by differences"
)
POPULATION = 32
"""Closed loops side by side in a generation."""
ENOUGH = 0.1
"""Differences of the cost within a generation below which sampling ends: a small share of what one sd is worth."""
ROUGH = "the cost of a closed loop is rough on the scale of these standard deviations: take them for a lower limit"
OF_THE_LOG = ("command_delay", "camera_delay")
"""Numbers between a log and the winches: no logged command is replayed here."""


def find_closed(task: Task) -> Found:
    """CMA-ES, finished by Levenberg-Marquardt, once a start; no profiles: every Jacobian is 4 n + 1 closed loops.

    Raises InputError for delays of a log and numbers without effect, NumericalError where nothing can be simulated.
    """
    problem = closed_problem(task)
    predictor, recipe = problem.predictor, task.recipe
    before = identifiability(problem, problem.z0, problem.frees)
    trace: list[TraceStep] = []
    keep = task.checkpoint
    saved = keep.load() if keep is not None else None

    def told(one: SolverProgress) -> None:
        trace.append(TraceStep(one.start, "closed loop", one.iteration, one.cost))
        task.progress(Step("fit", int(1000 * one.fraction), 1000, one.cost))

    def kept(one: SolverCheckpoint) -> None:
        if keep is not None:
            keep.save({"solver": one.to_dict()})

    z0s = _begins(task, problem, trace)
    trials = multi_start(
        [("closed loop", problem)], z0s, loss=LOSSES[recipe.loss], seed=task.request.seed,
        last=Limits(max_iterations=recipe.max_iterations, tolerance=1e-4, step_sd=0.1, gradient_sd=0.05),
        progress=told, checkpoint=kept, resume=None if saved is None else SolverCheckpoint.from_dict(saved["solver"]),
    )  # fmt: skip
    begin = np.array([free.start for free in problem.frees])
    first = np.tile(begin, (len(z0s), 1))
    fits = [Fit(problem, one, values_of(problem.frees, one.z), trials, first) for one in trials.solutions]
    rows = tuple(start_found(first[k], one) for k, one in zip(trials.order, fits, strict=True))
    close = [one.z for one in trials.solutions if one.cost <= trials.best.cost + CLOSE]
    took, real = problem.seconds(trials.best.z)
    made = Fitted(
        fits[0], rows, np.array(close), tuple(trace), LOSS.format(window=recipe.window), before, profiles=0,
        remarks=(f"in closed loop the training windows take {took:.2f} s, {real:.2f} s in the runs", ROUGH),
    )  # fmt: skip
    return concluded(task, predictor, made)


def _begins(task: Task, problem: ClosedResiduals, trace: list[TraceStep]) -> np.ndarray:
    """Where Levenberg-Marquardt begins, (starts, n)."""
    count = task.settings.starts
    found = []
    for start in range(count):

        def told(one: SolverProgress, start: int = start) -> None:
            trace.append(TraceStep(start, "CMA-ES", one.iteration, one.cost))
            task.progress(Step("CMA-ES", int(1000 * (start + one.fraction) / count), 1000, one.cost))

        found.append(sampled(task, problem, LOSSES[task.recipe.loss], task.request.seed + start, told))
    return np.array(found)


def sampled(
    task: Task, problem: ClosedResiduals, loss: Loss, seed: int, progress: Callable[[SolverProgress], None]
) -> np.ndarray:
    """The best point of CMA-ES from robot.toml's values, (n,): a generation is one batch of closed loops.

    The cost is rough where a robot rolls or a motor stops a tick later: from far off, differences lead nowhere.
    """

    def costs(points: np.ndarray) -> list[float]:
        found = []
        for z, residual in zip(points, problem.batch(points), strict=True):
            known = bool(np.isfinite(residual).all())
            found.append(cost_of(problem, z, Evaluation(residual, None, problem.block), loss)[0] if known else np.inf)
        return found

    return cma_es(
        problem, problem.z0, sd0=np.minimum(problem.prior_sd, START_SPREAD), seed=seed, loss=loss, tolerance=ENOUGH,
        budget=POPULATION * task.recipe.max_iterations, population=POPULATION, batch=costs, progress=progress,
    ).z  # fmt: skip


def closed_problem(task: Task) -> ClosedResiduals:
    """The training windows of a request at robot.toml's values."""
    asked = task.request.free or task.settings.free
    frees = free_parameters(task.robot, task.runs, task.request, task.settings)
    delays = [free.name for free in frees if free.name in OF_THE_LOG]
    if asked and delays:
        raise InputError(
            f"{delays[0]} has no effect in closed loop: no logged command is replayed", where="--drive closed-loop",
            expected="numbers of the robot, its ground and its controller", received=", ".join(delays),
            hint=f"r2s2r identify --drive replay --free {delays[0]}",
        )  # fmt: skip
    predictor = task.predictor([free for free in frees if free.name not in OF_THE_LOG])
    values = np.array([free.start for free in predictor.mapping.frees])
    recipe = replace(task.recipe, key_only=True)
    windows = training_windows(task.runs, task.request.train, predictor, values, recipe)
    return ClosedResiduals(predictor, windows, noise=recipe.noise)
