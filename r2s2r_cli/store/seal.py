"""From the journal of a recording to its artifact: after a run, and with `recover` after a crash."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Blobs, Group, Rows, Value
from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.journal import Field, JournalHead, Place, Stream, decode, read_head, records
from r2s2r_cli.store.read import checked_header
from r2s2r_cli.store.write import write_artifact
from schemas.header import Header, Provenance

_ROWS_A_BLOCK = 256


@dataclass(frozen=True)
class Sealed:
    """What became of a journal."""

    header: Header
    rows: dict[str, int]
    """Rows by stream."""
    torn_bytes: int
    """Bytes of a torn last row that were left out."""
    lost_bytes: int
    """Bytes of damaged rows in the middle; where there are any, the journal is kept beside the artifact."""


def seal(journal: Path, target: Path, *, recovered: bool = False) -> Sealed:
    """Write the artifact of a closed journal, then remove the journal.

    Nothing is lost on failure: the journal stays until the artifact is verified under its name.
    Raises ArtifactError: damaged head, no rows, target exists, disk full.
    """
    head, end = read_head(journal)
    if target.exists():
        if read_header(target).provenance == Provenance.model_validate(head.provenance):
            return _finish(journal, checked_header(target), {}, 0)  # killed between sealing and tidying up
        raise ArtifactError(
            "an artifact of that name exists already",
            where=str(target),
            expected="no artifact, so that nothing is overwritten",
            received="one",
            hint=f"mv '{target}' '{target.with_suffix('.old.h5')}' && r2s2r recover '{journal}'",
        )
    places: dict[int, list[Place]] = defaultdict(list)
    lost = 0
    for place in records(journal):
        lost += place.start - end
        end = place.offset + place.length
        places[place.stream].append(place)
    if not places:
        raise ArtifactError(
            "the journal holds no rows, there is nothing to keep",
            where=str(journal),
            expected="at least one recorded row",
            received="none",
            hint=f"rm '{journal}'",
        )
    torn = journal.stat().st_size - end
    header = write_artifact(target, _data(journal, head, places, recovered), Provenance.model_validate(head.provenance))
    rows = {head.streams[n].path: len(p) for n, p in sorted(places.items())}
    return _finish(journal, header, rows, torn, lost)


def _finish(journal: Path, header: Header, rows: dict[str, int], torn: int, lost: int = 0) -> Sealed:
    if lost:  # damage in the middle: keep the bytes, somebody may want to look at them
        journal.rename(journal.with_suffix(".journal-damaged"))
    else:
        journal.unlink()
    return Sealed(header, rows, torn, lost)


def _data(journal: Path, head: JournalHead, places: dict[int, list[Place]], recovered: bool) -> ArtifactData:
    groups: dict[str, Group] = {}
    for path, attributes in head.groups.items():
        extra = {"recovered": True} if recovered and path.count("/") == 1 else {}
        groups[path] = Group({}, {**attributes, **extra})
    for number, stream in enumerate(head.streams):
        rows = places.get(number, [])
        if rows:
            values = {field.name: _value(journal, stream, field, rows) for field in stream.fields}
            groups[stream.path] = Group(values, stream.attributes)
    return ArtifactData(head.kind, groups)


def _value(journal: Path, stream: Stream, field: Field, places: list[Place]) -> Value:
    if field.dtype == "blobs":
        return Blobs((bytes(row) for row in _column(journal, stream, field, places)), len(places))
    blocks = _stacked(_column(journal, stream, field, places))
    return Rows(blocks, (len(places), *field.shape), np.dtype(field.dtype))


def _column(journal: Path, stream: Stream, field: Field, places: list[Place]) -> Iterator[np.ndarray | bytes]:
    with journal.open("rb") as file:
        for place in places:
            file.seek(place.offset)
            yield decode(stream, file.read(place.length))[field.name]


def _stacked(rows: Iterator[np.ndarray | bytes]) -> Iterator[np.ndarray]:
    block: list[np.ndarray] = []
    for row in rows:
        block.append(np.asarray(row))
        if len(block) == _ROWS_A_BLOCK:
            yield np.stack(block)
            block = []
    if block:
        yield np.stack(block)
