"""An HDF5 file that is written through Python, so that a full disk or Ctrl-C cannot crash the HDF5 library.

HDF5 2.0 does not survive a failed write: it cannot close the file any more, and takes the process down with a
segmentation fault at exit. Here no write ever fails from its point of view: the first failure is kept, what follows
goes to memory, and a check between blocks raises it.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import h5py


class Sink:
    """The file below HDF5. Its methods are those that h5py's file-object driver calls, none of which raises."""

    def __init__(self, path: Path) -> None:
        """Open `path` for reading and writing; it is created where it is not there. Raises OSError."""
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        self._size = os.fstat(self._descriptor).st_size
        self._position = 0
        self._unwritten: list[tuple[int, bytes]] = []
        self.failure: OSError | None = None

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move; the end of the file counts what could not be written."""
        self._position = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._size}[whence] + offset
        return self._position

    def tell(self) -> int:
        """Offset of the next byte."""
        return self._position

    def write(self, data: Any) -> int:
        """Write all of `data`, to memory once the file has refused some."""
        view = memoryview(data).cast("B")
        start, self._position = self._position, self._position + len(view)
        self._size = max(self._size, self._position)
        if self.failure is None:
            try:
                done = 0
                while done < len(view):
                    done += os.pwrite(self._descriptor, view[done:], start + done)
                return len(view)
            except OSError as error:
                self.failure = error
        self._unwritten.append((start, bytes(view)))
        return len(view)

    def readinto(self, buffer: Any) -> int:
        """Fill `buffer`, with what stands in memory over what stands in the file, zeros beyond its end."""
        view = memoryview(buffer).cast("B")
        start, stop = self._position, self._position + len(view)
        done = 0
        try:
            while done < len(view) and (count := os.preadv(self._descriptor, [view[done:]], start + done)):
                done += count
        except OSError as error:
            self.failure = self.failure or error
        view[done:] = bytes(len(view) - done)
        for offset, data in self._unwritten:
            low, high = max(start, offset), min(stop, offset + len(data))
            if low < high:
                view[low - start : high - start] = data[low - offset : high - offset]
        self._position = stop
        return len(view)

    def read(self, size: int = -1) -> bytes:
        """The next `size` bytes, all to the end by default (h5py knows a file object by this method)."""
        buffer = bytearray(max(0, self._size - self._position) if size < 0 else size)
        self.readinto(buffer)
        return bytes(buffer)

    def truncate(self, size: int | None = None) -> int:
        """Set the length."""
        self._size = self._position if size is None else size
        if self.failure is None:
            try:
                os.ftruncate(self._descriptor, self._size)
            except OSError as error:
                self.failure = error
        return self._size

    def flush(self) -> None:
        """Nothing is buffered here."""

    def close(self) -> None:
        """Close the file below."""
        os.close(self._descriptor)


@contextlib.contextmanager
def writable(path: Path, mode: str, **options: Any) -> Iterator[tuple[h5py.File, Callable[[], None]]]:
    """An HDF5 file open for writing (`w` or `r+`), and a check to call after every block.

    The check, and the end of the block, raise OSError where the disk refused something, and KeyboardInterrupt where
    Ctrl-C was pressed: an exception inside a callback of HDF5 would leave it in a state that it cannot close.
    """
    with _deferred_interrupt() as interrupted:
        sink = Sink(path)

        def check() -> None:
            if sink.failure is not None:
                raise sink.failure
            if interrupted:
                raise KeyboardInterrupt

        try:
            with h5py.File(sink, mode, **options) as file:
                yield file, check
            check()
        finally:
            sink.close()


@contextlib.contextmanager
def _deferred_interrupt() -> Iterator[list[int]]:
    """A list that a Ctrl-C is put into instead of being raised. Signals reach the main thread only."""
    interrupted: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield interrupted
        return

    def remember(number: int, frame: FrameType | None) -> None:
        del frame
        interrupted.append(number)

    before = signal.signal(signal.SIGINT, remember)
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)
