"""What every stage command does around its stage: decide, lock, compute, write, draw, report."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from pydantic import BaseModel

from r2s2r_cli.commands.asked_again import joined
from r2s2r_cli.commands.freshness import same_inputs, stale_inputs
from r2s2r_cli.commands.interrupts import whole_items
from r2s2r_cli.commands.pictures import remove_pictures
from r2s2r_cli.commands.wanted import wanted
from r2s2r_cli.errors import InputError, R2S2RError, UsageError
from r2s2r_cli.store.atomic import sweep, write_bytes
from r2s2r_cli.store.header import read_header, sealed_header
from r2s2r_cli.store.lock import writing
from r2s2r_cli.store.project import Iteration, Project
from r2s2r_cli.store.staleness import reasons
from schemas.header import Header, InputRef
from schemas.results import StageResult

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData

Report = TypeVar("Report", bound=BaseModel)
Drawings = Iterable[tuple[str, bytes]]


@dataclass
class StageRun(Generic[Report]):
    """One run of one stage command."""

    stage: str
    kind: str
    project: Project
    iteration: Iteration | None
    find_inputs: Callable[[], Sequence[InputRef]]
    """Called before and after computing: what a stage used must be what its provenance says."""
    report_model: type[Report]
    overrides: dict[str, Any] = field(default_factory=dict)
    flags: Mapping[str, Any] = field(default_factory=dict)
    dry_run: bool = False
    force: bool = False
    resumed: bool = field(default=False, init=False)
    """Whether there is something to go on from: it is made, fresh or not."""
    guard: Callable[[Header | None], None] | None = None
    """Raises where the artifact in the way must not be replaced; in a dry run as well."""
    executed: bool = False
    """Of the executed plan: 50-execute.h5, 51-estimate.h5."""
    not_applied: Callable[[Report], list[str]] | None = None
    """Why an artifact that is fresh has not had its effect elsewhere."""

    def __post_init__(self) -> None:
        self.inputs = self.find_inputs()
        self.target = self.project.artifact(self.kind, self.iteration, executed=self.executed)
        self.wanted = wanted(self.project, self.iteration, self.stage, self.overrides, self.flags)

    def run(
        self,
        compute: Callable[[], tuple[ArtifactData, Report]],
        draw: Callable[[ArtifactData, Report], Drawings] | None,
        after: Callable[[Report], None] | None = None,
    ) -> tuple[StageResult, Report | None]:
        """Compute, write and draw where the artifact is not fresh; say what it says where it is.

        `draw` yields (suffix, bytes): `-run.png`, `.html`. `after` runs once the artifact stands, under the lock.
        """
        present, why = self.why(drawn=draw is not None)
        if not why and (self.force or self.resumed):
            why = ["--force was given" if self.force else "--resume goes on with what was interrupted"]
        if present is not None and not why:
            return self._fresh(present, draw)
        if self.guard is not None and not self.force:
            self.guard(present)
        if self.dry_run:
            return self._result("dry_run", present, why, None), None
        with writing(self.project.root, self.stage):
            return self._run_locked(compute, draw, after, why)

    def why(self, *, drawn: bool) -> tuple[Header | None, list[str]]:
        """The header of what is there, and why it must be made (again); empty: it is fresh."""
        self._seen = self._content()
        if not self.target.exists():
            return None, ["there is no artifact yet"]
        try:
            header = sealed_header(self.target)
        except R2S2RError as error:
            return None, [f"what is there is damaged: {error.what}"]
        found = reasons(self.project, header, self.wanted)
        if header.provenance.stage != self.stage:
            found.insert(0, f"it was made by {header.provenance.stage}")
        elif not found and not same_inputs(header.provenance.inputs, self.inputs):
            found += joined(self.project, self.iteration, header.provenance) or ["it was made from other inputs"]
        elif not found and drawn and not header.provenance.drawings:
            found.append("it was made with --no-draw")
        if not found and self.not_applied is not None and header.provenance.report:
            found += self.not_applied(self.report_model.model_validate(header.provenance.report))
        return header, found

    def _fresh(
        self, header: Header, draw: Callable[[ArtifactData, Report], Drawings] | None
    ) -> tuple[StageResult, Report | None]:
        """Nothing to compute: touch the file for make, and draw again what is missing."""
        made = header.provenance
        report = self.report_model.model_validate(made.report) if made.report else None
        missing = [name for name in made.drawings if not self.target.with_name(name).exists()]
        drawings: list[str] = []
        if not self.dry_run:
            with contextlib.suppress(OSError):  # a file that only others may touch is as fresh
                os.utime(self.target)
            if missing and draw is not None and report is not None:
                from r2s2r_cli.store.read import read_artifact

                with writing(self.project.root, self.stage):
                    _, data = read_artifact(self.target, self.kind, blobs=True)
                    drawings = self._write_drawings(list(whole_items(draw(data, report))))
        return self._result("fresh", header, stale_inputs(self.project, self.inputs), report, drawings), report

    def _run_locked(
        self,
        compute: Callable[[], tuple[ArtifactData, Report]],
        draw: Callable[[ArtifactData, Report], Drawings] | None,
        after: Callable[[Report], None] | None,
        why: Sequence[str],
    ) -> tuple[StageResult, Report | None]:
        from r2s2r_cli.store.provenance import build_provenance
        from r2s2r_cli.store.write import write_artifact

        self._require_unchanged()
        sweep(self.target.parent)
        started, clock = datetime.now(UTC), time.monotonic()
        data, report = compute()
        wall_s = time.monotonic() - clock
        self._require_same_inputs()
        pictures = list(whole_items(draw(data, report))) if draw is not None else []
        provenance = build_provenance(
            stage=self.stage, stage_version=self.wanted.stage_version, argv=sys.argv, settings=self.wanted.settings,
            overrides=self.overrides, robot=self.wanted.robot, inputs=self.inputs, started=started, wall_s=wall_s,
            report=report.model_dump(mode="json"), drawings=[self.target.stem + suffix for suffix, _ in pictures],
        )  # fmt: skip
        # Before the artifact changes: a picture that is there must never show another artifact.
        header = write_artifact(self.target, data, provenance, replacing_now=lambda: remove_pictures(self.target))
        if after is not None:
            after(report)
        return self._result("done", header, why, report, self._write_drawings(pictures)), report

    def _content(self) -> str | None:
        try:
            return read_header(self.target).content_sha256
        except R2S2RError:
            return None

    def _require_unchanged(self) -> None:
        """Everything was decided before the lock was held: it must still be so."""
        if self._content() != self._seen:
            raise UsageError("another r2s2r wrote this artifact just now", where=self.project.relative(self.target),
                             expected="what was there when this command began", received="another",
                             hint="run the command again")  # fmt: skip

    def _require_same_inputs(self) -> None:
        before, now = ({ref.path: ref.sha256 for ref in refs} for refs in (self.inputs, self.find_inputs()))
        for path in sorted({*before, *now}):
            expected, received = (side.get(path, "")[:16] for side in (before, now))
            if expected != received:
                raise InputError("an input changed while it was read", where=path,
                                 expected=f"sha256 {expected}" if expected else "no such input, as at the beginning",
                                 received=received or "no such file any more",
                                 hint="run the command again")  # fmt: skip

    def _write_drawings(self, pictures: Sequence[tuple[str, bytes]]) -> list[str]:
        names = []
        for suffix, content in pictures:
            path = self.target.with_name(self.target.stem + suffix)
            try:
                write_bytes(path, content)
            except R2S2RError as error:
                error.what += f"; {self.target.name} is whole, and pictures that it lacks are drawn by the same command"
                raise
            names.append(self.project.relative(path))
        return names

    def _result(
        self,
        state: Literal["done", "fresh", "dry_run"],
        header: Header | None,
        why: Sequence[str],
        report: Report | None,
        drawings: Sequence[str] = (),
    ) -> StageResult:
        return StageResult(
            stage=self.stage, state=state, artifact=self.project.relative(self.target), reasons=tuple(why),
            content_sha256=header.content_sha256 if header else None, inputs=tuple(ref.path for ref in self.inputs),
            drawings=tuple(drawings), report=report.model_dump(mode="json") if report else None,
            stale_inputs=() if state == "fresh" else tuple(stale_inputs(self.project, self.inputs)),
        )  # fmt: skip
