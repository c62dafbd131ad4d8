"""Bytes that wait until the host reads: bounded, and only whole lines are lost."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

ROOM = 65536
"""Bytes that may wait; a port of a microcontroller has far less."""


class Outbox:
    """What could not be sent yet. `lost`: lines that found no room."""

    def __init__(self, room: int = ROOM) -> None:
        self._room, self._size = room, 0
        self._waiting: deque[bytes] = deque()
        self.lost = 0

    def __len__(self) -> int:
        return self._size

    def put(self, data: bytes) -> None:
        """Queue a line, or lose it."""
        if self._size + len(data) > self._room:
            self.lost += 1
            return
        self._waiting.append(data)
        self._size += len(data)

    def flush(self, write: Callable[[bytes], int]) -> None:
        """Write as much as goes. `write` returns how many bytes it took; BlockingIOError: none for now."""
        while self._waiting:
            data = self._waiting[0]
            try:
                taken = write(data)
            except BlockingIOError:
                return
            self._size -= taken
            if taken < len(data):
                self._waiting[0] = data[taken:]
                return
            self._waiting.popleft()

    def clear(self) -> None:
        """Forget everything."""
        self._waiting.clear()
        self._size = 0
