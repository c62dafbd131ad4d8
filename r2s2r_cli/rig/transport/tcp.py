"""TCP: one host at a time; another one is turned away while the first is there."""

from __future__ import annotations

import contextlib
import select
import socket
import time

from r2s2r_cli.errors import HardwareError
from r2s2r_cli.rig.transport.base import Event
from r2s2r_cli.rig.transport.host import ipv4_of
from r2s2r_cli.rig.transport.outbox import Outbox

_CHUNK = 4096


class TcpTransport:
    """A listening socket and its one host."""

    stream = True

    def __init__(self, host: str = "127.0.0.1", port: int = 0) -> None:
        self._listen = _listening(host, port)
        self._at: tuple[str, int] = (host, self._listen.getsockname()[1])
        self.address = f"socket://{host}:{self._at[1]}"
        self._peer: socket.socket | None = None
        self._outbox = Outbox()
        self._gone = False

    @property
    def connected(self) -> bool:
        """A host is there."""
        return self._peer is not None

    def poll(self, timeout: float) -> list[Event]:
        """Opened, bytes, closed."""
        if self._gone:
            time.sleep(timeout)
            return []
        sockets = [self._listen] + ([self._peer] if self._peer else [])
        writing = [self._peer] if self._peer and len(self._outbox) else []
        readable, writable, _ = select.select(sockets, writing, [], timeout)
        events = []
        if self._peer in writable:
            events += self._flush()
        if self._peer is not None and self._peer in readable:
            events += self._read(self._peer)
        if self._listen in readable:
            events += self._accept()
        return events

    def send(self, data: bytes, board: int) -> None:
        """To the host, if there is one."""
        if self._peer is not None:
            self._outbox.put(data)
            with contextlib.suppress(OSError):  # the next poll reads that it has gone
                self._outbox.flush(self._peer.send)

    def drop(self) -> None:
        """Nobody is let in any more."""
        self.close()

    def restore(self) -> None:
        """Listen at the same port again."""
        if self._gone:
            self._listen = _listening(*self._at)
            self._gone = False

    def close(self) -> None:
        """Release the port."""
        if not self._gone:
            self._gone = True
            self._listen.close()  # before the host's: it shall not slip in again between the two
            self._leave()

    def _accept(self) -> list[Event]:
        try:
            peer, _ = self._listen.accept()
        except OSError:  # it went away again
            return []
        if self._peer is not None:
            peer.close()
            return []
        peer.setblocking(False)
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._peer = peer
        return [Event("opened")]

    def _read(self, peer: socket.socket) -> list[Event]:
        try:
            data = peer.recv(_CHUNK)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        return [Event("bytes", data)] if data else self._leave()

    def _flush(self) -> list[Event]:
        assert self._peer is not None  # noqa: S101 - it was just found writable
        try:
            self._outbox.flush(self._peer.send)
        except OSError:
            return self._leave()
        return []

    def _leave(self) -> list[Event]:
        if self._peer is None:
            return []
        self._peer.close()
        self._peer = None
        self._outbox.clear()
        return [Event("closed")]


def _listening(host: str, port: int) -> socket.socket:
    address = ipv4_of(host, "tcp")
    listen = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listen.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listen.bind((address, port))
        listen.listen()
    except OSError as error:
        listen.close()
        raise HardwareError(
            "the port cannot be opened", where=f"{host}:{port}", expected="a free port",
            received=error.strerror or str(error), hint="r2s2r rig --link tcp --port 0",
        ) from error  # fmt: skip
    listen.setblocking(False)
    return listen
