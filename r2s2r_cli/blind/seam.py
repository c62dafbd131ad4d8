"""Many independent pieces of work through one seam in the manner of `concurrent.futures.Executor`.

`open_executor("local", 2)` gives processes of this machine; `dask://host:port` the workers of a dask.distributed
scheduler (extra `cluster`), where the same package is installed and the same folders are mounted.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import TypeVar

from r2s2r_cli.errors import HardwareError, R2S2RError, UsageError, install_extra

LOCAL, DASK = "local", "dask://"
Item = TypeVar("Item")
Result = TypeVar("Result")


@contextmanager
def open_executor(spec: str, workers: int) -> Iterator[Executor]:
    """An executor, shut down at the end; what has not begun is given up where an exception leaves the block.

    Raises UsageError for another kind of address or where dask is not installed, HardwareError where no scheduler
    answers.
    """
    close: Callable[[], object] = lambda: None  # noqa: E731 - what an executor of somebody else's needs beside shutdown
    if spec == LOCAL:
        # Fresh interpreters: nothing of this process (loaded modules, threads of torch) goes along.
        fresh = multiprocessing.get_context("spawn")
        executor: Executor = ProcessPoolExecutor(workers, mp_context=fresh, initializer=_end_with_parent)
    elif spec.startswith(DASK):
        executor, close = _dask(spec)
    else:
        raise UsageError(
            "there is no such executor", where="--executor", expected="local, or dask://host:port", received=spec,
            hint="r2s2r blind run bank --executor local",
        )  # fmt: skip
    try:
        yield executor
    except BaseException:
        executor.shutdown(wait=False, cancel_futures=True)
        raise
    else:
        executor.shutdown()
    finally:
        close()


def _end_with_parent() -> None:
    """In a worker: nobody waits for what it computes once who asked for it is gone, killed for instance."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_until_gone, args=(parent.sentinel,), daemon=True).start()


def _until_gone(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


def each(
    executor: Executor, work: Callable[[Item], Result], items: Sequence[Item], *, at_once: int
) -> Iterator[tuple[Item, Result]]:
    """Items with their results as they come. At most `at_once` are handed out, so that an interruption loses little."""
    waiting = list(reversed(items))
    under_way: dict[Future[Result | _Broken], Item] = {}
    while waiting or under_way:
        while waiting and len(under_way) < at_once:
            item = waiting.pop()
            under_way[executor.submit(_held, work, item)] = item
        done = next(as_completed(under_way))
        found = done.result()
        if isinstance(found, _Broken):
            raise found.error()
        yield under_way.pop(done), found


@dataclass(frozen=True)
class _Broken:
    """An error of ours on its way between processes: its class asks for keywords, which pickling cannot give."""

    kind: type[R2S2RError]
    facts: dict[str, str]

    def error(self) -> R2S2RError:
        return self.kind(**self.facts)


def _held(work: Callable[[Item], Result], item: Item) -> Result | _Broken:
    try:
        return work(item)
    except R2S2RError as error:
        names = ("what", "where", "expected", "received", "hint")
        return _Broken(type(error), {name: getattr(error, name) for name in names})


def _dask(spec: str) -> tuple[Executor, Callable[[], object]]:
    try:
        from distributed import Client
    except ImportError as error:
        raise UsageError(
            "dask.distributed is not installed", where="--executor", expected="the extra `cluster`",
            received=str(error), hint=install_extra("cluster"),
        ) from error  # fmt: skip
    address = "tcp://" + spec.removeprefix(DASK)
    try:
        client = Client(address, timeout="10s")
    except (OSError, TimeoutError) as error:
        raise HardwareError(
            "no dask scheduler answers", where="--executor", expected="a scheduler", received=f"{address}: {error}",
            hint="dask scheduler --port 8786",
        ) from error  # fmt: skip
    executor: Executor = client.get_executor()
    return executor, client.close
