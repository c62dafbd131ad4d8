"""One host that watches: a socket, a thread that writes to it, and the frames that wait."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections import deque
from collections.abc import Sequence

WAITING = 2
"""Frames that wait for a slow host in real time; older ones are dropped, as a camera's driver does."""
WAITING_LOSSLESS = 8
PATIENCE_S = 5.0
"""How long a lossless stream waits for its host before it drops a frame after all."""
_BUFFER_BYTES = 4 << 20

Pieces = Sequence[bytes | memoryview]


class Client:
    """Frames go in by `put` and out to the host in a thread of its own, so that a host that stops reading stops
    nothing else."""

    def __init__(self, connection: socket.socket, greeting: bytes, *, lossless: bool) -> None:
        self._connection, self._lossless = connection, lossless
        self._queue: deque[Pieces] = deque()
        self._changed = threading.Condition()
        self._open = True
        self.dropped = 0
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._queue.append([greeting])
        self._thread = threading.Thread(target=self._write, name="camera-client", daemon=True)
        self._thread.start()

    @property
    def open(self) -> bool:
        """Whether the host is still there."""
        return self._open

    def put(self, pieces: Pieces) -> None:
        """Queue a message. Real time: the oldest waiting one goes where there is no room. Lossless: waits for room."""
        with self._changed:
            if self._lossless:
                free = self._changed.wait_for(
                    lambda: not self._open or len(self._queue) < WAITING_LOSSLESS, timeout=PATIENCE_S
                )
                self.dropped += not free
                if not free:
                    return
            while not self._lossless and len(self._queue) >= WAITING:
                self._queue.popleft()
                self.dropped += 1
            self._queue.append(pieces)
            self._changed.notify_all()

    def hint(self, message: bytes) -> None:
        """Queue a small message if nothing else waits; never blocks."""
        with self._changed:
            if self._open and not self._queue:
                self._queue.append([message])
                self._changed.notify_all()

    def close(self) -> None:
        """End the connection at once; what waits is not sent."""
        with self._changed:
            self._open = False
            self._queue.clear()
            self._changed.notify_all()
        with contextlib.suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)
        self._connection.close()
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=PATIENCE_S)

    def _write(self) -> None:
        try:
            while True:
                with self._changed:
                    self._changed.wait_for(lambda: self._queue or not self._open)
                    if not self._open:
                        return
                    pieces = self._queue.popleft()
                    self._changed.notify_all()
                for piece in pieces:
                    self._connection.sendall(piece)
        except OSError:
            with self._changed:
                self._open = False
                self._changed.notify_all()
        finally:
            self._connection.close()
