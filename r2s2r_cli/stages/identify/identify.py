"""The stage: from runs and a request to the artifact and the report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from r2s2r_cli import __version__
from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.fit import Fit, fit, more_starts, training_windows
from r2s2r_cli.stages.identify.found import OURS, Found, ParameterFound, StartFound, TraceStep
from r2s2r_cli.stages.identify.free import Free, Mapping, select
from r2s2r_cli.stages.identify.free.base import values_of
from r2s2r_cli.stages.identify.groups import identification
from r2s2r_cli.stages.identify.held_out import held_out
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe, default_free, recipe_of
from r2s2r_cli.stages.identify.report import report_of
from r2s2r_cli.stages.identify.request import Checkpoint, Progress, Request, Step, silent
from r2s2r_cli.stages.identify.residuals import CapResiduals
from r2s2r_cli.stages.identify.solve.record import Checkpoint as SolverCheckpoint, Progress as SolverProgress
from r2s2r_cli.stages.identify.starts_found import start_shifts
from r2s2r_cli.stages.identify.trust.identifiability import Identifiability, identifiability
from r2s2r_cli.stages.identify.trusted import profiled, sureness, weakest
from schemas.config import IdentifySettings
from schemas.results_identify import IdentifyReport
from schemas.robot import Robot

MOVED_SHARE = 0.25
"""Of the busiest winch's running time: winches that run less than this are left at robot.toml's speed by default."""


def identify(
    robot: Robot,
    runs: Sequence[RunData],
    request: Request,
    settings: IdentifySettings,
    *,
    cache_dir: Path | None = None,
    progress: Progress = silent,
    checkpoint: Checkpoint | None = None,
) -> tuple[ArtifactData, IdentifyReport]:
    """Identify a robot from its runs; the layout is that of `schemas/identification.py`.

    Raises UsageError for parameters that do not exist, InputError for what the runs cannot show or a start on a bound,
    NumericalError where nothing can be simulated.
    """
    found = find(robot, runs, request, settings, cache_dir=cache_dir, progress=progress, checkpoint=checkpoint)
    return identification(found), report_of(found)


def find(
    robot: Robot,
    runs: Sequence[RunData],
    request: Request,
    settings: IdentifySettings,
    *,
    cache_dir: Path | None = None,
    progress: Progress = silent,
    checkpoint: Checkpoint | None = None,
) -> Found:
    """The same as values: everything that was found."""
    recipe = recipe_of(settings)
    frees = free_parameters(robot, runs, request, settings)
    predictor = predictor_of(robot, frees, request, recipe, settings, cache_dir)
    before = known_before(runs, request, predictor, recipe)
    trace: list[TraceStep] = []
    fitted = _fitted(runs, request, predictor, recipe, trace, progress, checkpoint)
    fitted, starts, near = _other_starts(fitted, request, recipe, settings, progress)
    sure = sureness(fitted, near, loss=recipe.loss, seed=request.seed)
    rows = weakest(sure, settings.profiles)
    profiles, better = profiled(
        fitted, sure, rows, loss=recipe.loss,
        progress=lambda done: progress(Step("profiles", done, len(rows))),
    )  # fmt: skip
    warnings = []
    if better is not None:
        warnings.append("a profile came upon a lower cost: the fit is no minimum there, give it more --starts")
    if not fitted.solution.reason.converged:
        warnings.append(f"the fit did not converge: {fitted.solution.message}")
    judged = held_out(
        robot, runs, request, predictor, fitted.values, recipe, settings, cache_dir=cache_dir,
        progress=lambda done, total: progress(Step("held-out", done, total)),
    )  # fmt: skip
    fixed = tuple(fixed_parameter(robot, name, value) for name, value in request.fixed.items())
    return Found(
        request=request, robot=robot.name, engine=f"r2s2r {__version__}", step=recipe.step,
        loss=f"end caps at all frames of windows of {recipe.window} intervals, Student t, start states fitted along",
        parameters=(*sure.parameters, *fixed),
        train_segments=judged.train_segments, train=judged.train, test_segments=judged.test_segments, test=judged.test,
        cost=fitted.solution.cost, residuals=len(fitted.solution.residual),
        converged=fitted.solution.reason.converged, reason=fitted.solution.message,
        rollouts=predictor.rollouts + judged.rollouts, floor=judged.floor, free_runs=judged.free_runs,
        closed_loop_m=judged.closed_loop_m, covariance=widened(sure.spread.covariance, len(fixed)), information=before,
        trace=tuple(trace), starts=starts, profiles=profiles, windows=start_shifts(fitted), p_RS=judged.p_RS,
        uncertainty=sure.spread.how, computed_by_torch=not predictor.native,
        warnings=(*warnings, *judged.warnings),
    )  # fmt: skip


def free_parameters(
    robot: Robot, runs: Sequence[RunData], request: Request, settings: IdentifySettings
) -> tuple[Free, ...]:
    """Of --free, else of the settings, else the default set."""
    specs = request.free or settings.free or default_free(robot, busy(robot, runs, request))
    given = tuple(spec for spec in specs if spec.split("=")[0].split(",")[0] not in request.fixed)
    return select(given if not request.free else specs, robot, request.effects)


def busy(robot: Robot, runs: Sequence[RunData], request: Request) -> tuple[int, ...]:
    """Cables whose winches ran for a fair share of the training intervals, all runs together."""
    spent = np.zeros(len(robot.actuated))
    for one in request.train:
        run = next(run for run in runs if run.name == one.run)
        for number in one.intervals:
            inside = (run.t_command >= run.intervals.t_first[number - 1]) & (
                run.t_command <= run.intervals.t_last[number - 1]
            )
            spent += np.abs(np.nan_to_num(run.control[inside])).sum(axis=0)
    return tuple(
        cable for cable, time in zip(robot.actuated, spent, strict=True) if time > MOVED_SHARE * max(spent.max(), 1e-12)
    )


def predictor_of(
    robot: Robot, frees: Sequence[Free], request: Request, recipe: Recipe, settings: IdentifySettings,
    cache_dir: Path | None,
) -> Predictor:  # fmt: skip
    """The engine with these free and fixed numbers and the effects asked for."""
    from r2s2r_cli.stages.model import structure_of

    structure = replace(structure_of(robot), rod_contact=settings.rod_contact)
    mapping = Mapping(robot, frees, request.effects, fixed=request.fixed, structure=structure)
    return Predictor(mapping, step=recipe.step, cache_dir=cache_dir)


def known_before(runs: Sequence[RunData], request: Request, predictor: Predictor, recipe: Recipe) -> Identifiability:
    """What the training intervals can tell at all, at the values of robot.toml, each interval from its own start.

    Raises InputError for parameters without effect, and starts on a bound.
    """
    frees = predictor.mapping.frees
    values = np.array([free.start for free in frees])
    windows = training_windows(runs, request.train, predictor, values, replace(recipe, window=1))
    problem = CapResiduals(predictor, windows, spread=recipe.spread, noise=recipe.noise)
    return identifiability(problem, problem.z0, frees)


def _fitted(
    runs: Sequence[RunData], request: Request, predictor: Predictor, recipe: Recipe, trace: list[TraceStep],
    progress: Progress, checkpoint: Checkpoint | None,
) -> Fit:  # fmt: skip
    """The fit, with its trace, its progress and its checkpoints."""

    def told(number: int, rounds: int, one: SolverProgress) -> None:
        trace.append(TraceStep(0, f"round {number + 1}, {one.stage_name}", one.iteration, one.cost))
        done = (number + one.fraction) / rounds
        progress(Step("fit", int(1000 * done), 1000, one.cost))

    def kept(number: int, values: np.ndarray, one: SolverCheckpoint) -> None:
        assert checkpoint is not None  # noqa: S101 - only called where there is one
        checkpoint.save({"round": number, "values": values.tolist(), "solver": one.to_dict()})

    saved = checkpoint.load() if checkpoint is not None else None
    resume = None
    if saved is not None:
        resume = saved["round"], np.array(saved["values"]), SolverCheckpoint.from_dict(saved["solver"])
    return fit(
        runs, request.train, predictor, recipe, seed=request.seed, progress=told,
        checkpoint=None if checkpoint is None else kept, resume=resume,
    )  # fmt: skip


def _other_starts(
    fitted: Fit, request: Request, recipe: Recipe, settings: IdentifySettings, progress: Progress
) -> tuple[Fit, tuple[StartFound, ...], np.ndarray]:
    """Fits from other starts; the best of all; and the parameters (k, p) of those that are about as good."""
    frees = fitted.problem.frees
    n = len(frees)
    first = np.array([free.start for free in frees])
    own = StartFound(first, fitted.values, fitted.solution.cost, fitted.solution.iterations, fitted.solution.message)
    if settings.starts == 1 or not n:
        return fitted, (own,), fitted.solution.z[None, :n]

    def told(one: SolverProgress) -> None:
        progress(Step("starts", int(1000 * one.fraction), 1000, one.cost))

    trials, z0s = more_starts(fitted, recipe, settings.starts - 1, request.seed, told)
    found = [own]
    for solution, index in zip(trials.solutions, trials.order, strict=True):
        found.append(
            StartFound(
                values_of(frees, z0s[index][:n]),
                values_of(frees, solution.z[:n]),
                solution.cost,
                solution.iterations,
                solution.message,
            )
        )
    best = fitted
    if trials.best.cost < fitted.solution.cost:
        best = replace(fitted, solution=trials.best, values=values_of(frees, trials.best.z[:n]))
    everyone = [fitted.solution, *trials.solutions]
    close = best.solution.cost + CLOSE_SHARE * len(best.solution.residual)
    near = np.array([one.z[:n] for one in everyone if one.cost <= close])
    return best, tuple(found), near


CLOSE_SHARE = 1e-3
"""Costs within this many times the number of residuals are about as good: residuals of real runs are correlated."""


def fixed_parameter(robot: Robot, name: str, value: float) -> ParameterFound:
    """A number that was given."""
    from r2s2r_cli.stages.identify.free.catalogue import catalogue

    nan = float("nan")
    free = replace(catalogue(robot)[name], start=value)
    return ParameterFound(free, value, nan, nan, nan, (nan, nan), None, "fixed by hand")


def widened(covariance: np.ndarray, fixed: int) -> np.ndarray:
    """(n, n) with rows and columns of NaN for the fixed parameters behind the free ones."""
    n = len(covariance) + fixed
    found = np.full((n, n), np.nan)
    found[: len(covariance), : len(covariance)] = covariance
    return found


Told = Callable[[int, int], None]
__all__ = ["OURS", "find", "identify"]
