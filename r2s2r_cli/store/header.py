"""The sealed head of an artifact: a JSON header in the HDF5 user block, readable without HDF5.

Layout of the block: one line `r2s2r-artifact 1 <sha256 of the JSON> <its length>`, the JSON, spaces,
a newline. The HDF5 body follows at the next power of two from 4096 (docs/adr/0003).
"""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path

from pydantic import ValidationError

from r2s2r_cli.errors import ArtifactError, InputError, nearest_folder, quoted
from r2s2r_cli.store.canonical import canonical_json
from schemas.header import Header

NAME = b"r2s2r-artifact "
MAGIC = NAME + b"1 "
MIN_BLOCK = 4096
MAX_BLOCK = 1 << 22
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
TEXTS = (".toml", ".csv", ".json")
"""Endings of files that are no artifacts, and of which `validate` says what they are and which command takes them."""
_LINE = len(MAGIC) + 64 + 1 + 10 + 1
_READ = 1 << 20


class NotAnArtifact(ArtifactError):
    """The file does not begin with an r2s2r header: another program's file, or a damaged head."""


class CutOff(ArtifactError):
    """An artifact whose last bytes are gone."""


def block_size(header: Header) -> int:
    """Size of the user block for this header: a power of two of at least 4096 bytes.

    Raises InputError where it would need more than 4 MB.
    """
    size = MIN_BLOCK
    while size < _LINE + len(_encode(header)) + 1:
        size *= 2
    if size > MAX_BLOCK:
        raise InputError("the artifact has too many runs for one file", where=header.kind,
                         expected="a header of at most 4 MB",
                         received=f"one of {size / 1e6:.0f} MB for {len(header.datasets)} datasets",
                         hint="use several iterations, each with a part of the runs")  # fmt: skip
    return size


def write_block(path: Path, header: Header) -> None:
    """Write the header into the user block that is reserved at the start of `path`."""
    with path.open("r+b") as file:
        file.write(block(header))


def block(header: Header) -> bytes:
    """The user block: first line, JSON, spaces, newline. Raises ValueError where it does not fit."""
    body = _encode(header)
    line = MAGIC + hashlib.sha256(body).hexdigest().encode() + b" %010d\n" % len(body)
    found = (line + body).ljust(header.body_offset - 1) + b"\n"
    if len(found) != header.body_offset:
        raise ValueError(f"header of {len(body)} bytes does not fit into a block of {header.body_offset}")
    return found


def read_header(path: Path) -> Header:
    """The header of an artifact, checked against its own digest.

    Raises ArtifactError: no such file, not an artifact, or the head is damaged.
    """
    try:
        if path.exists() and not path.is_dir() and not path.is_file():
            raise NotAnArtifact("this is no regular file", where=str(path), expected="an artifact",
                                received="a pipe, socket or device", hint=f"ls -la {quoted(path)}")  # fmt: skip
        return _head(path)
    except OSError as error:
        raise unreadable(path, error) from error
    except _Foreign as error:
        raise not_an_artifact(path, error.line) from error
    except _Damage as error:
        raise _damaged(path, str(error)) from error


def peeked_header(path: Path) -> Header | None:
    """The header of an artifact; None where it cannot be read. It says of none what is wrong with it, and so can be
    asked while what mends one is looked for, in the heads of others."""
    try:
        return _head(path)
    except (OSError, _Foreign, _Damage):
        return None


def whole_header(path: Path) -> Header:
    """The header of an artifact that has all its bytes. Raises ArtifactError, also where the file was cut off.

    The bytes themselves are not read: this is what a light command can afford.
    """
    header = read_header(path)
    expected, received = header.body_offset + header.body_bytes, path.stat().st_size
    if received < expected:
        raise CutOff("the file was cut off", where=str(path), expected=f"{expected} bytes",
                     received=f"{received} bytes", hint=mends_cut_off(path, header))  # fmt: skip
    return header


def sealed_header(path: Path) -> Header:
    """The header of an artifact that is byte for byte what was sealed. Raises ArtifactError. Reads the whole file."""
    header = whole_header(path)
    if body_sha256(path, header.body_offset) != (header.body_sha256, header.body_bytes):
        raise ArtifactError("bytes of the file changed after it was sealed", where=str(path),
                            expected=f"sha256 {header.body_sha256[:16]}", received="another",
                            hint=f"r2s2r recover {quoted(path)}")  # fmt: skip
    return header


def body_sha256(path: Path, offset: int, limit: int | None = None) -> tuple[str, int]:
    """Digest and length of the bytes of `path` from `offset` on, of at most `limit` bytes. Raises ArtifactError."""
    digest, length = hashlib.sha256(), 0
    try:
        with path.open("rb") as file:
            file.seek(offset)
            while part := file.read(_READ if limit is None else min(_READ, limit - length)):
                digest.update(part)
                length += len(part)
    except OSError as error:
        raise unreadable(path, error) from error
    return digest.hexdigest(), length


def not_an_artifact(path: Path, head: bytes) -> NotAnArtifact:
    """Name what the file is instead, as far as its first bytes tell."""
    if head.startswith(NAME):
        return NotAnArtifact(
            "the head of this artifact is damaged, or of a newer format",
            where=str(path),
            expected=MAGIC.decode(),
            received=repr(head[: len(MAGIC)]),
            hint=mends(path),
        )
    if not head:
        received = "an empty file"
    elif head.startswith(HDF5_SIGNATURE):
        received = "an HDF5 file of another program"
    else:
        received = f"a file that begins {head[:16]!r}"
    return NotAnArtifact(
        "this is not an r2s2r artifact, or its head is damaged",
        where=str(path),
        expected="a file that begins 'r2s2r-artifact'",
        received=received,
        hint=mends(path, or_else="inspect"),
    )


def mends(path: Path, or_else: str = "recover") -> str:
    """The command for a file whose head cannot be read: what brings it back where there are data behind it, else what
    makes it again; where nothing does, the command `or_else` of r2s2r."""
    from r2s2r_cli.store.again import command_at
    from r2s2r_cli.store.verify import find_body

    with contextlib.suppress(OSError):
        if find_body(path) is not None:
            return f"r2s2r recover {quoted(path)}"
    return command_at(path) or f"r2s2r {'validate' if path.suffix.lower() in TEXTS else or_else} {quoted(path)}"


def mends_cut_off(path: Path, header: Header) -> str:
    """The command for a file that lost its end, and with it numbers: what makes it again, of the options that its head
    still has where they mean the same here; of logs that are there what imports them once more; of a measurement, and
    outside a project, what rescues the rest."""
    from r2s2r_cli.store.again import command_again, command_at
    from r2s2r_cli.store.imported import import_again
    from r2s2r_cli.store.project import root_of
    from schemas.versions import STAGE_VERSIONS

    if header.kind == "recording":
        return import_again(path, header.provenance) or f"r2s2r recover {quoted(path)}"
    anew = command_at(path)
    if anew and root_of(path.absolute()) == Path.cwd() and header.provenance.stage in STAGE_VERSIONS:
        return command_again(header.provenance, path)
    return anew or f"r2s2r recover {quoted(path)}"


def unreadable(path: Path, error: OSError) -> ArtifactError:
    """Say in words why `path` cannot be read."""
    if isinstance(error, FileNotFoundError):
        return ArtifactError("there is no such file", where=str(path), expected="an artifact", received="nothing",
                             hint=f"ls -la {quoted(nearest_folder(path))}")  # fmt: skip
    if isinstance(error, IsADirectoryError):
        return ArtifactError("this is a directory, not an artifact", where=str(path), expected="a file",
                             received="a directory", hint=f"ls -la {quoted(path)}")  # fmt: skip
    return ArtifactError("the file cannot be read", where=str(path), expected="a file that may be read",
                         received=error.strerror or str(error), hint=f"ls -la {quoted(path)}")  # fmt: skip


def _encode(header: Header) -> bytes:
    return canonical_json(header.model_dump(mode="json")).encode()


class _Foreign(Exception):
    """The file begins as no artifact does. line: its first bytes."""

    def __init__(self, line: bytes) -> None:
        super().__init__(line)
        self.line = line


class _Damage(Exception):
    """What is wrong with a head, in words."""


def _head(path: Path) -> Header:
    """The header, checked against its own digest. Raises OSError, _Foreign, _Damage."""
    with path.open("rb") as file:
        line = file.read(_LINE)
        if not line.startswith(MAGIC):
            raise _Foreign(line)
        digest, length = _parse(line)
        body = file.read(length)
    if hashlib.sha256(body).hexdigest() != digest:
        raise _Damage("its digest does not match its text")
    try:
        return Header.model_validate_json(body)
    except ValidationError as error:
        raise _Damage(error.errors()[0]["msg"]) from error


def _parse(line: bytes) -> tuple[str, int]:
    try:
        digest, length = line[len(MAGIC) :].split()
        size = int(length)
    except ValueError as error:
        raise _Damage(f"its first line reads {line!r}") from error
    if not 0 < size <= MAX_BLOCK:
        raise _Damage(f"it claims a length of {size} bytes")
    return digest.decode("ascii", "replace"), size


def _damaged(path: Path, received: str) -> ArtifactError:
    return NotAnArtifact(
        "the head of this artifact is damaged",
        where=str(path),
        expected="an intact header",
        received=received,
        hint=mends(path),
    )
