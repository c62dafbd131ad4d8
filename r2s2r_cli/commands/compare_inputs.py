"""What `compare` was asked for: real runs of an iteration, simulators by their names; as inputs and values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from r2s2r_cli.commands.stage import require_input
from r2s2r_cli.errors import UsageError
from r2s2r_cli.store.project import Iteration, Project
from schemas.header import InputRef

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData, Group
    from r2s2r_cli.stages.compare import Model, RealRun

INITIAL = "initial"
"""Name of the simulator with the numbers of robot.toml."""
TRAIN = 1
"""Code of `schemas.identification.ROLES`."""


@dataclass(frozen=True)
class Asked:
    """The request of one command line. models: as typed, FILE or NAME=FILE; empty: robot.toml and every identification
    up to this iteration. of: `record` or `execute`."""

    project: Project
    iteration: Iteration
    models: tuple[str, ...]
    of: str

    def flags(self) -> dict[str, Any]:
        """What else than settings and inputs decides the result, for the provenance."""
        return {"models": {name: self.project.relative(path) for name, path in self.files.items()}, "of": self.of}

    @property
    def estimate(self) -> Path:
        """The states of the real runs."""
        return self.iteration.artifact("estimate", executed=self.of == "execute")

    @property
    def recording(self) -> Path:
        """What they were made of."""
        return self.iteration.artifact("recording", executed=self.of == "execute")

    @property
    def floor(self) -> Path:
        """The floor of the project, there or not."""
        return self.project.artifact("floor", None)

    @cached_property
    def files(self) -> dict[str, Path]:
        """Identifications by the name of their simulator. Raises UsageError for two of one name."""
        if not self.models:
            earlier = [place for place in self.project.iterations() if place.number <= self.iteration.number]
            paths = [(place, place.artifact("identification")) for place in earlier]
            return {f"iteration {place.number}": path for place, path in paths if path.exists()}
        found: dict[str, Path] = {}
        for text in self.models:
            name, equals, typed = text.rpartition("=")
            path = Path(typed)
            name = name if equals else f"iteration {int(path.parent.name)}" if path.parent.name.isdigit() else path.stem
            if name in found or name == INITIAL:
                raise UsageError("two simulators would have the same name", where="--model", expected="a name for each",
                                 received=name, hint="--model first=a.h5 --model second=b.h5")  # fmt: skip
            found[name] = path
        return found

    def refs(self) -> list[InputRef]:
        """The inputs. Raises ArtifactError where one cannot be read."""
        from r2s2r_cli.store.header import whole_header
        from r2s2r_cli.store.staleness import artifact_ref

        number = self.iteration.number
        require_input(self.estimate, f"r2s2r estimate --iteration {number}" + " --of execute" * (self.of == "execute"))
        for path in self.files.values():
            require_input(path, "r2s2r identify")
        others = [path for path in (self.recording, self.floor) if path.exists()]
        return [
            artifact_ref(self.project, path, whole_header(path))
            for path in (self.estimate, *others, *self.files.values())
        ]

    def runs(self) -> tuple[tuple[RealRun, ...], tuple[str, ...]]:
        """The real runs, and why others are left out. Raises ArtifactError, InputError."""
        from r2s2r_cli.stages.compare import real_runs
        from r2s2r_cli.store.read import read_artifact

        recording = read_artifact(self.recording, "recording")[1] if self.recording.exists() else None
        return real_runs(self._states, recording, self.project.robot())

    def simulators(self) -> tuple[Model, ...]:
        """The simulators, that of robot.toml first. Raises ArtifactError, InputError."""
        from r2s2r_cli.stages.compare import Model
        from r2s2r_cli.stages.identified import identified, nominal
        from r2s2r_cli.store.read import read_artifact

        robot = self.project.robot()
        found = [Model(INITIAL, nominal(robot))]
        for name, path in self.files.items():
            header, data = read_artifact(path, "identification")
            used = {ref.path for ref in header.provenance.inputs}
            trained: frozenset[str] = frozenset()
            if self.project.relative(self.estimate) in used:
                segments = data.groups["segments"]
                roles = zip(segments["run"].tolist(), segments["role"].tolist(), strict=True)
                trained = self._own({run.decode() for run, role in roles if role == TRAIN}, segments)
            found.append(Model(name, identified(data, robot, words=self.project.relative(path)), trained))
        return tuple(found)

    def _own(self, trained: set[str], segments: Group) -> frozenset[str]:
        """Of the runs that were trained on, by the names that `identify` gave them, those of this estimate, by theirs.

        There a run of another iteration is called NNN-RUN, and an executed one executed-RUN where both have one name.
        """
        known = {run.decode() for run in segments["run"].tolist()}
        found = set()
        for run in self._states.runs():
            plain = {run, f"{self.iteration.number:03d}-{run}"}
            marked = {f"executed-{name}" for name in plain}
            if (marked if self.of == "execute" and marked & known else plain) & trained:
                found.add(run)
        return frozenset(found)

    @cached_property
    def _states(self) -> ArtifactData:
        from r2s2r_cli.store.read import read_artifact

        return read_artifact(self.estimate, "estimate")[1]

    def keyframe_floor(self) -> float | None:
        """Of the caps at key frames [m], from floor.h5; None where there is none."""
        from r2s2r_cli.store.read import read_artifact

        if not self.floor.exists():
            return None
        group = read_artifact(self.floor, "floor")[1].groups.get("caps")
        return None if group is None else float(group.attributes["floor"])
