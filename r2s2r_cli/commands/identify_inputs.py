"""What `identify` was asked for: iterations, target intervals, parameters; as inputs, flags and a request."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from r2s2r_cli.commands.stage import require_input
from r2s2r_cli.errors import UsageError
from r2s2r_cli.store.project import Iteration, Project
from schemas.header import InputRef

if TYPE_CHECKING:
    from r2s2r_cli.stages.identify.data import RunData
    from r2s2r_cli.stages.identify.request import Drive, Method, Request
    from schemas.config import IdentifySettings

_KINDS = ("recording", "estimate")


@dataclass(frozen=True)
class Asked:
    """The request of one command line, its texts as typed."""

    project: Project
    iteration: Iteration
    train: tuple[str, ...] = ()
    test: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    fix: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    method: Method = "default"
    drive: Drive = "command replay"
    online: bool = False
    also: tuple[int, ...] = ()
    seed: int = 0
    typed: tuple[str, ...] = ()
    """The options as given."""

    def flags(self) -> dict[str, Any]:
        """What else than settings and inputs decides the result, for the provenance."""
        names = ("train", "test", "free", "fix", "effects", "method", "drive", "online", "also", "seed")
        values = {name: getattr(self, name) for name in names}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}

    @cached_property
    def sources(self) -> tuple[Iteration, ...]:
        """The iterations whose runs are used, the main one first.

        The main one is the iteration itself where it has an estimate, else the latest before it that has one. Raises
        ArtifactError where there is none, UsageError for an iteration of --also that does not exist.
        """
        earlier = [i for i in self.project.iterations() if i.number < self.iteration.number]
        main = next(
            (i for i in (self.iteration, *reversed(earlier)) if i.artifact("estimate").exists()), self.iteration
        )
        others = [self.project.iteration(number) for number in self.also if number != main.number]
        for place in (main, *others):
            require_input(place.artifact("recording"), f"r2s2r import run.csv --iteration {place.number}")
            require_input(place.artifact("estimate"), f"r2s2r estimate --iteration {place.number}")
        return (main, *{place.number: place for place in others}.values())

    @cached_property
    def last(self) -> Iteration | None:
        """The latest earlier iteration with an identification, which --online continues; None: from robot.toml."""
        if not self.online:
            return None
        earlier = [i for i in self.project.iterations() if i.number < self.iteration.number]
        return next((i for i in reversed(earlier) if i.artifact("identification").exists()), None)

    def refs(self) -> list[InputRef]:
        """The inputs. Raises ArtifactError where one cannot be read."""
        from r2s2r_cli.store.header import whole_header
        from r2s2r_cli.store.staleness import artifact_ref

        paths = self.artifacts()
        if self.last is not None:
            paths.append(self.last.artifact("identification"))
        return [artifact_ref(self.project, path, whole_header(path)) for path in paths]

    def runs(self) -> list[RunData]:
        """The runs of all sources; those of --also are called NNN-RUN. Raises ArtifactError, InputError."""
        from r2s2r_cli.stages.identify.load import run_data
        from r2s2r_cli.store.read import read_artifact

        found = []
        for place in self.sources:
            recording, estimate = (read_artifact(place.artifact(kind), kind)[1] for kind in _KINDS)
            prefix = "" if place == self.sources[0] else f"{place.number:03d}-"
            found += [run_data(recording, estimate, run, name=prefix + run) for run in estimate.runs()]
        return found

    def artifacts(self) -> list[Path]:
        """Recordings and estimates that are read, those of the main iteration first."""
        return [place.artifact(kind) for place in self.sources for kind in _KINDS]

    def check(self, settings: IdentifySettings) -> None:
        """Find what is wrong with the request before any work: names, bounds, intervals, runs, what goes together.

        Raises UsageError, InputError or ArtifactError, as the fit would.
        """
        from r2s2r_cli.stages.identify.free import Mapping
        from r2s2r_cli.stages.identify.task import Task, free_parameters, require_combination

        robot, runs = self.project.robot(), self.runs()
        request = self.request(runs, settings.train_share)
        require_combination(request)
        frees = free_parameters(robot, runs, request, settings)
        if request.method == "paper" or request.drive == "closed loop":
            Mapping(robot, frees, request.effects, fixed=request.fixed)
        else:
            Task(robot, runs, request, settings).predictor(frees)

    def request(self, runs: Sequence[RunData], train_share: float) -> Request:
        """The request, its intervals resolved. Raises UsageError for runs and intervals that do not exist."""
        from r2s2r_cli.stages.identify.request import Request
        from r2s2r_cli.stages.identify.selection import split
        from r2s2r_cli.store.read import read_artifact

        train, test = split(runs, self.train, self.test, train_share)
        before = read_artifact(self.last.artifact("identification"), "identification")[1] if self.last else None
        return Request(
            train=train, test=test, free=self.free, fixed=parse_fixed(self.fix), effects=self.effects,
            method=self.method, drive=self.drive, seed=self.seed, online=self.online, before=before,
        )  # fmt: skip


def parse_fixed(texts: Sequence[str]) -> dict[str, float]:
    """`friction=0.6` items as numbers by parameter. Raises UsageError."""
    fixed: dict[str, float] = {}
    for text in texts:
        name, _, number = text.partition("=")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not name or not math.isfinite(value):
            raise UsageError("a fixed parameter has no number", where="--fix", expected="NAME=VALUE", received=text,
                             hint="--fix friction=0.6")  # fmt: skip
        fixed[name] = value
    return fixed
