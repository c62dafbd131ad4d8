"""The append journal of a recording in progress: every row is in the kernel before the next one is taken.

HDF5 that is being written does not survive a kill (docs/adr/0004). The journal is a header line of JSON and
then records: stream number, length, CRC-32, payload. A torn last record is recognised and dropped.
"""

from __future__ import annotations

import json
import os
import struct
import time
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.atomic import disk_error

MAGIC = b"r2s2r-journal 1 "
_RECORD = struct.Struct("<4sIII")
_MARK = b"R2SJ"
_BLOB_LENGTH = struct.Struct("<I")
MAX_RECORD = 1 << 28
SYNC_INTERVAL_S = 1.0
"""A kill loses at most the last row; a power cut at most this much."""


@dataclass(frozen=True)
class Field:
    """One dataset of a stream: a fixed-size array a row, or (dtype `blobs`) an encoded image a row."""

    name: str
    dtype: str
    shape: tuple[int, ...] = ()


@dataclass(frozen=True)
class Stream:
    """One group of the artifact that grows row by row."""

    path: str
    """Group path in the artifact, `runs/<run>/sensors`."""
    fields: tuple[Field, ...]
    attributes: Mapping[str, Any]


@dataclass(frozen=True)
class JournalHead:
    """What the journal will become: the artifact kind, its streams and its provenance (as JSON)."""

    kind: str
    streams: tuple[Stream, ...]
    groups: Mapping[str, Mapping[str, Any]]
    """Attributes of groups without rows (the run itself)."""
    provenance: Mapping[str, Any]


class Journal:
    """An open journal. `append` one row at a time; the file is sealed with `store.recover.seal`."""

    def __init__(self, path: Path, head: JournalHead) -> None:
        """Create the journal. Raises ArtifactError where it exists (an unsealed recording) or cannot be written."""
        self.path = path
        self.head = head
        self._index = {stream.path: i for i, stream in enumerate(head.streams)}
        self._synced = time.monotonic()
        self._end = 0
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError as error:
            raise ArtifactError(
                "an unsealed recording is in the way",
                where=str(path),
                expected="no journal",
                received="the journal of a recording that was cut off",
                hint=f"r2s2r recover '{path}'",
            ) from error
        except OSError as error:
            raise disk_error(error, path) from error
        body = json.dumps(_to_json(head), sort_keys=True).encode()
        self._write(MAGIC + b"%d %d\n" % (len(body), zlib.crc32(body)) + body)
        os.fsync(self._descriptor)

    def append(self, path: str, row: Mapping[str, np.ndarray | bytes | float | int | bool]) -> None:
        """Append one row to the stream of group `path`; it is in the kernel when this returns.

        Raises ValueError for a row of another form; ArtifactError on a full disk (rows before stay whole).
        """
        number = self._index[path]
        payload = _encode(self.head.streams[number], row)
        self._write(_RECORD.pack(_MARK, number, len(payload), zlib.crc32(payload)) + payload)
        if time.monotonic() - self._synced > SYNC_INTERVAL_S:
            os.fdatasync(self._descriptor)
            self._synced = time.monotonic()

    def close(self) -> None:
        """Sync and close; the journal stays until it is sealed."""
        os.fsync(self._descriptor)
        os.close(self._descriptor)

    def _write(self, data: bytes) -> None:
        try:
            view = memoryview(data)
            while view:
                view = view[os.write(self._descriptor, view) :]
        except OSError as error:
            os.ftruncate(self._descriptor, self._end)  # or the torn record would hide what comes after it
            raise disk_error(error, self.path) from error
        self._end += len(data)


def read_head(path: Path) -> tuple[JournalHead, int]:
    """Head of a journal and the offset of its first record. Raises ArtifactError where it is damaged."""
    try:
        with path.open("rb") as file:
            line = file.readline(200)
            length, crc = (int(part) for part in line[len(MAGIC) :].split())
            body = file.read(length)
            offset = file.tell()
        if not line.startswith(MAGIC) or len(body) != length or zlib.crc32(body) != crc:
            raise ValueError("checksum")
        return _from_json(json.loads(body)), offset
    except OSError as error:
        raise ArtifactError("the journal cannot be read", where=str(path), received=error.strerror or str(error),
                            hint=f"ls -la '{path.parent}'") from error  # fmt: skip
    except (ValueError, KeyError, TypeError) as error:
        raise ArtifactError(
            "this is not a journal, or it was cut off before its first row",
            where=str(path),
            expected="a file that begins 'r2s2r-journal'",
            received=f"{path.stat().st_size} bytes that do not begin with an intact head",
            hint=f"rm '{path}'   # nothing was recorded in it",
        ) from error


@dataclass(frozen=True)
class Place:
    """Where a whole record lies in the journal."""

    stream: int
    start: int
    """Offset of the record [byte]."""
    offset: int
    """Offset of its payload [byte]."""
    length: int


def records(path: Path) -> Iterator[Place]:
    """Every whole record, in order. Damaged stretches are skipped, a torn last record ends the search."""
    _, position = read_head(path)
    size = path.stat().st_size
    with path.open("rb") as file:
        while position < size:
            place = _record_at(file, position)
            if place is None:
                position = _next_mark(file, position + 1, size)
                continue
            yield place
            position = place.offset + place.length


def _record_at(file: BinaryIO, position: int) -> Place | None:
    file.seek(position)
    head = file.read(_RECORD.size)
    if len(head) < _RECORD.size:
        return None
    mark, number, length, crc = _RECORD.unpack(head)
    if mark != _MARK or length > MAX_RECORD:
        return None
    payload = file.read(length)
    if len(payload) != length or zlib.crc32(payload) != crc:
        return None
    return Place(number, position, position + _RECORD.size, length)


def _next_mark(file: BinaryIO, position: int, size: int) -> int:
    """Position of the next record mark, or `size`."""
    step = 1 << 20
    while position < size:
        file.seek(position)
        window = file.read(step + len(_MARK))
        found = window.find(_MARK)
        if found >= 0:
            return position + found
        position += step
    return size


def decode(stream: Stream, payload: bytes) -> dict[str, np.ndarray | bytes]:
    """The row that a record holds."""
    row: dict[str, np.ndarray | bytes] = {}
    position = 0
    for field in stream.fields:
        if field.dtype == "blobs":
            (length,) = _BLOB_LENGTH.unpack_from(payload, position)
            position += _BLOB_LENGTH.size
            row[field.name] = payload[position : position + length]
            position += length
        else:
            dtype = np.dtype(field.dtype)
            count = int(np.prod(field.shape, dtype=np.int64))
            row[field.name] = np.frombuffer(payload, dtype, count, position).reshape(field.shape)
            position += count * dtype.itemsize
    return row


def _encode(stream: Stream, row: Mapping[str, Any]) -> bytes:
    if set(row) != {field.name for field in stream.fields}:
        raise ValueError(f"{stream.path}: row has {sorted(row)}, the stream {[f.name for f in stream.fields]}")
    parts: list[bytes] = []
    for field in stream.fields:
        value = row[field.name]
        if field.dtype == "blobs":
            parts += [_BLOB_LENGTH.pack(len(value)), bytes(value)]
            continue
        array = np.asarray(value, dtype=field.dtype)
        if array.shape != field.shape:
            raise ValueError(f"{stream.path}/{field.name}: shape {array.shape}, the stream says {field.shape}")
        parts.append(array.tobytes())
    return b"".join(parts)


def _to_json(head: JournalHead) -> dict[str, Any]:
    streams = [
        {
            "path": s.path,
            "attributes": dict(s.attributes),
            "fields": [[f.name, f.dtype, list(f.shape)] for f in s.fields],
        }
        for s in head.streams
    ]
    groups = {path: dict(attributes) for path, attributes in head.groups.items()}
    return {"kind": head.kind, "streams": streams, "groups": groups, "provenance": dict(head.provenance)}


def _from_json(values: dict[str, Any]) -> JournalHead:
    streams = tuple(
        Stream(s["path"], tuple(Field(n, d, tuple(shape)) for n, d, shape in s["fields"]), s["attributes"])
        for s in values["streams"]
    )
    return JournalHead(values["kind"], streams, values["groups"], values["provenance"])
