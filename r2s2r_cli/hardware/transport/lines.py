"""Lines from a stream of bytes: complete ones only, however the bytes are cut."""

from __future__ import annotations

from collections import deque

MOST = 512
"""Bytes of a line, newline included, in every protocol."""


class LineBuffer:
    """Feed it bytes, take lines. What stands before the first newline is a part of a line and thrown away.

    overlong: how often more than MOST bytes came without a newline; they are thrown away up to the next one.
    """

    def __init__(self) -> None:
        self.overlong = 0
        self._rest = b""
        self._skip = True
        self._lines: deque[bytes] = deque()

    def feed(self, data: bytes) -> None:
        """More bytes, in order."""
        *complete, rest = (self._rest + data).split(b"\n")
        for line in complete:
            if self._skip:
                self._skip = False
            elif len(line) >= MOST:
                self.overlong += 1
            else:
                self._lines.append(line)
        if len(rest) >= MOST:
            self.overlong += not self._skip
            self._skip, rest = True, b""
        self._rest = rest

    def take(self) -> bytes | None:
        """The oldest line not yet taken, without its newline; None where there is none."""
        return self._lines.popleft() if self._lines else None
