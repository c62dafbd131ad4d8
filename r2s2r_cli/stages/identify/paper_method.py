"""`--method paper`: Adam on the Key Frame Loss, judged like every other method. The paper's own is in closed loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from r2s2r_cli import __version__
from r2s2r_cli.stages.identify.conclude import judged_by
from r2s2r_cli.stages.identify.found import Found, ParameterFound, StartFound, TraceStep
from r2s2r_cli.stages.identify.free import select
from r2s2r_cli.stages.identify.holding import fitted_to_shown, holding_effects, require_any
from r2s2r_cli.stages.identify.kept import Kept
from r2s2r_cli.stages.identify.paper import (
    PAPER_FREE,
    PaperFit,
    Preset,
    Settings,
    demonstrations,
    preset,
    settled_start,
)
from r2s2r_cli.stages.identify.paper.adam import identify_paper
from r2s2r_cli.stages.identify.paper.demonstration import Demonstration
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.request import Step
from r2s2r_cli.stages.identify.solve.record import names_on_bound
from r2s2r_cli.stages.identify.task import Task, specs_asked
from r2s2r_cli.stages.identify.trust.identifiability import Trust
from r2s2r_cli.stages.identify.trusted import NOT_SHOWN, held_as

NO_SD = "method paper gives no uncertainty"
LOSS = "Key Frame Loss of the paper, mean squared distance of the end caps at key frames [m^2], {drive}, state detached"


def find_paper(task: Task) -> Found:
    """The paper's fit, from robot.toml's values and from rest at the first caps of each stretch of intervals.

    Raises UsageError for numbers that the engine does not read, NumericalError where the robot does not come to rest
    where a stretch begins or the simulation leaves the finite numbers.
    """
    request, settings = task.request, task.settings
    made, judge = paper_engines(task)
    task, judge = holding_effects(task, judge)
    require_any(task.held, judge.mapping.names)
    named = {run.name: run for run in task.runs}
    demos = [demo for one in request.train for demo in demonstrations(named[one.run], one)]
    asked = Settings(iterations=settings.max_iterations, closed_loop=request.drive == "closed loop")
    kept = Kept(task.checkpoint)

    def make(task: Task, judge: Predictor) -> tuple[Preset, Predictor, PaperFit]:
        own = replace(made, numbers=made.numbers.starting(judge.mapping.frees))
        return own, judge, _fitted(task, own, demos, replace(asked, held=task.held), kept)

    task, (own, judge, fit) = fitted_to_shown(task, judge, make, lambda one: _without_derivative(one[2]), kept=kept)
    return _found(task, own, judge, fit, demos)


def paper_engines(task: Task) -> tuple[Preset, Predictor]:
    """The paper's engine with what is free in it, and the one of the other methods, which replays commands and judges.
    Raises UsageError for numbers that one of them does not read: before anything is fitted."""
    from r2s2r_cli.stages.model import structure_of

    request = task.request
    frees = select(specs_asked(request, task.settings, PAPER_FREE), task.robot, request.effects, request.fixed)
    made = preset(
        task.robot, frees, effects=request.effects, fixed=task.given,
        structure=replace(structure_of(task.robot), rod_contact=task.settings.rod_contact), step=task.recipe.step,
        cache_dir=task.cache_dir,
    )  # fmt: skip
    return made, task.predictor(frees)


def _fitted(task: Task, made: Preset, demos: list[Demonstration], asked: Settings, kept: Kept) -> PaperFit:
    """Adam, with progress and checkpoints. The last step is left out of the checkpoint: a resumed fit makes it again,
    and knows its mask."""
    starts = [settled_start(made, demo.p_WE[0], run=demo.name) for demo in demos]

    def save(values: Mapping[str, Any]) -> None:
        if len(values["rows"]) < asked.iterations:
            kept.save(adam=dict(values))

    return identify_paper(
        made.world, made.numbers, demos, starts, asked,
        progress=lambda number, loss: task.progress(Step("fit", number, asked.iterations, loss)), save=save,
        resume=kept.saved.get("adam"),
    )  # fmt: skip


def _still(fit: PaperFit) -> np.ndarray:
    """(n,) bool: the loss had no derivative by it at any step."""
    return np.asarray(~np.any(fit.trace.gradients != 0, axis=0))


def _without_derivative(fit: PaperFit) -> list[str]:
    return [name for name, still in zip(fit.names, _still(fit), strict=True) if still]


def _found(task: Task, made: Preset, predictor: Predictor, fit: PaperFit, demos: list[Demonstration]) -> Found:
    trace = fit.trace
    judged = judged_by(task, predictor, fit.best)
    best = int(np.argmin(trace.whole))
    steps = len(trace.losses)
    reason = f"Adam made the {steps} steps it was given; the smallest loss over all segments came at step {best + 1}"
    values = tuple(
        TraceStep(0, "Adam", k + 1, float(trace.losses[k]), trace.values[k].copy()) for k in range(steps)
    )  # fmt: skip
    warnings = []
    if best == steps - 1:
        warnings.append("the loss was still falling when Adam ended: --set identify.max_iterations=N for more steps")
    return Found(
        request=task.request, robot=task.robot.name, engine=f"r2s2r {__version__}", step=made.world.step,
        loss=LOSS.format(drive=task.request.drive), parameters=(*_parameters(fit, made, task.held), *task.fixed()),
        train_segments=judged.train_segments, train=judged.train, test_segments=judged.test_segments, test=judged.test,
        cost=float(trace.whole[best]), residuals=_residuals(demos), converged=False, reason=reason,
        rollouts=steps * len(demos) + predictor.rollouts + judged.rollouts, floor=judged.floor,
        free_runs=judged.free_runs, closed_loop_m=judged.closed_loop_m, trace=values,
        starts=(StartFound(made.first, fit.best, float(trace.whole[best]), steps, reason),), p_RS=judged.p_RS,
        mask="; ".join(fit.words), uncertainty=NO_SD, natures=task.natures, computed_by_torch=not predictor.native,
        warnings=(*warnings, *judged.warnings),
    )  # fmt: skip


def _residuals(demos: list[Demonstration]) -> int:
    """Coordinates at the key frames of the real run."""
    return sum(len(demo.spans) * demo.p_WE[0].size for demo in demos)


def _parameters(fit: PaperFit, made: Preset, held: Sequence[str]) -> tuple[ParameterFound, ...]:
    """Values without an interval: Adam gives none, and none is made up."""
    frees, nan = made.numbers.frees, float("nan")
    lower, upper = (np.array([getattr(free, side) for free in frees]) for side in ("lower", "upper"))
    bound = names_on_bound(fit.best, lower, upper, fit.names)
    still = _still(fit)
    found = []
    for k, free in enumerate(frees):
        trust, reason = Trust.WEAK, NO_SD
        if free.name in held:
            trust, reason = Trust.NOT_IDENTIFIABLE, f"{NOT_SHOWN}: {held_as(free)}"
        elif still[k]:
            trust, reason = Trust.NOT_IDENTIFIABLE, "the loss had no derivative by it at any step"
        elif free.name in bound:
            trust, reason = Trust.ON_BOUND, f"the runs ask for more than its bound allows; {NO_SD}"
        found.append(ParameterFound(free, float(fit.best[k]), nan, nan, nan, (nan, nan), trust, reason))
    return tuple(found)
