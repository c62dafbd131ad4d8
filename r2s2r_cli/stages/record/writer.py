"""Rows on their way to the disk: a thread of its own, so that a slow disk does not hold up the control loop."""

from __future__ import annotations

import queue
import threading
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Protocol, Self

from r2s2r_cli.errors import HardwareError, R2S2RError

MAX_ROWS = 4000
"""Rows that may wait: about 20 s of a run without camera; half a minute of a disk that stands still is too long."""
MAX_PICTURES_BYTES = 256 << 20
"""Encoded pictures that may wait: some 400 frames."""
PATIENCE_S = 60.0
"""For which a robot in lock-step waits for a disk that takes nothing, before that is an error."""


class Sink(Protocol):
    """Takes the rows of a recording: `store.journal.Journal.append`."""

    def __call__(self, stream: str, row: Mapping[str, Any]) -> None:
        """One row of a stream of `layout`. Raises ArtifactError on a full disk."""


class Writer:
    """Takes rows from any thread, in order of each thread, and hands them to the sink in one thread.

    Used as a context manager: its end waits until every row is with the sink. lossless: a full queue holds the sender
    up (a robot in lock-step waits); else it is an error, since a robot that moves does not wait.
    """

    def __init__(self, sink: Sink, *, lossless: bool = False) -> None:
        self._sink = sink
        self._lossless = lossless
        self._rows: queue.Queue[tuple[str, Mapping[str, Any]] | None] = queue.Queue(MAX_ROWS)
        self._waiting_bytes = 0
        self._lock = threading.Lock()
        self._error: BaseException | None = None
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work, name="record-writer", daemon=True)

    def put(self, stream: str, row: Mapping[str, Any]) -> None:
        """A row for the sink. Raises HardwareError where the disk takes no more, or is too slow."""
        self.check()
        with self._lock:
            self._waiting_bytes += _size(row)
            too_much = self._waiting_bytes > MAX_PICTURES_BYTES and not self._lossless
        try:
            self._rows.put((stream, row), block=self._lossless, timeout=PATIENCE_S if self._lossless else None)
        except queue.Full:
            too_much = True
        if too_much:
            raise HardwareError(
                "the disk is too slow for this recording, the motors were stopped",
                where=f"{self._rows.qsize()} rows wait",
                expected=f"at most {MAX_ROWS} rows and {MAX_PICTURES_BYTES >> 20} MB of pictures in memory",
                received="more", hint="record to a local disk, or without --camera",
            )  # fmt: skip

    def check(self) -> None:
        """Raises HardwareError where the disk refused a row."""
        error = self._error
        if error is None:
            return
        if not isinstance(error, R2S2RError):
            raise error  # a bug
        raise HardwareError(
            "the recording cannot be written, the motors were stopped", where=error.where,
            expected="room for the next row", received=error.what, hint=error.hint,
        ) from error  # fmt: skip

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._drain()
        except KeyboardInterrupt:  # what was received is written down all the same; who presses again insists
            if isinstance(error, KeyboardInterrupt):
                raise
            self._drain()
            if error is None:
                raise
        if error is None:
            self.check()

    def _drain(self) -> None:
        while not self._ended.is_set():  # a dead writer empties no queue
            try:
                self._rows.put(None, timeout=0.2)
                break
            except queue.Full:
                continue
        while not self._ended.wait(1.0):  # a `join` that was interrupted once takes the thread for ended
            pass

    def _work(self) -> None:
        try:
            self._write()
        finally:
            self._ended.set()

    def _write(self) -> None:
        while (item := self._rows.get()) is not None:
            stream, row = item
            if self._error is None:  # after a refusal the rest is only taken off: nobody must wait for room
                try:
                    self._sink(stream, row)
                except BaseException as error:  # for the thread that reads the robot
                    self._error = error
            with self._lock:
                self._waiting_bytes -= _size(row)


def _size(row: Mapping[str, Any]) -> int:
    return sum(len(value) for value in row.values() if isinstance(value, bytes))
