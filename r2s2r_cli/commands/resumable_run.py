"""A stage command that goes on from what an interrupted one left of its artifact."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar

from r2s2r_cli.commands.interrupts import Kept, resumable
from r2s2r_cli.commands.stage import Drawings, Report, StageRun
from r2s2r_cli.commands.typed import typed_words
from r2s2r_cli.store.checkpoint import checkpoint_key, checkpoint_of
from schemas.results import StageResult

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData


class Checkpoint(Kept, Protocol):
    """One of `store`: a `CheckpointFile` or an `ArrayCheckpoint`."""

    @property
    def command(self) -> Sequence[str]:
        """The words that were typed after `r2s2r`, without --resume."""
        ...

    def require_own(self) -> None:
        """Raises what taking it up would raise, of a damaged one and of another request's."""

    def clear(self) -> None:
        """Remove it: the artifact stands."""


Own = TypeVar("Own", bound=Checkpoint)


@dataclass
class ResumableRun(StageRun[Report]):
    """A `StageRun` with a checkpoint beside its artifact."""

    resume: bool = False
    """Whether --resume was given."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.unfinished = checkpoint_of(self.target)
        self.resumed = self.resume and self.unfinished.exists()

    def checkpoint(
        self, kind: Callable[..., Own], *depends: object, command: Sequence[str] | None = None, **how: object
    ) -> Own:
        """Of this request: stage, settings, robot, inputs and what else it depends on. command: the words that were
        typed after `r2s2r`, without --resume; None: as they were. how: as `kind` takes it."""
        if command is None:
            command = [word for word in typed_words(self.stage) if word != "--resume"]
        digests = [ref.sha256 for ref in self.inputs]
        made = self.wanted
        key = checkpoint_key(made.stage_version, made.settings, made.robot, digests, *depends)
        return kind(self.unfinished, key, self.resume, command=command, **how)

    def run_on(
        self,
        checkpoint: Checkpoint,
        compute: Callable[[], tuple[ArtifactData, Report]],
        draw: Callable[[ArtifactData, Report], Drawings] | None,
        say: Callable[[str], None],
        *,
        done: str = "fitted",
    ) -> tuple[StageResult, Report | None]:
        """As `run`, and where it is interrupted as `resumable` says. A dry run looks whether there is a way on."""
        if self.resume and not self.resumed:
            say("nothing was interrupted: there is no checkpoint to go on from")
        with resumable(checkpoint, self.project.relative(self.unfinished), checkpoint.command, done=done):
            if self.dry_run and self.resumed:
                checkpoint.require_own()
            return self.run(compute, draw, lambda _: checkpoint.clear())
