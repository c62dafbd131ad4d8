"""`--method cma`: CMA-ES beside the default fit, to see whether derivatives led it past a better minimum."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from r2s2r_cli.stages.identify.conclude import Assured, Fitted, assured, start_found
from r2s2r_cli.stages.identify.default_method import first_fit, loss_words
from r2s2r_cli.stages.identify.found import Found, StartFound, TraceStep
from r2s2r_cli.stages.identify.free.base import values_of
from r2s2r_cli.stages.identify.holding import concluded_to_shown, holding
from r2s2r_cli.stages.identify.kept import Kept
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.request import Step
from r2s2r_cli.stages.identify.rounds import START_SPREAD, Fit
from r2s2r_cli.stages.identify.solve.cma_es import Sampled, cma_es
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.loss import LOSSES
from r2s2r_cli.stages.identify.solve.record import Progress as SolverProgress
from r2s2r_cli.stages.identify.task import Task, free_parameters

EVALUATIONS = 25
"""Of CMA-ES, for each of the `max_iterations` of the settings: 1000 by default."""


def find_cma(task: Task) -> Found:
    """The default fit; CMA-ES from robot.toml's values as wide as their priors, at the start states of that fit; the
    better of the two, CMA-ES's finished by Levenberg-Marquardt. Raises as `identify`."""
    predictor = task.predictor(free_parameters(task.robot, task.runs, task.request, task.settings))
    task, predictor, before = holding(task, predictor)
    kept = Kept(task.checkpoint)

    def make(task: Task, predictor: Predictor) -> Assured:
        fitted = first_fit(task, predictor, kept)
        best, starts, words = better_of(task, fitted, _sampled(task, fitted, kept))
        made = Fitted(
            best, starts, best.solution.z[None, : len(best.values)], tuple(kept.steps),
            f"{loss_words(task)}; CMA-ES over the parameters beside it", before, task.settings.profiles,
            remarks=(words,),
        )  # fmt: skip
        return assured(task, made)

    return concluded_to_shown(task, predictor, make, kept)


def _sampled(task: Task, fitted: Fit, kept: Kept) -> Sampled:
    """CMA-ES beside the fit. Its checkpoint holds the costs of all generations: told again, they take it to where it
    was, and make the same steps of the trace; no simulation is made twice."""
    problem, n = fitted.problem, len(fitted.values)
    predictor = problem.predictor
    z0 = fitted.solution.z.copy()
    z0[:n] = problem.z0[:n]
    budget = EVALUATIONS * task.settings.max_iterations
    before = predictor.rollouts
    predictor.rollouts += kept.saved.get("sampling", 0)
    known = [[math.inf if cost is None else cost for cost in one] for one in kept.saved.get("generations", ())]

    def told(one: SolverProgress) -> None:
        kept.steps.append(TraceStep(1, "CMA-ES", one.iteration, one.cost))
        task.progress(Step("CMA-ES", min(one.counts.plain, budget), budget, one.cost))

    def keep(generations: Sequence[Sequence[float]]) -> None:
        rows = [[cost if math.isfinite(cost) else None for cost in one] for one in generations]
        kept.save(generations=rows, sampling=predictor.rollouts - before)

    return cma_es(
        problem, z0, sd0=np.minimum(problem.prior_sd[:n], START_SPREAD), budget=budget, seed=task.request.seed,
        loss=LOSSES[task.recipe.loss], progress=told, checkpoint=keep, resume=known,
    )  # fmt: skip


def better_of(task: Task, fitted: Fit, sampled: Sampled) -> tuple[Fit, tuple[StartFound, ...], str]:
    """The fit of least cost; both as rows of starts; and in words how they compare."""
    frees, n = fitted.problem.frees, len(fitted.values)
    first = [free.start for free in frees]
    reason = f"CMA-ES, {sampled.counts.plain} evaluations, ended by {sampled.reason}"
    there = StartFound(
        np.array(first), values_of(frees, sampled.z[:n]), sampled.cost, len(sampled.costs), reason
    )  # fmt: skip
    starts = (start_found(first, fitted), there)
    head = f"CMA-ES reached cost {sampled.cost:.6g}, the default fit {fitted.solution.cost:.6g}"
    if sampled.cost >= fitted.solution.cost:
        return fitted, starts, f"{head}: no better minimum was found, the numbers are those of the default fit"
    finished = levenberg_marquardt(
        fitted.problem, sampled.z, loss=LOSSES[task.recipe.loss], max_iterations=task.recipe.max_iterations
    )
    best = replace(fitted, solution=finished, values=values_of(frees, finished.z[:n]))
    return best, starts, f"{head}: the numbers are those of CMA-ES, finished by Levenberg-Marquardt"
