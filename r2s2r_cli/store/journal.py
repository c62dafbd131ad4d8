"""The append journal of a recording in progress: every row is in the kernel before the next one is taken.

HDF5 that is being written does not survive a kill (docs/adr/0004). The journal is a header line of JSON and
then records: mark, stream number, length, CRC-32 of the rest, payload. A torn last record is recognised and dropped.
It comes into being with its head whole, and is locked while somebody writes it.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import struct
import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from r2s2r_cli.errors import ArtifactError, quoted
from r2s2r_cli.store.atomic import creating, disk_error

MAGIC = b"r2s2r-journal 1 "
RECORD = struct.Struct("<4sIII")
MARK = b"R2SJ"
_NUMBERS = struct.Struct("<II")
BLOB_LENGTH = struct.Struct("<I")
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
    """Datasets of one group of the artifact that grow together, row by row."""

    path: str
    """Group path in the artifact, `runs/<run>/sensors`."""
    fields: tuple[Field, ...]
    attributes: Mapping[str, Any]
    name: str = ""
    """Set where a group has several streams (`color` and `depth` of a camera)."""

    @property
    def key(self) -> str:
        """What `append` calls it: the path, and the name where there is one."""
        return f"{self.path}:{self.name}" if self.name else self.path


@dataclass(frozen=True)
class JournalHead:
    """What the journal will become: the artifact kind, its streams and its provenance (as JSON)."""

    kind: str
    schema_version: int
    streams: tuple[Stream, ...]
    groups: Mapping[str, Mapping[str, Any]]
    """Attributes of groups without rows (the run itself)."""
    provenance: Mapping[str, Any]


class Journal:
    """An open journal. `append` one row at a time; the closed file is sealed with `store.seal.seal`."""

    def __init__(self, path: Path, head: JournalHead) -> None:
        """Create the journal. Raises ArtifactError where it exists (an unsealed recording) or cannot be written."""
        self.path = path
        self.head = head
        self._index = {stream.key: i for i, stream in enumerate(head.streams)}
        self._synced = time.monotonic()
        body = json.dumps(_to_json(head), sort_keys=True).encode()
        content = MAGIC + b"%d %d\n" % (len(body), zlib.crc32(body)) + body
        self._end = len(content)
        self._descriptor = -1
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with creating(path) as temp:
                temp.write_bytes(content)
                self._descriptor = os.open(temp, os.O_WRONLY | os.O_APPEND)
                fcntl.flock(self._descriptor, fcntl.LOCK_EX)
        except FileExistsError as error:
            self.close()
            raise ArtifactError(
                "an unsealed recording is in the way",
                where=str(path),
                expected="no journal",
                received="the journal of a recording that was cut off, or is running",
                hint=f"r2s2r recover {quoted(path)}",
            ) from error
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def append(self, stream: str, row: Mapping[str, np.ndarray | bytes | float | int | bool]) -> None:
        """Append one row to the stream with this key; it is in the kernel when this returns.

        Raises ValueError for a row of another form; ArtifactError on a full disk (the rows before stay whole, and
        more can follow once there is space).
        """
        number = self._index[stream]
        payload = _encode(self.head.streams[number], row)
        if len(payload) > MAX_RECORD:
            raise ValueError(f"{stream}: a row of {len(payload)} bytes, at most {MAX_RECORD} are allowed")
        self._write(RECORD.pack(MARK, number, len(payload), record_crc(number, payload)) + payload)
        if time.monotonic() - self._synced > SYNC_INTERVAL_S:
            try:
                os.fdatasync(self._descriptor)
            except OSError as error:
                raise disk_error(error, self.path) from error
            self._synced = time.monotonic()

    def close(self) -> None:
        """Sync and close; the journal stays until it is sealed. Closing twice does no harm."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            try:
                os.fsync(descriptor)
            except OSError as error:
                raise disk_error(error, self.path) from error
            finally:
                os.close(descriptor)

    def _write(self, data: bytes) -> None:
        try:
            view = memoryview(data)
            while view:
                view = view[os.write(self._descriptor, view) :]
        except BaseException as error:  # Ctrl-C as well: a torn record must not stand before a whole one
            with contextlib.suppress(OSError):
                os.ftruncate(self._descriptor, self._end)
            if isinstance(error, OSError):
                raise disk_error(error, self.path) from error
            raise
        self._end += len(data)


def record_crc(number: int, payload: bytes) -> int:
    """Checksum of a record: over stream number, length and payload."""
    return zlib.crc32(payload, zlib.crc32(_NUMBERS.pack(number, len(payload))))


def _encode(stream: Stream, row: Mapping[str, Any]) -> bytes:
    if set(row) != {field.name for field in stream.fields}:
        raise ValueError(f"{stream.path}: row has {sorted(row)}, the stream {[f.name for f in stream.fields]}")
    parts: list[bytes] = []
    for field in stream.fields:
        value = row[field.name]
        if field.dtype == "blobs":
            parts += [BLOB_LENGTH.pack(len(value)), bytes(value)]
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
            "name": s.name,
            "attributes": dict(s.attributes),
            "fields": [[f.name, f.dtype, list(f.shape)] for f in s.fields],
        }
        for s in head.streams
    ]
    groups = {path: dict(attributes) for path, attributes in head.groups.items()}
    return {
        "kind": head.kind, "schema_version": head.schema_version, "streams": streams, "groups": groups,
        "provenance": dict(head.provenance),
    }  # fmt: skip
