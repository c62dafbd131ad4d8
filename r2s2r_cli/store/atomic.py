"""Files that are whole or absent: temp file beside the target, fsync, replace, fsync of the directory."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from r2s2r_cli.errors import ArtifactError

PARTIAL = ".partial"
"""Ending of unfinished files; nothing that bears it is ever read as an artifact."""


@contextlib.contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Yield a temp path beside `target`; on success it becomes `target`, on failure it is removed.

    The caller writes and closes the temp file. Raises ArtifactError (disk full, no permission).
    """
    temp = target.with_name(f".{target.name}.{os.getpid()}-{secrets.token_hex(4)}{PARTIAL}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield temp
        _fsync(temp)
        os.replace(temp, target)
        _fsync(target.parent)
    except OSError as error:
        raise disk_error(error, target) from error
    finally:
        with contextlib.suppress(OSError):
            temp.unlink(missing_ok=True)


def write_bytes(target: Path, content: bytes) -> None:
    """Write `content` to `target`, whole or not at all."""
    with replacing(target) as temp:
        temp.write_bytes(content)


def write_text(target: Path, content: str) -> None:
    """Write UTF-8 text to `target`, whole or not at all."""
    write_bytes(target, content.encode())


def disk_error(error: OSError, target: Path) -> ArtifactError:
    """Say in words what the operating system refused while writing `target`."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return ArtifactError(
            "the disk is full, nothing was written",
            where=str(target),
            expected="free space for the whole file",
            received=f"{_free(target.parent)} free",
            hint=f"df -h '{target.parent}'",
        )
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return ArtifactError(
            "this place may not be written to",
            where=str(target),
            expected="write permission",
            received=os.strerror(error.errno),
            hint=f"ls -ld '{target.parent}'",
        )
    return ArtifactError(
        "the file could not be written, nothing was changed",
        where=str(target),
        received=error.strerror or str(error),
        hint=f"ls -la '{target.parent}'",
    )


def sweep(directory: Path) -> list[Path]:
    """Remove what killed writers of this project left behind; return the removed paths.

    Call it only under the project's lock: a live writer's temp file looks the same.
    """
    removed = []
    for path in directory.glob(f".*{PARTIAL}"):
        with contextlib.suppress(OSError):
            path.unlink()
            removed.append(path)
    return removed


def _fsync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _free(directory: Path) -> str:
    try:
        stats = os.statvfs(directory)
    except OSError:
        return "unknown space"
    return f"{stats.f_bavail * stats.f_frsize / 1e6:.1f} MB"
