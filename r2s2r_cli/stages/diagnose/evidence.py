"""What a diagnosis is made from: robot, nominal simulator, runs with end caps and cable lengths, split, floor.

Values only: a project's artifacts and a blind set's logs become the same `Evidence`, and no truth has a place in it.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.causal import Known, known
from r2s2r_cli.stages.estimate.smooth import switched
from r2s2r_cli.stages.floor.runs import SensedRun
from r2s2r_cli.stages.identified import Identified
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.selection import complete, default_split, in_words
from schemas.robot import Robot

LOST_M = 0.05
"""Sd from which on a filter that knows no later frame knows nothing of a cap."""


@dataclass(frozen=True)
class Run:
    """One run that is diagnosed. caps: observed end caps, commands, target intervals. lengths: what the cable sensors
    read at their own times; None where the log has none. gait: policy that was run; runs of one gait are repeats of
    each other.
    """

    caps: RunData
    lengths: SensedRun | None = None
    gait: str = ""

    @property
    def name(self) -> str:
        """Of the run, unique in the evidence."""
        return self.caps.name

    @cached_property
    def known(self) -> Known:
        """Its caps at every frame, from it and those before; a cap that was not seen for so long that it may be
        anywhere is where the estimate has it."""
        caps = self.caps
        row = np.clip(np.searchsorted(caps.t_command, caps.t, side="right") - 1, 0, len(caps.t_command) - 1)
        noise = caps.noise if caps.observed_sd is None else caps.observed_sd
        found = known(caps.t, caps.observed, noise, caps.quality, switched(caps.control[row]))
        lost = found.sd_p > LOST_M
        return Known(
            np.where(lost, caps.p_WE, found.p_WE), np.where(lost, caps.v_WE, found.v_WE),
            np.where(lost, np.minimum(caps.sd_p, LOST_M), found.sd_p), np.where(lost, caps.sd_v, found.sd_v),
        )  # fmt: skip


@dataclass(frozen=True)
class FloorGiven:
    """What remains of a gap when nothing is wrong. rmse: key-frame cap RMSE [m]; sensor: the part of it that noise
    explains [m]; words: where it comes from; given: False where it was estimated from the diagnosed runs themselves.
    kept: share of the intervals, the best ones, that it was taken from. usual: the same RMSE [m] of the share that the
    equivalence test looks at, and that share; None: as `rmse` and `kept`."""

    rmse: float
    sensor: float
    words: str
    given: bool = True
    kept: float = 1.0
    usual: tuple[float, float] | None = None

    @property
    def equivalence(self) -> tuple[float, float]:
        """RMSE [m] that no gap must be near, and the share of the intervals that it is taken from."""
        return self.usual or (self.rmse, self.kept)


@dataclass(frozen=True)
class Evidence:
    """runs: what is diagnosed. fit, judge: target intervals (1-based) by run, disjoint; nothing of `judge` is looked at
    before everything of `fit` is decided. model: the simulator as identified, before any effect. healthy: runs of the
    robot from when nothing was wrong (commissioning); with them a diagnosis says what changed. within_run: `judge`
    shares its runs with `fit`, so that what is constant over a run helps both. missing: what would be of use and is not
    there, in words.
    """

    robot: Robot
    model: Identified
    runs: tuple[Run, ...]
    fit: tuple[Selection, ...]
    judge: tuple[Selection, ...]
    floor: FloorGiven | None = None
    healthy: tuple[Run, ...] = ()
    missing: tuple[str, ...] = ()

    @property
    def within_run(self) -> bool:
        """Whether a run is in both parts of the split."""
        return bool({one.run for one in self.fit} & {one.run for one in self.judge})

    def run(self, name: str) -> Run:
        """The run of that name. Raises KeyError."""
        return {run.name: run for run in (*self.runs, *self.healthy)}[name]

    def only(self, part: Sequence[Selection]) -> tuple[Run, ...]:
        """Runs that a part of the split names, in the order of the evidence."""
        named = {one.run for one in part}
        return tuple(run for run in self.runs if run.name in named)

    def shuffled(self, seed: int) -> Evidence:
        """A negative control: observations of the fitted intervals under one another's commands. Nothing can be learned
        from it, so nothing may be named."""
        rng = np.random.default_rng(seed)
        runs = []
        for run in self.runs:
            order = rng.permutation(len(run.caps.intervals))
            runs.append(replace(run, caps=_exchanged(run.caps, order)))
        return replace(self, runs=tuple(runs))


def whole(runs: Sequence[Run]) -> tuple[Selection, ...]:
    """All complete target intervals of runs."""
    return tuple(Selection(run.name, complete(run.caps)) for run in runs)


def require_enough(evidence: Evidence) -> None:
    """Raises InputError where there is nothing to diagnose: no run, fewer than two intervals to fit, or runs of
    different numbers of caps."""
    if not evidence.runs and evidence.healthy:
        raise InputError(
            "there is no run to diagnose: all of them are given as healthy", where="--healthy",
            expected="a run that is not, beside them", received=", ".join(run.name for run in evidence.healthy),
            hint="r2s2r record --random 15 --port /dev/ttyUSB0   # elsewhere; then `diagnose --also` with it",
        )  # fmt: skip
    if not evidence.runs:
        raise InputError(
            "there is no run to diagnose", where="r2s2r diagnose", expected="runs with end caps and commands",
            received="none", hint="r2s2r import run.csv && r2s2r estimate && r2s2r identify",
        )  # fmt: skip
    for run in evidence.runs:
        caps = run.caps.observed.shape[1]
        if caps != evidence.robot.n_caps:
            raise InputError(
                f"run {run.name} is of another robot", where=f"runs/{run.name}",
                expected=f"{evidence.robot.n_caps} end caps", received=str(caps),
                hint="r2s2r status   # another iteration may have runs of this robot alone",
            )  # fmt: skip
    if sum(len(one.intervals) for one in evidence.fit) < 2:
        fitted = ", ".join(f"{one.run}:{in_words(one.intervals)}" for one in evidence.fit if one.intervals)
        raise InputError(
            "too few target intervals to tell causes apart", where="--train", expected="at least 2 to fit",
            received=fitted or "none", hint=_enough(evidence.runs),
        )  # fmt: skip


def _enough(runs: Sequence[Run]) -> str:
    """The command that fits the first part of the longest run and judges on the rest."""
    longest = max((run.caps for run in runs), key=lambda run: len(complete(run)))
    train, test = default_split(longest)
    if len(train.intervals) < 2:
        return "r2s2r inspect 20-estimate.h5   # which intervals there are: record longer runs"
    split = [f"--{role} {shlex.quote(f'{one.run}:{in_words(one.intervals)}')}"
             for role, one in (("train", train), ("test", test))]  # fmt: skip
    return f"r2s2r diagnose {' '.join(split)}"


def _exchanged(run: RunData, order: np.ndarray) -> RunData:
    """The run with the targets and commands of its intervals in another order, each stretched to the interval that it
    is put into."""
    first, last = run.intervals.t_first, run.intervals.t_last
    place = np.clip(np.searchsorted(first, run.t_command, side="right") - 1, 0, len(first) - 1)
    share = (run.t_command - first[place]) / np.maximum(last[place] - first[place], 1e-9)
    source = order[place]
    wanted = first[source] + np.clip(share, 0.0, 1.0) * (last[source] - first[source])
    row = np.clip(np.searchsorted(run.t_command, wanted, side="right") - 1, 0, len(run.t_command) - 1)
    return replace(run, control=run.control[row], target=run.target[row])
