"""The journal of a recording, from the layout that the stage asks for; and its sealing, whatever ended it."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from r2s2r_cli.commands.pictures import remove_pictures
from r2s2r_cli.commands.typed import typed_words
from r2s2r_cli.errors import UsageError, quoted
from r2s2r_cli.store.lock import writer
from r2s2r_cli.store.project import Iteration, Project, journal_of
from schemas.versions import KINDS, STAGE_VERSIONS

if TYPE_CHECKING:
    from r2s2r_cli.stages.record import StreamLayout
    from r2s2r_cli.store.journal import Journal, JournalHead
    from r2s2r_cli.store.seal import Sealed
    from schemas.header import InputRef
    from schemas.results_record import RecordReport
SETTINGS = "record"
"""Whoever executes a plan records it: the settings are the same."""


@dataclass
class Recording:
    """Where a recording goes, and when it began. overrides, flags: of the command line. stage: `record`, or `execute`
    for the runs of a plan, which have a file of their own. inputs: what the policies came from."""

    project: Project
    iteration: Iteration
    overrides: Mapping[str, Any]
    flags: Mapping[str, Any]
    seed: int | None
    stage: str = "record"
    inputs: Sequence[InputRef] = ()
    started: datetime = field(default_factory=lambda: datetime.now(UTC))
    clock: float = field(default_factory=time.monotonic)

    @property
    def target(self) -> Path:
        """The artifact."""
        return self.iteration.artifact("recording", executed=self.stage == "execute")

    def writer(self) -> str | None:
        """Who records into this very file now; None: nobody."""
        return writer(self.project.root) if journal_of(self.target).exists() else None

    def refusal(self, *, force: bool) -> UsageError | None:
        """Why nothing can be recorded here, as `require_room` raises it; None where there is room."""
        try:
            self.require_room(force=force)
        except UsageError as error:
            return error
        return None

    def require_room(self, *, force: bool, more: Sequence[str] = ()) -> None:
        """Raises UsageError where a recording is there: raw runs cannot be made again. force: it keeps another name.
        more: options that the command lacks beside."""
        journal = journal_of(self.target)
        busy = self.writer()
        if busy is not None:
            raise UsageError("a recording is running in this iteration", where=self.project.relative(journal),
                             expected="one at a time", received=busy, hint="r2s2r status")  # fmt: skip
        if journal.exists():
            raise UsageError(
                "a recording that was cut off is in the way", where=self.project.relative(journal),
                expected="no journal", received="one", hint=f"r2s2r recover {quoted(journal)}",
            )  # fmt: skip
        if self.target.exists() and not force:
            raise UsageError(
                "this iteration has a recording already, and what a robot did cannot be made again",
                where=self.project.relative(self.target), expected="none", received="one",
                hint=self._elsewhere(more),
            )  # fmt: skip

    def _elsewhere(self, more: Sequence[str]) -> str:
        """The command as it was typed, for where there is room: a recording starts a new iteration, what is executed
        belongs to the plan of its own."""
        words = [word for word in typed_words(self.stage) if word != "--dry-run"]  # which is not refused
        if self.stage == "execute":
            return shlex.join(["r2s2r", *words, *more, "--force"]) + "   # the old runs stay as .replaced"
        at = next((k for k, word in enumerate(words) if word.split("=")[0] == "--iteration"), None)
        if at is not None:
            del words[at : at + (1 if "=" in words[at] else 2)]
        newest = self.project.iterations()[-1].number
        return shlex.join(["r2s2r", *words, "--iteration", str(newest + 1)])

    def put_aside(self) -> Path | None:
        """The recording that is there gets another name (--force), and its pictures go; None where there is none."""
        from r2s2r_cli.store.atomic import keep_beside

        if not self.target.exists():
            return None
        kept = keep_beside(self.target, ".replaced")
        remove_pictures(self.target)
        self.target.unlink()
        return kept

    def open(self, streams: Sequence[StreamLayout], groups: Mapping[str, Mapping[str, Any]]) -> Journal:
        """The journal, ready for rows. Raises ArtifactError on a full disk."""
        from r2s2r_cli.store.journal import Journal

        return Journal(journal_of(self.target), self._head(streams, groups))

    def seal(self, report: RecordReport, started: Mapping[str, float], drawings: Sequence[str]) -> Sealed:
        """The artifact of the closed journal. started: wall clock of each run [unix s]. Raises ArtifactError."""
        from r2s2r_cli.store.seal import Late, seal

        late = Late(
            wall_s=time.monotonic() - self.clock, report=report.model_dump(mode="json"), drawings=tuple(drawings),
            attributes={f"runs/{run}": {"start_unix": start} for run, start in started.items()},
        )  # fmt: skip
        return seal(journal_of(self.target), self.target, late=late)

    def _head(self, streams: Sequence[StreamLayout], groups: Mapping[str, Mapping[str, Any]]) -> JournalHead:
        from r2s2r_cli.commands.wanted import wanted
        from r2s2r_cli.store.journal import Field, JournalHead, Stream
        from r2s2r_cli.store.provenance import build_provenance

        use = wanted(self.project, self.iteration, SETTINGS, dict(self.overrides), self.flags)
        provenance = build_provenance(
            stage=self.stage, stage_version=STAGE_VERSIONS[self.stage], argv=sys.argv, settings=use.settings,
            overrides=self.overrides, robot=use.robot, inputs=self.inputs, started=self.started, wall_s=0.0,
            seed=self.seed,
        )  # fmt: skip
        made = tuple(
            Stream(s.path, tuple(Field(name, dtype, shape) for name, dtype, shape in s.fields), s.attributes, s.name)
            for s in streams
        )
        return JournalHead("recording", KINDS["recording"].version, made, groups, provenance.model_dump(mode="json"))
