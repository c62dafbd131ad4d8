"""A disk of a few hundred kilobytes, and ballast to fill it with."""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

PAGE = 4096


@dataclass(frozen=True)
class SmallDisk:
    """A mounted file system of its own."""

    path: Path

    def free(self) -> int:
        """Free space [byte]."""
        found = os.statvfs(self.path)
        return found.f_bavail * found.f_frsize

    def fill(self, leave: int = 0) -> None:
        """Fill it up to `leave` bytes, a whole number of pages."""
        self.empty()
        with (self.path / "ballast").open("wb", buffering=0) as file, contextlib.suppress(OSError):
            while self.free() > leave:
                file.write(bytes(PAGE))

    def empty(self) -> None:
        """Take the ballast out."""
        (self.path / "ballast").unlink(missing_ok=True)

    def names(self) -> set[str]:
        """Names of the files on it, without the ballast."""
        return {p.relative_to(self.path).as_posix() for p in self.path.rglob("*") if p.is_file()} - {"ballast"}


@contextlib.contextmanager
def small_disk(folder: Path, size: int) -> Iterator[SmallDisk]:
    """Mount a tmpfs of `size` bytes on `folder`; skips where this user may not mount."""
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(folder)]
    try:
        done = subprocess.run(mount, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip("no tmpfs can be mounted here (there is no mount); the tests with a file size limit still run")
    if done.returncode != 0:
        pytest.skip(f"no tmpfs can be mounted here ({done.stderr.strip()}); the tests with a file size limit still run")
    try:
        yield SmallDisk(folder)
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)
