"""UDP as the authors have it: every board has a socket of its own and sends to the fixed address of the host."""

from __future__ import annotations

import contextlib
import select
import socket
import time

from r2s2r_cli.errors import HardwareError
from r2s2r_cli.rig.transport.base import Event
from r2s2r_cli.rig.transport.host import ipv4_of

PORT = 2390
"""Where the authors' boards send to."""
_CHUNK = 2048
_BURST = 64
"""Datagrams that are read of one board before another has its turn."""


class UdpTransport:
    """One socket a board, or one for all (`shared`). A datagram is sent or lost; there is no connection."""

    stream = False
    connected = True

    def __init__(self, host: str = "127.0.0.1", port: int = PORT, *, boards: int = 1, shared: bool = False) -> None:
        self._to = (ipv4_of(host, "udp"), port or PORT)
        self.address = f"udp://{host}:{self._to[1]}"
        self._shared, self._boards = shared, 1 if shared else boards
        self._sockets = self._open()
        self._gone = False

    def poll(self, timeout: float) -> list[Event]:
        """Datagrams, each ended by a newline whether it came with one or not."""
        if self._gone:
            time.sleep(timeout)
            return []
        readable, _, _ = select.select(self._sockets, [], [], timeout)
        events = []
        for one in readable:
            board = None if self._shared else self._sockets.index(one)
            for _ in range(_BURST):
                try:
                    data = one.recv(_CHUNK)
                except OSError:
                    break
                events.append(Event("bytes", data, board))
        return events

    def send(self, data: bytes, board: int) -> None:
        """A datagram from that board's socket."""
        if not self._gone:
            with contextlib.suppress(OSError):  # as lost as any other datagram
                self._sockets[0 if self._shared else board].sendto(data, self._to)

    def drop(self) -> None:
        """Silence."""
        self.close()

    def restore(self) -> None:
        """Other sockets, as after a restart of the boards."""
        if self._gone:
            self._sockets, self._gone = self._open(), False

    def close(self) -> None:
        """Release the sockets."""
        self._gone = True
        for one in self._sockets:
            one.close()

    def _open(self) -> list[socket.socket]:
        sockets: list[socket.socket] = []
        # On the loopback alone where the host is: nobody else shall drive the rig.
        own = "127.0.0.1" if self._to[0].startswith("127.") else "0.0.0.0"
        try:
            for _ in range(self._boards):
                sockets.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
                sockets[-1].bind((own, 0))
                sockets[-1].setblocking(False)
        except OSError as error:
            for one in sockets:
                one.close()
            raise HardwareError(
                "no socket can be opened", where=self.address, expected="a free UDP port",
                received=error.strerror or str(error), hint="r2s2r rig --link tcp",
            ) from error  # fmt: skip
        return sockets
