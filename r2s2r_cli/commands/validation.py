"""What `validate` gathers about each file, as values for the checks, and the order in which they are run."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from shlex import quote

import numpy as np

from r2s2r_cli.checks import CHECKS
from r2s2r_cli.checks.base import Check, run_checks
from r2s2r_cli.checks.files import ALWAYS
from r2s2r_cli.checks.schema import FORM
from r2s2r_cli.checks.subjects import (
    Content,
    Difference,
    InputState,
    Links,
    Policy,
    Reading,
    policies_of,
    runs_of,
)
from r2s2r_cli.commands.places import ROBOT_FILE, Place, shown
from r2s2r_cli.commands.sources import MASSES, is_masses, what_source
from r2s2r_cli.errors import ArtifactError, InputError, R2S2RError, quoted
from r2s2r_cli.store.canonical import source_sha256
from r2s2r_cli.store.examine import Examined, examine
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.isolated import IsolatedReader
from r2s2r_cli.store.layout import Mismatch
from r2s2r_cli.store.project import CONFIG_FILE, ITERATIONS, PROJECT_FILE
from r2s2r_cli.store.toml import model_problems, read_toml
from schemas.base import Frozen
from schemas.config import ProjectFile, RunConfig
from schemas.header import Header, InputRef
from schemas.policy import PolicyFile
from schemas.results import Finding
from schemas.robot import Robot
from schemas.sidecar import Sidecar
from schemas.versions import KINDS, STAGE_VERSIONS

_TOML: dict[str, type[Frozen]] = {
    "policy": PolicyFile,
    "robot description": Robot,
    "project file": ProjectFile,
    "settings of an iteration": RunConfig,
    "sidecar": Sidecar,
}
"""What a TOML file can be, in the order in which a tie is decided."""


@dataclass(frozen=True)
class Gathered:
    """One file as the checks see it."""

    reading: Reading
    links: Links | None = None
    content: Content | None = None
    subjects: tuple[object, ...] = ()
    """Runs, policies, the robot: looked at where the form of `content` is right."""

    @property
    def unreadable(self) -> bool:
        """Whether nothing but `reading` could be checked."""
        return bool(self.reading.refused or self.reading.wrong or self.reading.damage)


def gather(path: Path, place: Place | None, reader: IsolatedReader) -> Gathered:
    """Read one file, whatever it is. Never raises for what is in it."""
    try:
        if _is_toml(path):
            return _gather_toml(path, place)
        _refuse_others(path)
    except R2S2RError as error:
        return Gathered(Reading(refused=(error,)))
    return _gather_artifact(path, examine(path, reader), place)


def findings_of(gathered: Gathered, file: str, selected: Collection[Check]) -> list[Finding]:
    """All findings of one file: can it be read, its links, its form, and where that is right, its values."""
    found = run_checks(ALWAYS, gathered.reading, file)
    if gathered.unreadable:
        return found
    chosen = [entry for entry in CHECKS if entry in selected]
    found = [finding for finding in found if any(finding.check == entry.name for entry in chosen)]
    if gathered.links is not None:
        found += run_checks(chosen, gathered.links, file)
    if gathered.content is not None:
        wrong = run_checks(FORM, gathered.content, file)
        if wrong:
            names = {entry.name for entry in chosen}
            return found + [finding for finding in wrong if finding.check in names]
        found += run_checks([entry for entry in chosen if entry not in FORM], gathered.content, file)
    for subject in gathered.subjects:
        found += run_checks(chosen, subject, file)
    return found


def _is_toml(path: Path) -> bool:
    return path.suffix.lower() == ".toml" and not path.is_dir()


def _refuse_others(path: Path) -> None:
    """Raises InputError for files that are neither artifacts nor TOML, with the command that takes them."""
    source = what_source(path)
    if source is not None:
        raise InputError("validate does not read files of this kind", where=str(path),
                         expected="an artifact (.h5) or a TOML file", received=source.words,
                         hint=source.command)  # fmt: skip


def _gather_artifact(path: Path, found: Examined, place: Place | None) -> Gathered:
    refused = () if found.refused is None else (found.refused,)
    reading = Reading(refused, newer=found.newer, damage=_differences(found.damage), unread_bytes=found.unread_bytes)
    if found.header is None or found.data is None:
        return Gathered(reading)
    robot = place.robot if place is not None else None
    data = found.data
    content = Content(data, _differences(found.layout))
    robots = {
        group: str(values.attributes["robot"])
        for group, values in data.groups.items()
        if isinstance(values.attributes.get("robot"), str)
    }
    links = Links(
        header=found.header, body=found.body, robots=robots, project_robot=robot.name if robot else None,
        inputs=tuple(_inputs(found.header.provenance.inputs, place)), stage_versions=STAGE_VERSIONS,
        filename=path.name if place is not None else "", belongs=_belongs(path, found.header, place),
    )  # fmt: skip
    if found.layout:
        return Gathered(reading, links, content)
    subjects = (*(runs_of(data, robot) if "runs" in _roots(data.groups) else ()), *policies_of(data, robot))
    return Gathered(reading, links, content, subjects)


def _belongs(path: Path, header: Header, place: Place | None) -> str:
    """The place of the kind of a misnamed artifact, as it is typed here; empty where something lies there."""
    spec = KINDS.get(header.kind)
    if place is None or spec is None or path.name in spec.filenames:
        return ""
    project = spec.level == "project"
    if not project and path.absolute().parent.parent != place.root / ITERATIONS:
        return ""
    executed = header.provenance.stage == "execute" or any(
        ref.path.endswith(f"/{KINDS['recording'].executed}") for ref in header.provenance.inputs
    )
    name = spec.executed if spec.executed and executed else spec.filename
    found = place.root / name if project else path.with_name(name)
    return "" if found.exists() else shown(found) if found.is_absolute() else str(found)


def _differences(places: tuple[Mismatch, ...]) -> tuple[Difference, ...]:
    return tuple(Difference(p.where, p.what, p.expected, p.received, p.hint) for p in places)


def _roots(groups: Mapping[str, object]) -> set[str]:
    return {path.partition("/")[0] for path in groups}


def _inputs(refs: tuple[InputRef, ...], place: Place | None) -> Iterator[InputState]:
    """What became of the recorded inputs. Outside a project their paths lead nowhere: nothing is said."""
    for ref in refs if place is not None else ():
        path = place.root / ref.path  # type: ignore[union-attr]
        try:
            if ref.kind in KINDS:
                header = read_header(path)
                # A migration changes the form of an input, not what it says: `status` counts it as the same as well.
                former = {note.content_sha256 for note in header.provenance.migrations}
                yield InputState(ref, ref.sha256 if ref.sha256 in former else header.content_sha256)
            elif path.exists():
                yield InputState(ref, source_sha256(path))
            else:
                yield InputState(ref, None, "it is gone")
        except ArtifactError as error:
            yield InputState(ref, None, error.what)
        except OSError as error:
            yield InputState(ref, None, error.strerror or str(error))


def _gather_toml(path: Path, place: Place | None) -> Gathered:
    if path.exists() and not path.is_file():
        raise InputError(
            "this is no regular file", where=str(path), expected="a TOML file", hint=f"ls -la {quoted(path)}"
        )
    values = read_toml(path)
    if is_masses(values):
        return _gather_masses(path, place)
    kind = _model_of(path, values, place)
    problems = model_problems(values, kind, str(path))
    if problems:
        return Gathered(Reading(wrong=tuple(problems)))
    model = kind.model_validate(values)
    if isinstance(model, Robot):
        return Gathered(Reading(), subjects=(model,))
    if isinstance(model, PolicyFile):
        return Gathered(Reading(), subjects=(_policy(model, place),))
    return Gathered(Reading())


def _gather_masses(path: Path, place: Place | None) -> Gathered:
    """Weighed parts: read as `calibrate` reads them, for the robot of the project."""
    from r2s2r_cli.stages.calibrate.masses import read_masses
    from r2s2r_cli.stages.calibrate.source import Source

    if place is None or place.robot is None:
        raise InputError("these are measurements for calibrate, and there is no robot to compare them with",
                         where=str(path), expected="a project with a robot.toml that can be used", received=MASSES,
                         hint=f"r2s2r calibrate --masses {quote(str(path))}   # in its project")  # fmt: skip
    try:
        read_masses(Source(str(path), path.read_bytes()), place.robot)
    except InputError as error:
        return Gathered(Reading(wrong=(error,)))
    return Gathered(Reading())


def _model_of(path: Path, values: Mapping[str, object], place: Place | None) -> type[Frozen]:
    """What a TOML file is: by its place in the project, else by its keys. Raises InputError."""
    if place is not None and place.project is not None and path.absolute() == place.project.robot_path.absolute():
        return Robot
    named: dict[str, type[Frozen]] = {PROJECT_FILE: ProjectFile, CONFIG_FILE: RunConfig, ROBOT_FILE: Robot}
    if path.name in named:
        return named[path.name]
    scores = {}
    for words, model in _TOML.items():
        known = {entry.alias or name for name, entry in model.model_fields.items()}
        scores[words] = len(known & set(values)) - len(set(values) - known)
    best = max(scores, key=lambda words: scores[words])
    if scores[best] < 1:
        raise InputError("this is none of the TOML files that r2s2r reads", where=str(path), expected=", ".join(_TOML),
                         received=f"a file with the keys {', '.join(sorted(values)[:5]) or '(none)'}",
                         hint="r2s2r validate --help   # docs/reference/checks.md has what it looks at")  # fmt: skip
    return _TOML[best]


def _policy(file: PolicyFile, place: Place | None) -> Policy:
    return Policy(
        root="",
        robot_name=file.robot,
        target=np.array([step.target for step in file.steps]),
        hold=np.array([step.hold_s for step in file.steps]),
        timeout=np.array([np.nan if step.timeout_s is None else step.timeout_s for step in file.steps]),
        repeat=file.repeat,
        project_robot=place.robot if place is not None else None,
    )
