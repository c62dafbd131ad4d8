"""The runs of iterations that a stage learns from, and what each is called among them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from r2s2r_cli.errors import InputError
from r2s2r_cli.nearest import nearest, nearest_choice
from r2s2r_cli.store.project import Iteration

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData


@dataclass(frozen=True)
class Source:
    """Runs of one iteration: the recorded ones, or those that executed its plan."""

    place: Iteration
    executed: bool = False

    @property
    def recording(self) -> Path:
        """What came from the robot."""
        return self.place.artifact("recording", executed=self.executed)

    @property
    def estimate(self) -> Path:
        """Their states."""
        return self.place.artifact("estimate", executed=self.executed)


def estimated(place: Iteration) -> list[Source]:
    """The runs of an iteration that have states, recorded ones first."""
    return [one for one in (Source(place), Source(place, executed=True)) if one.estimate.exists()]


@dataclass(frozen=True)
class NamedRun:
    """A run of both artifacts, where it is called `run`, and its name among those of all sources."""

    name: str
    recording: ArtifactData
    estimate: ArtifactData
    run: str


def named_runs(sources: Sequence[Source]) -> Iterator[NamedRun]:
    """The runs of all sources: those of another iteration than the first are called NNN-RUN, an executed one with the
    name of a recorded one executed-RUN. Raises ArtifactError."""
    from r2s2r_cli.store.read import read_artifact

    taken: set[str] = set()
    for source in sources:
        recording = read_artifact(source.recording, "recording")[1]
        estimate = read_artifact(source.estimate, "estimate")[1]
        prefix = "" if source.place == sources[0].place else f"{source.place.number:03d}-"
        for run in estimate.runs():
            name = prefix + run
            name = f"executed-{name}" if name in taken else name
            taken.add(name)
            yield NamedRun(name, recording, estimate, run)


def require_robot(recording: ArtifactData | None, run: str, name: str) -> None:
    """Raises InputError where a run says that it is of another robot than `name`."""
    own = None if recording is None else recording.groups.get(f"runs/{run}")
    told = name if own is None else str(own.attributes.get("robot", name))
    if told != name:
        raise InputError(
            f"run {run} is of another robot", where=f"runs/{run}, robot", expected=f"{name}, as robot.toml says",
            received=told, hint="r2s2r status   # another iteration may have runs of this robot alone",
        )  # fmt: skip


def nearest_run(name: str, known: Sequence[str]) -> str:
    """The run that was meant by a name that none has: one that has it in its own (`after` of 002-after), else the one
    that is spelt like it. Where none is near, a place for one with a remark: a wrong run would be believed."""
    holding = [one for one in known if name and name.lower() in one.lower()]
    return nearest_choice(name, holding) if holding else nearest(name, known) or "RUN   # one of those that are listed"
