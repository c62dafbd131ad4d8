"""Everything that `validate` must know about one artifact file, whatever its state. Damage is an answer, no error."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.errors import ArtifactError, quoted
from r2s2r_cli.store.hashing import PROVENANCE, attributes
from r2s2r_cli.store.hdf5_errors import translate
from r2s2r_cli.store.header import (
    HDF5_SIGNATURE,
    NotAnArtifact,
    body_sha256,
    mends_cut_off,
    read_header,
    unreadable,
)
from r2s2r_cli.store.isolated import IsolatedReader
from r2s2r_cli.store.layout import Mismatch, check_layout
from r2s2r_cli.store.read import check_kind_and_version, load
from r2s2r_cli.store.verify import find_body
from schemas.header import Header
from schemas.versions import KINDS

HEAD = "head of the file"
"""`where` of a problem with the head itself, in the report of the child process."""


@dataclass(frozen=True)
class Examined:
    """What is in a file, as far as it can be told."""

    header: Header | None = None
    refused: ArtifactError | None = None
    """Why it is not read at all: missing, not an artifact, head damaged, another kind, a newer version."""
    newer: bool = False
    """`refused` because of kind or version: the file itself may be sound."""
    damage: tuple[Mismatch, ...] = ()
    """Where it is not what was sealed."""
    unread_bytes: bool = False
    """Bytes changed, and the digests prove that nothing readable did."""
    layout: tuple[Mismatch, ...] = ()
    data: ArtifactData | None = None
    """The values, migrated to the current version; None where the file is refused or damaged."""
    body: Mapping[str, Any] = field(default_factory=dict)
    """Root attributes, and `provenance/<field>`: what the head says too."""


def examine(path: Path, reader: IsolatedReader) -> Examined:
    """Look at one file. HDF5 code sees a file whose bytes are not the sealed ones only in the child process."""
    try:
        header = read_header(path)
    except NotAnArtifact as error:
        return _headless(path, error, reader)
    except ArtifactError as error:
        return Examined(refused=error)
    try:
        check_kind_and_version(path, header)
    except ArtifactError as error:
        return Examined(header, refused=error, newer=True)
    try:
        digest, length = body_sha256(path, header.body_offset)
        padded = _is_padded(path, header)
    except OSError as error:
        return Examined(header, refused=unreadable(path, error))
    if digest == header.body_sha256:
        return _read(path, header, unread_bytes=not padded)
    return _examine_changed(path, header, length, reader)


def _is_padded(path: Path, header: Header) -> bool:
    """Whether the head is followed by spaces only, as it was written: these bytes are in no digest."""
    with path.open("rb") as file:
        head = file.read(header.body_offset)
    line, _, rest = head.partition(b"\n")
    padding = rest[int(line.split()[-1]) :]
    return padding == b"\n".rjust(len(padding))


def _examine_changed(path: Path, header: Header, length: int, reader: IsolatedReader) -> Examined:
    report = _ask(path, reader)
    problems = [p for p in report["problems"] if p.where != HEAD]
    if report["content_ok"] and report["seal_ok"]:
        return _read(path, header, unread_bytes=True)
    if length < header.body_bytes:
        cut = Mismatch("", "the file was cut off", f"{header.body_bytes} bytes of data", f"{length} bytes",
                       mends_cut_off(path, header))  # fmt: skip
        problems = [cut, *(p for p in problems if p.where.strip("/"))]
    return Examined(header, damage=tuple(problems))


def _headless(path: Path, error: ArtifactError, reader: IsolatedReader) -> Examined:
    """No readable head. What lies behind it may still be ours: say how much of it is intact."""
    if not path.is_file():
        return Examined(refused=error)
    try:
        with path.open("rb") as file:
            foreign = file.read(len(HDF5_SIGNATURE)) == HDF5_SIGNATURE
        if foreign or find_body(path) is None:
            return Examined(refused=error)
    except OSError as problem:
        return Examined(refused=unreadable(path, problem))
    report = _ask(path, reader)
    if report["content_ok"] and report["seal_ok"]:
        error.received = f"{error.received}; the data behind it are intact"
        error.hint = f"r2s2r recover {quoted(path)}"
        return Examined(refused=error)
    unknown = Mismatch("", "the data changed too; which dataset, only the head could tell", "the sealed data", "others")
    return Examined(refused=error, damage=tuple(p for p in report["problems"] if p.where != HEAD) or (unknown,))


def _ask(path: Path, reader: IsolatedReader) -> dict[str, Any]:
    """Report of the child, with Mismatch values; a file that crashes or hangs it has one problem at its root."""
    try:
        report = reader.verify(path)
    except ArtifactError as error:
        problem = Mismatch("", error.what, error.expected, error.received)
        return {"content_ok": False, "seal_ok": False, "problems": [problem]}
    return {**report, "problems": [Mismatch(**problem) for problem in report["problems"]]}


def _read(path: Path, header: Header, *, unread_bytes: bool = False) -> Examined:
    spec = KINDS[header.kind]
    try:
        with h5py.File(path, "r", locking=False) as file:
            body = _body(file)
            current = header.schema_version == spec.version
            layout = tuple(check_layout(file, spec)) if current else ()
        data = load(path, header, blobs=True)
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        return Examined(header, refused=translate(error, path))
    except ArtifactError as error:
        return Examined(header, refused=error)
    return Examined(header, unread_bytes=unread_bytes, layout=layout, data=data, body=body)


def _body(file: h5py.File) -> dict[str, Any]:
    found: dict[str, Any] = attributes(file)
    group = file.get(PROVENANCE)
    for name, dataset in group.items() if isinstance(group, h5py.Group) else ():
        found[f"{PROVENANCE}/{name}"] = json.loads(bytes(dataset[()]))
    return found
