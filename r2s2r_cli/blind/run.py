"""`blind run`: a verdict on every set of a bank, each a small JSON file; what is there already is not done again.

Nothing here can know a label: the contracts of pyproject forbid to import what makes or opens one, and a hook on file
opening (`guard`) refuses to read one.
"""

from __future__ import annotations

import importlib
import json
import os
import time
import traceback
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from r2s2r_cli.blind.code import code
from r2s2r_cli.blind.guard import Guard, Peeked
from r2s2r_cli.blind.index import digest, read_index
from r2s2r_cli.blind.seam import each, open_executor
from r2s2r_cli.blind.sets import read_set
from r2s2r_cli.blind.verdict import FORMAT, unreadable, write_document
from r2s2r_cli.errors import InputError, R2S2RError
from r2s2r_cli.stages.diagnose.evidence import Evidence

Diagnoser = Callable[[Evidence, dict[str, Any]], dict[str, Any]]
"""Evidence and settings in, the document of `diagnose --json` out."""
DEFAULT = "r2s2r_cli.blind.catalogue:diagnosed"


@dataclass(frozen=True)
class Job:
    """One set. diagnoser: `module:function` of a Diagnoser. settings: for it. shuffled: seed of the negative control
    that exchanges the commands of the target intervals."""

    bank: Path
    name: str
    out: Path
    index: str
    logs: str
    diagnoser: str = DEFAULT
    settings: dict[str, Any] = field(default_factory=dict)
    shuffled: int | None = None

    @property
    def asked(self) -> dict[str, Any]:
        """What makes a verdict another one."""
        return {"diagnoser": self.diagnoser, "settings": self.settings, "shuffled": self.shuffled}


def jobs(bank: Path, out: Path, **asked: Any) -> tuple[Job, ...]:
    """All sets of a bank; `asked`: fields of Job. Raises InputError where the bank has no list."""
    index, own = read_index(bank / "index.json")
    return tuple(Job(bank, name, out, own, facts["logs"], **asked) for name, facts in sorted(index["sets"].items()))


def left(all_jobs: tuple[Job, ...]) -> tuple[Job, ...]:
    """Those without a verdict. Raises InputError where one is of another bank or other settings."""
    return tuple(job for job in all_jobs if not _is_done(job))


def run(todo: tuple[Job, ...], *, executor: str = "local", workers: int = 1) -> Generator[dict[str, Any]]:
    """Verdicts as they come, each written before it is handed over; closed, it ends what is under way. Raises Peeked
    where a diagnoser reached for the truth, InputError where logs are not those of the bank's list."""
    with open_executor(executor, workers) as pool:
        for _, verdict in each(pool, one, todo, at_once=workers):
            yield verdict


def one(job: Job) -> dict[str, Any]:
    """One set in this process, which has the guard from then on."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    folder = job.bank / "sets" / job.name
    if digest(folder) != job.logs:
        raise InputError(
            "the logs of a set are not those that the bank was closed with", where=str(folder), expected=job.logs,
            received=digest(folder), hint="r2s2r blind make bank --key labels.key",
        )  # fmt: skip
    diagnoser = _diagnoser(job.diagnoser)
    judge = code()  # before the guard stands: it asks git
    guard = _guard(job.bank)
    guard.begin(folder)
    begun, spent = time.monotonic(), time.process_time()
    failed: str | None = None
    found: dict[str, Any] = {}
    try:
        found = diagnoser(read_set(folder, shuffled=job.shuffled), job.settings)
    except Peeked:
        raise
    # A set that cannot be diagnosed is a miss, not the end of the trial; so is one that a bug of the diagnoser's ends.
    except R2S2RError as error:
        failed = str(error)
    except Exception as error:
        failed = "bug: " + "".join(traceback.format_exception(error)[-2:]).strip()
    finally:
        guard.end()
    verdict = {
        "format": FORMAT, "set": job.name, "index": job.index, "logs": job.logs, **job.asked, "failed": failed,
        "code": judge, "diagnosis": found, "opened": guard.opened, "refused": guard.refused,
        "wall_s": time.monotonic() - begun, "cpu_s": time.process_time() - spent,
    }  # fmt: skip
    write_document(job.out / f"{job.name}.json", verdict)
    return verdict


def _is_done(job: Job) -> bool:
    path = job.out / f"{job.name}.json"
    if not path.exists():
        return False
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        same = {"index": job.index, "logs": job.logs, **job.asked}
        wrong = [key for key, value in same.items() if found[key] != value]
    except (ValueError, KeyError, TypeError) as error:
        raise unreadable(path, error) from error
    if wrong:
        raise InputError(
            "a verdict is there that answers another question", where=f"{path}: {wrong[0]}",
            expected=json.dumps(same[wrong[0]]), received=json.dumps(found[wrong[0]]),
            hint="r2s2r blind run bank --out verdicts-2",
        )  # fmt: skip
    return True


def _diagnoser(name: str) -> Diagnoser:
    module, _, function = name.partition(":")
    found: Diagnoser = getattr(importlib.import_module(module), function)
    return found


_GUARDS: dict[str, Guard] = {}


def _guard(bank: Path) -> Guard:
    """The one of this process: a hook cannot be taken off, so there is one for each bank."""
    key = os.path.realpath(bank)
    if key not in _GUARDS:
        _GUARDS[key] = Guard(bank)
        _GUARDS[key].install()
    return _GUARDS[key]
