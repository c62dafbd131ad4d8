"""A pseudo terminal: to the host it is a serial port."""

from __future__ import annotations

import contextlib
import os
import select
import termios
import time
import tty
from pathlib import Path

from r2s2r_cli.errors import HardwareError
from r2s2r_cli.rig.transport.base import Event
from r2s2r_cli.rig.transport.outbox import Outbox

_CHUNK = 4096
_IDLE_S = 0.02
"""How often we look whether a host has opened the port: a terminal that nobody has open cannot be waited for."""


class PtyTransport:
    """The master's side. The slave's is left to the host alone, so that we see it open and close the port."""

    stream = True

    def __init__(self, name: Path | None = None) -> None:
        """name: a link to the device, made here and removed by `close`; a plug that comes back keeps it.

        Raises HardwareError where there is no free terminal, or something else has that name.
        """
        self._name = name
        self._outbox = Outbox()
        self._poll = select.poll()
        self.connected = False
        self._open()

    def _open(self) -> None:
        try:
            self._master, slave = os.openpty()
        except OSError as error:
            raise HardwareError(
                "no pseudo terminal can be opened", where="--link pty", expected="a free /dev/pts",
                received=error.strerror or str(error), hint="r2s2r rig --link tcp",
            ) from error  # fmt: skip
        tty.setraw(slave)
        self._device = os.ttyname(slave)
        os.set_blocking(self._master, False)
        # Once it was open and is no longer, the master reports a hang-up until somebody opens it.
        os.close(slave)
        self._poll.register(self._master, select.POLLIN | select.POLLHUP)
        self._gone = False
        self.address = self._device if self._name is None else str(self._name)
        if self._name is not None:
            self._link(self._name)

    def _link(self, name: Path) -> None:
        try:
            if name.is_symlink():
                name.unlink()
            name.symlink_to(self._device)
        except OSError as error:
            self.close()
            raise HardwareError(
                "the device cannot have that name", where=str(name), expected="a free name, or a link to replace",
                received=error.strerror or str(error), hint="r2s2r rig --link pty",
            ) from error  # fmt: skip

    def poll(self, timeout: float) -> list[Event]:
        """Opened, bytes, closed. Raises nothing for what the host does."""
        if self._gone:
            time.sleep(timeout)
            return []
        self._flush()
        state = self._wait(0.0 if not self.connected else timeout)
        if not self.connected and state & select.POLLHUP:
            time.sleep(min(timeout, _IDLE_S))
            state = self._wait(0.0)
        events = []
        if not self.connected and not state & select.POLLHUP:
            self.connected = True
            events.append(Event("opened"))
        data = self._read() if state & select.POLLIN else b""
        if data:
            events.append(Event("bytes", data))
        if self.connected and state & select.POLLHUP and not data:
            self._hang_up()
            events.append(Event("closed"))
        self._flush()
        return events

    def send(self, data: bytes, board: int) -> None:
        """To the host, if there is one."""
        if self.connected and not self._gone:
            self._outbox.put(data)
            self._flush()

    def drop(self) -> None:
        """The device file is gone, as with a USB plug that was pulled."""
        self.close()

    def restore(self) -> None:
        """Plugged in again: another terminal, under the same name where it has one."""
        if self._gone:
            self._open()

    def close(self) -> None:
        """Release the terminal."""
        if not self._gone:
            self._gone, self.connected = True, False
            self._outbox.clear()
            self._poll.unregister(self._master)
            os.close(self._master)
            # Another rig may have taken the name over since.
            if self._name is not None and self._name.is_symlink() and str(self._name.readlink()) == self._device:
                self._name.unlink()

    def _wait(self, timeout: float) -> int:
        found = self._poll.poll(timeout * 1e3)
        return found[0][1] if found else 0

    def _read(self) -> bytes:
        try:
            return os.read(self._master, _CHUNK)
        except OSError:  # EIO: closed at this moment, which the next poll tells
            return b""

    def _flush(self) -> None:
        if self.connected and not self._gone:
            with contextlib.suppress(OSError):
                self._outbox.flush(lambda data: os.write(self._master, data))

    def _hang_up(self) -> None:
        self.connected = False
        self._outbox.clear()
        with contextlib.suppress(OSError, termios.error):
            termios.tcflush(self._master, termios.TCIOFLUSH)  # the next host shall not read what was for the last
