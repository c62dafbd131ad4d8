"""What `simulate` was asked for: policy files and artifacts, recorded runs, starts; as inputs, flags and requests."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from r2s2r_cli.commands.outcome import require_input, require_model
from r2s2r_cli.errors import InputError, UsageError, quoted
from r2s2r_cli.nearest import nearest
from r2s2r_cli.store.project import Iteration, Project
from schemas.header import InputRef

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.stages.identified import Identified
    from r2s2r_cli.stages.simulate import Request, Start
    from r2s2r_cli.stages.simulate.replay import Replay
    from schemas.policy import PolicyFile
    from schemas.robot import Robot

REST = "rest"
ARTIFACT = ".h5"


@dataclass(frozen=True)
class Asked:
    """The request of one command line. policies: as typed, relative to the working directory."""

    project: Project
    iteration: Iteration
    policies: tuple[str, ...]
    random: int | None
    seed: int
    replay: tuple[str, ...]
    start: str | None
    model: Path | None = None

    def flags(self) -> dict[str, Any]:
        """What else than settings and inputs decides the result, for the provenance."""
        return {
            "policies": stored_names(self.project, self.policies),
            "random": self.random,
            "seed": None if self.random is None else self.seed,
            "replay": list(self.replay),
            "from": self.start,
            "model": None if self.model is None else self.project.relative(self.model),
        }

    def refs(self) -> list[InputRef]:
        """The inputs: policy files, artifacts. Raises InputError or ArtifactError where one cannot be read."""
        from r2s2r_cli.store.header import whole_header
        from r2s2r_cli.store.staleness import artifact_ref, source_ref

        refs: dict[str, InputRef] = {}
        for path, _ in map(split_name, self.policies):
            try:
                artifact = path.suffix == ARTIFACT
                ref = (
                    artifact_ref(self.project, path, whole_header(path)) if artifact else source_ref(self.project, path)
                )
            except OSError as error:
                raise InputError("the policy cannot be read", where=str(path), expected="a policy file or an artifact",
                                 received=error.strerror or str(error),
                                 hint=_meant(path)) from error  # fmt: skip
            refs[ref.path] = ref
        if self.model is not None:
            ref = artifact_ref(self.project, self.model, require_model(self.project, self.model, "simulate"))
            refs[ref.path] = ref
        if self._recorded is not None:
            ref = artifact_ref(self.project, self._recorded, whole_header(self._recorded))
            refs[ref.path] = ref
        return list(refs.values())

    def check(self) -> None:
        """What the stage itself would refuse of policies, runs and numbers, for a dry run. Raises InputError,
        UsageError."""
        from r2s2r_cli.stages.simulate.policies import require_length, sequence

        robot = self.project.robot()
        for text in self.policies:
            for policy in read_policies(text):
                sequence(policy, robot)
        if self.random is not None:
            require_length(self.random)
        for run in self.replay:
            self._replay(run, robot)
        if self.start not in (None, REST):
            self._start(None)
        self.simulator()

    def simulator(self) -> Identified | None:
        """The identified numbers that were asked for. Raises ArtifactError; InputError for those of another robot, or
        of robot.toml as it was before it was changed."""
        from r2s2r_cli.commands.numbers import read_numbers
        from r2s2r_cli.stages.identified import identified

        if self.model is None:
            return None
        found = read_numbers(self.project, self.model)
        return identified(found, self.project.robot(), words=self.project.relative(self.model))

    @property
    def numbers(self) -> str:
        """Where the numbers of the simulator come from."""
        return "robot.toml" if self.model is None else self.project.relative(self.model)

    @property
    def unused(self) -> Path | None:
        """The identification of the iteration, or else of the last one before it, where none was asked for; None: there
        is none."""
        places = [one for one in self.project.iterations() if one.number <= self.iteration.number]
        found = (one.artifact("identification") for one in reversed(places))
        return next((path for path in found if path.exists()), None) if self.model is None else None

    def requests(self) -> list[Request]:
        """The runs to simulate, in the order of the command line. Raises InputError, UsageError."""
        from r2s2r_cli.stages.simulate import Request
        from r2s2r_cli.stages.simulate.policies import random_policy

        robot = self.project.robot()
        found = [Request(policy, self._start(None)) for text in self.policies for policy in read_policies(text)]
        if self.random is not None:
            found.append(Request(random_policy(robot, self.random, self.seed), self._start(None)))
        for run in self.replay:
            found.append(Request(self._replay(run, robot), self._start(run)))
        return found

    def _replay(self, run: str, robot: Robot) -> Replay:
        from r2s2r_cli.stages.simulate.replay import recorded_commands

        data = self._data(run, "--replay")
        return recorded_commands(data, run, len(robot.actuated), source=str(self._recorded))

    def _start(self, run: str | None) -> Start | None:
        """The start of a replay of `run`, or of a policy; None: the rest state."""
        from r2s2r_cli.stages.simulate import Start

        name = self.start or run
        if name is None or name == REST:
            return None
        frames = self._data(name, "--from").group(name, "frames")
        if frames is None:
            if self.start is None:  # a replay of a recording without estimated states
                return None
            raise InputError(f"run {name} has no estimated states to start from", where="--from",
                             expected="a run of 20-estimate.h5", received="a recording",
                             hint=f"r2s2r estimate --iteration {self.iteration.number}")  # fmt: skip
        return Start(name, frames["p_WE"][0])

    def _data(self, run: str, option: str) -> ArtifactData:
        data = self._recording
        if run not in data.runs():
            raise UsageError("there is no such run", where=option, expected=" | ".join(data.runs()), received=run,
                             hint=f"r2s2r inspect {quoted(self._recorded)}")  # fmt: skip
        return data

    @cached_property
    def _recorded(self) -> Path | None:
        """The artifact with the recorded runs: estimated where that was done. None where none is asked for."""
        if not self.replay and self.start in (None, REST):
            return None
        estimate = self.iteration.artifact("estimate")
        if estimate.exists():
            return estimate
        recording = self.iteration.artifact("recording")
        require_input(recording, partial(self.project.first_data, self.iteration))
        return recording

    @cached_property
    def _recording(self) -> ArtifactData:
        from r2s2r_cli.store.read import read_artifact

        if self._recorded is None:
            raise AssertionError("no recorded run was asked for")
        return read_artifact(self._recorded)[1]


def split_name(text: str) -> tuple[Path, str]:
    """`10-record.h5:crawl` -> the path and the name behind it; a path that exists is taken as it is."""
    head, colon, name = text.rpartition(":")
    if Path(text).exists() or not colon or Path(head).suffix != ARTIFACT:
        return Path(text), ""
    return Path(head), name


def stored_names(project: Project, texts: Sequence[str]) -> list[str]:
    """Policies as typed here, for the provenance: as they would be typed in the project's directory."""
    return [project.relative(path) + (f":{name}" if name else "") for path, name in map(split_name, texts)]


def read_policies(text: str, command: str = "simulate") -> Iterator[PolicyFile]:
    """The policies of a TOML file (one) or an artifact (all, or the one named). command: that was typed, for hints.
    Raises InputError, UsageError."""
    from r2s2r_cli.commands.typed import typed_instead
    from r2s2r_cli.stages.simulate.policies import policy_names, stored_policies
    from r2s2r_cli.store.read import read_artifact
    from r2s2r_cli.store.toml import load_model
    from schemas.policy import PolicyFile

    path, name = split_name(text)
    if path.suffix != ARTIFACT:
        yield load_model(path, PolicyFile)
        return
    data = read_artifact(path)[1]
    found = policy_names(data)
    if not found or (name and name not in found):
        near = nearest(name, found)
        raise UsageError(
            "there is no such policy" if name else "the artifact holds no policy", where=str(path),
            expected=" | ".join(found) or "a policy, or runs with targets", received=name or "none",
            hint=typed_instead(command, name, near) if near else f"r2s2r inspect {quoted(path)}",
        )  # fmt: skip
    yield from stored_policies(data, [name] if name else None).values()


def _meant(path: Path) -> str:
    """The command with the policy file that was probably meant: without a name behind it, which an artifact alone has,
    or of a near name; else with none."""
    from r2s2r_cli.commands.typed import typed_instead
    from r2s2r_cli.store.log_folders import some_files

    bare = Path(str(path).rpartition(":")[0])
    near = nearest(path.name, [one.name for ending in (".toml", ARTIFACT) for one in some_files(path.parent, ending)])
    right = bare if bare.is_file() else path.with_name(near) if near else None
    return "r2s2r simulate --random 15" if right is None else typed_instead("simulate", str(path), str(right))
