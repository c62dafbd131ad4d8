"""What was begun and is no artifact yet, as `status` says it: journals of recordings, checkpoints of computations."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from r2s2r_cli.store.checkpoint import checkpoint_of, command_in, head_of
from r2s2r_cli.store.project import Iteration, Project, journal_of
from schemas.results import ArtifactState

RESUMED = {"identification": "identify", "plan": "plan", "comparison": "compare", "diagnosis": "diagnose"}
"""Stages that go on from a checkpoint, by what they make."""
UNDER_WAY = ("interrupted", "running")
"""States of computations: no artifact is wrong or missing because of them."""


@dataclass(frozen=True)
class Kept:
    """A checkpoint."""

    path: Path
    name: str
    """Its path in the project."""
    stage: str
    iteration: int
    latest: bool = True
    """Whether a command without --iteration means this one."""

    @cached_property
    def _head(self) -> dict[str, Any] | None:
        return head_of(self.path)

    @property
    def readable(self) -> bool:
        """Whether its head is whole: without it nothing goes on from it."""
        return self._head is not None

    @cached_property
    def command(self) -> str:
        """What goes on from it: as it was typed, or, of an older r2s2r, without its options. Where nothing does, what
        removes it."""
        if not self.readable:
            return shlex.join(["rm", self.name])
        typed = command_in(self._head) or (self.stage, "--iteration", str(self.iteration))
        named = self.latest or any(word.partition("=")[0] == "--iteration" for word in typed)
        return shlex.join(["r2s2r", *typed, *([] if named else ["--iteration", str(self.iteration)]), "--resume"])

    @property
    def use(self) -> str:
        """What it is good for, with the command behind: a table breaks a long one before its end, and without its last
        word, --resume, the work begins anew."""
        if not self.readable:
            return f"its head is damaged, nothing goes on from it: {self.command}"
        return f"--resume goes on with what is kept: {self.command}"


def checkpoints(project: Project) -> dict[tuple[str, int | None], Kept]:
    """Of every iteration, by stage and its number."""
    every = project.iterations()
    places = [(one, checkpoint_of(one.artifact(kind)), stage) for one in every for kind, stage in RESUMED.items()]
    return {
        (stage, one.number): Kept(path, project.relative(path), stage, one.number, latest=one == every[-1])
        for one, path, stage in places
        if path.exists()
    }


def interrupted(one: Kept, busy: str | None) -> ArtifactState:
    """A checkpoint. busy: who writes in the project now."""
    running = busy is not None and f"'r2s2r {one.stage}'" in busy
    why = f"{busy} is at work" if running else one.use
    return ArtifactState(
        stage=one.stage, iteration=one.iteration, artifact=one.name,
        state="running" if running else "interrupted", reasons=(why,), bytes=one.path.stat().st_size,
        content_sha256=None,
    )  # fmt: skip


def unsealed(project: Project, iteration: Iteration | None, path: Path, busy: str | None) -> ArtifactState:
    """A journal: of a recording that runs, or of one that was cut off. busy: who writes in the project now."""
    executed = iteration is not None and path == journal_of(iteration.artifact("recording", executed=True))
    why = "the recording was cut off before it was sealed" if busy is None else f"{busy} is writing it"
    return ArtifactState(
        stage="execute" if executed else "record", iteration=iteration.number if iteration else None,
        artifact=project.relative(path), state="unsealed" if busy is None else "recording", reasons=(why,),
        bytes=path.stat().st_size, content_sha256=None,
    )  # fmt: skip
