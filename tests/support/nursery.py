"""Processes that are killed in the middle of their work: `python -m tests.support.nursery`.

One JSON request a line on stdin: job, folder, and when to die: after `delay` seconds, or before system call number
`step` that changes the disk; `limit` is the largest file that it may write. The job runs in a fork, so that a kill
costs milliseconds. One JSON answer a line: `reported`, what the job said was safe before it died; `finished`, whether
it came to its end first; `code`, its exit code (that of an R2S2RError where it raised one), None for a kill.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

CALLS = ("write", "pwrite", "fsync", "fdatasync", "replace", "rename", "link", "unlink", "ftruncate")
"""What changes the disk, as the store calls it."""
_NUMBER = struct.Struct("<I")
Report = Callable[[int], None]


class Nursery:
    """The process that forks the victims, seen from the test."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.support.nursery"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def run(
        self, job: str, folder: Path, *, delay: float | None = None, step: int | None = None, limit: int | None = None
    ) -> dict[str, Any]:
        """Run `job` in `folder`, and kill it or let it run; the answer of the module's docstring."""
        assert self._process.stdin is not None and self._process.stdout is not None
        request = {"job": job, "folder": str(folder), "delay": delay, "step": step, "limit": limit}
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        return answer

    def close(self) -> None:
        """End it."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()


def write(folder: Path, report: Report) -> None:
    """Write artifact over artifact, of three lengths, and report the number of each that stands."""
    from r2s2r_cli.store.write import write_artifact
    from tests.support.builders import provenance, simulation

    versions = [simulation(frames) for frames in (8, 9, 10)]
    for number in range(12):
        write_artifact(folder / "simulation.h5", versions[number % 3], provenance())
        report(number)


def record(folder: Path, report: Report) -> None:
    """Append rows to a journal and report the number of each that `append` has taken."""
    from r2s2r_cli.store.journal import Journal
    from tests.support import recorder

    with Journal(folder / "10-record.h5.journal", recorder.head()) as journal:
        for number in range(12_000):
            recorder.append(journal, number)
            report(number)


def seal(folder: Path, report: Report) -> None:
    """Seal the journal that lies in the folder."""
    from r2s2r_cli.store.seal import seal as run

    run(folder / "10-record.h5.journal", folder / "10-record.h5")
    report(0)


def migrate(folder: Path, report: Report) -> None:
    """Migrate the toy artifact that lies in the folder."""
    from r2s2r_cli.store.migrate import migrate_file
    from tests.support.versions import current

    with current(3):
        migrate_file(folder / "90-toy.h5")
    report(0)


def restore(folder: Path, report: Report) -> None:
    """Restore the artifact with a damaged head that lies in the folder."""
    from r2s2r_cli.store.isolated import IsolatedReader
    from r2s2r_cli.store.recover import recover_file

    with IsolatedReader() as reader:
        recover_file(folder / "policy.h5", reader)
    report(0)


JOBS = {job.__name__: job for job in (write, record, seal, migrate, restore)}


def main() -> None:
    """Answer requests until stdin closes."""
    import tests.support.recorder
    import tests.support.versions  # noqa: F401  (loaded once, before any fork)

    for line in sys.stdin:
        sys.stdout.write(json.dumps(_run(json.loads(line))) + "\n")
        sys.stdout.flush()


def _run(request: dict[str, Any]) -> dict[str, Any]:
    out, into = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(out)
        _victim(request, into)
    os.close(into)
    if request["delay"] is not None:
        time.sleep(request["delay"])
        os.kill(child, signal.SIGKILL)
    told = b""
    while block := os.read(out, 1 << 16):
        told += block
    os.close(out)
    _, status = os.waitpid(child, 0)
    numbers = [n for (n,) in _NUMBER.iter_unpack(told[: len(told) // _NUMBER.size * _NUMBER.size])]
    return {"reported": numbers[-1] + 1 if numbers else 0, "finished": not os.WIFSIGNALED(status),
            "code": os.WEXITSTATUS(status) if os.WIFEXITED(status) else None}  # fmt: skip


def _victim(request: dict[str, Any], into: int) -> None:
    from r2s2r_cli.errors import R2S2RError

    code = 1
    try:
        tell = os.write
        if request["limit"] is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (request["limit"],) * 2)
        if request["step"] is not None:
            _die_at(request["step"])
        JOBS[request["job"]](Path(request["folder"]), lambda number: tell(into, _NUMBER.pack(number)) and None)
        code = 0
    except R2S2RError as error:
        code = int(error.exit_code)
    finally:
        os._exit(code)


def _die_at(step: int) -> None:
    """Die by SIGKILL instead of making the disk-changing system call with this number."""
    left = [step]

    def counted(call: Callable[..., Any]) -> Callable[..., Any]:
        def run(*arguments: Any, **options: Any) -> Any:
            if left[0] == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            left[0] -= 1
            return call(*arguments, **options)

        return run

    for name in CALLS:
        setattr(os, name, counted(getattr(os, name)))


if __name__ == "__main__":
    main()
