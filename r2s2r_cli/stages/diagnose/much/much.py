"""How much: predicted from what was left out, then realised on intervals that nothing has looked at before."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.diagnose.evidence import Evidence
from r2s2r_cli.stages.diagnose.much.blackbox import corrected
from r2s2r_cli.stages.diagnose.much.shrink import Shrinkage, share_with_interval
from r2s2r_cli.stages.diagnose.starts import Starts
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.fit import Fit, Fits
from r2s2r_cli.stages.diagnose.which.score import Score
from r2s2r_cli.stages.diagnose.which.stretches import Stretch, stretches
from r2s2r_cli.stages.diagnose.which.which import Compared

Told = Callable[[str, int, int], None]


def much(
    evidence: Evidence, compared: Compared, *, floor_m: float, starts: Starts, seed: int = 0, told: Told
) -> Shrinkage | None:
    """Of the effect that was named, else of the best one; None where nothing was fitted.

    Start states of the judged intervals are causal and each model's own: a filter over the run with its numbers.
    Raises NumericalError where the refit model cannot be simulated.
    """
    fit, score = _chosen(compared)
    refit = compared.refit
    if fit is None or score is None:
        return None
    runs = [one.run for one in compared.arena.whole]
    predicted, spread = share_with_interval(refit.squared, score.squared, floor_m, groups=runs, seed=seed)
    arena = compared.arena
    solver = Fits(arena)
    none = np.concatenate([arena.model.values0[arena.engine], np.zeros(len(arena.names) - len(arena.engine))])
    models = {
        "nominal": (solver.values(compared.base.hypothesis, none[None], np.zeros((1, 0))), none),
        "refit": (solver.values(compared.base.hypothesis, compared.base.z[None], np.zeros((1, 0))), compared.base.z),
        "effect": (solver.values(fit.hypothesis, fit.z[None], fit.x[None]), fit.z),
    }
    squared: dict[str, np.ndarray] = {}
    missing: list[str] = []
    names: tuple[str, ...] = ()
    for done, (name, (values, z)) in enumerate(models.items()):
        told("judged", done, len(models))
        try:
            errors, judged = _judged(evidence, arena, values[0], z, starts)
        except NumericalError as error:
            missing.append(f"{name}: {error.what}")
            continue
        squared[name] = np.sum(errors**2, axis=-1).mean(axis=-1)
        names = tuple(one.name for one in judged)
        if name == "refit":
            left = corrected(arena.whole, refit.key, judged, errors)
            squared["ceiling"] = np.sum(left**2, axis=-1).mean(axis=-1)
    told("judged", len(models), len(models))
    share, ci90 = (None, None)
    if "refit" in squared and "effect" in squared:
        share, ci90 = share_with_interval(
            squared["refit"], squared["effect"], floor_m, groups=[name.rpartition(":")[0] for name in names], seed=seed
        )
    return Shrinkage(
        effects=fit.hypothesis.effects, names=names, squared=squared, floor=floor_m, share=share, ci90=ci90,
        predicted=predicted, predicted_ci90=spread, within_run=evidence.within_run, missing=tuple(missing),
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


def _judged(
    evidence: Evidence, arena: Arena, values: np.ndarray, z: np.ndarray, starts: Starts
) -> tuple[np.ndarray, tuple[Stretch, ...]]:
    """Errors (segment, cap, 3) [m] at the key frames of the judged intervals, and the intervals."""
    runs = evidence.only(evidence.judge)
    last = {one.run: max(one.intervals) for one in evidence.judge}
    states = starts.at(runs, arena.replayer, values, last)
    many = stretches(runs, evidence.judge, states, whole=True)
    if not many:
        raise NumericalError("no judged interval can be simulated", where="judge", expected="an interval",
                             received="none", hint="r2s2r identify --test RUN:8-11")  # fmt: skip
    own = Arena(arena.replayer, many, floor_m=arena.floor_m)
    return own.keys(values[None], z[None])[0], many
