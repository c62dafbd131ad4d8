"""Ask the child process about a file that nobody vouches for, with a time limit."""

from __future__ import annotations

import json
import selectors
import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

from r2s2r_cli.errors import ArtifactError

BASE_LIMIT_S = 20.0
"""Covers the start of the child on a loaded machine."""
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
        assert child.stdin is not None and child.stdout is not None  # noqa: S101 - both are pipes
        try:
            child.stdin.write(json.dumps({"call": call, "path": str(path)}) + "\n")
            child.stdin.flush()
            with selectors.DefaultSelector() as selector:
                selector.register(child.stdout, selectors.EVENT_READ)
                ready = selector.select(limit)
            line = child.stdout.readline() if ready else ""
        except BrokenPipeError:
            ready, line = True, ""
        if line:
            return json.loads(line)  # type: ignore[no-any-return]
        self.close()
        what = "crashed the HDF5 library" if ready else f"kept the HDF5 library busy for over {limit:.0f} s"
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
        return self._child
