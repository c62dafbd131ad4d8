"""Files that are whole or absent: temp file beside the target, fsync, replace, fsync of the directory."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path

from r2s2r_cli.errors import ArtifactError, nearest_folder, quoted

PARTIAL = ".partial"
"""Ending of unfinished files; nothing that bears it is ever read as an artifact."""
_TEMP = re.compile(r"\..+\.\d+-[0-9a-f]{8}" + re.escape(PARTIAL))


@contextlib.contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Yield a temp path beside `target`; on success it becomes `target`, on failure it is removed.

    The caller writes and closes the temp file. Raises ArtifactError (disk full, no permission).
    """
    temp = temp_beside(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise disk_error(error, target) from error
    try:
        yield temp
        _fsync(temp)
        os.replace(temp, target)
    except OSError as error:
        other = error.filename is not None and os.fspath(error.filename) not in map(str, (temp, target, target.parent))
        raise _source_error(error) if other else disk_error(error, target) from error
    finally:
        with contextlib.suppress(OSError):
            temp.unlink(missing_ok=True)
    sync_directory(target.parent)


@contextlib.contextmanager
def creating(target: Path) -> Iterator[Path]:
    """As `replacing`, for a file that must be new: FileExistsError where `target` exists, whoever was first."""
    temp = temp_beside(target)
    try:
        yield temp
        _fsync(temp)
        _link_or_move(temp, target)
    except FileExistsError:
        raise
    except OSError as error:
        raise disk_error(error, target) from error
    finally:
        with contextlib.suppress(OSError):
            temp.unlink(missing_ok=True)
    sync_directory(target.parent)


def keep_beside(path: Path, suffix: str) -> Path:
    """Give the present content of `path` a second name beside it, which nothing overwrites; return that name.

    A hard link where the file system has them, else a copy: `path` itself is there all the time. Raises ArtifactError.
    """
    for number in range(1, 1000):
        name = path.with_name(f"{path.name}{suffix}" + (f".{number}" if number > 1 else ""))
        try:
            if name.exists() and not name.samefile(path):
                continue
            if not name.exists():
                _link_or_copy(path, name)
        except FileExistsError:
            continue
        except OSError as error:
            raise disk_error(error, name) from error
        sync_directory(path.parent)
        return name
    raise ArtifactError("there are too many kept copies", where=str(path), expected="fewer than 1000",
                        received="1000", hint=f"ls -la {quoted(path.parent)}")  # fmt: skip


def temp_beside(target: Path) -> Path:
    """A name for an unfinished file, which `sweep` recognises."""
    return target.with_name(f".{target.name}.{os.getpid()}-{secrets.token_hex(4)}{PARTIAL}")


def _link_or_move(temp: Path, target: Path) -> None:
    """Give `temp` its name; FileExistsError where that is taken. The open file stays the same one."""
    try:
        os.link(temp, target)
    except FileExistsError:
        raise
    except OSError:  # no hard links on this file system
        if target.exists():
            raise FileExistsError(target) from None
        temp.rename(target)


def _link_or_copy(path: Path, name: Path) -> None:
    """A second name for `path`; FileExistsError where it is taken."""
    try:
        os.link(path, name)
    except FileExistsError:
        raise
    except OSError:  # no hard links on this file system
        with name.open("xb") as copy, path.open("rb") as original:
            shutil.copyfileobj(original, copy)
            copy.flush()
            os.fsync(copy.fileno())


def write_bytes(target: Path, content: bytes) -> None:
    """Write `content` to `target`, whole or not at all."""
    with replacing(target) as temp:
        temp.write_bytes(content)


def write_text(target: Path, content: str) -> None:
    """Write UTF-8 text to `target`, whole or not at all."""
    write_bytes(target, content.encode())


def disk_error(error: OSError, target: Path) -> ArtifactError:
    """Say in words what the operating system refused while writing `target`."""
    folder = nearest_folder(target)  # the one that it goes into may be what could not be made
    if error.errno == errno.EFBIG:
        return ArtifactError(
            "the file would be larger than files may be here",
            where=str(target),
            expected="a limit above the size of the file",
            received=os.strerror(error.errno),
            hint="ulimit -f",
        )
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return ArtifactError(
            "the disk is full",
            where=str(target),
            expected="free space for the whole file",
            received=f"{_free(folder)} free",
            hint=f"df -h {quoted(folder)}",
        )
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return ArtifactError(
            "this place may not be written to",
            where=str(target),
            expected="write permission",
            received=os.strerror(error.errno),
            hint=f"ls -ld {quoted(folder)}",
        )
    return ArtifactError(
        "the file could not be written",
        where=str(target),
        received=error.strerror or str(error),
        hint=f"ls -la {quoted(folder)}",
    )


def sweep(directory: Path) -> list[Path]:
    """Remove what killed writers of this project left behind; return the removed paths.

    Call it only under the project's lock: a live writer's temp file looks the same.
    """
    removed = []
    for path in sorted(directory.glob(f".*{PARTIAL}")):
        if not _TEMP.fullmatch(path.name):
            continue
        with contextlib.suppress(OSError):
            path.unlink()
            removed.append(path)
    return removed


def sync_directory(directory: Path) -> None:
    """Make the names in `directory` survive a power cut, where its file system can."""
    with contextlib.suppress(OSError):
        _fsync(directory)


def _source_error(error: OSError) -> ArtifactError:
    """A file that is read while the artifact is written."""
    return ArtifactError("a file that is being read in failed", where=str(error.filename), expected="a readable file",
                         received=error.strerror or str(error), hint=f"ls -la {quoted(error.filename)}")  # fmt: skip


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
