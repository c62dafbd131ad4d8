"""What every method of `identify` starts from: robot, runs, request, settings; what is free, and the engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.stages.checkpoint import Values
from r2s2r_cli.stages.identify.commands import CommandLog
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.found import ParameterFound
from r2s2r_cli.stages.identify.free import Free, Mapping, select
from r2s2r_cli.stages.identify.free.extend import PLUS, extended, name_of
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe, default_fixed, default_free, recipe_of
from r2s2r_cli.stages.identify.request import Progress, Request, silent
from schemas.config import IdentifySettings
from schemas.robot import Robot

MOVED_SHARE = 0.3
"""Of the busiest winch's running time: winches that run less than this are left at robot.toml's speed by default."""
WAY_SHARE = 0.1
"""Of its running time: a winch that runs less than this in one way has no rate of its own there."""


@dataclass(frozen=True)
class Task:
    """One request with all that it is about."""

    robot: Robot
    runs: Sequence[RunData]
    request: Request
    settings: IdentifySettings
    cache_dir: Path | None = None
    progress: Progress = silent
    checkpoint: Values | None = None
    held: tuple[str, ...] = ()
    """Free parameters that the training intervals do not show."""

    @property
    def recipe(self) -> Recipe:
        """The recipe with the settings of the project."""
        return replace(recipe_of(self.settings), held=self.held)

    @property
    def natures(self) -> dict[str, str]:
        """What each run is, of those that say so."""
        return {run.name: run.nature for run in self.runs if run.nature}

    @property
    def with_default(self) -> bool:
        """Whether the default set is free, alone or with more beside it. The paper's own two numbers are another."""
        own = self.request.method != "paper"
        return own and all(spec.startswith(PLUS) for spec in (*self.settings.free, *self.request.free))

    @property
    def of_default(self) -> tuple[str, ...]:
        """Names of the default set, where it is free: nobody asked for one of them by itself."""
        moved = busy(self.robot, self.runs, self.request)
        return tuple(map(name_of, default_free(self.robot, moved))) if self.with_default else ()

    @property
    def given(self) -> dict[str, float]:
        """Values of parameters that are not fitted: those that the default set goes with, where it is what is free and
        none of them was asked for, or those that the identification which is gone on from was given; and those of the
        request."""
        asked = {name_of(spec.removeprefix(PLUS)) for spec in (*self.settings.free, *self.request.free)}
        # A number is asked for by its name, with all of its family, or, one damping of all cables, by a part of them.
        asked |= {name.removesuffix(".*") for name in asked} | {"damping_actuated" for name in asked if _damps(name)}
        own = self._beside if self.with_default else {}
        mine = {name: value for name, value in own.items() if not {name, name.partition(".")[0]} & asked}
        return {**mine, **self.request.fixed}

    @property
    def _beside(self) -> dict[str, float]:
        """What has a value beside the numbers that are free where nobody names any."""
        from r2s2r_cli.stages.identify.before import given_in

        before = self.request.before
        return default_fixed(self.robot) if before is None else given_in(before, self.robot)

    def predictor(self, frees: Sequence[Free]) -> Predictor:
        """The engine with these free numbers, those that were given, and the effects that were asked for."""
        from r2s2r_cli.stages.model import structure_of

        structure = replace(structure_of(self.robot), rod_contact=self.settings.rod_contact)
        mapping = Mapping(self.robot, frees, self.request.effects, fixed=self.given, structure=structure)
        return Predictor(mapping, step=self.recipe.step, cache_dir=self.cache_dir)

    def fixed(self) -> tuple[ParameterFound, ...]:
        """The numbers that were given."""
        from r2s2r_cli.stages.identify.free.catalogue import catalogue

        known, nan = catalogue(self.robot), float("nan")
        why = "the default set goes with it" if self.request.before is None else "as in the earlier identification"
        return tuple(
            ParameterFound(
                known[name], value, nan, nan, nan, (nan, nan), None,
                "fixed by hand" if name in self.request.fixed else f"{why}; robot.toml has {known[name].mean:g}",
            )
            for name, value in self.given.items()
        )  # fmt: skip


def _damps(name: str) -> bool:
    return name.partition(".")[0] == "damping"


def require_combination(request: Request) -> None:
    """Nothing falls back on another fit: raises UsageError for a method, drive and --online that do not go together,
    InputError for --online without an earlier identification."""
    if request.method == "cma" and request.drive == "closed loop":
        raise UsageError(
            "CMA-ES replays recorded commands only", where="--method cma --drive closed-loop",
            expected="--drive replay, or another method", received="--drive closed-loop",
            hint="r2s2r identify --drive closed-loop   # it samples with CMA-ES there already",
        )  # fmt: skip
    if request.online and (request.method != "default" or request.drive != "command replay"):
        raise UsageError(
            "--online is there for the default fit on recorded commands only", where="--online, --method, --drive",
            expected="--method default --drive replay",
            received=f"--method {request.method}, {request.drive}",
            hint="r2s2r identify --online",
        )  # fmt: skip
    if request.online and request.before is None:
        raise InputError(
            "there is no earlier identification to go on from", where="--online",
            expected="30-identify.h5 in an earlier iteration", received="none",
            hint="r2s2r identify   # without --online: from robot.toml",
        )  # fmt: skip


def require_replay(request: Request) -> None:
    """Raises UsageError for a self-test of anything but the default fit: it would test something else."""
    if request.method != "default" or request.drive != "command replay" or request.online:
        raise UsageError(
            "the self-test plants for the default fit on recorded commands only",
            where="--self-test, --method, --drive, --online",
            expected="--method default --drive replay, without --online",
            received=f"--method {request.method}, {request.drive}" + ", --online" * request.online,
            hint="r2s2r identify --self-test",
        )  # fmt: skip


def free_parameters(
    robot: Robot, runs: Sequence[RunData], request: Request, settings: IdentifySettings
) -> tuple[Free, ...]:
    """Of --free, else of the settings, else the default set."""
    specs = specs_asked(request, settings, default_free(robot, busy(robot, runs, request)))
    return select(specs, robot, request.effects, request.fixed)


def specs_asked(request: Request, settings: IdentifySettings, default: Sequence[str]) -> tuple[str, ...]:
    """What is free, as after --free: of the request, else of the settings, else the default; where nothing was named
    on the command line, without what is fixed there. Numbers of the request's effects are free beside them, but for
    families of which one is named and for what is fixed. Raises UsageError for a spec that cannot be read."""
    own = tuple(spec for spec in extended(settings.free, default) if name_of(spec) not in request.fixed)
    specs = extended(request.free, own)
    named = {_family(name_of(spec)) for spec in specs}
    beside = (spec for spec in request.of_effects if name_of(spec) not in request.fixed)
    return (*specs, *(spec for spec in beside if _family(name_of(spec)) not in named))


def _family(name: str) -> str:
    """Effect and number of EFFECT.NUMBER, EFFECT.NUMBER.K and EFFECT.NUMBER.*."""
    return ".".join(name.split(".")[:2])


def busy(robot: Robot, runs: Sequence[RunData], request: Request) -> tuple[tuple[str, int], ...]:
    """(way, cable), in or out: winches that ran for a fair share of the time of the training intervals, all runs
    together, each way that they ran in."""
    inwards, outwards = np.zeros(len(robot.actuated)), np.zeros(len(robot.actuated))
    for one in request.train:
        run = next(run for run in runs if run.name == one.run)
        inwards += _wound(run, one.intervals, 1.0)
        outwards += _wound(run, one.intervals, -1.0)
    both = inwards + outwards
    fair = both > MOVED_SHARE * max(both.max(), 1e-12)
    return tuple(
        (way, cable)
        for way, spent in (("in", inwards), ("out", outwards))
        for k, cable in enumerate(robot.actuated)
        if fair[k] and spent[k] > WAY_SHARE * both[k]
    )


def _wound(run: RunData, intervals: Sequence[int], way: float) -> np.ndarray:
    """Integral of the commands of that sign over the intervals (1-based), (actuated,) [s at full speed]."""
    log = CommandLog(replace(run, control=np.maximum(way * np.nan_to_num(run.control), 0.0)))
    spent = np.zeros(run.control.shape[1])
    for number in intervals:
        begin, end = (float(side[number - 1]) for side in (run.intervals.t_first, run.intervals.t_last))
        if end > begin:
            spent += (end - begin) * log.means(begin, 1, step=end - begin, delay=0.0)[0]
    return spent
