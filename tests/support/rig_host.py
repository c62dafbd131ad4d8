"""A host that knows nothing but bytes: it opens what the rig prints, over any link. For tests of the rig alone."""

from __future__ import annotations

import binascii
import os
import select
import socket
import time
import tty
from types import TracebackType
from typing import Self

PATIENCE_S = 60.0


def line(body: str) -> bytes:
    """A line of our protocol; the CRC from the standard library, as docs/reference/protocols.md has it."""
    return f"{body}*{binascii.crc_hqx(body.encode(), 0xFFFF):04X}\n".encode()


class RawHost:
    """The other end of a link. `boards`: over UDP, addresses that were heard from."""

    def __init__(self, address: str, port: socket.socket | None = None) -> None:
        """port: the bound UDP socket to which the rig sends."""
        self.boards: dict[tuple[str, int], None] = {}
        self._address = address
        self._socket: socket.socket | None = port
        self._datagrams = port is not None
        self._fd = -1
        self.open()

    def open(self) -> None:
        """Open the link, unless it is."""
        if self._fd >= 0:
            return
        self._rest = b""
        if self._address.startswith("socket://"):
            host, _, number = self._address.removeprefix("socket://").partition(":")
            self._socket = socket.create_connection((host, int(number)))
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if self._socket is not None:
            self._fd = self._socket.fileno()
        else:
            self._fd = os.open(self._address, os.O_RDWR | os.O_NOCTTY)
            tty.setraw(self._fd)

    def send(self, data: bytes, *, everywhere: bool = False) -> None:
        """To the robot; over UDP to the first board that spoke, or to all."""
        if self._datagrams:
            assert self._socket is not None
            for at in list(self.boards)[: None if everywhere else 1]:
                self._socket.sendto(data, at)
        else:
            os.write(self._fd, data)

    def read(self, timeout: float = PATIENCE_S) -> list[bytes]:
        """The lines that come next, without their newlines; none after `timeout`. Raises EOFError at the end."""
        if not select.select([self._fd], [], [], timeout)[0]:
            return []
        if self._datagrams:
            assert self._socket is not None
            data, at = self._socket.recvfrom(4096)
            self.boards[at] = None
            return [data.removesuffix(b"\n")]
        try:
            data = os.read(self._fd, 4096)
        except OSError as error:
            raise EOFError from error
        if not data:
            raise EOFError
        *lines, self._rest = (self._rest + data).split(b"\n")
        return lines

    def until(self, wanted: bytes) -> list[bytes]:
        """All lines up to one that has `wanted` in it."""
        lines: list[bytes] = []
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            lines += self.read(0.2)
            if any(wanted in one for one in lines):
                return lines
        raise AssertionError(f"{wanted!r} never came, only {lines[-5:]}")

    def close(self) -> None:
        """Hang up."""
        if self._fd < 0:
            return
        if self._socket is not None:
            self._socket.close()
        else:
            os.close(self._fd)
        self._fd = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def bound() -> socket.socket:
    """A UDP socket of the host at any free port."""
    port = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    port.bind(("127.0.0.1", 0))
    return port
