"""Reading what the user points at: every way in which a path can be wrong becomes an InputError."""

from __future__ import annotations

import codecs
import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from r2s2r_cli.errors import InputError, nearest_folder, quoted
from r2s2r_cli.nearest import nearest

MIB = 1024 * 1024
MAX_CSV_BYTES = 256 * MIB
"""Two hours at 30 frames a second of 40 columns are 80 MiB: a larger file is not a run."""
MAX_TEXT_BYTES = 4 * MIB
"""Sidecar, JSON of one frame, camera configuration."""
MAX_IMAGE_BYTES = 64 * MIB
"""A 16-bit image of 8 megapixels, uncompressed, is 16 MiB."""
_SHOWN = 60


def shown(value: object) -> str:
    """A value as it may stand in a message: printable, in quotes, at most 60 characters."""
    return clipped(repr(value) if isinstance(value, str) else str(value))


def clipped(text: str) -> str:
    """A printable text of at most 60 characters."""
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}... ({len(text)} characters)"


def nearest_name(name: str, known: list[str]) -> str:
    """The known name that a misspelt one is nearest to, whatever its case; empty where none is near."""
    lower = {word.lower(): word for word in known}
    return lower.get(nearest(name.lower(), lower), "")


def did_you_mean(name: str, known: list[str]) -> str:
    """` (did you mean ...?)` for a misspelt name, else empty."""
    close = nearest_name(name, known)
    return f" (did you mean {close!r}?)" if close else ""


class Missing(InputError):
    """A file or folder that is not there. near: the one beside it that is spelt like it; empty where none is."""

    def __init__(self, path: Path, what: str, near: str) -> None:
        super().__init__(
            f"{what} does not exist" + (f" (did you mean {near!r}?)" if near else ""),
            where=str(path),
            expected="a file or folder that is there",
            received="nothing",
            hint=f"ls {quoted(nearest_folder(path))}",
        )
        self.near = near


def file_size(path: Path, what: str, *, limit: int) -> int:
    """Size of a regular file [byte].

    Raises InputError where it is missing, a folder, a device or pipe (reading one could hang), unreadable, in a loop
    of links, or larger than `limit`.
    """
    status = _status(path, what)
    if stat.S_ISDIR(status.st_mode):
        raise InputError(
            f"{what} is a folder", where=str(path), expected="a file", received="a folder", hint=f"ls {quoted(path)}"
        )
    if not stat.S_ISREG(status.st_mode):
        raise InputError(
            f"{what} is not a regular file",
            where=str(path),
            expected="a file",
            received="a device, pipe or socket",
            hint=f"copy the data into a file first: cat {quoted(path)} > data.csv",
        )
    if status.st_size > limit:
        raise InputError(
            f"{what} is too large to be one run",
            where=str(path),
            expected=f"at most {limit // MIB} MiB",
            received=f"{status.st_size / MIB:.0f} MiB",
            hint="split it into one file a run",
        )
    return status.st_size


def read_source(path: Path, what: str, *, limit: int) -> bytes:
    """Bytes of a file that the user named. Raises InputError as `file_size` does."""
    file_size(path, what, limit=limit)
    try:
        return path.read_bytes()
    except OSError as error:
        raise _unreadable(path, what, error) from error


def read_ends(path: Path, what: str, *, head: int, tail: int) -> tuple[bytes, bytes]:
    """First and last bytes of an image, without reading the rest. Raises InputError as `file_size` does."""
    size = file_size(path, what, limit=MAX_IMAGE_BYTES)
    try:
        with path.open("rb") as file:
            first = file.read(head)
            file.seek(max(0, size - tail))
            return first, file.read(tail)
    except OSError as error:
        raise _unreadable(path, what, error) from error


def list_folder(path: Path, what: str) -> list[str]:
    """Names in a folder, sorted. Raises InputError where it is missing, not a folder or unreadable."""
    status = _status(path, what)
    if not stat.S_ISDIR(status.st_mode):
        raise InputError(f"{what} is not a folder", where=str(path), expected="a folder", received="a file",
                         hint=f"ls -l {quoted(path)}")  # fmt: skip
    try:
        return sorted(entry.name for entry in path.iterdir())
    except OSError as error:
        raise _unreadable(path, what, error) from error


@dataclass(frozen=True)
class FileBytes:
    """The bytes of files in order, read only when they are asked for; can be gone through again and again."""

    paths: tuple[Path, ...]
    what: str

    def __iter__(self) -> Iterator[bytes]:
        for path in self.paths:
            yield read_source(path, self.what, limit=MAX_IMAGE_BYTES)

    def __len__(self) -> int:
        return len(self.paths)


def decode(data: bytes, what: str, where: str) -> str:
    """UTF-8 text, a byte-order mark taken off. Raises InputError with line and column of the first bad byte."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        encoding = "UTF-32" if data.startswith((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)) else "UTF-16"
        raise InputError(
            f"{what} is {encoding} text",
            where=where,
            expected="UTF-8",
            received=f"a {encoding} byte-order mark",
            hint=in_place(where, f"iconv -f {encoding} -t UTF-8"),
        )
    zero = data.find(b"\0")
    if zero >= 0:
        raise InputError(
            f"{what} holds NUL bytes",
            where=f"{where}:{data.count(10, 0, zero) + 1}",
            expected="text",
            received="a NUL byte: a binary file, or one damaged by a crash while it was written",
            hint=f"look at it: head -c 300 {quoted(where)} | xxd",
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(10, 0, error.start) + 1
        column = error.start - (data.rfind(10, 0, error.start) + 1) + 1
        raise InputError(
            f"{what} is not UTF-8 text",
            where=f"{where}:{line}:{column}",
            expected="UTF-8",
            received=f"byte 0x{data[error.start]:02x}",
            hint=in_place(where, "iconv -f LATIN1 -t UTF-8"),
        ) from error


def _status(path: Path, what: str) -> os.stat_result:
    try:
        return path.stat()
    except (FileNotFoundError, NotADirectoryError) as error:
        raise Missing(path, what, _sibling(path)) from error
    except (OSError, ValueError) as error:
        raise _unreadable(path, what, error) from error


def _sibling(path: Path) -> str:
    """The entry beside it that was meant. Of files of one kind the names count without their suffix: what all of them
    end with makes no two of them alike."""
    try:
        names = [entry.name for entry in path.parent.iterdir()]
    except (OSError, ValueError):
        return ""
    alike = {Path(name).stem: name for name in names if path.suffix and Path(name).suffix == path.suffix}
    return alike.get(nearest_name(path.stem, list(alike)), "") if alike else nearest_name(path.name, names)


def _unreadable(path: Path, what: str, error: Exception) -> InputError:
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    name = str(path) if str(path).isprintable() else shown(str(path))
    return InputError(f"{what} cannot be read", where=name, expected="a file or folder that may be read",
                      received=reason, hint=f"ls -ld {quoted(name)}")  # fmt: skip


def in_place(path: object, filter_command: str) -> str:
    """A command that puts a file through a filter and keeps the original as `.bak`; the sidecar still fits."""
    copy = quoted(f"{path}.bak")
    return f"cp {quoted(path)} {copy} && {filter_command} < {copy} > {quoted(path)}"
