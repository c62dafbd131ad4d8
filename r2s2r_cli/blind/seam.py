"""Many independent pieces of work through one seam in the manner of `concurrent.futures.Executor`.

`open_executor("local", 2)` gives processes of this machine; `dask://host:port` the workers of a dask.distributed
scheduler (extra `cluster`), where the same package is installed and the same folders are mounted.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import TypeVar

from r2s2r_cli.errors import HardwareError, R2S2RError, UsageError, install_extra
from r2s2r_cli.stopping import POLITE

LOCAL, DASK = "local", "dask://"
WHOLE = threading.Lock()
"""Held while a file is written and named: a worker ends before or after that, never in between."""
Item = TypeVar("Item")
Result = TypeVar("Result")


@contextmanager
def open_executor(spec: str, workers: int) -> Iterator[Executor]:
    """An executor, shut down at the end; where an exception leaves the block, an interrupt for instance, what has not
    begun is given up, and what is under way on this machine is ended at once.

    Raises UsageError for another kind of address or where dask is not installed, HardwareError where no scheduler
    answers.
    """
    if spec == LOCAL:
        # Fresh interpreters: nothing of this process (loaded modules, threads of torch) goes along.
        fresh = multiprocessing.get_context("spawn")
        # A pipe on which nothing is sent: its end closes with this process, and is closed where work is given up.
        heard, said = fresh.Pipe(duplex=False)
        executor: Executor = ProcessPoolExecutor(workers, mp_context=fresh, initializer=_listen, initargs=(heard,))
        own, close = True, said.close
    elif spec.startswith(DASK):
        own, (executor, close) = False, _dask(spec)
    else:
        raise UsageError(
            "there is no such executor", where="--executor", expected="local, or dask://host:port", received=spec,
            hint="r2s2r blind run bank --executor local",
        )  # fmt: skip
    try:
        yield executor
    except BaseException:
        if own:
            close()
        executor.shutdown(wait=own, cancel_futures=True)
        raise
    else:
        executor.shutdown()
    finally:
        close()


def _listen(heard: Connection) -> None:
    """In a worker: nobody waits for what it computes once who asked for it has given it up, or is gone, killed for
    instance."""
    # The pool sends SIGTERM to all workers as soon as one has ended, a closed terminal SIGHUP: to one that writes a
    # file, too.
    for number in POLITE:
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_until_closed, args=(heard,), daemon=True).start()


def _until_closed(heard: Connection) -> None:
    wait([heard])
    with WHOLE:
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
            with _deaf():
                under_way[executor.submit(_held, work, item)] = item
        done = next(as_completed(under_way))
        found = done.result()
        if isinstance(found, _Broken):
            raise found.error()
        yield under_way.pop(done), found


@contextmanager
def _deaf() -> Iterator[None]:
    """Processes that begin meanwhile never hear Ctrl-C, which a terminal sends to all of them: who asked them ends
    them, and they would say where they were. This one hears it afterwards."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


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
        return _Broken(type(error), error.facts)


def _dask(spec: str) -> tuple[Executor, Callable[[], None]]:
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
