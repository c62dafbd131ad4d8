"""Ask the child process about a file that nobody vouches for, with a time limit."""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

from r2s2r_cli.errors import ArtifactError, quoted
from r2s2r_cli.store.header import unreadable
from r2s2r_cli.store.worker import READY

Call = Literal["verify", "tree", "facts", "save"]

START_LIMIT_S = 60.0
"""Covers the imports of the child on a loaded machine."""
BASE_LIMIT_S = 10.0
"""For any file, however small, on a loaded machine."""
BYTES_PER_S = 20e6
"""Slowest reading that is still waited for."""


class IsolatedReader:
    """A child process that reads foreign HDF5 files. It is restarted when a file crashes or hangs it."""

    def __init__(self) -> None:
        self._child: subprocess.Popen[str] | None = None

    def __enter__(self) -> IsolatedReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def verify(self, path: Path) -> dict[str, Any]:
        """Report of `store.verify.verify`. Raises ArtifactError where the file crashes or hangs the HDF5 library."""
        return self._ask("verify", path)

    def tree(self, path: Path) -> dict[str, Any]:
        """Report of `store.verify.tree`. Raises ArtifactError where the file crashes or hangs the HDF5 library."""
        return self._ask("tree", path)

    def facts(self, path: Path) -> dict[str, Any]:
        """Report of `store.salvage.facts`. Raises ArtifactError as `verify` does."""
        return self._ask("facts", path)

    def save(self, path: Path, dataset: str, target: Path) -> dict[str, Any]:
        """Report of `store.salvage.save`: one dataset into a `.npy` file. Raises ArtifactError as `verify` does."""
        return self._ask("save", path, dataset=dataset, target=str(target.absolute()))

    def close(self) -> None:
        """End the child."""
        child, self._child = self._child, None
        if child is None:
            return
        child.kill()
        child.wait()
        for stream in (child.stdin, child.stdout):
            if stream is not None:
                with contextlib.suppress(BrokenPipeError):  # a request that the dead child did not take
                    stream.close()

    def _ask(self, call: Call, path: Path, **arguments: str) -> dict[str, Any]:
        try:
            limit = BASE_LIMIT_S + path.stat().st_size / BYTES_PER_S
        except OSError as error:
            raise unreadable(path, error) from error
        request = {"call": call, "path": str(path.absolute()), **arguments}
        try:
            answer = self._answer(request, limit)
        except BrokenPipeError:  # it died before it took the request, which says nothing of this file
            self.close()
            answer = self._answer(request, limit)
        if answer and answer.endswith("\n"):
            return json.loads(answer)
        self.close()
        slow = answer is None
        what = f"kept the HDF5 library busy for over {limit:.0f} s" if slow else "crashed the HDF5 library"
        raise ArtifactError(
            f"the file {what}: its structure is damaged",
            where=str(path),
            expected="an intact HDF5 file",
            received="a file that cannot be opened safely",
            hint=f"r2s2r recover {quoted(path)}",
        )

    def _answer(self, request: dict[str, str], limit: float) -> str | None:
        """What `_line` reads. Raises BrokenPipeError where the child is dead before it was asked."""
        child = self._running()
        print(json.dumps(request), file=child.stdin, flush=True)
        return _line(child, limit)

    def _running(self) -> subprocess.Popen[str]:
        if self._child is None or self._child.poll() is not None:
            self.close()
            self._child = subprocess.Popen(
                [sys.executable, "-P", "-m", "r2s2r_cli.store.worker"], env=_environment(), encoding="utf-8",
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            )  # fmt: skip
            if _line(self._child, START_LIMIT_S) != f"{READY}\n":
                self.close()
                raise RuntimeError(
                    "the reader process did not start: run 'python -m r2s2r_cli.store.worker' to see why"
                )
        return self._child


def _environment() -> dict[str, str]:
    """The child finds this package, and nothing in the user's directory; threads would eat its address space."""
    home = str(Path(__file__).resolve().parents[2])
    paths = [home, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def _line(child: subprocess.Popen[str], limit_s: float) -> str | None:
    """The child's next line; empty if it died, None if it kept silent for `limit_s`."""
    if child.stdout is None:
        raise RuntimeError("the reader process has no output pipe")
    with selectors.DefaultSelector() as selector:
        selector.register(child.stdout, selectors.EVENT_READ)
        return child.stdout.readline() if selector.select(limit_s) else None
