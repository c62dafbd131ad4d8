"""What can be read of a journal, whatever became of its end and of the bytes in between."""

from __future__ import annotations

import contextlib
import fcntl
import json
import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from r2s2r_cli.errors import ArtifactError, UsageError, quoted
from r2s2r_cli.store.header import unreadable
from r2s2r_cli.store.journal import BLOB_LENGTH, MAGIC, MARK, MAX_RECORD, RECORD, Field, JournalHead, Stream, record_crc


def read_head(path: Path) -> tuple[JournalHead, int]:
    """Head of a journal and the offset of its first record. Raises ArtifactError where it is damaged."""
    try:
        with path.open("rb") as file:
            line = file.readline(200)
            length, crc = (int(part) for part in line[len(MAGIC) :].split())
            body = file.read(min(max(0, length), MAX_RECORD))
            offset = file.tell()
        if not line.startswith(MAGIC) or len(body) != length or zlib.crc32(body) != crc:
            raise ValueError("checksum")
        return _from_json(json.loads(body)), offset
    except OSError as error:
        raise ArtifactError("the journal cannot be read", where=str(path), received=error.strerror or str(error),
                            hint=f"ls -la {quoted(path.parent)}") from error  # fmt: skip
    except (ValueError, KeyError, TypeError) as error:
        raise ArtifactError(
            "this is not a journal, or its head is damaged",
            where=str(path),
            expected="a file that begins 'r2s2r-journal' and the digest of its head",
            received=f"{path.stat().st_size} bytes that do not begin with an intact head",
            hint=f"head -c 200 {quoted(path)}",
        ) from error


@contextlib.contextmanager
def unwatched(path: Path) -> Iterator[None]:
    """Hold the journal's lock while it is sealed. Raises UsageError where it is still being written."""
    if path.exists() and not path.is_dir() and not path.is_file():  # to open a pipe would wait for its writer for ever
        raise ArtifactError("this is no regular file", where=str(path), expected="a journal",
                            received="a pipe, socket or device", hint=f"ls -la {quoted(path)}")  # fmt: skip
    try:
        file = path.open("rb")
    except OSError as error:
        raise unreadable(path, error) from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise UsageError("this recording is running", where=str(path), expected="a journal that nobody has open",
                             received="an open one", hint="stop the recording first") from error  # fmt: skip
        yield


@dataclass(frozen=True, slots=True)
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
    head, position = read_head(path)
    size = path.stat().st_size
    with path.open("rb") as file:
        while position < size:
            place = _record_at(file, position)
            if place is None or place.stream >= len(head.streams):
                position = _next_mark(file, position + 1, size)
                continue
            yield place
            position = place.offset + place.length


def torn_at(path: Path, end: int) -> int:
    """Where the torn last record of a journal begins, behind its last whole record, which ends at `end`; the size of
    the file where it ended cleanly. What lies between is damaged: records that are all there and not what was written.
    """
    size, last = path.stat().st_size, end
    with path.open("rb") as file:
        while (later := _next_mark(file, last + 1, size)) < size:
            last = later
        return last if _is_cut(file, last, size) else size


def _is_cut(file: BinaryIO, position: int, size: int) -> bool:
    """Whether a record begins here of which the file does not have the end."""
    file.seek(position)
    head = file.read(RECORD.size)
    if len(head) < RECORD.size:
        return head[: len(MARK)] == MARK[: len(head)]
    mark, _, length, _ = RECORD.unpack(head)
    return bool(mark == MARK and length <= MAX_RECORD and position + RECORD.size + length > size)


def _record_at(file: BinaryIO, position: int) -> Place | None:
    file.seek(position)
    head = file.read(RECORD.size)
    if len(head) < RECORD.size:
        return None
    mark, number, length, crc = RECORD.unpack(head)
    if mark != MARK or length > MAX_RECORD:
        return None
    payload = file.read(length)
    if len(payload) != length or record_crc(number, payload) != crc:
        return None
    return Place(number, position, position + RECORD.size, length)


def _next_mark(file: BinaryIO, position: int, size: int) -> int:
    """Position of the next record mark, or `size`."""
    step = 1 << 20
    while position < size:
        file.seek(position)
        window = file.read(step + len(MARK))
        found = window.find(MARK)
        if found >= 0:
            return position + found
        position += step
    return size


def read_field(file: BinaryIO, offset: int, stream: Stream, name: str) -> np.ndarray | bytes:
    """One field of the row whose payload begins at `offset`; nothing else of it is read. KeyError: no such field."""
    for field in stream.fields:
        file.seek(offset)
        if field.dtype == "blobs":
            (size,) = BLOB_LENGTH.unpack(file.read(BLOB_LENGTH.size))
            offset += BLOB_LENGTH.size
        else:
            size = np.dtype(field.dtype).itemsize * int(np.prod(field.shape, dtype=np.int64))
        if field.name == name:
            data = file.read(size)
            return data if field.dtype == "blobs" else np.frombuffer(data, field.dtype).reshape(field.shape)
        offset += size
    raise KeyError(name)


def fixed_place(stream: Stream, name: str) -> tuple[int, int] | None:
    """Where a field lies in every row of its stream: offset in the payload and length [byte]; None where rows differ,
    since it is encoded or lies behind what is. KeyError: no such field."""
    offset = 0
    for field in stream.fields:
        size = 0 if field.dtype == "blobs" else np.dtype(field.dtype).itemsize * math.prod(field.shape)
        if field.name == name:
            return None if field.dtype == "blobs" or offset < 0 else (offset, size)
        offset = -1 if field.dtype == "blobs" or offset < 0 else offset + size
    raise KeyError(name)


def _from_json(values: dict[str, Any]) -> JournalHead:
    streams = tuple(
        Stream(s["path"], tuple(Field(n, d, tuple(shape)) for n, d, shape in s["fields"]), s["attributes"], s["name"])
        for s in values["streams"]
    )
    return JournalHead(values["kind"], values["schema_version"], streams, values["groups"], values["provenance"])
