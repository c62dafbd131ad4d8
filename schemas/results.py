"""The JSON documents of `--json`: one model a command, each with its own version in `schema`."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from schemas.base import Frozen
from schemas.results_compare import CompareHistory


class ErrorResult(Frozen):
    """What any command prints on stdout when it fails with --json."""

    schema_: Literal["r2s2r.error/1"] = Field(default="r2s2r.error/1", alias="schema")
    exit_code: int
    what: str
    where: str
    expected: str
    received: str
    hint: str


class StageResult(Frozen):
    """What `import`, `calibrate` and `estimate` print: state of the artifact and the stage's own report."""

    schema_: Literal["r2s2r.stage/1"] = Field(default="r2s2r.stage/1", alias="schema")
    stage: str
    state: Literal["done", "fresh", "dry_run"]
    artifact: str
    """Relative to the project."""
    content_sha256: str | None
    reasons: tuple[str, ...]
    """Why the stage ran (or would run); where it is fresh, which of its inputs are stale themselves."""
    inputs: tuple[str, ...]
    stale_inputs: tuple[str, ...] = ()
    """Where the stage ran (or would run): which of its inputs are stale themselves, and why."""
    drawings: tuple[str, ...] = ()
    """Pictures and reports written beside the artifact, relative to the project."""
    report: dict[str, Any] | None = None
    """Set where the stage ran; its own model is one of `schemas/json/result_*_report.json`."""


class InitResult(Frozen):
    """What `init` prints."""

    schema_: Literal["r2s2r.init/1"] = Field(default="r2s2r.init/1", alias="schema")
    project: str
    robot: str
    files: tuple[str, ...]


class ArtifactState(Frozen):
    """One line of `status`."""

    stage: str
    iteration: int | None
    artifact: str
    state: Literal["fresh", "stale", "damaged", "unsealed", "recording", "interrupted", "running"]
    reasons: tuple[str, ...]
    mend: str = ""
    """Of a damaged artifact the command that brings it back or makes it again, else empty."""
    notes: tuple[str, ...] = ()
    """What else is to be known of it, whatever its state: runs that were cut off."""
    overrides: dict[str, Any] = Field(default_factory=dict)
    """Settings that came from `--set` when it was made: the same command without them makes it again."""
    bytes: int
    content_sha256: str | None


class StatusResult(Frozen):
    """What `status` prints."""

    schema_: Literal["r2s2r.status/1"] = Field(default="r2s2r.status/1", alias="schema")
    project: str
    robot: str
    iterations: int
    artifacts: tuple[ArtifactState, ...]
    bytes: int
    """Disk that the whole project takes."""
    next: str
    """The command that brings the project forward; empty where everything is fresh."""
    history: tuple[CompareHistory, ...] = ()
    """The gap to the robot over the iterations, as the latest comparison says it."""


class RunStep(Frozen):
    """One stage of `run`."""

    stage: str
    state: Literal["done", "kept", "dry_run"]
    """done: its command ended well, fresh or made; kept: what is there is used as it is."""
    artifact: str
    """Relative to the project."""
    command: str


class RunResult(Frozen):
    """What `run` prints; where a stage fails, the document of that stage in its place."""

    schema_: Literal["r2s2r.run/1"] = Field(default="r2s2r.run/1", alias="schema")
    iteration: int
    stages: tuple[RunStep, ...]
    """Of those that were asked for, in their order."""


class NodeInfo(Frozen):
    """One group or dataset in `inspect`."""

    path: str
    dtype: str = ""
    shape: tuple[int, ...] | None = None
    unit: str = ""
    dims: str = ""
    frame: str = ""
    description: str = ""
    attributes: dict[str, Any] = Field(default_factory=dict)


class InspectResult(Frozen):
    """What `inspect` prints."""

    schema_: Literal["r2s2r.inspect/1"] = Field(default="r2s2r.inspect/1", alias="schema")
    path: str
    header: dict[str, Any] | None
    """None for an HDF5 file of another program."""
    nodes: tuple[NodeInfo, ...]
    same: bool | None = None
    """With `--same-as`: whether the contents are equal."""
    differences: tuple[str, ...] = ()


class Finding(Frozen):
    """One thing that `validate` found."""

    check: str
    importance: Literal["error", "warning", "advice"]
    file: str
    location: str
    what: str
    expected: str
    received: str
    hint: str


class ValidateResult(Frozen):
    """What `validate` prints."""

    schema_: Literal["r2s2r.validate/1"] = Field(default="r2s2r.validate/1", alias="schema")
    files: tuple[str, ...]
    checks: tuple[str, ...]
    """Names of the checks that ran."""
    findings: tuple[Finding, ...]
    unreadable: tuple[str, ...]
    """Files that cannot be read at all; where there are any, the exit code is 4."""
    errors: int
    warnings: int
    advice: int


class MigrateResult(Frozen):
    """What `migrate` prints."""

    schema_: Literal["r2s2r.migrate/1"] = Field(default="r2s2r.migrate/1", alias="schema")
    files: dict[str, str]
    """What was done with each file, in words; with --dry-run, what would be."""
    failed: dict[str, str] = Field(default_factory=dict)
    """Files that stayed as they were, and why."""


class RecoverResult(Frozen):
    """What `recover` prints."""

    schema_: Literal["r2s2r.recover/1"] = Field(default="r2s2r.recover/1", alias="schema")
    files: dict[str, str]
    """What was done with each file, in words."""
    failed: dict[str, str] = Field(default_factory=dict)
    """Files that could not be restored, and why. What could be read of them was rescued."""
    rows: dict[str, int]
    """Rows rescued, by stream."""
    removed: tuple[str, ...]
    """Temp files of killed writers that were swept away."""


class ExportResult(Frozen):
    """What `export` prints."""

    schema_: Literal["r2s2r.export/1"] = Field(default="r2s2r.export/1", alias="schema")
    source: str
    format: str
    files: tuple[str, ...]


class Probe(Frozen):
    """One thing that `doctor` looked at."""

    name: str
    state: Literal["ok", "warning", "error"]
    found: str
    hint: str = ""


class DoctorResult(Frozen):
    """What `doctor` prints."""

    schema_: Literal["r2s2r.doctor/1"] = Field(default="r2s2r.doctor/1", alias="schema")
    probes: tuple[Probe, ...]


class BenchResult(Frozen):
    """What `bench startup` prints: medians over repeated fresh processes."""

    schema_: Literal["r2s2r.bench.startup/1"] = Field(default="r2s2r.bench.startup/1", alias="schema")
    machine: str
    repeats: int
    seconds: dict[str, float]
    """Wall time by command [s]."""
    ratio_to_python: dict[str, float]
    """The same as a multiple of a bare interpreter's start on this machine."""
