"""What `identify` was asked for: iterations, target intervals, parameters; as inputs, flags and a request."""

from __future__ import annotations

import math
import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from r2s2r_cli.commands.named_runs import Source, estimated, named_runs, require_robot
from r2s2r_cli.commands.outcome import require_input
from r2s2r_cli.errors import UsageError
from r2s2r_cli.store.project import Iteration, Project
from schemas.header import InputRef

if TYPE_CHECKING:
    from r2s2r_cli.stages.identify.data import RunData
    from r2s2r_cli.stages.identify.request import Drive, Method, Request
    from schemas.config import IdentifySettings


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
    discrepancy: bool = True
    also: tuple[int, ...] = ()
    seed: int = 0
    typed: tuple[str, ...] = ()
    """The options as given."""
    command: str = "r2s2r identify"
    """Whose options they are."""

    def flags(self) -> dict[str, Any]:
        """What else than settings and inputs decides the result, for the provenance."""
        names = ("train", "test", "free", "fix", "effects", "method", "drive", "online", "also", "seed")
        values = {name: getattr(self, name) for name in names}
        # As before it could be chosen: what was made without the option is not stale for it.
        more = {} if self.discrepancy else {"discrepancy": False}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()} | more

    @cached_property
    def sources(self) -> tuple[Source, ...]:
        """Where the runs that are used lie, those of the main iteration first.

        The main one is the iteration itself where it has an estimate of recorded runs, else the latest before it that
        has any; of an earlier one the executed runs are used as well. Raises ArtifactError where there is none,
        UsageError for an iteration of --also that does not exist, or is the present one.
        """
        earlier = [one for one in self.project.iterations() if one.number < self.iteration.number]
        if self.iteration.artifact("estimate").exists():
            main = [Source(self.iteration)]
        else:
            main = next((found for one in reversed(earlier) if (found := estimated(one))), [Source(self.iteration)])
        self._require_another(main[0].place)
        others: dict[int, list[Source]] = {}
        for number in self.also:
            if number != main[0].place.number:
                place = self._also(number)
                others[number] = estimated(place) or [Source(place)]
        found = [*main, *(one for part in others.values() for one in part)]
        for one in found:
            number, of = one.place.number, " --of execute" * one.executed
            require_input(one.recording, partial(self.project.first_data, one.place))
            require_input(one.estimate, f"r2s2r estimate --iteration {number}{of}")
        return tuple(found)

    def _require_another(self, main: Iteration) -> None:
        """Raises UsageError where --also names the iteration itself: its recorded runs are used anyway, and what ran
        its plan later is for a later iteration to learn from."""
        if main.number in self.also and main.number == self.iteration.number:
            executed = Source(main, executed=True).estimate
            if executed.exists():
                raise UsageError(
                    f"the recorded runs of iteration {main.number} are used without --also, its executed ones "
                    f"({executed.name}) from the next iteration on", where="--also",
                    expected="another iteration, or a later one as the main one", received=str(main.number),
                    hint=self._with_executed(main),
                )  # fmt: skip
            others = [str(one.number) for one in self.project.iterations() if one.number != main.number]
            raise UsageError(
                f"the runs of iteration {main.number} are used without --also", where="--also",
                expected="another iteration" + (f": {', '.join(others)}" if others else ", and there is none"),
                received=str(main.number), hint=self.command,
            )  # fmt: skip

    def _with_executed(self, main: Iteration) -> str:
        """The command that takes the executed runs of an iteration as well: from a later one, as it does."""
        later = next((one for one in self.project.iterations() if one.number > main.number), None)
        number = main.number + 1 if later is None else later.number
        also = f" --also {main.number}" * (later is not None and Source(later).estimate.exists())
        if self.command == "r2s2r identify":
            return f"r2s2r identify --iteration {number}{also}"
        if later is None:  # only `identify` begins an iteration
            return f"r2s2r identify --iteration {number}   # of both; then: {self.command} --iteration {number}"
        model = main.artifact("identification")
        own = f" --model {shlex.quote(os.path.relpath(model))}" * model.exists()
        return f"{self.command} --iteration {number}{also}{own}"

    def _also(self, number: int) -> Iteration:
        """An iteration of --also. Raises UsageError where there is none."""
        try:
            return self.project.iteration(number)
        except UsageError as error:
            error.where = "--also"
            raise

    @cached_property
    def last(self) -> Iteration | None:
        """The latest earlier iteration with an identification, which --online continues; None: from robot.toml."""
        if not self.online:
            return None
        earlier = [i for i in self.project.iterations() if i.number < self.iteration.number]
        return next((i for i in reversed(earlier) if i.artifact("identification").exists()), None)

    @cached_property
    def kept(self) -> Iteration | None:
        """The latest earlier iteration with an identification, where that has effects and none are named here: its
        effects stay in the simulator. Raises ArtifactError where it cannot be read."""
        from r2s2r_cli.store.read import read_artifact

        earlier = [] if self.effects else [i for i in self.project.iterations() if i.number < self.iteration.number]
        found = next((i for i in reversed(earlier) if i.artifact("identification").exists()), None)
        if found is None:
            return None
        fit = read_artifact(found.artifact("identification"), "identification")[1].groups["fit"]
        return found if str(fit.attributes["effects"]).split() else None

    def refs(self) -> list[InputRef]:
        """The inputs. Raises ArtifactError where one cannot be read."""
        from r2s2r_cli.store.header import whole_header
        from r2s2r_cli.store.staleness import artifact_ref

        paths = self.artifacts()
        earlier = [one for one in (self.last, self.kept) if one is not None]
        paths += dict.fromkeys(one.artifact("identification") for one in earlier)
        return [artifact_ref(self.project, path, whole_header(path)) for path in paths]

    def runs(self) -> list[RunData]:
        """The runs of all sources, named by `named_runs`. Raises ArtifactError, InputError."""
        from r2s2r_cli.stages.identify.load import run_data

        found, robot = list(named_runs(self.sources)), self.project.robot()
        for one in found:
            require_robot(one.recording, one.run, robot.name)
        return [run_data(one.recording, one.estimate, one.run, name=one.name) for one in found]

    def artifacts(self) -> list[Path]:
        """Recordings and estimates that are read, those of the main iteration first."""
        return [path for source in self.sources for path in (source.recording, source.estimate)]

    def check(self, settings: IdentifySettings, *, planted: bool = False) -> None:
        """Find what is wrong with the request before any work: names, bounds, intervals, runs, what goes together.
        planted: a self-test is asked for.

        Raises UsageError, InputError or ArtifactError, as the fit would.
        """
        from r2s2r_cli.stages.identify.identify import require_possible
        from r2s2r_cli.stages.identify.task import require_replay

        runs = self.runs()
        request = self.request(runs, settings)
        if planted:
            require_replay(request)
        require_possible(self.project.robot(), runs, request, settings)

    def request(self, runs: Sequence[RunData], settings: IdentifySettings) -> Request:
        """The request, its intervals resolved. Raises UsageError for runs and intervals that do not exist."""
        from r2s2r_cli.stages.identify.effects_asked import effects_asked, effects_kept
        from r2s2r_cli.stages.identify.free.extend import name_of
        from r2s2r_cli.stages.identify.request import Request
        from r2s2r_cli.stages.identify.selection import split, upright
        from r2s2r_cli.store.read import read_artifact

        robot = self.project.robot()
        usable, left_out = (runs, ()) if self.train or self.test else upright(runs, robot)
        train, test = split(usable, self.train, self.test, settings.train_share)
        before, kept = (
            read_artifact(place.artifact("identification"), "identification")[1] if place else None
            for place in (self.last, self.kept)
        )
        wanted = effects_asked(self.effects, robot) if kept is None else effects_kept(kept, robot)
        named = {name_of(text.removeprefix("+")) for text in self.free}
        kept_fixed = {**wanted.fixed, **parse_fixed(settings.fix, where="identify.fix")}
        fixed = {name: value for name, value in kept_fixed.items() if name not in named} | parse_fixed(self.fix)
        return Request(
            train=train, test=test, free=self.free, fixed=fixed, effects=wanted.ids,
            of_effects=wanted.specs,
            method=self.method, drive=self.drive, seed=self.seed, online=self.online, before=before,
            discrepancy=self.discrepancy, left_out=left_out,
        )  # fmt: skip


def parse_fixed(texts: Sequence[str], where: str = "--fix") -> dict[str, float]:
    """`friction=0.6` items as numbers by parameter. where: they stand. Raises UsageError."""
    fixed: dict[str, float] = {}
    for text in texts:
        name, _, number = text.partition("=")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not name or not math.isfinite(value):
            raise UsageError("a fixed parameter has no number", where=where, expected="NAME=VALUE", received=text,
                             hint=f"--fix {name or 'friction'}=0.6")  # fmt: skip
        fixed[name] = value
    return fixed
