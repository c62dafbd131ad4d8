"""One writer a project. The lock dies with its process, so a crash never leaves a project locked."""

from __future__ import annotations

import contextlib
import json
import os
import platform
from collections.abc import Iterator
from pathlib import Path

from r2s2r_cli.errors import ArtifactError, UsageError, quoted
from r2s2r_cli.store.atomic import disk_error
from r2s2r_cli.store.project import STATE_DIR, root_of

GLANCE_S = 0.2
"""How long a writer waits: who only asks whether somebody writes (`writer`) takes the lock for an instant."""


@contextlib.contextmanager
def writing(root: Path, command: str) -> Iterator[None]:
    """Hold the project's write lock. Raises UsageError naming the holder where another process writes."""
    from filelock import FileLock, Timeout

    directory = root / STATE_DIR
    holder = directory / "writer.json"
    try:
        directory.mkdir(exist_ok=True)
        lock = FileLock(directory / "write.lock")
        lock.acquire(timeout=GLANCE_S)
    except Timeout as error:
        raise UsageError(
            "another r2s2r is writing in this project",
            where=str(root),
            expected="one writer at a time",
            received=_describe(holder),
            hint="wait until it is done, then run the command again",
        ) from error
    except NotImplementedError as error:
        raise ArtifactError(
            "the file system of the project has no file locks",
            where=str(directory),
            expected="a local file system, or a network one with locks",
            received=str(error),
            hint=f"df -T {quoted(root)}",
        ) from error
    except OSError as error:
        raise disk_error(error, directory) from error
    try:
        with contextlib.suppress(OSError):  # only for the message above; a full disk must not stop a read
            holder.write_text(json.dumps({"pid": os.getpid(), "host": platform.node(), "command": command}))
        yield
    finally:
        with contextlib.suppress(OSError):
            holder.unlink(missing_ok=True)
        lock.release()


def writer(root: Path) -> str | None:
    """Who writes in the project at this moment, in words; None: nobody, or nobody can tell."""
    from filelock import FileLock, Timeout

    directory = root / STATE_DIR
    if not (directory / "write.lock").exists():
        return None
    lock = FileLock(directory / "write.lock")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        return _describe(directory / "writer.json")
    except (NotImplementedError, OSError):
        return None
    lock.release()
    return None


@contextlib.contextmanager
def writing_at(path: Path, command: str) -> Iterator[None]:
    """Hold the write lock of the project that `path` lies in; outside of any project there is nothing to lock."""
    root = root_of(path)
    with writing(root, command) if root else contextlib.nullcontext():
        yield


def _describe(holder: Path) -> str:
    try:
        who = json.loads(holder.read_text())
        return f"'r2s2r {who['command']}' (process {who['pid']} on {who['host']})"
    except (OSError, ValueError, KeyError, TypeError):
        return "an unnamed process"
