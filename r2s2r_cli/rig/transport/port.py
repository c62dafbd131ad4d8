"""The port as the rig's loop sees it: lines in, lines out, with the faults of the world file between."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

import numpy as np

from r2s2r_cli.rig.transport.base import LineBuffer, Transport
from r2s2r_cli.rig.transport.faults import Channel
from r2s2r_cli.rig.wire.base import LINE_MAX, DeviceCodec, Line
from r2s2r_cli.rig.world import World

_RAW_LINE = 1 << 16
_TAG = 0x77697265
"""Makes the random numbers of the wire others than those of anything else with the same seed."""


@dataclass(frozen=True)
class Arrival:
    """What came: a host, a line of it, or that it has gone."""

    kind: Literal["opened", "closed", "line"]
    line: bytes = b""
    board: int | None = None


class Port:
    """A transport, its line buffer, and channels of faults: one for each direction, over datagrams for each board too.

    lock: lock-step.
    """

    def __init__(self, transport: Transport, codec: DeviceCodec, world: World, *, lock: bool) -> None:
        self.transport, self._codec, self._world, self._lock = transport, codec, world, lock
        self._down: dict[int, Channel] = {}
        self._up: dict[int, Channel] = {}
        self._gathered: list[bytes] | None = None
        self._raw, self._lines = LineBuffer(_RAW_LINE), LineBuffer()

    @property
    def too_long(self) -> int:
        """Lines that had no end."""
        return self._raw.too_long + self._lines.too_long

    def poll(self, timeout: float, t: float) -> list[Arrival]:
        """What came and has got through by time t [s]; waits up to `timeout` [s] of the wall for the first thing."""
        arrivals: list[Arrival] = []
        for event in self.transport.poll(timeout):
            if event.kind != "bytes":
                self.clear()
                arrivals.append(Arrival(event.kind))
                continue
            for line in self._raw.feed(event.data) if self.transport.stream else _datagram(event.data):
                if self._codec.untouched(line):
                    arrivals += self.arrived(t)
                    arrivals.append(Arrival("line", line, event.board))
                else:
                    self._channel(self._down, event.board).put(line, event.board, t)
        return arrivals + self.arrived(t)

    def arrived(self, t: float) -> list[Arrival]:
        """What was on its way to us and has got through by now."""
        arrivals = []
        for channel in self._down.values():
            for data, board in channel.take(t):
                for line in self._lines.feed(data) if self.transport.stream else _datagram(data):
                    arrivals.append(Arrival("line", line, board))
        return arrivals

    def send(self, lines: Iterable[Line], t: float) -> None:
        """Put lines on their way."""
        for line in lines:
            channel = self._channel(self._up, line.board)
            data = line.data if self.transport.stream or self._codec.datagrams_end else line.data.rstrip(b"\n")
            if line.safe:
                self.flush(t)
                self._out(channel.whole(data), line.board)
                channel.sent(data)
            else:
                channel.put(data, line.board, t)
        self.flush(t)

    def flush(self, t: float) -> None:
        """Send what is due."""
        for channel in self._up.values():
            for data, board in channel.take(t):
                channel.sent(data)
                self._out(data, board or 0)

    @contextmanager
    def together(self) -> Iterator[None]:
        """What is sent meanwhile goes out at its end: over a stream in one piece, which is faster than line by line."""
        self._gathered = [] if self.transport.stream else None
        try:
            yield
        finally:
            gathered, self._gathered = self._gathered, None
            if gathered:
                self.transport.send(b"".join(gathered), 0)

    def clear(self) -> None:
        """Another host, or none: what was on its way is lost."""
        for buffer in (self._raw, self._lines):
            buffer.clear()
        for channel in (*self._up.values(), *self._down.values()):
            channel.clear()

    def _out(self, data: bytes, board: int) -> None:
        if self._gathered is None:
            self.transport.send(data, board)
        else:
            self._gathered.append(data)

    def _channel(self, direction: dict[int, Channel], board: int | None) -> Channel:
        """The channel of a board: of its own over datagrams, that of all over a stream."""
        stream = self.transport.stream
        key = 0 if stream or board is None else board
        if key not in direction:
            # Each has its own numbers, so that it does not matter which board is heard first.
            seed = (self._world.seed, _TAG, int(direction is self._up), key)
            rng = np.random.default_rng(seed)
            direction[key] = Channel(self._world.wire, rng, stream=stream, still=self._lock)
        return direction[key]


def _datagram(data: bytes) -> list[bytes]:
    """The lines of one datagram: what is left of it without a newline is a line as well."""
    lines = LineBuffer().feed(data)
    rest = data.rpartition(b"\n")[2]
    return [*lines, rest] if rest and len(rest) <= LINE_MAX else lines
