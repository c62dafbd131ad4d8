"""What every stage command does around its stage: decide, lock, compute, write, draw, report."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from r2s2r_cli.console import Console
from r2s2r_cli.errors import ArtifactError, R2S2RError
from r2s2r_cli.store.atomic import sweep, write_bytes
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.lock import writing
from r2s2r_cli.store.project import Iteration, Project
from r2s2r_cli.store.staleness import Wanted, reasons
from schemas.header import Header, InputRef, Provenance
from schemas.results import StageResult
from schemas.versions import STAGE_VERSIONS

if TYPE_CHECKING:
    from pydantic import BaseModel

    from r2s2r_cli.artifact import ArtifactData
    from schemas.robot import Robot

_GEOMETRY = {"rods": ("length_m", "cap_radius_m"), "cables": ("caps", "kind")}
ROBOT_PARTS: dict[str, dict[str, tuple[str, ...]]] = {
    "import": {"name": (), **_GEOMETRY},
    "calibrate": {
        "name": (),
        "rods": ("name", "length_m", "cap_radius_m"),
        "sensors": ("cable",),
        "cables": ("caps", "kind", "rest_length_m"),
        "pid": (),
        "limits": (),
    },
    "estimate": {
        "name": (),
        "rods": ("length_m", "cap_radius_m", "parts"),
        "cables": ("caps", "kind"),
        "pid": (),
        "sensors": ("cable", "slope_f_per_m", "offset_f"),
    },
}
"""Which part of robot.toml each stage uses; a change elsewhere does not make its results stale."""


def robot_part(stage: str, robot: Robot) -> dict[str, Any]:
    """The part of the robot description that `stage` uses, as JSON values."""
    everything = robot.model_dump(mode="json")
    part: dict[str, Any] = {}
    for name, keys in ROBOT_PARTS.get(stage, {}).items():
        value = everything[name]
        part[name] = [{key: item[key] for key in keys} for item in value] if keys else value
    return part


def wanted(
    project: Project, iteration: Iteration | None, stage: str, overrides: dict[str, Any], flags: Mapping[str, Any]
) -> Wanted:
    """What `stage` would use if it ran now. Raises InputError or UsageError for wrong settings."""
    config = project.config(iteration, overrides).model_dump(mode="json", by_alias=True)
    settings = {**config.get(stage, {}), "flags": dict(flags)}
    return Wanted(STAGE_VERSIONS.get(stage, 1), settings, robot_part(stage, project.robot()))


def wanted_again(project: Project, iteration: Iteration | None, made: Provenance) -> Wanted:
    """What the stage that made an artifact would use now, with the same overrides and flags."""
    return wanted(project, iteration, made.stage, made.overrides, made.settings.get("flags", {}))


@dataclass
class StageRun:
    """One run of one stage command."""

    stage: str
    kind: str
    project: Project
    iteration: Iteration | None
    console: Console
    inputs: Sequence[InputRef]
    overrides: dict[str, Any] = field(default_factory=dict)
    flags: Mapping[str, Any] = field(default_factory=dict)
    dry_run: bool = False
    force: bool = False
    guard: Callable[[Header | None], None] | None = None
    """Raises where the artifact in the way must not be replaced."""

    def __post_init__(self) -> None:
        self.target = self.project.artifact(self.kind, self.iteration)
        self.wanted = wanted(self.project, self.iteration, self.stage, self.overrides, self.flags)

    def run(
        self,
        compute: Callable[[], tuple[ArtifactData, BaseModel]],
        draw: Callable[[ArtifactData], Iterable[tuple[str, bytes]]] | None,
        after: Callable[[], None] = lambda: None,
    ) -> StageResult:
        """Compute and write where the artifact is not fresh; `draw` yields (suffix, bytes): `-run.png`, `.html`.

        `after` runs once the artifact stands, still under the lock.
        """
        present, why = self.why()
        if not why and not self.force:
            os.utime(self.target)  # make decides by file time; it must see that this is up to date
            return self._result("fresh", present, (), None)
        if self.dry_run:
            return self._result("dry_run", present, why or ["--force was given"], None)
        if self.guard is not None and not self.force:
            self.guard(present)
        with writing(self.project.root, self.stage):
            return self._run_locked(compute, draw, after, why or ["--force was given"])

    def why(self) -> tuple[Header | None, list[str]]:
        """The header of what is there, and why it must be made (again); empty: it is fresh."""
        if not self.target.exists():
            return None, ["there is no artifact yet"]
        try:
            header = read_header(self.target)
        except R2S2RError as error:
            return None, [f"what is there is damaged: {error.what}"]
        recorded = {ref.path for ref in header.provenance.inputs}  # `reasons` compares their content
        asked = {ref.path for ref in self.inputs}
        found = reasons(self.project, header, self.wanted)
        if header.provenance.stage != self.stage:
            found.insert(0, f"it was made by {header.provenance.stage}")
        elif not found and recorded != asked:
            found.append("it was made from other inputs")
        return header, found

    def _run_locked(
        self,
        compute: Callable[[], tuple[ArtifactData, BaseModel]],
        draw: Callable[[ArtifactData], Iterable[tuple[str, bytes]]] | None,
        after: Callable[[], None],
        why: Sequence[str],
    ) -> StageResult:
        from r2s2r_cli.store.provenance import build_provenance
        from r2s2r_cli.store.write import write_artifact

        sweep(self.target.parent)
        started, clock = datetime.now(UTC), time.monotonic()
        data, report = compute()
        provenance = build_provenance(
            stage=self.stage, stage_version=self.wanted.stage_version, argv=sys.argv, settings=self.wanted.settings,
            overrides=self.overrides, robot=self.wanted.robot, inputs=self.inputs, started=started,
            wall_s=time.monotonic() - clock,
        )  # fmt: skip
        header = write_artifact(self.target, data, provenance)
        after()
        drawings = []
        for suffix, content in draw(data) if draw else ():
            path = self.target.with_name(self.target.stem + suffix)
            write_bytes(path, content)
            drawings.append(self.project.relative(path))
        return self._result("done", header, why, report, drawings)

    def _result(
        self,
        state: Any,
        header: Header | None,
        why: Sequence[str],
        report: BaseModel | None,
        drawings: Sequence[str] = (),
    ) -> StageResult:
        return StageResult(
            stage=self.stage, state=state, artifact=self.project.relative(self.target), reasons=tuple(why),
            content_sha256=header.content_sha256 if header else None, inputs=tuple(ref.path for ref in self.inputs),
            drawings=tuple(drawings), report=report.model_dump(mode="json") if report else None,
        )  # fmt: skip


def show_outcome(result: StageResult, console: Console) -> None:
    """Say on stderr what became of the artifact; with --json print the document."""
    console.document(result)
    words = {
        "done": f"wrote {result.artifact}",
        "fresh": f"{result.artifact} is fresh, nothing to do",
        "dry_run": f"would write {result.artifact}",
    }
    console.say(words[result.state])
    for reason in result.reasons:
        console.say(f"  because {reason}")
    for path in result.drawings:
        console.say(f"  drew {path}")
    if result.state == "dry_run":
        for path in result.inputs:
            console.say(f"  from {path}")


def require_input(path: Path, command: str) -> None:
    """Raises ArtifactError where the stage before has not run."""
    if not path.exists():
        raise ArtifactError(
            "the artifact of the stage before is missing",
            where=str(path),
            expected=path.name,
            received="nothing",
            hint=command,
        )


def print_config(settings: Mapping[str, Any], console: Console) -> None:
    """The effective settings on stdout: TOML, or JSON with --json."""
    if console.json:
        import json

        console.raw(json.dumps(settings, indent=2))
        return
    import tomlkit

    console.raw(tomlkit.dumps(dict(settings)).rstrip())
