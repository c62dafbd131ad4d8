"""From the journal of a recording to its artifact: after a run, and with `recover` after a crash."""

from __future__ import annotations

import mmap
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from r2s2r_cli.artifact import ArtifactData, Blobs, Group, Rows, Scalar, Value
from r2s2r_cli.errors import ArtifactError, quoted
from r2s2r_cli.store.atomic import keep_beside
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.journal import Field, JournalHead, Stream
from r2s2r_cli.store.journal_read import fixed_place, read_field, read_head, records, torn_at, unwatched
from r2s2r_cli.store.newer import newer_r2s2r
from r2s2r_cli.store.read import checked_header, length
from r2s2r_cli.store.torn_table import without_torn_tables
from r2s2r_cli.store.write import write_artifact
from schemas.header import Header, Provenance
from schemas.versions import KINDS, NoMigration, chain

_ROWS_A_BLOCK = 256


@dataclass(frozen=True)
class Sealed:
    """What became of a journal."""

    header: Header | None
    """None: the journal held no row, and is gone."""
    rows: dict[str, int]
    """Rows by stream."""
    torn_bytes: int
    """Length of the torn last record [byte], 0 after a clean end."""
    lost_bytes: int
    """Damaged stretches [byte], not the torn last record; the journal is then kept as `.journal-damaged`."""


@dataclass(frozen=True)
class Late:
    """What is known of a recording only when it has ended.

    wall_s, report, drawings: of its provenance. attributes: by group path, added to those of the head.
    """

    wall_s: float
    report: Mapping[str, Any]
    drawings: tuple[str, ...] = ()
    attributes: Mapping[str, Mapping[str, Scalar]] = field(default_factory=dict)


@dataclass(frozen=True)
class Rowset:
    """Where the whole rows of one stream lie in the journal; 8 bytes a row, runs can be long."""

    offsets: array[int] = field(default_factory=lambda: array("Q"))

    def __len__(self) -> int:
        return len(self.offsets)


def seal(journal: Path, target: Path, *, recovered: bool = False, late: Late | None = None) -> Sealed:
    """Write the artifact of a closed journal, then remove the journal. late: what its head could not know.

    A run without a single row (it was never begun) is left out.

    Nothing is lost on failure: the journal stays until the artifact is verified under its name. A journal without a
    single whole row leaves no artifact.

    Raises ArtifactError: damaged head, target exists, disk full; UsageError: the recording is running.
    """
    with unwatched(journal):
        head, start = read_head(journal)
        provenance = _with_late(_provenance(journal, head), late)
        rows, end, lost = _survey(journal, start)
        torn_from = torn_at(journal, end)
        lost += torn_from - end
        torn = journal.stat().st_size - torn_from
        counts = {head.streams[n].key: len(r) for n, r in sorted(rows.items())}
        if not rows:
            _remove(journal, keep=torn > 0 or lost > 0)
            return Sealed(None, counts, torn, lost)
        if target.exists():
            header = _sealed_before(target, provenance, head, rows)  # killed between sealing and tidying up
            if header is None:
                raise ArtifactError(
                    "an artifact of that name exists already",
                    where=str(target),
                    expected="no artifact, so that nothing is overwritten",
                    received="one",
                    hint=f"mv -n {quoted(target)} {quoted(f'{target}.old')} && r2s2r recover {quoted(journal)}",
                )
        else:
            header = write_artifact(target, _current(journal, head, rows, recovered, late), provenance)
        _remove(journal, keep=lost > 0)
        return Sealed(header, counts, torn, lost)


def _with_late(provenance: Provenance, late: Late | None) -> Provenance:
    if late is None:
        return provenance
    return provenance.model_copy(
        update={"wall_s": round(late.wall_s, 3), "report": dict(late.report), "drawings": tuple(late.drawings)}
    )


def _survey(journal: Path, start: int) -> tuple[dict[int, Rowset], int, int]:
    """The whole rows by stream, where the last one ends, and how many bytes between them are damaged."""
    rows: dict[int, Rowset] = {}
    end, lost = start, 0
    for place in records(journal):
        lost += place.start - end
        end = place.offset + place.length
        found = rows.setdefault(place.stream, Rowset())
        found.offsets.append(place.offset)
    return rows, end, lost


def _provenance(journal: Path, head: JournalHead) -> Provenance:
    try:
        if head.kind not in KINDS:
            raise NoMigration(f"kind {head.kind} is not known")
        chain(head.kind, head.schema_version)
        return Provenance.model_validate(head.provenance)
    except (NoMigration, ValidationError) as error:
        raise ArtifactError(
            "this journal was written by another version of r2s2r",
            where=str(journal),
            expected="a kind, version and provenance that this r2s2r knows",
            received=" ".join(str(error).split())[:200],
            hint=newer_r2s2r(),
        ) from error


def _sealed_before(
    target: Path, provenance: Provenance, head: JournalHead, rows: Mapping[int, Rowset]
) -> Header | None:
    """The header of the artifact that an earlier, killed attempt made of the same journal; None for another one."""
    if _with_late(read_header(target).provenance, _NOTHING_LATE) != _with_late(provenance, _NOTHING_LATE):
        return None
    header = checked_header(target)
    whole = all(_holds(target, head.streams[number], len(found)) for number, found in rows.items())
    return header if whole else None


def _holds(target: Path, stream: Stream, count: int) -> bool:
    """Whether an artifact has all rows of a stream. A second one of its group may be a torn table, which it lacks."""
    there = (count, None) if stream.name else (count,)
    return all(length(target, f"{stream.path}/{column.name}") in there for column in stream.fields)


_NOTHING_LATE = Late(0.0, {})
"""Puts aside what two seals of one journal may differ in."""


def _remove(journal: Path, *, keep: bool) -> None:
    if keep:  # bytes that no row was made of: somebody may want to look at them
        keep_beside(journal, "-damaged")
    journal.unlink()


def _current(
    journal: Path, head: JournalHead, rows: Mapping[int, Rowset], recovered: bool, late: Late | None
) -> ArtifactData:
    groups: dict[str, Group] = {}
    begun = {_run_of(head.streams[n].path) for n in rows}
    for path, attributes in head.groups.items():
        if _run_of(path) not in begun:
            continue
        extra: dict[str, Scalar] = {"recovered": True} if recovered and path.count("/") == 1 else {}
        told = late.attributes.get(path, {}) if late is not None else {}
        groups[path] = Group({}, {**attributes, **extra, **told})
    groups_with_rows = {head.streams[n].path for n in rows}
    for number, stream in enumerate(head.streams):
        if stream.path in groups_with_rows:  # a stream without rows, beside one that has some, is empty, not missing
            found = rows.get(number, Rowset())
            values = {column.name: _value(journal, stream, column, found) for column in stream.fields}
            before = groups.get(stream.path, Group())
            groups[stream.path] = Group({**before.datasets, **values}, {**before.attributes, **stream.attributes})
    for _, step in chain(head.kind, head.schema_version):
        groups = dict(step(groups))
    return ArtifactData(head.kind, without_torn_tables(groups, KINDS[head.kind]))


def _run_of(path: str) -> str:
    """`runs/walk` of `runs/walk/camera`; what lies elsewhere is its own."""
    return "/".join(path.split("/")[:2])


def _value(journal: Path, stream: Stream, column: Field, rows: Rowset) -> Value:
    if column.dtype == "blobs":
        return Blobs((bytes(row) for row in _column(journal, stream, column, rows)), len(rows))
    place = fixed_place(stream, column.name)
    blocks = _stacked(_column(journal, stream, column, rows)) if place is None else _cut(journal, place, column, rows)
    return Rows(blocks, (len(rows), *column.shape), np.dtype(column.dtype))


def _cut(journal: Path, place: tuple[int, int], column: Field, rows: Rowset) -> Iterator[np.ndarray]:
    """The same as stacking the fields of each row, thirty times as fast: half an hour of a robot is a million rows."""
    skip, size = place
    if not len(rows):
        return
    with journal.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as held:
        for first in range(0, len(rows), _ROWS_A_BLOCK):
            begins = [offset + skip for offset in rows.offsets[first : first + _ROWS_A_BLOCK]]
            data = b"".join([held[begin : begin + size] for begin in begins])
            yield np.frombuffer(data, column.dtype).reshape(len(begins), *column.shape)


def _column(journal: Path, stream: Stream, column: Field, rows: Rowset) -> Iterator[np.ndarray | bytes]:
    with journal.open("rb") as file:
        for offset in rows.offsets:
            yield read_field(file, offset, stream, column.name)


def _stacked(rows: Iterator[np.ndarray | bytes]) -> Iterator[np.ndarray]:
    block: list[np.ndarray] = []
    for row in rows:
        block.append(np.asarray(row))
        if len(block) == _ROWS_A_BLOCK:
            yield np.stack(block)
            block = []
    if block:
        yield np.stack(block)
