"""`--drive closed-loop`: the controller inside the simulation, from several starts; judged as every other fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import cast

import numpy as np

from r2s2r_cli.stages.identify.closed_fit import ClosedFit, fit_closed
from r2s2r_cli.stages.identify.closed_residuals import ClosedResiduals
from r2s2r_cli.stages.identify.conclude import Assured, Fitted, assured, start_found
from r2s2r_cli.stages.identify.found import Found, TraceStep
from r2s2r_cli.stages.identify.free import select
from r2s2r_cli.stages.identify.holding import concluded_to_shown, holding_effects, require_any
from r2s2r_cli.stages.identify.kept import Kept
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import default_free
from r2s2r_cli.stages.identify.request import Step
from r2s2r_cli.stages.identify.residuals import CapResiduals
from r2s2r_cli.stages.identify.rounds import Fit
from r2s2r_cli.stages.identify.solve.record import Progress as SolverProgress
from r2s2r_cli.stages.identify.solve.starts import CLOSE
from r2s2r_cli.stages.identify.task import Task, busy, specs_asked
from r2s2r_cli.stages.identify.training import training_windows
from r2s2r_cli.stages.identify.trust.identifiability import Identifiability, identifiability

LOSS = (
    "end caps at the key frame of each interval and its duration, controller in the loop, windows of {window} "
    "intervals with free start states, Student t, planes through samples"
)
ROUGH = (
    "about the fit, simulations scatter by {:.2g} of what observations do, since a controller decides tick by tick: "
    "the standard deviations count that"
)
OF_THE_LOOP = ("camera_delay,~0.1", "pid_min_length,~0.1")
"""Free beside the default set: when the controller sees a cable arrive, and how long it reads."""


def find_closed(task: Task) -> Found:
    """A fit for each start; no profiles: every point of one is a search. Raises InputError for numbers without effect,
    NumericalError where nothing can be simulated."""
    predictor = closed_predictor(task)
    problem = closed_problem(task, predictor)
    before = identifiability(problem, problem.z0, problem.frees)
    kept = Kept(task.checkpoint)
    task, predictor = holding_effects(task, predictor, before, _looked)
    require_any(task.held, before.names)

    def make(task: Task, predictor: Predictor) -> Assured:
        fits = [_fit_of(task, predictor, kept, start) for start in range(task.settings.starts)]
        return assured(task, _fitted(task, fits, kept, before))

    return concluded_to_shown(task, predictor, make, kept, look=_looked)


def _fitted(task: Task, fits: Sequence[ClosedFit], kept: Kept, before: Identifiability) -> Fitted:
    """The best of the fits, with those of all starts."""
    best = min(fits, key=lambda one: (one.problem.noise > 0, one.solution.cost))
    first = np.array([free.start for free in best.problem.frees])
    near = [one.solution.z[: len(first)] for one in fits if one.solution.cost <= best.solution.cost + CLOSE]
    rows = tuple(start_found(first, _as_fit(one)) for one in fits)
    took, real = best.problem.seconds(best.solution.z)
    return Fitted(
        _as_fit(best), rows, np.array(near), tuple(kept.steps), LOSS.format(window=task.recipe.window), before,
        profiles=0,
        remarks=(
            f"in closed loop the training windows take {took:.2f} s, {real:.2f} s in the runs",
            ROUGH.format(float(np.median(best.surface.rough))),
        ),
    )  # fmt: skip


def _looked(task: Task, predictor: Predictor) -> Identifiability:
    """What the windows say in closed loop where a fit begins."""
    problem = closed_problem(task, predictor)
    return identifiability(problem, problem.z0, problem.frees, refuse=False)


def closed_predictor(task: Task) -> Predictor:
    """The engine with the free numbers of a request; where it names none, those of the loop as well."""
    default = (*default_free(task.robot, busy(task.robot, task.runs, task.request)), *OF_THE_LOOP)
    specs = specs_asked(task.request, task.settings, default)
    return task.predictor(select(specs, task.robot, task.request.effects, task.request.fixed))


def closed_problem(task: Task, predictor: Predictor | None = None) -> ClosedResiduals:
    """The training windows of a request at robot.toml's values."""
    predictor = predictor or closed_predictor(task)
    values = np.array([free.start for free in predictor.mapping.frees])
    windows = training_windows(task.runs, task.request.train, predictor, values, task.recipe)
    recipe = task.recipe
    return ClosedResiduals(predictor, windows, values, spread=recipe.spread, noise=recipe.noise, held=recipe.held)


def _fit_of(task: Task, predictor: Predictor, kept: Kept, start: int) -> ClosedFit:
    """One start. Its checkpoint holds the costs of all generations of all starts: told again they take the searches to
    where they were; planes are made again, and are the same."""
    count, key = task.settings.starts, f"generations {start}"

    def told(stage: str, one: SolverProgress) -> None:
        kept.steps.append(TraceStep(start, stage, one.iteration, one.cost))
        done = (start + one.iteration / max(one.max_iterations, 1)) / count
        task.progress(Step(stage, int(1000 * done), 1000, one.cost))

    def keep(generations: Sequence[Sequence[float]]) -> None:
        kept.save(**{key: [[cost if math.isfinite(cost) else None for cost in one] for one in generations]})

    known = [[math.inf if cost is None else cost for cost in one] for one in kept.saved.get(key, ())]
    return fit_closed(
        task.runs, task.request.train, predictor, task.recipe, seed=task.request.seed + start, progress=told,
        checkpoint=keep, resume=known,
    )  # fmt: skip


def _as_fit(one: ClosedFit) -> Fit:
    """The plane at the minimum stands for the problem: it has all that is asked of one there."""
    return Fit(cast(CapResiduals, one.surface), one.solution, one.values)
