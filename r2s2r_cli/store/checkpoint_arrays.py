"""Work that survives an interruption, as arrays: appended one result after the other, so that a killed process keeps
all but the one that it was at."""

from __future__ import annotations

import io
import json
import os
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from r2s2r_cli.store.atomic import disk_error
from r2s2r_cli.store.checkpoint import discard, of_another, unreadable

_FORM = "arrays-1"
MOST_BYTES = 48_000_000
RECORD = struct.Struct("<32sQI")
"""Of every result: digest of what was asked, length and CRC-32 of what follows."""


@dataclass
class ArrayCheckpoint:
    """The checkpoint of one artifact, for work that asks the same questions in the same order when it begins again.
    key: digest of the inputs and settings that it belongs to. most: bytes that it grows to; later work is not kept.
    command: the words that were typed after `r2s2r`, without --resume.

    Results come back bit by bit as long as the questions are the same. From the first other one, or the first that was
    not written whole, the rest is forgotten."""

    path: Path
    key: str
    resume: bool = False
    most: int = MOST_BYTES
    command: Sequence[str] = ("status",)
    _place: int | None = field(default=None, init=False)
    """Where the next result to read begins; None: nothing is read (any more)."""
    _begun: bool = field(default=False, init=False)
    _mine: bool = field(default=False, init=False)
    """Whether the file is of this request: it was read or begun here."""
    _size: int = field(default=0, init=False)

    def recall(self, digest: bytes) -> list[np.ndarray] | None:
        """What was kept for the next question; None where it must be worked out.

        Raises InputError where the file cannot be read, UsageError where it belongs to another request.
        """
        if not self._begun:
            self._begun = True
            self._place = self._opened() if self.resume and self.path.exists() else None
        if self._place is None:
            return None
        try:
            with self.path.open("rb") as file:
                file.seek(self._place)
                head = file.read(RECORD.size)
                found = RECORD.unpack(head) if len(head) == RECORD.size else None
                # A damaged length may be of any size: no more is asked for than the file has.
                left = os.fstat(file.fileno()).st_size - file.tell()
                body = b"" if found is None else file.read(min(found[1], left))
                after = file.tell()
        except OSError as error:
            raise unreadable(self.path, self.command, error) from error
        if found is None or found[0] != digest or len(body) != found[1] or zlib.crc32(body) != found[2]:
            os.truncate(self.path, self._place)
            self._place = None
            return None
        self._place, self._size = after, self._size + len(body)
        return _arrays(body)

    def keep(self, digest: bytes, arrays: Sequence[np.ndarray]) -> None:
        """Append the result of a question that `recall` did not know; nothing once there is no room. Raises
        ArtifactError (disk full)."""
        body = io.BytesIO()
        for one in arrays:
            np.lib.format.write_array(body, np.asarray(one, order="C"), allow_pickle=False)
        value = body.getvalue()
        self._size += len(value)
        if self._size > self.most:
            return
        record = RECORD.pack(digest, len(value), zlib.crc32(value)) + value
        try:
            with self.path.open("ab" if self._mine else "wb") as file:
                if not self._mine:
                    head = {"form": _FORM, "key": self.key, "command": list(self.command)}
                    file.write(json.dumps(head).encode() + b"\n")
                file.write(record)
        except OSError as error:
            raise disk_error(error, self.path) from error
        self._mine = True

    def require_own(self) -> None:
        """Raises what the first `recall` raises."""
        if self.resume and self.path.exists():
            self._opened()

    def kept(self) -> bool:
        """Whether results of this very request lie there, with which --resume goes on."""
        try:
            with self.path.open("rb") as file:
                head = json.loads(file.readline())
                return bool((head["form"], head["key"]) == (_FORM, self.key) and file.read(1))
        except (OSError, ValueError, KeyError, TypeError):
            return False

    def clear(self) -> None:
        """Remove it, and one that failed: the artifact stands."""
        discard(self.path)

    def _opened(self) -> int:
        """Where the first result begins."""
        try:
            with self.path.open("rb") as file:
                head = json.loads(file.readline())
                form, key = head["form"], head["key"]
                place = file.tell()
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise unreadable(self.path, self.command, error) from error
        if (form, key) != (_FORM, self.key):
            raise of_another(self.path, self.command)
        self._mine = True
        return place


def _arrays(body: bytes) -> list[np.ndarray]:
    file = io.BytesIO(body)
    found = []
    while file.tell() < len(body):
        found.append(np.lib.format.read_array(file, allow_pickle=False))
    return found
