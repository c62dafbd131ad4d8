"""What `compare` was asked for: real runs of the iterations, simulators by their names; as inputs and values."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from r2s2r_cli.commands.compare_models import learned_names, require_current
from r2s2r_cli.commands.outcome import require_input, require_model
from r2s2r_cli.errors import InputError, UsageError, quoted
from r2s2r_cli.store.again import GIVEN, SELECTED
from r2s2r_cli.store.project import Iteration, Project, iteration_number
from schemas.header import InputRef

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.stages.compare import Model, RealRun

INITIAL = "initial"
"""Name of the simulator with the numbers of robot.toml."""
TAKEN = ("real", "real robot", "floor")
"""What tables and pictures call what is no simulator."""
TRAIN = 1
"""Code of `schemas.identification.ROLES`."""


@dataclass(frozen=True)
class Asked:
    """The request of one command line. models: as typed, FILE or NAME=FILE; empty: robot.toml and every identification
    up to this iteration. of: `record`, `execute`, or None: executed runs where there are any. own: without the executed
    runs of earlier iterations."""

    project: Project
    iteration: Iteration
    models: tuple[str, ...]
    of: str | None
    own: bool = False

    def flags(self) -> dict[str, Any]:
        """What else than settings and inputs decides the result, for the provenance."""
        models = {name: self.project.relative(path) for name, path in self.files.items()}
        typed = {"models": bool(self.models), "of": self.of is not None}
        given = [name for name in SELECTED["compare"] if typed[name]]
        return {"models": models, "of": "execute" if self.executed else "record", "own": self.own, GIVEN: given}

    @cached_property
    def executed(self) -> bool:
        """Whether executed runs are compared, not the recorded ones."""
        if self.of is not None:
            return self.of == "execute"
        kinds = ("recording", "estimate")
        return any(self.iteration.artifact(kind, executed=True).exists() for kind in kinds)

    @cached_property
    def places(self) -> tuple[Iteration, ...]:
        """Iterations whose runs are compared: this one, then earlier ones with executed runs, the first one first."""
        if self.own or not self.executed:
            return (self.iteration,)
        earlier = [one for one in self.project.iterations() if one.number < self.iteration.number]
        return self.iteration, *(one for one in earlier if one.artifact("estimate", executed=True).exists())

    def estimate(self, place: Iteration) -> Path:
        """The states of the real runs."""
        return place.artifact("estimate", executed=self.executed)

    def recording(self, place: Iteration) -> Path:
        """What they were made of."""
        return place.artifact("recording", executed=self.executed)

    def prefix(self, place: Iteration) -> str:
        """Before the names of its runs: those of other iterations may have the same."""
        return "" if place == self.iteration else f"{place.number:03d}-"

    @property
    def floor(self) -> Path:
        """The floor of the project, there or not."""
        return self.project.artifact("floor", None)

    @cached_property
    def files(self) -> dict[str, Path]:
        """Identifications by the name of their simulator. Raises UsageError for two of one name, for none, and for a
        name that stands for the robot or its floor."""
        if not self.models:
            earlier = [place for place in self.project.iterations() if place.number <= self.iteration.number]
            paths = [(place, place.artifact("identification")) for place in earlier]
            return {f"iteration {place.number}": path for place, path in paths if path.exists()}
        found: dict[str, Path] = {}
        for text in self.models:
            name, path = _split(text)
            if path is None:
                raise self._without_file(text)
            if name is None:
                number = iteration_number(path.parent)
                name = path.stem if number is None else f"iteration {number}"
            if not name.strip():
                raise UsageError("a simulator has no name", where="--model", expected="FILE or NAME=FILE",
                                 received=text, hint=f"--model {quoted(path)}")  # fmt: skip
            if name in found or name == INITIAL:
                raise UsageError("two simulators would have the same name", where="--model", expected="a name for each",
                                 received=text, hint=_named(name, path, found))  # fmt: skip
            if name.strip().casefold() in TAKEN:
                raise UsageError("the name is that of no simulator in tables and pictures", where="--model",
                                 expected=f"another name than {' | '.join(TAKEN)}", received=text,
                                 hint=_named("simulated", path, found))  # fmt: skip
            found[name] = path
        return found

    def _without_file(self, text: str) -> UsageError:
        """For a name, or nothing, where a simulator has to be: the latest up to this iteration, else of the project,
        under that name."""
        places = sorted(self.project.iterations(), key=lambda one: (one.number <= self.iteration.number, one.number))
        there = [os.path.relpath(path) for one in places if (path := one.artifact("identification")).exists()]
        return UsageError(
            "a simulator has no file", where="--model", expected="FILE or NAME=FILE", received=text or "nothing",
            hint=f"--model {quoted(text.removeprefix('=') + there[-1])}" if there else "r2s2r identify",
        )  # fmt: skip

    def refs(self) -> list[InputRef]:
        """The inputs. Raises ArtifactError where one cannot be read."""
        from r2s2r_cli.store.header import whole_header
        from r2s2r_cli.store.staleness import artifact_ref

        number = self.iteration.number
        recorded, executed = (self.iteration.artifact("recording", executed=one).exists() for one in (False, True))
        if self.of == "record" and executed and not recorded and not self.estimate(self.iteration).exists():
            raise UsageError("this iteration has no recorded runs", where="--of record", expected="--of execute",
                             received=f"iteration {number}, whose robot has only executed its plan",
                             hint="--of execute")  # fmt: skip
        require_input(
            self.estimate(self.iteration),
            f"r2s2r estimate --iteration {number}" + " --of execute" * self.executed,
        )
        known = {path: require_model(self.project, path, "compare") for path in dict.fromkeys(self.files.values())}
        return [artifact_ref(self.project, path, known.get(path) or whole_header(path)) for path in self.artifacts()]

    def artifacts(self) -> list[Path]:
        """What is read, each file once: one may be two simulators, by two names."""
        states = [self.estimate(place) for place in self.places]
        others = [path for path in (*map(self.recording, self.places), self.floor) if path.exists()]
        return [*{self.project.relative(path): path for path in (*states, *others, *self.files.values())}.values()]

    def runs(self) -> tuple[tuple[RealRun, ...], tuple[str, ...]]:
        """The real runs, those of this iteration first, and why others are left out. Raises ArtifactError, and
        InputError where this iteration has none."""
        from r2s2r_cli.stages.compare import real_runs
        from r2s2r_cli.stages.repeated import asked_repeats
        from r2s2r_cli.store.read import read_artifact

        found: list[RealRun] = []
        said: list[str] = []
        for place in self.places:
            path = self.recording(place)
            header, recording = read_artifact(path, "recording") if path.exists() else (None, None)
            try:
                runs, left_out = real_runs(
                    self._states[place.number], recording, self.project.robot(), iteration=place.number,
                    prefix=self.prefix(place), repeats=asked_repeats(header.provenance.settings) if header else 0,
                )  # fmt: skip
            except InputError as error:
                if place == self.iteration:
                    raise
                said.append(f"the runs of iteration {place.number} are left out: {error.what}")
                continue
            found += runs
            said += left_out
        return tuple(found), tuple(said)

    def simulators(self) -> tuple[tuple[Model, ...], tuple[str, ...]]:
        """The simulators, that of robot.toml first, and what is stale about them. Raises ArtifactError, InputError."""
        from r2s2r_cli.stages.compare import Model
        from r2s2r_cli.stages.identified import identified, nominal
        from r2s2r_cli.store.read import read_artifact

        robot = self.project.robot()
        found, said = [Model(INITIAL, nominal(robot))], []
        for name, path in self.files.items():
            header, data = read_artifact(path, "identification")
            said += [f"simulator {name}: {text}" for text in require_current(self.project, name, path, header)]
            called = learned_names(self.project, path, header)
            segments = data.groups["segments"]
            roles = zip(segments["run"].tolist(), segments["role"].tolist(), strict=True)
            trained = {run.decode() for run, role in roles if role == TRAIN}
            here = frozenset(
                self.prefix(place) + run
                for place in self.places
                for run in self._states[place.number].runs()
                if called.get((self.project.relative(self.estimate(place)), run)) in trained
            )
            found.append(Model(name, identified(data, robot, words=self.project.relative(path)), here))
        return tuple(found), tuple(said)

    @cached_property
    def _states(self) -> dict[int, ArtifactData]:
        """The estimates by number of their iteration."""
        from r2s2r_cli.store.read import read_artifact

        return {place.number: read_artifact(self.estimate(place), "estimate")[1] for place in self.places}

    def keyframe_floor(self) -> float | None:
        """Of the caps at key frames [m], from floor.h5; None where there is none."""
        from r2s2r_cli.store.read import read_artifact

        if not self.floor.exists():
            return None
        group = read_artifact(self.floor, "floor")[1].groups.get("caps")
        return None if group is None else float(group.attributes["floor"])


def asked_again(project: Project, iteration: Iteration, flags: Mapping[str, Any]) -> Asked:
    """The request with these flags, once more: what was typed then is typed again, the rest selected anew. An artifact
    from before it was noted what was typed is taken to have it all typed."""
    given = flags.get(GIVEN, SELECTED["compare"])
    named = flags.get("models", {}) if "models" in given else {}
    models = tuple(f"{name}={project.root / path}" for name, path in named.items())
    return Asked(project, iteration, models, flags.get("of") if "of" in given else None, flags.get("own", False))


def _split(text: str) -> tuple[str | None, Path | None]:
    """Name and file of FILE or NAME=FILE; None for one that is not given. Both may hold `=`: a file that is there
    decides, else the first sign does."""
    if "=" not in text or Path(text).is_file():
        return None, Path(text) if text else None
    parts = text.split("=")
    ways = [("=".join(parts[:i]), "=".join(parts[i:])) for i in range(1, len(parts))]
    name, file = next((way for way in ways if Path(way[1]).is_file()), ways[0])
    return name, Path(file) if file else None


def _named(name: str, path: Path, others: Collection[str]) -> str:
    """The option with a name that no other simulator has: this one, else with a number."""
    names = (name, *(f"{name}-{number}" for number in range(2, len(others) + 4)))
    free = next(one for one in names if one not in others and one != INITIAL)
    return f"--model {quoted(f'{free}={path}')}"
