"""A UDP address of ours, to which the boards of a robot send. A datagram is a line."""

from __future__ import annotations

import contextlib
import errno
import select
import socket
import time

from r2s2r_cli.hardware.transport.base import WRITE_TIMEOUT, Address, Message
from r2s2r_cli.hardware.transport.gone import not_taken, port_errors
from r2s2r_cli.hardware.transport.lines import MOST
from r2s2r_cli.hardware.transport.name import PortName


class UdpSocket:
    """Bound when opened. Where to send is known once the boards have spoken."""

    def __init__(self, name: PortName) -> None:
        self.name = name.text
        self.overlong = 0
        self._address = (name.host, name.port)
        self._socket: socket.socket | None = None

    def open(self) -> None:
        """Raises LinkError: an address that is taken, or not ours."""
        self.close()
        with port_errors(self.name, "opening"):
            family = socket.AF_INET6 if ":" in self._address[0] else socket.AF_INET
            self._socket = socket.socket(family, socket.SOCK_DGRAM)
            try:
                self._socket.bind(self._address)
            except OSError as error:
                self.close()
                if isinstance(error, socket.gaierror):  # its number is none of the operating system's
                    raise OSError(errno.EADDRNOTAVAIL, "no such host") from error
                raise
            self._socket.setblocking(False)

    def receive(self, timeout: float) -> Message | None:
        """The next datagram. Raises LinkError where the socket is closed."""
        end = time.monotonic() + timeout
        with port_errors(self.name, "reading"):
            while True:
                if self._socket is None:
                    raise OSError("the socket is not open")
                left = max(0.0, end - time.monotonic())
                if not select.select([self._socket], [], [], left)[0]:
                    return None
                try:
                    data, source = self._socket.recvfrom(65536)
                except (BlockingIOError, ConnectionRefusedError):
                    continue  # damaged, or the echo of one of ours that nobody wanted: silence tells the rest
                if len(data) > MOST:
                    self.overlong += 1
                    continue
                return Message(data.removesuffix(b"\n"), time.monotonic(), (source[0], source[1]))

    def send(self, data: bytes, to: Address | None = None) -> None:
        """To a board's address; nothing where none is known yet. Raises LinkError."""
        if to is None:
            return
        with port_errors(self.name, "writing"):
            if self._socket is None:
                raise OSError("the socket is not open")
            with contextlib.suppress(ConnectionRefusedError):  # of a datagram before this one
                try:
                    self._socket.sendto(data, to)
                except BlockingIOError:
                    if not select.select([], [self._socket], [], WRITE_TIMEOUT)[1]:
                        raise not_taken(self.name, WRITE_TIMEOUT) from None
                    self._socket.sendto(data, to)

    def close(self) -> None:
        """Never raises."""
        port, self._socket = self._socket, None
        if port is not None:
            with contextlib.suppress(OSError):
                port.close()
