"""The rig's loop: what the host sends reaches the motors, what boards measure reaches the host, and time goes on."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from r2s2r_cli.rig.clock import RealClock, TickClock
from r2s2r_cli.rig.transport.port import Arrival, Port
from r2s2r_cli.rig.wire.base import BoardReading, DeviceCodec, Motors
from r2s2r_cli.rig.world import World
from r2s2r_cli.rig.world.faults import LinkGone, LinkStalled

STEP_S = 0.002
"""How long the loop waits for the host at most before it goes on [s] of the wall."""
SUBSTEPS = 5
"""Parts of a tick in lock-step: how finely watchdog and wire see it."""
_ANNOUNCE_S = 0.2
_SILENT_S = 1.0
"""[s] of the wall's clock in which nothing is heard: another host may have come, unseen, as the last one went."""


class Machine(Motors, Protocol):
    """The robot behind the wire: the boards of `r2s2r_cli.rig.firmware.Firmware`."""

    def tick(self, t: float) -> Sequence[BoardReading]:
        """Let the world go on to time t [s]; what the boards measured on the way, in order."""


class Server:
    """One rig. `observe(t)` is called whenever the world has gone on: camera, log of the truth."""

    def __init__(
        self, machine: Machine, codec: DeviceCodec, port: Port, world: World, *, clock: RealClock | TickClock,
        observe: Callable[[float], None] = lambda t: None,
    ) -> None:  # fmt: skip
        self._machine, self._codec, self._port, self._clock = machine, codec, port, clock
        self._observe = observe
        self._gone = [fault for fault in world.faults if isinstance(fault, LinkGone)]
        self._stalled = [fault for fault in world.faults if isinstance(fault, LinkStalled)]
        self._torn = False
        self._announced = self._heard = -np.inf
        self.latest_s = 0.0
        """The longest that the loop was behind the wall's clock [s]."""

    def run(self, stopping: Callable[[], bool]) -> None:
        """Serve until `stopping`. The motors are off after it."""
        try:
            while not stopping():
                if isinstance(self._clock, TickClock):
                    self._turn_in_lock_step(self._clock)
                else:
                    self._turn(self._clock)
        finally:
            self._machine.stop()

    def _turn(self, clock: RealClock) -> None:
        began = clock.t
        if self._cut_off(began):
            time.sleep(STEP_S)
        else:
            self._hear(self._port.poll(STEP_S, began), clock.t)
        t = clock.t
        self._go_on(t)
        self.latest_s = max(self.latest_s, t - began)

    def _turn_in_lock_step(self, clock: TickClock) -> None:
        if self._cut_off(clock.t):
            # No host can ask for a tick now, and yet the watchdog must run out.
            time.sleep(clock.tick)
            self._pass(clock)
            return
        arrivals = self._in_order(clock.t)
        with self._port.together():
            for arrival in arrivals:
                if arrival.kind == "opened":
                    clock.contact()
                    self._announced = -np.inf
                k = self._obey(arrival, clock.t)
                if k is not None:
                    self._tick(clock, k, arrival.board or 0)
        now = time.monotonic()
        if arrivals:
            self._heard = now
        stream = self._port.transport.stream
        waited_for = not clock.started or (stream and now - self._heard >= _SILENT_S)
        if self._port.transport.connected and waited_for and now - self._announced >= _ANNOUNCE_S:
            self._announced = now
            lines = self._codec.announce(clock.us, clock.t, first=not stream)
            self._port.send(lines, clock.t)

    def _in_order(self, t: float) -> list[Arrival]:
        """What came, ticks after the commands that were sent before them."""
        arrivals = self._port.poll(_ANNOUNCE_S / 2, t)
        ticks = [one for one in arrivals if one.kind == "line" and self._codec.tick_of(one.line) is not None]
        if self._port.transport.stream or not ticks:
            return arrivals
        # Each board has a socket: the tick at one may have been read before the commands at the others.
        others = [one for one in arrivals if one not in ticks] + self._port.poll(0.0, t)
        return [*others, *ticks]

    def _tick(self, clock: TickClock, k: int, board: int) -> None:
        advance = clock.asked(k)
        if advance is None:
            return
        if advance:
            self._pass(clock)
        if not self._cut_off(clock.t):
            self._port.send([self._codec.ticked(k, clock.t, board)], clock.t)

    def _pass(self, clock: TickClock) -> None:
        """One tick passes."""
        start = clock.t
        for part in range(1, SUBSTEPS + 1):
            t = start + clock.tick * part / SUBSTEPS
            self._go_on(t)
            self._hear(self._port.arrived(t), t)
        clock.advance()

    def _cut_off(self, t: float) -> bool:
        """Whether the link is torn or stalled; tears and mends it when its time has come."""
        gone = any(fault.on(t) for fault in self._gone)
        if gone and not self._torn:
            self._codec.closed(t)
            self._port.transport.drop()
        elif self._torn and not gone:
            self._port.transport.restore()
        self._torn = gone
        return gone or any(fault.on(t) for fault in self._stalled)

    def _hear(self, arrivals: Sequence[Arrival], t: float) -> None:
        for arrival in arrivals:
            self._obey(arrival, t)

    def _obey(self, arrival: Arrival, t: float) -> int | None:
        """The tick that is asked for, if it is that."""
        if arrival.kind == "opened":
            self._codec.opened(t)
        elif arrival.kind == "closed":
            self._codec.closed(t)
        else:
            received = self._codec.receive(arrival.line, arrival.board, t)
            self._port.send(received.lines, t)
            return received.tick
        return None

    def _go_on(self, t: float) -> None:
        """Watchdog, boards, and what they send, up to time t."""
        lines = self._codec.advance(t)
        for reading in self._machine.tick(t):
            lines += self._codec.sample(reading, t)
        self._observe(t)
        if not self._cut_off(t):
            self._port.send(lines, t)
