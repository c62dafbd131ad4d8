"""A TCP connection as a stream of lines. (pyserial's socket:// tells only whether one byte waits.)"""

from __future__ import annotations

import contextlib
import select
import socket
import time

from r2s2r_cli.hardware.transport.base import WRITE_TIMEOUT, Address
from r2s2r_cli.hardware.transport.gone import hung_up, no_such_host, not_taken, port_errors
from r2s2r_cli.hardware.transport.line_stream import LineStream
from r2s2r_cli.hardware.transport.name import PortName

CONNECT_TIMEOUT = 3.0
"""[s]"""


class TcpStream(LineStream):
    """Small lines go out at once (no Nagle)."""

    def __init__(self, name: PortName) -> None:
        super().__init__(name.text)
        self._address = (name.host, name.port)
        self._socket: socket.socket | None = None

    def open(self) -> None:
        """Raises LinkError: nobody there, no such host."""
        self.close()
        self.renew()
        with port_errors(self.name, "opening"):
            try:
                self._socket = socket.create_connection(self._address, CONNECT_TIMEOUT)
            except socket.gaierror as error:
                raise no_such_host(self.name, self._address[0]) from error
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._socket.setblocking(False)

    def _bytes(self, timeout: float) -> bytes:
        with port_errors(self.name, "reading"):
            if self._socket is None:
                raise OSError("the connection is not open")
            if not select.select([self._socket], [], [], timeout)[0]:
                return b""
            try:
                data = self._socket.recv(65536)
            except BlockingIOError:
                return b""
            if not data:
                raise hung_up(self.name)
            return data

    def send(self, data: bytes, to: Address | None = None) -> None:
        """Raises LinkError where the robot does not read within the time-out, or is gone."""
        end = time.monotonic() + WRITE_TIMEOUT
        with port_errors(self.name, "writing"):
            if self._socket is None:
                raise OSError("the connection is not open")
            while data:
                with contextlib.suppress(BlockingIOError):
                    data = data[self._socket.send(data) :]
                if data and not select.select([], [self._socket], [], max(0.0, end - time.monotonic()))[1]:
                    raise not_taken(self.name, WRITE_TIMEOUT)

    def close(self) -> None:
        """Never raises."""
        port, self._socket = self._socket, None
        if port is not None:
            with contextlib.suppress(OSError):
                port.close()
