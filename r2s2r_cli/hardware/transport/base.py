"""What a port gives and takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

Address = tuple[str, int]
WRITE_TIMEOUT = 0.2
"""[s] after which a robot that does not read is gone: within the 250 ms after which a device stops by itself."""


@dataclass(frozen=True)
class Message:
    """A line without its newline, or a datagram. t: its arrival [s], `time.monotonic`. source: None on a stream."""

    line: bytes
    t: float
    source: Address | None = None


class Transport(Protocol):
    """One port. Every failure is a LinkError that names the port; nothing else comes out of any method.

    name: as the user gave it.
    """

    name: str

    @property
    def overlong(self) -> int:
        """Lines thrown away so far."""
        ...

    def open(self) -> None:
        """Open it, and forget what had been buffered. Raises LinkError."""
        ...

    def receive(self, timeout: float) -> Message | None:
        """The next line; None where none was complete within `timeout` [s]. Raises LinkError where the port is gone."""
        ...

    def send(self, data: bytes, to: Address | None = None) -> None:
        """All of `data`, within WRITE_TIMEOUT. to: on a port without connections, where to. Raises LinkError."""
        ...

    def close(self) -> None:
        """Never raises; may be called repeatedly."""
        ...
