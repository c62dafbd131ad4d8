"""Ask the child process about a file that nobody vouches for, with a time limit."""

from __future__ import annotations

import json
import selectors
import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.worker import READY

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

    def close(self) -> None:
        """End the child."""
        child, self._child = self._child, None
        if child is None:
            return
        child.kill()
        child.wait()
        for stream in (child.stdin, child.stdout):
            if stream is not None:
                stream.close()

    def _ask(self, call: Literal["verify", "tree"], path: Path) -> dict[str, Any]:
        limit = BASE_LIMIT_S + path.stat().st_size / BYTES_PER_S
        child = self._running()
        try:
            print(json.dumps({"call": call, "path": str(path)}), file=child.stdin, flush=True)
            answer = _line(child, limit)
        except BrokenPipeError:
            answer = ""
        if answer:
            return json.loads(answer)  # type: ignore[no-any-return]
        self.close()
        slow = answer is None
        what = f"kept the HDF5 library busy for over {limit:.0f} s" if slow else "crashed the HDF5 library"
        raise ArtifactError(
            f"the file {what}: its structure is damaged",
            where=str(path),
            expected="an intact HDF5 file",
            received="a file that cannot be opened safely",
            hint=f"r2s2r recover '{path}'",
        )

    def _running(self) -> subprocess.Popen[str]:
        if self._child is None or self._child.poll() is not None:
            self.close()
            self._child = subprocess.Popen(
                [sys.executable, "-m", "r2s2r_cli.store.worker"],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            )  # fmt: skip
            if _line(self._child, START_LIMIT_S) != f"{READY}\n":
                self.close()
                raise RuntimeError(
                    "the reader process did not start: run 'python -m r2s2r_cli.store.worker' to see why"
                )
        return self._child


def _line(child: subprocess.Popen[str], limit_s: float) -> str | None:
    """The child's next line; empty if it died, None if it kept silent for `limit_s`."""
    if child.stdout is None:
        raise RuntimeError("the reader process has no output pipe")
    with selectors.DefaultSelector() as selector:
        selector.register(child.stdout, selectors.EVENT_READ)
        return child.stdout.readline() if selector.select(limit_s) else None
