"""`--method default`: Levenberg-Marquardt on recorded commands, from several starts."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.identify.alike import as_the_others
from r2s2r_cli.stages.identify.conclude import Assured, Fitted, assured, start_found
from r2s2r_cli.stages.identify.fit import fit
from r2s2r_cli.stages.identify.found import Found, StartFound, TraceStep
from r2s2r_cli.stages.identify.free.base import values_of
from r2s2r_cli.stages.identify.holding import concluded_to_shown, holding
from r2s2r_cli.stages.identify.kept import Kept
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.request import Step
from r2s2r_cli.stages.identify.rounds import Fit, more_starts
from r2s2r_cli.stages.identify.solve.record import Checkpoint as SolverCheckpoint, Progress as SolverProgress
from r2s2r_cli.stages.identify.task import Task, free_parameters
from r2s2r_cli.stages.identify.windows import spans

LOSS = (
    "end caps at all frames, Student t: windows of up to {window} with free start states, then of "
    "{short} from filtered ones"
)
CLOSE_SHARE = 1e-3
"""Costs within this many times the number of residuals are about as good: residuals of real runs are correlated."""


def find_default(task: Task) -> Found:
    """Fit and judge. Raises as `identify`."""
    frees = free_parameters(task.robot, task.runs, task.request, task.settings)
    predictor = task.predictor(frees)
    task, predictor, before = holding(task, predictor)
    kept = Kept(task.checkpoint)

    def make(task: Task, predictor: Predictor) -> Assured:
        fitted = first_fit(task, predictor, kept)
        starts, near = _other_starts(task, fitted)
        trace, words = tuple(kept.steps), loss_words(task)
        return assured(task, Fitted(fitted, starts, near, trace, words, before, task.settings.profiles))

    return concluded_to_shown(task, predictor, make, kept)


def loss_words(task: Task) -> str:
    """What the default fit makes small: windows as long as the training intervals allow."""
    recipe = task.recipe
    longest = max(len(one) for chosen in task.request.train for one in spans(chosen.intervals, recipe.window))
    short = [length for length in recipe.short if length <= longest] or [longest]
    whole = f"{longest} target interval{'s' if longest > 1 else ''}"
    return LOSS.format(window=whole, short=", ".join(map(str, short)))


def first_fit(task: Task, predictor: Predictor, kept: Kept) -> Fit:
    """The fit from the starts of the parameters, with its trace, its progress and its checkpoints; or the rest of it,
    from where `kept` was left. Winches that it could not show are as the others. Raises as `fit`."""

    def told(number: int, rounds: int, one: SolverProgress) -> None:
        kept.steps.append(TraceStep(0, f"round {number + 1}, {one.stage_name}", one.iteration, one.cost))
        if kept.held:
            kept.save_with_trace(rollouts=predictor.rollouts)
        done = (number + one.fraction) / rounds
        task.progress(Step.share("fit", done, one.cost))

    def hold(number: int, values: np.ndarray, one: SolverCheckpoint | None) -> None:
        kept.hold(round=number, values=values.tolist(), solver=None if one is None else one.to_dict())
        if one is None:  # a round that is taken up begins anew, with the trace and the count of its beginning
            kept.save_with_trace(rollouts=predictor.rollouts)

    saved, resume = kept.saved, None
    if saved:
        solver = None if saved["solver"] is None else SolverCheckpoint.from_dict(saved["solver"])
        resume = saved["round"], np.array(saved["values"]), solver
        predictor.rollouts = saved["rollouts"]
    found = fit(
        task.runs, task.request.train, predictor, task.recipe, seed=task.request.seed, progress=told,
        checkpoint=hold, resume=resume,
    )  # fmt: skip
    return as_the_others(found)


def _other_starts(task: Task, fitted: Fit) -> tuple[tuple[StartFound, ...], np.ndarray]:
    """Fits of the last round's windows from other starts; and the parameters (k, p) of those that are about as good.

    They tell the range, and do not replace the fit: the start states of the windows were filtered with its parameters,
    so that a lower cost with others may only say that they make up for these.
    """
    frees = fitted.problem.frees
    n, settings = len(frees), task.settings
    own = start_found([free.start for free in frees], fitted)
    if settings.starts == 1 or not n:
        return (own,), fitted.solution.z[None, :n]

    def told(one: SolverProgress) -> None:
        task.progress(Step.share("starts", one.fraction, one.cost))

    others = more_starts(fitted, task.recipe, settings.starts - 1, task.request.seed, told)
    found = [own]
    for z0, solution in others:
        first, last = (values_of(frees, z[:n]) for z in (z0, solution.z))
        found.append(StartFound(first, last, solution.cost, solution.iterations, solution.message))
    close = fitted.solution.cost + CLOSE_SHARE * len(fitted.solution.residual)
    near = [fitted.solution, *(one for _, one in others if one.cost <= close)]
    return tuple(found), np.array([one.z[:n] for one in near])
