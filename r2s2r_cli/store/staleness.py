"""Is an artifact still what its inputs, settings and stage version would give? If not, why not, in words.

Decided by content hashes and values, never by file times or source text. Reads headers only, no HDF5.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from r2s2r_cli.errors import InputError, R2S2RError
from r2s2r_cli.measured import BYTES, CONTENT, changed
from r2s2r_cli.store.canonical import source_sha256
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from schemas.header import Header, InputRef
from schemas.versions import KINDS

_LISTED = 3
"""Values of a list that are told one by one."""


BORROWED = "simulate"
"""Among the settings of another stage: those of this one that it uses. An artifact from before they were noted does not
say what they were, and is not judged by them."""


@dataclass(frozen=True)
class Wanted:
    """What a stage would use if it ran now."""

    stage_version: int
    settings: Mapping[str, Any]
    robot: Mapping[str, Any]


def reasons(project: Project, header: Header, wanted: Wanted) -> list[str]:
    """Why the artifact with this header is stale, one sentence a cause; empty: it is fresh."""
    made = header.provenance
    found: list[str] = []
    if made.stage_version != wanted.stage_version:
        found.append(f"stage {made.stage} changed: made by version {made.stage_version}, now {wanted.stage_version}")
    settings = {name: value for name, value in wanted.settings.items() if name != BORROWED or name in made.settings}
    found += [f"setting {made.stage}.{text}" for text in differences(made.settings, settings)]
    found += [f"robot.toml: {text}" for text in differences(made.robot, wanted.robot)]
    for ref in made.inputs:
        found += input_reasons(project, ref, made.stage)
    return found


def input_reasons(project: Project, ref: InputRef, stage: str = "") -> list[str]:
    """Why one recorded input no longer matches. stage: that made the artifact.

    A migration of an input changes its form, not what it says. A source file may be gone: what was made of it stays.
    """
    path = project.root / ref.path
    if ref.kind in KINDS:
        try:
            header = read_header(path)
        except R2S2RError as error:
            return [f"input {ref.path}: {error.what}"]
        forms = {header.content_sha256, *(note.content_sha256 for note in header.provenance.migrations)}
        return [] if ref.sha256 in forms else [changed(ref.path, stage, CONTENT)]
    try:
        other = path.exists() and source_sha256(path) != ref.sha256
    except OSError as error:
        return [f"input {ref.path} cannot be read: {error.strerror}"]
    return [changed(ref.path, stage, BYTES)] if other else []


def differences(old: Mapping[str, Any], new: Mapping[str, Any], prefix: str = "") -> list[str]:
    """`key was a, is b` for every value that differs between two nested mappings."""
    found: list[str] = []
    for key in sorted({**old, **new}):
        name = f"{prefix}{key}"
        before, after = _plain(old.get(key)), _plain(new.get(key))
        if isinstance(before, Mapping) and isinstance(after, Mapping):
            found += differences(before, after, f"{name}.")
        elif before != after:
            found.append(f"{name} was {_text(old.get(key))}, is {_text(new.get(key))}")
    return found


def artifact_ref(project: Project, path: Path, header: Header) -> InputRef:
    """The reference to an artifact that serves as an input."""
    return InputRef(
        path=project.relative(path),
        kind=header.kind,
        schema_version=header.schema_version,
        sha256=header.content_sha256,
    )


def source_ref(project: Project, path: Path, *, kind: str = "") -> InputRef:
    """The reference to a file or folder from outside. Raises OSError; InputError where its name is not text."""
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise InputError("the name of the file is not UTF-8 text", where=ascii(str(path)), expected="a UTF-8 name",
                         received="other bytes", hint="rename it, then run the command again") from error  # fmt: skip
    kind = kind or ("folder" if path.is_dir() else "file")
    return InputRef(path=project.relative(path), kind=kind, sha256=source_sha256(path))


def _plain(value: Any) -> Any:
    """Lists as mappings by index, so that a difference names the one entry; an empty one is absent: a setting that is
    newer than the artifact, and asks for nothing, does not make it stale."""
    if isinstance(value, list | tuple):
        return {str(i): item for i, item in enumerate(value)} or None
    return value


def _text(value: Any) -> str:
    if value is None or value in ([], ()):
        return "absent"
    if isinstance(value, Mapping):
        return f"a table of {len(value)}"
    if isinstance(value, list | tuple):
        plain = len(value) <= _LISTED and not any(isinstance(one, Mapping | list | tuple) for one in value)
        return ", ".join(map(repr, value)) if plain else f"a list of {len(value)}"
    return repr(value)
