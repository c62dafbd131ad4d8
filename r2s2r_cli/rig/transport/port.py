"""The port as the rig's loop sees it: lines in, lines out, with the faults of the world file between."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from r2s2r_cli.rig.transport.base import LineBuffer, Transport
from r2s2r_cli.rig.transport.faults import Channel
from r2s2r_cli.rig.wire.base import LINE_MAX, DeviceCodec, Line
from r2s2r_cli.rig.world import World

_RAW_LINE = 1 << 16


@dataclass(frozen=True)
class Arrival:
    """What came: a host, a line of it, or that it has gone."""

    kind: Literal["opened", "closed", "line"]
    line: bytes = b""
    board: int | None = None


class Port:
    """A transport, its line buffers, and a channel of faults for each direction. lock: lock-step."""

    def __init__(self, transport: Transport, codec: DeviceCodec, world: World, *, lock: bool) -> None:
        self.transport, self._codec = transport, codec
        seeds = np.random.SeedSequence((world.seed, 0x77697265)).spawn(2)
        self._down, self._up = (
            Channel(world.wire, np.random.default_rng(seed), stream=transport.stream, still=lock) for seed in seeds
        )
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
                for part in (self._raw, self._lines, self._up, self._down):
                    part.clear()
                arrivals.append(Arrival(event.kind))
                continue
            for line in self._raw.feed(event.data) if self.transport.stream else _datagram(event.data):
                safe = self._codec.tick_of(line) is not None
                if safe:
                    arrivals += self.arrived(t)
                    arrivals.append(Arrival("line", line, event.board))
                else:
                    self._down.put(line, event.board, t)
            arrivals += self.arrived(t)
        return arrivals + self.arrived(t)

    def arrived(self, t: float) -> list[Arrival]:
        """What was on its way to us and has got through by now."""
        arrivals = []
        for data, board in self._down.take(t):
            for line in self._lines.feed(data) if self.transport.stream else _datagram(data):
                arrivals.append(Arrival("line", line, board))
        return arrivals

    def send(self, lines: Iterable[Line], t: float) -> None:
        """Put lines on their way."""
        for line in lines:
            data = line.data if self.transport.stream or self._codec.datagrams_end else line.data.rstrip(b"\n")
            if line.safe:
                self.flush(t)
                self.transport.send(self._up.whole(data), line.board)
                self._up.sent(data)
            else:
                self._up.put(data, line.board, t)
        self.flush(t)

    def flush(self, t: float) -> None:
        """Send what is due."""
        for data, board in self._up.take(t):
            self._up.sent(data)
            self.transport.send(data, board or 0)


def _datagram(data: bytes) -> list[bytes]:
    """The lines of one datagram: what is left of it without a newline is a line as well."""
    lines = LineBuffer().feed(data)
    rest = data.rpartition(b"\n")[2]
    return [*lines, rest] if rest and len(rest) <= LINE_MAX else lines
