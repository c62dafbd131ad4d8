"""A diagnosis, from values to values: parity, where, which, how much, what next."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.checkpoint import Answers
from r2s2r_cli.stages.diagnose.diagnosis import Diagnosis, SegmentSeen
from r2s2r_cli.stages.diagnose.evidence import Evidence, require_enough
from r2s2r_cli.stages.diagnose.much.much import much
from r2s2r_cli.stages.diagnose.next_gait import GaitLibrary, next_gait
from r2s2r_cli.stages.diagnose.parity import Parity
from r2s2r_cli.stages.diagnose.parity.finding import discoveries
from r2s2r_cli.stages.diagnose.parity.parity import parity
from r2s2r_cli.stages.diagnose.prepare import refit
from r2s2r_cli.stages.diagnose.starts import Starts
from r2s2r_cli.stages.diagnose.where import Where
from r2s2r_cli.stages.diagnose.where.where import where
from r2s2r_cli.stages.diagnose.which.calibration import Calibration, calibration
from r2s2r_cli.stages.diagnose.which.numbers import SENSOR_LAG, Model
from r2s2r_cli.stages.diagnose.which.remembered import Remembered
from r2s2r_cli.stages.diagnose.which.replay import Replayer
from r2s2r_cli.stages.diagnose.which.score import Score
from r2s2r_cli.stages.diagnose.which.which import Compared, compare_effects
from r2s2r_cli.stages.identify.belief import Filter

FALSE = 0.05
"""Share of false ones among the segments that are said to have a gap (Benjamini-Hochberg)."""

Told = Callable[[str, int, int], None]
"""Called with the part of the work, how much of it is done, and how much there is."""


@dataclass(frozen=True)
class Settings:
    """How a diagnosis is made. effects: only these are considered; None: the whole catalogue. step [s]: of the engine.
    members: of the filter that makes start states. seed: of all that is drawn. with_parity, with_where, with_much:
    parts that can be left out. refit_baseline: nuisances are fitted again; with_floor: the covariance has one;
    with_unknown: an error without a name is possible (all three: what an ablation switches off). calibration: None,
    that of the package."""

    effects: tuple[str, ...] | None = None
    step: float = 2e-3
    members: int = 16
    seed: int = 0
    with_parity: bool = True
    with_where: bool = True
    with_much: bool = True
    refit_baseline: bool = True
    with_floor: bool = True
    with_unknown: bool = True
    calibration: Calibration | None = None
    library: GaitLibrary = field(default_factory=GaitLibrary)


def silent(part: str, done: int, total: int) -> None:
    """No progress."""


def diagnose(
    evidence: Evidence, settings: Settings | None = None, progress: Told = silent, *, cache_dir: Path | None = None,
    threads: int = 2, checkpoint: Answers | None = None,
) -> Diagnosis:  # fmt: skip
    """Where the gap lies, which effect causes it, how far it shrinks, and what to run next.

    Nothing of the judged intervals is looked at before everything else is decided, but that start states of later
    intervals of the same run go on from them. checkpoint: with what was
    simulated before an interruption the result is that of an uninterrupted run, to the last bit. Raises InputError
    where there is too little to diagnose or a setting contradicts the data, NumericalError where nothing can be
    simulated.
    """
    settings = settings or Settings()
    require_enough(evidence)
    progress("parity", 0, 1)
    said: Parity | None = parity(evidence) if settings.with_parity else None
    if said is not None and said.mismatches:
        first = said.mismatches[0]
        raise InputError(
            first.what, where=first.kind, expected=first.expected, received=first.received, hint=first.hint
        )
    progress("parity", 1, 1)
    starts = Starts(Filter(members=settings.members, seed=settings.seed))
    model = Model(evidence.model, asked=settings.effects or ())
    how = {"step": settings.step, "cache_dir": cache_dir, "threads": threads}
    replayer = Replayer(model, **how) if checkpoint is None else Remembered(model, checkpoint, **how)
    fitted = refit(evidence, replayer, starts=starts, told=progress,
        again=settings.refit_baseline, with_floor=settings.with_floor,
    )  # fmt: skip
    at_floor, kept = fitted.floor.equivalence
    learned = settings.calibration or calibration()
    compared = compare_effects(
        fitted.arena, fitted.base, floor_m=at_floor, kept=kept,
        calibration=learned,
        sizes={} if said is None else said.starts(), told_by=None if said is None else said.nats(),
        effects=settings.effects, seed=settings.seed, told=progress,
        strangers=settings.with_unknown, healthy=fitted.healthy, stranger=None if said is None else said.stranger,
    )  # fmt: skip
    found: Where | None = None
    if settings.with_where:
        found = where(
            evidence,
            compared.arena,
            compared.base.z,
            found=said,
            seed=settings.seed,
            cache_dir=cache_dir,
            threads=threads,
            told=progress,
            compared=compared,
        )
    shrunk = None
    if settings.with_much and evidence.judge:
        shrunk = much(
            evidence, compared, floor=fitted.floor, healthy=fitted.healthy, starts=starts, seed=settings.seed,
            told=progress,
        )  # fmt: skip
    after = next_gait(evidence, compared, settings.library, calibration=learned, told=progress)
    sd = compared.refit.sd
    return Diagnosis(
        robot=evidence.robot.name, floor=fitted.floor, parity=said, where=found, which=compared.which, much=shrunk,
        next_gait=after,
        refit={name: (float(z), float(sd[k])) for k, (name, z) in enumerate(
            zip(compared.arena.names[: compared.arena.shared], compared.base.z, strict=False))
            if name != SENSOR_LAG or compared.arena.sensors},
        segments=_segments(compared), within_run=evidence.within_run, rollouts=replayer.rollouts,
        warnings=(*fitted.warnings, *compared.which.warnings), actuated=tuple(evidence.robot.actuated),
    )  # fmt: skip


def _segments(compared: Compared) -> tuple[SegmentSeen, ...]:
    """The fitted intervals as the refit nominal model and the best effect predict them when they are left out."""
    from scipy.stats import chi2

    refit = compared.refit
    best = compared.scores[0] if compared.scores else None
    arena = compared.arena
    place = {(one.run, one.interval): k for k, one in enumerate(arena.whole)}
    size, square = np.zeros(len(place)), np.zeros(len(place))
    for one, white, misfit in zip(arena.many, arena.white, refit.misfit, strict=True):
        k = place.get((one.run, one.interval))
        if k is not None:
            size[k] += white.size
            square[k] += white.size * misfit
    p = chi2.sf(square, size)
    gap = discoveries(np.where(np.isfinite(p), p, 0.0), FALSE)
    return tuple(
        SegmentSeen(
            run=one.run,
            interval=one.interval,
            gait=one.gait,
            t=(one.window.start, float(one.t[-1])),
            refit=_seen(refit, k),
            effect=None if best is None else _seen(best, k),
            misfit=float(square[k] / size[k]),
            gap=bool(gap[k]),
            key=one.caps[-1],
            error=refit.key[k],
        )
        for k, one in enumerate(arena.whole)
    )


def _seen(score: Score, k: int) -> float:
    """Error of the caps at the end of the interval k [m]; nan where one is lost, which a mean bounds and a picture
    leaves out."""
    return float("nan") if np.isnan(score.key[k]).any() else float(np.sqrt(score.squared[k]))
