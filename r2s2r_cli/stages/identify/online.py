"""`--online`: go on from an earlier identification, run after run; between two runs parameters may drift.

What was known of a parameter becomes its prior: a normal one about its value, as wide as its standard deviation and the
drift together, sqrt(sd^2 + drift^2), but never wider than the prior it had before anything was known (a Kalman filter
whose measurement is a whole fit). What the runs did not determine keeps its prior.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.stages.identify.before import names_of, specs_of
from r2s2r_cli.stages.identify.conclude import Assured, Fitted, assured, concluded, known_before, start_found
from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.identify.default_method import loss_words
from r2s2r_cli.stages.identify.fit import fit
from r2s2r_cli.stages.identify.found import Course, Found, TraceStep, Update
from r2s2r_cli.stages.identify.free import Free, select
from r2s2r_cli.stages.identify.free.base import Coordinate
from r2s2r_cli.stages.identify.holding import fitted_to_shown, holding_effects, not_identifiable, undetermined
from r2s2r_cli.stages.identify.kept import Kept
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.request import Step
from r2s2r_cli.stages.identify.solve.record import Progress as SolverProgress
from r2s2r_cli.stages.identify.task import Task, free_parameters, specs_asked
from r2s2r_cli.stages.identify.trust.identifiability import Trust
from r2s2r_cli.stages.identify.trusted import Sureness
from r2s2r_cli.stages.identify.twice import learned_twice

DRIFT = 0.05
"""Standard deviation of what a run changes: of a logarithmic coordinate, 5 %; else this share of its width."""
INSIDE = 1e-3
"""Share of its range by which a value on a bound is moved inside, so that a fit can begin there."""


@dataclass(frozen=True)
class Known:
    """What is known of parameters by name: value in its unit and standard deviation of the coordinate."""

    value: dict[str, float]
    sd_z: dict[str, float]


def find_online(task: Task) -> Found:
    """The estimate after every run of the training intervals; judged is the last.

    Raises what the default fit raises.
    """
    before = task.request.before
    assert before is not None  # noqa: S101 - require_combination
    wide = first_free(task)
    order = by_run(task.request.train)
    first = task.predictor(wide)
    known_before(task, first)  # refuses what no run shows
    kept = Kept(task.checkpoint)
    known, updates = _resumed(kept, known_of(before))
    rollouts = first.rollouts + kept.saved.get("rollouts", 0)
    for k in range(len(updates), len(order)):
        frees = tuple(drifted(free, known) for free in wide)
        last = _fit_to(replace(task, request=replace(task.request, train=(order[k],))), frees, kept, (k, order))
        frees, predictor, sure = last.made.fit.problem.frees, last.made.fit.problem.predictor, last.sure
        known = learned(known, frees, sure)
        updates.append(update_of(order[k].run, frees, sure))
        if k + 1 < len(order):
            rollouts += predictor.rollouts
            kept.save_with_trace(
                updates=[_row(one) for one in updates], known=asdict(known), rollouts=rollouts - first.rollouts
            )
    predictor.rollouts += rollouts
    remarks = (*_remarks(learned_twice(before, task.runs, order)), *_dropped(known_of(before), task, wide))
    words = f"{loss_words(task)}; run after run, the cost is of the last"
    made = replace(last.made, trace=tuple(kept.steps), loss=words, updates=tuple(updates), remarks=remarks)
    return replace(concluded(task, predictor, replace(last, made=made)), course=_course(wide, known))


def _course(wide: Sequence[Free], known: Known) -> Course:
    """The state for the next `--online`: with nothing but the last prior it would forget the first one, beyond which
    nothing becomes wider, and what the last run did not determine would stay as it was instead of drifting on."""
    first = {free.name: free for free in wide}
    return Course({name: free.mean for name, free in first.items() if math.isfinite(free.prior_sd)},
                  {name: free.prior_sd for name, free in first.items()}, known.value, known.sd_z)  # fmt: skip


def _fit_to(task: Task, frees: Sequence[Free], kept: Kept, place: tuple[int, Sequence[Selection]]) -> Assured:
    """The fit to one run, the task's, one of several. What it does not show of effects is held: of the last, what is
    reported so; of others what their information does not determine, since the next goes on from that."""
    steps, (k, order) = len(kept.steps), place
    final = k + 1 == len(order)

    def make(own: Task, predictor: Predictor) -> Assured:
        del kept.steps[steps:]
        made = fit(own.runs, own.request.train, predictor, own.recipe, seed=own.request.seed,
                   progress=_progress(own, kept.steps, order, k))  # fmt: skip
        first, near = [free.start for free in made.problem.frees], made.solution.z[None, : len(frees)]
        starts, profiles = (start_found(first, made),), own.settings.profiles if final else 0
        return assured(own, Fitted(made, starts, near, (), "", None, profiles))

    def unknown(made: Assured) -> Collection[str]:
        return not_identifiable(made.sure.parameters) if final else undetermined(made.sure.after)

    own, predictor = holding_effects(task, task.predictor(frees))
    return fitted_to_shown(own, predictor, make, unknown)[1]


def _remarks(twice: tuple[str, ...]) -> tuple[str, ...]:
    if not twice:
        return ()
    names = ", ".join(twice)
    text = (
        f"the earlier identification has learned from {names} already: what these runs say counts twice, and intervals"
    )
    return (f"{text} are too narrow; --online is for runs that are new",)


def _dropped(known: Known, task: Task, frees: Sequence[Free]) -> tuple[str, ...]:
    """What the earlier identification knew and this fit neither frees nor was given: it is at robot.toml's value."""
    names = [name for name in known.value if name not in {free.name for free in frees} and name not in task.given]
    if not names:
        return ()
    kept = " ".join(f"--fix {name}={known.value[name]:.4g}" for name in names)
    text = f"the earlier identification knew {', '.join(names)}: not free here, so robot.toml's values hold"
    return (f"{text}; without --free the same numbers are free as there, and {kept} keeps what was learned",)


def first_free(task: Task) -> tuple[Free, ...]:
    """Of --free or the settings, else what was free in the earlier identification, with the priors it had."""
    before = task.request.before
    if before is None:
        return free_parameters(task.robot, task.runs, task.request, task.settings)
    specs = specs_asked(task.request, task.settings, tuple(specs_of(before, task.robot).values()))
    return select(specs, task.robot, task.request.effects, task.request.fixed)


def known_of(before: ArtifactData) -> Known:
    """The numbers that an earlier identification determined, and how well.

    Those without an interval (not identifiable, fixed by hand, method paper) are left out; after `--online`, those that
    no run so far has determined.
    """
    group = before.groups["parameters"]
    if "known_sd" in group:
        there = [(name, k) for k, name in enumerate(names_of(before)) if math.isfinite(float(group["known_sd"][k]))]
        return Known(*({name: float(group[column][k]) for name, k in there} for column in ("known", "known_sd")))
    covariance = before.groups["covariance"]["covariance"] if "covariance" in before.groups else None
    known = Known({}, {})
    for k, name in enumerate(names_of(before)):
        sd = math.nan if covariance is None else math.sqrt(max(float(covariance[k, k]), 0.0))
        if bool(group["identifiable"][k]) and math.isfinite(sd) and sd > 0:
            known.value[name], known.sd_z[name] = float(group["value"][k]), sd
    return known


def drifted(free: Free, known: Known) -> Free:
    """The parameter with what is known of it, one run later, as its start and prior; `free` has the first prior."""
    if free.name not in known.value:
        return free
    margin = INSIDE * (free.upper - free.lower) if math.isfinite(free.upper - free.lower) else 0.0
    value = min(max(known.value[free.name], free.lower + margin), free.upper - margin)
    sd = math.hypot(known.sd_z[free.name], drift_of(free))
    return replace(free, start=value, prior_sd=min(sd, free.prior_sd), off=None)


def drift_of(free: Free) -> float:
    """How far a run may change a parameter, sd of its coordinate."""
    if free.coordinate is not Coordinate.LINEAR:
        return DRIFT
    box = (free.upper - free.lower) / math.sqrt(12.0)
    wide = min(box, free.prior_sd)
    return DRIFT * (wide if math.isfinite(wide) else abs(free.start) or 1.0)


def learned(known: Known, frees: Sequence[Free], sure: Sureness) -> Known:
    """What is known after a run that was fitted with `frees`: where it determined nothing, what was known drifts on.

    It is the information of the run that counts, not what its few windows would let one report of it alone.
    """
    value, sd_z = dict(known.value), dict(known.sd_z)
    for k, (free, one) in enumerate(zip(frees, sure.parameters, strict=True)):
        sd = math.sqrt(max(float(sure.spread.covariance[k, k]), 0.0))
        if _determined(sure, k) and math.isfinite(sd) and sd > 0:
            value[free.name], sd_z[free.name] = one.value, sd
        elif free.name in value:
            value[free.name], sd_z[free.name] = free.start, free.prior_sd
    return Known(value, sd_z)


def update_of(run: str, frees: Sequence[Free], sure: Sureness) -> Update:
    """The estimate after a run, in units: of what it did not determine, what was known before, with sd NaN."""
    value, sd = np.array([free.mean for free in frees]), np.full(len(frees), math.nan)
    for k, one in enumerate(sure.parameters):
        if _determined(sure, k):
            value[k], sd[k] = one.value, one.sd if math.isfinite(one.sd) else math.nan
    return Update(run, value, sd)


def _determined(sure: Sureness, k: int) -> bool:
    return sure.after.trust[k] is not Trust.NOT_IDENTIFIABLE


def by_run(train: Sequence[Selection]) -> tuple[Selection, ...]:
    """One selection a run, in the order in which runs are named."""
    numbers: dict[str, list[int]] = {}
    for one in train:
        numbers.setdefault(one.run, []).extend(one.intervals)
    return tuple(Selection(run, tuple(sorted(chosen))) for run, chosen in numbers.items())


def _resumed(kept: Kept, known: Known) -> tuple[Known, list[Update]]:
    """Where an interrupted fit stood: after its last whole run."""
    if not kept.saved:
        return known, []
    rows = [
        Update(one["run"], np.array(one["value"]), np.array(one["sd"], dtype=float)) for one in kept.saved["updates"]
    ]
    return Known(**kept.saved["known"]), rows


def _row(one: Update) -> dict[str, Any]:
    """As JSON values."""
    return {"run": one.run, "value": one.value.tolist(), "sd": [x if math.isfinite(x) else None for x in one.sd]}


def _progress(
    task: Task, trace: list[TraceStep], order: Sequence[Selection], k: int
) -> Callable[[int, int, SolverProgress], None]:
    def told(number: int, rounds: int, one: SolverProgress) -> None:
        trace.append(TraceStep(0, f"{order[k].run}, round {number + 1}, {one.stage_name}", one.iteration, one.cost))
        share = (k + (number + one.fraction) / rounds) / len(order)
        task.progress(Step.share("fit", share, one.cost))

    return told
