"""The camera of the rig: frames over TCP."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Callable

import numpy as np

from r2s2r_cli.devices.camera import CameraError, Frame, Intrinsics
from r2s2r_cli.hardware.camera.closing import Closing
from r2s2r_cli.hardware.camera.stream import (
    ALIVE,
    HEAD_BYTES,
    MAX_GREETING_BYTES,
    Greeting,
    Head,
    parse_greeting,
    parse_head,
)

CONNECT_S = 5.0
SILENCE_S = 2.0
"""Without a sign of life for so long the camera is taken for dead."""
_BUFFER_BYTES = 4 << 20


class RigCamera(Closing):
    """Reads one stream. Not for two threads at once."""

    def __init__(self, host: str, port: int, *, now: Callable[[], float] = time.monotonic) -> None:
        """now: the host's clock [s], for `Frame.t_host`."""
        self._address, self._now = (host, port), now
        self._where = f"rig://{host}:{port}"
        self._socket: socket.socket | None = None
        self._greeting: Greeting | None = None
        self._heard = 0.0
        self._color, self._depth = bytearray(), bytearray()
        self._message: Head | None = None
        self._buffers = [bytearray(HEAD_BYTES)]
        self._filled = 0

    @property
    def name(self) -> str:
        """Model and serial number."""
        return self._about().name

    @property
    def intrinsics(self) -> Intrinsics:
        """As the camera states them."""
        return self._about().intrinsics

    @property
    def depth_scale(self) -> float:
        """Metres a count."""
        return self._about().depth_scale

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return self._about().rate_hz

    def open(self) -> None:
        """Connect and read the greeting. Raises CameraError."""
        self.close()
        try:
            self._socket = socket.create_connection(self._address, timeout=CONNECT_S)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
            line = self._line(self._socket)
        except (OSError, UnicodeError) as error:  # the latter for a name that no host can have
            self.close()
            raise CameraError(
                "the rig's camera does not answer", where=self._where, expected="a greeting",
                received=getattr(error, "strerror", None) or str(error) or "nothing",
                hint="start the rig with a camera, and take the address that it prints: r2s2r rig --camera-port 0",
            ) from error  # fmt: skip
        try:
            self._greeting = parse_greeting(line, self._where)
        except CameraError:
            self.close()
            raise
        self._heard = time.monotonic()
        self._clear()

    def read(self, timeout_s: float = 1.0) -> Frame | None:
        """The next frame, None where none came in time. Raises CameraError where the camera is gone or silent."""
        deadline = time.monotonic() + timeout_s
        while True:
            head = self._receive(deadline)
            if head is None:
                if time.monotonic() - self._heard > SILENCE_S:
                    raise self._lost(f"nothing for {SILENCE_S:g} s")
                return None
            if head.kind == ALIVE:
                continue
            lens = self.intrinsics
            color = np.frombuffer(self._color, np.uint8).reshape(lens.height, lens.width, 3)
            depth = np.frombuffer(self._depth, "<u2").reshape(lens.height, lens.width)
            self._color, self._depth = bytearray(), bytearray()
            return Frame(color, depth.astype(np.uint16, copy=False), head.t_device, self._now(), head.number)

    def close(self) -> None:
        """Let go."""
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.close()
            self._socket = None

    def _about(self) -> Greeting:
        if self._greeting is None:
            raise CameraError("the camera is not open", where=self._where, expected="an open camera",
                              received="none", hint="open it first")  # fmt: skip
        return self._greeting

    def _line(self, connection: socket.socket) -> bytes:
        line = bytearray()
        while not line.endswith(b"\n"):
            more = connection.recv(1)
            if not more or len(line) > MAX_GREETING_BYTES:
                raise OSError("it hung up" if not more else "no end of its greeting")
            line += more
        return bytes(line[:-1])

    def _clear(self) -> None:
        """Forget what has come of a message."""
        self._message, self._filled = None, 0
        self._buffers = [bytearray(HEAD_BYTES)]

    def _receive(self, deadline: float) -> Head | None:
        """Go on with the message that is under way; None where it is not whole at the deadline."""
        while True:
            if not self._fill(deadline):
                return None
            if self._message is None:
                head = parse_head(bytes(self._buffers[0]), self.intrinsics, self._where)
                self._message = head
                self._color, self._depth = bytearray(head.color_bytes), bytearray(head.depth_bytes)
                self._buffers, self._filled = [self._color, self._depth], 0
                if head.kind != ALIVE:
                    continue
            message, self._message = self._message, None
            self._buffers, self._filled = [bytearray(HEAD_BYTES)], 0
            return message

    def _fill(self, deadline: float) -> bool:
        """Fill the buffers in their order; False where the deadline came first."""
        connection = self._socket
        if connection is None:
            raise self._lost("closed by this host")
        while self._buffers:
            buffer = self._buffers[0]
            if self._filled == len(buffer):
                if len(self._buffers) == 1:
                    return True
                self._buffers, self._filled = self._buffers[1:], 0
                continue
            left = deadline - time.monotonic()
            try:
                connection.settimeout(max(left, 1e-4))
                count = connection.recv_into(memoryview(buffer)[self._filled :])
            except TimeoutError:
                return False
            except OSError as error:
                raise self._lost(error.strerror or str(error)) from error
            if count == 0:
                raise self._lost("it hung up")
            self._filled += count
            self._heard = time.monotonic()
        return True

    def _lost(self, what: str) -> CameraError:
        self.close()
        return CameraError(
            "the camera is gone", where=self._where, expected="frames", received=what,
            hint="look at the rig's own messages, then start it again: r2s2r rig --camera-port 0",
        )  # fmt: skip
