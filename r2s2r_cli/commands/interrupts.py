"""Ctrl-C between pictures, not inside one, and what it leaves behind."""

from __future__ import annotations

import contextlib
import importlib
import shlex
import signal
import threading
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from r2s2r_cli.errors import Interrupted, NumericalError, R2S2RError
from r2s2r_cli.store.checkpoint import begin_anew, command_of, failed_of

Item = TypeVar("Item")


class Kept(Protocol):
    """A checkpoint."""

    @property
    def path(self) -> Path:
        """Where it lies."""
        ...

    def kept(self) -> bool:
        """Whether work of this very request lies there."""


def whole_items(items: Iterable[Item]) -> Iterator[Item]:
    """The same items; an interrupt while one is made waits until it is there, then raises KeyboardInterrupt.

    The drawing libraries are C++ that aborts the process where a Python exception comes out of the blue.
    """
    iterator = iter(items)
    done = object()
    while True:
        with _deferred():
            item = next(iterator, done)
        if item is done:
            return
        yield item  # type: ignore[misc]


def loaded(stage: str) -> Any:
    """Module `stage`, with the engine's libraries: compiled modules do not take an exception out of the blue while
    they load."""

    def made() -> Iterator[Any]:
        importlib.import_module("r2s2r_cli.engine")  # torch, roma, llvmlite
        yield importlib.import_module(stage)

    (found,) = whole_items(made())
    return found


@contextlib.contextmanager
def resumable(checkpoint: Kept, where: str, command: Sequence[str], *, done: str = "fitted") -> Iterator[None]:
    """Work that leaves a checkpoint (`where`, for people) when it is interrupted: raises Interrupted with `command` and
    --resume as its hint; KeyboardInterrupt as it came where nothing was kept yet. What another request left stays until
    this one has something to keep in its place: where it never had, that is said, since `status` still offers it.

    After a failure that comes again whatever is resumed nothing is left to go on from: of numbers that went wrong
    nothing, of a bug a file under another name, which a mended r2s2r may go on with. What the disk or the memory
    refused, and what was wrong before the work began, is tried again from where it was."""
    try:
        yield
    except NumericalError:
        if checkpoint.kept():
            checkpoint.path.unlink(missing_ok=True)
        raise
    except KeyboardInterrupt:
        if not checkpoint.kept():
            left = command_of(checkpoint.path)
            if left is None:
                raise
            raise Interrupted(
                f"nothing was {done} yet; {where} is still what another request left: {begin_anew(left)}",
                hint=begin_anew(command),
            ) from None
        raise Interrupted(
            f"what was {done} so far is kept in {where}, nothing else was written",
            hint=shlex.join(["r2s2r", *command, "--resume"]),
        ) from None
    except (R2S2RError, OSError, MemoryError):
        raise
    except Exception as error:
        if checkpoint.kept():
            aside = failed_of(checkpoint.path)
            checkpoint.path.replace(aside)
            error.add_note(f"what was {done} so far is kept as {Path(where).with_name(aside.name)}")
        raise


@contextlib.contextmanager
def _deferred() -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():  # only the main thread may set handlers
        yield
        return
    pending: list[int] = []
    previous = signal.signal(signal.SIGINT, lambda number, _: pending.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
    if pending:
        raise KeyboardInterrupt
