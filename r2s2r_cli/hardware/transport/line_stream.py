"""Lines out of a stream of bytes, for the transports that have one."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod

from r2s2r_cli.hardware.transport.base import Message
from r2s2r_cli.hardware.transport.lines import LineBuffer


class LineStream(ABC):
    """The reading half of a transport; where the bytes come from is the heir's."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._lines = LineBuffer()
        self._overlong = 0

    @property
    def overlong(self) -> int:
        """Lines thrown away because they did not end, since this object was made."""
        return self._overlong + self._lines.overlong

    def renew(self) -> None:
        """Forget what was begun on an earlier connection, and go on counting."""
        self._overlong, self._lines = self.overlong, LineBuffer()

    def receive(self, timeout: float) -> Message | None:
        """The next complete line. Raises LinkError where the plug is out, or the other side is gone."""
        end = time.monotonic() + timeout
        while (line := self._lines.take()) is None:
            left = end - time.monotonic()
            data = self._bytes(max(left, 0.0))
            self._lines.feed(data)
            if not data and left <= 0:
                return None
        return Message(line, time.monotonic())

    @abstractmethod
    def _bytes(self, timeout: float) -> bytes:
        """What has arrived, after at most so long [s]; empty: nothing. Raises LinkError."""
