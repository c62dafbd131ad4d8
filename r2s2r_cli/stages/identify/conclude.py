"""From a finished fit to all that was found: how sure each number is, and how well unseen intervals are predicted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli import __version__
from r2s2r_cli.stages.identify.closed_free_run import loop_of
from r2s2r_cli.stages.identify.found import Found, ProfileFound, StartFound, TraceStep, Update
from r2s2r_cli.stages.identify.held_out import Judged, held_out
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.request import Step
from r2s2r_cli.stages.identify.residuals import CapResiduals
from r2s2r_cli.stages.identify.rounds import Fit
from r2s2r_cli.stages.identify.starts_found import start_shifts
from r2s2r_cli.stages.identify.task import Task
from r2s2r_cli.stages.identify.training import training_windows
from r2s2r_cli.stages.identify.trust.identifiability import Identifiability, identifiability
from r2s2r_cli.stages.identify.trusted import Sureness, profiled, sureness, weakest, widened_by


@dataclass(frozen=True)
class Fitted:
    """A least-squares fit with its history. near: parameters (k, p), z, of fits that explain the data about as well.
    loss: in words. profiles: how many of the weakest parameters get one. remarks: what else to say in the report."""

    fit: Fit
    starts: tuple[StartFound, ...]
    near: np.ndarray
    trace: tuple[TraceStep, ...]
    loss: str
    before: Identifiability | None
    profiles: int
    updates: tuple[Update, ...] = ()
    remarks: tuple[str, ...] = ()


def known_before(task: Task, predictor: Predictor, *, refuse: bool = True) -> Identifiability:
    """What the training intervals can tell at all, where a fit would begin, each interval from its own start.

    Raises, with `refuse`, InputError for starts on a bound, and for parameters that were asked for and have no effect.
    One of the default set may have none: a random policy need not reel out every cable. It is not identifiable, and is
    held.
    """
    frees, recipe = predictor.mapping.frees, task.recipe
    values = np.array([free.start for free in frees])
    windows = training_windows(task.runs, task.request.train, predictor, values, replace(recipe, window=1))
    problem = CapResiduals(predictor, windows, spread=recipe.spread, noise=recipe.noise, held=recipe.held)
    return identifiability(problem, problem.z0, frees, refuse=refuse, excused=task.of_default)


@dataclass(frozen=True)
class Assured:
    """A fit with how sure its numbers are. better: all unknowns where a profile came upon a lower cost, else None."""

    made: Fitted
    sure: Sureness
    profiles: tuple[ProfileFound, ...]
    better: np.ndarray | None


def assured(task: Task, made: Fitted) -> Assured:
    """Profiles of the weakest numbers included."""
    fit, loss, seed = made.fit, task.recipe.loss, task.request.seed
    sure = sureness(fit, made.near, loss=loss, seed=seed)
    rows = weakest(sure, made.profiles)
    profiles, better = profiled(
        fit, sure, rows, loss=loss, seed=seed,
        progress=lambda done: task.progress(Step("profiles", done, len(rows))),
    )  # fmt: skip
    return Assured(made, widened_by(fit, sure, profiles), profiles, better)


def concluded(task: Task, predictor: Predictor, known: Assured) -> Found:
    """Judge a fit. Raises what `held_out` raises."""
    request, recipe, made, sure = task.request, task.recipe, known.made, known.sure
    fit, profiles = made.fit, known.profiles
    warnings = [*request.left_out, *made.remarks]
    if known.better is not None:
        warnings.append(
            "a profile came upon a lower loss: the loss is rough, and the fit is no minimum there. Its intervals hold "
            "what the profile found; judge it by its held-out errors"
        )
    if not fit.solution.reason.converged:
        warnings.append(
            f"the last round ended after {fit.solution.iterations} iterations, before it converged: its start states "
            f"come from a filter, and more iterations fit these instead of the robot. {fit.solution.message}"
        )
    judged = judged_by(task, predictor, fit.values)
    fixed = task.fixed()
    sensing, late = loop_of(task.runs, request.train, predictor, fit.values)
    return Found(
        request=request, robot=task.robot.name, engine=f"r2s2r {__version__}", step=recipe.step, loss=made.loss,
        parameters=(*sure.parameters, *fixed),
        train_segments=judged.train_segments, train=judged.train, test_segments=judged.test_segments, test=judged.test,
        cost=fit.solution.cost, residuals=len(fit.solution.residual), converged=fit.solution.reason.converged,
        reason=fit.solution.message, rollouts=predictor.rollouts + judged.rollouts, floor=judged.floor,
        free_runs=judged.free_runs, closed_loop_m=judged.closed_loop_m, repeats=judged.repeats,
        covariance=widened(sure.spread.covariance, len(fixed)), information=made.before, trace=made.trace,
        starts=made.starts, profiles=profiles, windows=start_shifts(fit), updates=made.updates, p_RS=judged.p_RS,
        sensing=sensing if sensing.arrivals or sensing.by_camera else None, command_delay=late,
        uncertainty=sure.spread.how, natures=task.natures, computed_by_torch=not predictor.native,
        warnings=(*warnings, *judged.warnings),
    )  # fmt: skip


def judged_by(task: Task, predictor: Predictor, values: np.ndarray) -> Judged:
    """Train and test intervals by command replay from their own causal starts: one judge for all methods."""
    return held_out(
        task.robot, task.runs, task.request, predictor, values, task.recipe, cache_dir=task.cache_dir,
        progress=lambda done, total: task.progress(Step("held-out", done, total)),
    )  # fmt: skip


def widened(covariance: np.ndarray, fixed: int) -> np.ndarray:
    """(n, n) with rows and columns of NaN for the fixed parameters behind the free ones."""
    n = len(covariance) + fixed
    found = np.full((n, n), np.nan)
    found[: len(covariance), : len(covariance)] = covariance
    return found


def start_found(first: Sequence[float] | np.ndarray, fit: Fit) -> StartFound:
    """The fit as the row of its start."""
    return StartFound(
        np.asarray(first, dtype=float), fit.values, fit.solution.cost, fit.solution.iterations, fit.solution.message
    )  # fmt: skip
