"""What a transport is, and the line buffer that all of them have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

from r2s2r_cli.rig.wire.base import LINE_MAX


@dataclass(frozen=True)
class Event:
    """Something that happened at the port. board: at which board, None: at all of them (byte streams)."""

    kind: Literal["opened", "closed", "bytes"]
    data: bytes = b""
    board: int | None = None


class Transport(Protocol):
    """The device's end of a link."""

    @property
    def address(self) -> str:
        """What a host is given to connect to."""

    @property
    def stream(self) -> bool:
        """Bytes in a row, not datagrams."""

    @property
    def connected(self) -> bool:
        """There is a host, as far as one can tell; always for datagrams."""

    def poll(self, timeout: float) -> list[Event]:
        """What happened; waits up to `timeout` [s] for the first thing. Never raises for what a host does."""

    def send(self, data: bytes, board: int) -> None:
        """Send as far as there is room; what a host does not read in time is lost, as at a real port."""

    def drop(self) -> None:
        """The link is torn off: closed, and from now on refused."""

    def restore(self) -> None:
        """It is there again, at the same address where that can be had."""

    def close(self) -> None:
        """Release the port."""


class LineBuffer:
    """Bytes in, whole lines out, newline included. A line beyond the limit is thrown away up to its newline."""

    def __init__(self, limit: int = LINE_MAX) -> None:
        self._limit = limit
        self._kept = bytearray()
        self._skipping = False
        self.too_long = 0

    def feed(self, data: bytes) -> list[bytes]:
        """The lines that these bytes complete."""
        lines = []
        for piece in _pieces(data):
            ended = piece.endswith(b"\n")
            if not self._skipping:
                self._kept += piece
                if len(self._kept) > self._limit:
                    self._skipping = True
                    self.too_long += 1
                elif ended:
                    lines.append(bytes(self._kept))
            if ended or self._skipping:
                self._kept.clear()
            if ended:
                self._skipping = False
        return lines

    def clear(self) -> None:
        """Forget an unfinished line."""
        self._kept.clear()
        self._skipping = False


def _pieces(data: bytes) -> list[bytes]:
    """The data cut after each newline, and nowhere else."""
    cut = data.split(b"\n")
    return [part + b"\n" for part in cut[:-1]] + ([cut[-1]] if cut[-1] else [])
