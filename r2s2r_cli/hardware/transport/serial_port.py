"""A serial port (or a pty, or another URL that pyserial knows) as a stream of lines."""

from __future__ import annotations

import contextlib
import os
import select
import time
from typing import Any

from r2s2r_cli.hardware.transport.base import WRITE_TIMEOUT, Address
from r2s2r_cli.hardware.transport.gone import not_taken, port_errors
from r2s2r_cli.hardware.transport.line_stream import LineStream
from r2s2r_cli.hardware.transport.name import PortName

BAUD = 115200
_POLL = 0.02
"""[s] between looks where the port cannot be waited for (Windows, loop://)."""


class SerialPort(LineStream):
    """Opened for this process alone. DTR and RTS are left as they are: a pty has none, a board may reset on them."""

    def __init__(self, name: PortName) -> None:
        super().__init__(name.text)
        self._url = "://" in name.text
        self._port: Any = None

    def open(self) -> None:
        """Raises LinkError: no such port, no permission, held by another program."""
        import serial

        self.close()
        self.renew()
        options: dict[str, Any] = {"baudrate": BAUD, "timeout": 0, "write_timeout": WRITE_TIMEOUT}
        if not self._url:
            options["exclusive"] = True
        with port_errors(self.name, "opening"):
            self._port = serial.serial_for_url(self.name, **options)
            self._port.reset_input_buffer()

    def _bytes(self, timeout: float) -> bytes:
        with port_errors(self.name, "reading"):
            port = self._opened()
            number = self._number()
            if number is None:
                data = bytes(port.read(4096))
                if not data and timeout > 0:
                    time.sleep(min(timeout, _POLL))
                return data
            if not select.select([number], [], [], timeout)[0]:
                return b""
            # Readable and nothing to read is how a hang-up looks; pyserial raises in `read`, which must be called.
            return bytes(port.read(max(1, port.in_waiting)))

    def _opened(self) -> Any:
        if self._port is None:
            raise OSError("the port is not open")
        return self._port

    def _number(self) -> int | None:
        """The file descriptor, where it can be waited for."""
        with contextlib.suppress(AttributeError, OSError):
            return int(self._port.fileno())
        return None

    def send(self, data: bytes, to: Address | None = None) -> None:
        """Raises LinkError where the robot does not read within the time-out, or the port is gone."""
        import serial

        with port_errors(self.name, "writing"):
            port, number = self._opened(), self._number()
            if number is not None:
                return self._write(number, data)
            try:
                port.write(data)
            except serial.SerialTimeoutException:
                raise not_taken(self.name, WRITE_TIMEOUT) from None

    def _write(self, number: int, data: bytes) -> None:
        """Without pyserial, which calls it a time-out where this process was held up after all had been written."""
        end = time.monotonic() + WRITE_TIMEOUT
        while data:
            with contextlib.suppress(BlockingIOError):
                data = data[os.write(number, data) :]
            if data and not select.select([], [number], [], max(0.0, end - time.monotonic()))[1]:
                raise not_taken(self.name, WRITE_TIMEOUT)

    def close(self) -> None:
        """Never raises."""
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(Exception):  # whatever is wrong with it, it is not ours any more
                port.close()
