"""What one simulator says of real runs: the policy in closed loop from the real start, and the commands replayed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.checkpoint import Answers
from r2s2r_cli.stages.compare.remembered import question
from r2s2r_cli.stages.compare.runs import RealRun
from r2s2r_cli.stages.compare.walk import Walk, same_targets
from r2s2r_cli.stages.identified import Identified
from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.identify.judged import replayed
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.measures.keyframes import KeyframeErrors, keyframe_errors
from r2s2r_cli.stages.segments import Intervals, target_intervals
from r2s2r_cli.stages.simulate.drive import Driver, Start
from schemas.config import SimulateSettings


@dataclass(frozen=True)
class Model:
    """A simulator under its name. trained_on: runs of this comparison from which its numbers were learned."""

    name: str
    numbers: Identified
    trained_on: frozenset[str] = frozenset()


@dataclass(frozen=True)
class PredictedRun:
    """walk: in closed loop, up to the last interval that both have; real: the same part of the real run. keyframes: by
    command replay, each interval from its own start, None where no commands were logged. warnings: in words;
    where it could not be simulated they say why, and walk and real are None."""

    run: str
    walk: Walk | None
    real: Walk | None
    keyframes: KeyframeErrors | None
    warnings: tuple[str, ...] = ()

    def to_arrays(self) -> list[np.ndarray]:
        """All that was simulated, for a checkpoint."""
        walk, key = self.walk, self.keyframes
        moved = [] if walk is None else [walk.t, walk.p_WE, *vars(walk.intervals).values()]
        errors = [] if key is None else [key.squared]
        return [np.array([walk is not None, key is not None]), np.array(self.warnings, dtype=str), *moved, *errors]

    @classmethod
    def from_arrays(cls, run: RealRun, arrays: Sequence[np.ndarray]) -> PredictedRun:
        """Of that run, from what `to_arrays` gave."""
        there, warnings, *rest = arrays
        walk = real = None
        if there[0]:
            t, p_WE, *intervals = rest[: 2 + len(Intervals.__dataclass_fields__)]
            walk = Walk(t, p_WE, run.walk.share, Intervals(*intervals))
            real = run.walk.first(len(walk.intervals))
        keyframes = KeyframeErrors(rest[-1]) if there[1] else None
        return cls(run.name, walk, real, keyframes, tuple(warnings.tolist()))


def predicted(
    model: Model, runs: Sequence[RealRun], settings: SimulateSettings, *, cache_dir: Path | None,
    checkpoint: Answers | None = None, done: Callable[[], None] = lambda: None,
) -> tuple[PredictedRun, ...]:  # fmt: skip
    """Every run by one simulator. checkpoint: a run that it has is not simulated, every other one is kept there as soon
    as it is. done: called after each. Raises InputError for a robot that cannot be simulated."""
    # What comes after the last target is in no real run; it would lengthen the last simulated interval.
    settings = settings.model_copy(update={"tail_s": 0.0})

    @cache
    def driver() -> Driver:
        return Driver(model.numbers.robot, settings, cache_dir, model.numbers)

    found = []
    for run in runs:
        asked = question(model.numbers, run, settings)
        known = None if checkpoint is None else checkpoint.recall(asked)
        if known is None:
            one = _simulated(driver(), model, run, settings)
            if checkpoint is not None:
                checkpoint.keep(asked, one.to_arrays())
        else:
            one = PredictedRun.from_arrays(run, known)
        found.append(one)
        done()
    return tuple(found)


def _simulated(driver: Driver, model: Model, run: RealRun, settings: SimulateSettings) -> PredictedRun:
    walk, real, warnings = _closed_loop(driver, run)
    key, more = _keyframes(driver, model, run, settings)
    return PredictedRun(run.name, walk, real, key, (*warnings, *more))


def _closed_loop(driver: Driver, run: RealRun) -> tuple[Walk | None, Walk | None, list[str]]:
    """The policy with the controller in the loop, started where the opening rest of the run ended, at rest."""
    words = "the state at the end of the opening rest" if run.opening.intervals else "the first state"
    start = Start(f"{words} of run {run.name}", run.walk.p_WE[0])
    try:
        simulated = driver.closed_loop(run.name, run.targets, start, lambda _: None)
    except NumericalError as error:
        return None, None, [f"run {run.name} could not be simulated in closed loop: {error.what}"]
    pid, frames = driver.robot.pid, simulated.frames
    position = (frames["length"][:, list(driver.robot.actuated)] - pid.min_length_m) / pid.range_m
    intervals = target_intervals(
        frames["t"], simulated.target_at, control=simulated.control_at, position=position, tolerance=pid.tolerance
    )
    walk = Walk(frames["t"], frames["p_WE"], run.walk.share, intervals)
    count = same_targets(run.walk.intervals, intervals)
    if count < 2:
        return None, None, [f"run {run.name} and its simulation have no two target intervals in common"]
    said = []
    if count < len(run.walk.intervals):
        said.append(f"run {run.name}: {count} of {len(run.walk.intervals)} target intervals are compared, then the "
                    "targets differ")  # fmt: skip
    if simulated.timed_out:
        numbers = ", ".join(map(str, simulated.timed_out))
        said.append(f"run {run.name}: the simulation gave up targets {numbers} after their timeout")
    return walk.first(count), run.walk.first(count), said


def _keyframes(
    driver: Driver, model: Model, run: RealRun, settings: SimulateSettings
) -> tuple[KeyframeErrors | None, list[str]]:
    """Key frames by command replay, each interval from its own causal start (docs/concepts/measures.md)."""
    if run.data is None:
        return None, []
    predictor = Predictor(model.numbers.mapping, step=settings.step_s)
    if predictor.structure == driver.structure:
        predictor.simulator = driver.simulator  # its machine code
    before = run.opening.intervals
    chosen = Selection(run.name, tuple(range(before + 1, before + len(run.walk.intervals) + 1)))
    recipe = replace(Recipe(), step=settings.step_s)
    try:
        both = replayed([run.data], [chosen], predictor, model.numbers.values, recipe, free_run=False)
    except NumericalError as error:
        return None, [f"the commands of run {run.name} could not be replayed: {error.what}"]
    return keyframe_errors(np.array([step.key for step in both.steps]), both.predicted.key), []
