"""How much: predicted from the targets of judged intervals and what was left out, then realised on these intervals,
which nothing has looked at before."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.diagnose.evidence import Evidence, FloorGiven, Run, whole
from r2s2r_cli.stages.diagnose.floors import KEPT
from r2s2r_cli.stages.diagnose.much.ahead import ahead
from r2s2r_cli.stages.diagnose.much.blackbox import corrected
from r2s2r_cli.stages.diagnose.much.shrink import Shrinkage, foretold, share_with_interval, squared_of
from r2s2r_cli.stages.diagnose.starts import Starts
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.before import Healthy
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit
from r2s2r_cli.stages.diagnose.which.score import Score, groups_of
from r2s2r_cli.stages.diagnose.which.stretches import Stretch, stretches
from r2s2r_cli.stages.diagnose.which.which import Compared
from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.measures.gap import kept_rmse

Told = Callable[[str, int, int], None]


def much(
    evidence: Evidence, compared: Compared, *, floor: FloorGiven, healthy: Healthy | None = None, starts: Starts,
    seed: int = 0, told: Told,
) -> Shrinkage | None:  # fmt: skip
    """Of the effect that was named, else, where names remain, of the best one; without a gap, or a name for it, of the
    refit model and the black box alone. None where no effect was fitted.

    Start states of the judged intervals are causal and each model's own: a filter over the run with its numbers. With
    healthy runs their refit is measured in the same way, falls included, and is the floor here; `floor`, of intervals
    up to their first fall, is where there are none. Raises NumericalError where the refit model cannot be simulated.
    """
    fit, score = _chosen(compared)
    refit = compared.refit
    if fit is None or score is None:
        return None
    named = compared.which.verdict not in ("no_gap", "unknown")
    arena = compared.arena
    solver = Fits(arena)
    predicted, spread = (None, None)
    floor_m, kept = (floor.rmse, floor.kept) if healthy is None else _alike(evidence.healthy, healthy, floor, starts)
    if named:
        told("left out", 0, 1)
        predicted, spread = _predicted(
            evidence, compared, fit, score, floor_m=floor_m, kept=kept, starts=starts, seed=seed
        )
        told("left out", 1, 1)
    none = np.concatenate([arena.model.values0[arena.engine], np.zeros(len(arena.names) - len(arena.engine))])
    models = {
        "nominal": (solver.values(compared.base.hypothesis, none[None], np.zeros((1, 0))), none),
        "refit": (solver.values(compared.base.hypothesis, compared.base.z[None], np.zeros((1, 0))), compared.base.z),
    }
    if named:
        models["effect"] = (solver.values(fit.hypothesis, fit.z[None], fit.x[None]), fit.z)
    squared: dict[str, np.ndarray] = {}
    missing: list[str] = []
    names: tuple[str, ...] = ()
    for done, (name, (values, z)) in enumerate(models.items()):
        told("judged", done, len(models))
        try:
            errors, judged = _errors(evidence.runs, evidence.judge, arena, values[0], z, starts)
        except NumericalError as error:
            missing.append(f"{name}: {error.what}")
            continue
        squared[name] = squared_of(errors)
        names = tuple(one.name for one in judged)
        if name == "refit":
            left = corrected(arena.whole, refit.key, judged, errors)
            squared["ceiling"] = squared_of(left)
    told("judged", len(models), len(models))
    share, ci90 = (None, None)
    if "refit" in squared and "effect" in squared:
        share, ci90 = share_with_interval(
            squared["refit"], squared["effect"], floor_m, kept=kept, groups=[name.rpartition(":")[0] for name in names],
            seed=seed,
        )  # fmt: skip
    return Shrinkage(
        effects=fit.hypothesis.effects if named else (), names=names, squared=squared, floor=floor_m, share=share,
        ci90=ci90, predicted=predicted, predicted_ci90=spread, within_run=evidence.within_run, missing=tuple(missing),
        kept=kept,
    )  # fmt: skip


def _chosen(compared: Compared) -> tuple[Fit | None, Score | None]:
    """The fit of what was committed to, else the best one."""
    wanted = set(compared.which.effects)
    for fit, score in zip(compared.fits, compared.scores, strict=True):
        if set(fit.hypothesis.effects) == wanted or (not wanted and len(fit.hypothesis.parts) == 1):
            return fit, score
    if wanted:
        return None, None  # what the logs alone show changes no prediction
    return (compared.fits[0], compared.scores[0]) if compared.fits else (None, None)


def _predicted(
    evidence: Evidence,
    compared: Compared,
    fit: Fit,
    score: Score,
    *,
    floor_m: float,
    kept: float,
    starts: Starts,
    seed: int,
) -> tuple[float | None, tuple[float, float] | None]:
    """Own share that the judged intervals will have, and its interval, from their targets: how far refit and effect
    will part there, and how they err on fitted ones, measured as the judged ones will be, from causal starts, with
    numbers that were fitted without their gait."""
    arena = compared.arena
    solver = Fits(arena)
    groups = groups_of(arena)
    p = len(fit.z)
    models = ((compared.base, compared.refit), (fit, score))
    errors: list[list[np.ndarray]] = [[], []]
    runs: list[str] = []
    for number, group in enumerate(np.unique(groups)):
        own = {(one.run, one.interval) for one, g in zip(arena.many, groups, strict=True) if g == group}
        part = tuple(
            Selection(name, tuple(sorted(k for run, k in own if run == name)))
            for name in dict.fromkeys(one.run for one in arena.many) if any(run == name for run, _ in own)
        )  # fmt: skip
        try:
            found = []
            for model, scored in models:
                at = scored.without[number]
                values = solver.values(model.hypothesis, at[None, :p], at[None, p:])[0]
                found.append(_errors(evidence.runs, part, arena, values, at[:p], starts))
        except NumericalError:
            continue  # one model fell to pieces there: nothing to compare
        for so_far, (error, _) in zip(errors, found, strict=True):
            so_far.append(error)
        runs += [one.run for one in found[0][1]]
    if not runs:
        return None, None
    refit, effect = (
        solver.values(one.hypothesis, one.z[None], one.x[None])[0] for one in (compared.base, fit)
    )  # fmt: skip
    apart = [
        ahead(arena, evidence.run(one.run).caps.intervals.target, one.intervals, effect, refit, name=one.run)
        for one in evidence.judge if one.intervals
    ]  # fmt: skip
    if not apart:
        return None, None
    before, after = (np.concatenate(one) for one in errors)
    return foretold(
        before, after, np.concatenate(apart, axis=1), floor_m, groups=runs, likely=_likely(compared, fit),
        kept=kept, seed=seed,
    )  # fmt: skip


def _likely(compared: Compared, fit: Fit) -> float:
    """How probable it is that the effects of a fit are the cause: what the verdict says where it is of them, else what
    the ranking has for the one effect."""
    which, own = compared.which, fit.hypothesis.effects
    if set(own) == set(which.effects):
        return which.probability
    return next((one.probability for one in which.ranking if (one.effect,) == own), 0.0)


def _alike(runs: Sequence[Run], healthy: Healthy, floor: FloorGiven, starts: Starts) -> tuple[float, float]:
    """What the healthy runs' own refit leaves at the ends of whole intervals, falls included, from starts as the judged
    ones have: key-frame RMSE [m] of the share KEPT of the best, and that share; the given floor where they cannot be
    simulated."""
    arena, base = healthy.arena, healthy.base
    values = Fits(arena).values(base.hypothesis, base.z[None], np.zeros((1, 0)))[0]
    try:
        errors, _ = _errors(runs, whole(runs), arena, values, base.z, starts)
    except NumericalError:
        return floor.rmse, floor.kept
    squared = squared_of(errors)
    return kept_rmse(squared, KEPT), KEPT


def _errors(
    runs: Sequence[Run], part: Sequence[Selection], arena: Arena, values: np.ndarray, z: np.ndarray, starts: Starts
) -> tuple[np.ndarray, tuple[Stretch, ...]]:
    """Errors (segment, cap, 3) [m] at the key frames of the intervals of a part of the split, from causal starts, and
    the intervals. Raises NumericalError where none can be simulated."""
    part = [one for one in part if one.intervals]  # of a run that was broken off nothing may be whole
    named = {one.run for one in part}
    runs = tuple(run for run in runs if run.name in named)
    last = {one.run: max(one.intervals) for one in part}
    states = starts.at(runs, arena.replayer, values, last)
    many = stretches(runs, part, states, whole=True)
    if not many:
        raise NumericalError("no judged interval can be simulated", where="judge", expected="an interval",
                             received="none", hint="r2s2r identify --test RUN:8-11")  # fmt: skip
    own = Arena(arena.replayer, many, floor_m=arena.floor_m)
    return own.keys(values[None], z[None])[0], many
