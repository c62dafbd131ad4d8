"""The authors' newer robot: three boards, 13 fields to the host and 12 from it. No check, no watchdog."""

from __future__ import annotations

from collections import deque

import numpy as np

from r2s2r_cli.rig.wire.authors import FULL, GRAVITY, AuthorsCodec, finite, like_strtod, tick_asked
from r2s2r_cli.rig.wire.base import BoardReading, Line, Motors, Received, duties

SENSORS_OF: tuple[tuple[int, ...], ...] = ((4, 2, 8), (3, 1, 7), (5, 0, 6))
"""Sensors at C0, C1, C2 of boards 0 (red), 1 (green), 2 (blue)."""

MOTORS_OF: tuple[tuple[int, int], ...] = ((2, 4), (1, 3), (0, 5))
"""Motors of each board."""

_SKIPPED, _MOTORS = 3, 6
_PWM = 255
_BUFFERED, _BYTES = 8, 255
"""Datagrams that wait in a board, and how much of one is kept."""


class BoardsCodec(AuthorsCodec):
    """Device side of `boards`. A board reads one datagram in each turn of its loop, just before it sends its sample."""

    def __init__(self, motors: Motors) -> None:
        self._motors = motors
        self._waiting: tuple[deque[bytes], ...] = tuple(deque() for _ in MOTORS_OF)

    def receive(self, line: bytes, board: int | None, t: float) -> Received:
        """Leave it in the buffer of the board, or of all of them; where that is full, it is lost."""
        tick = tick_asked(line)
        if tick is not None:
            return Received(tick=tick)
        for waiting in self._waiting if board is None else (self._waiting[board],):
            if len(waiting) < _BUFFERED:
                waiting.append(line[:_BYTES])
        return Received()

    def sample(self, reading: BoardReading, t: float) -> list[Line]:
        """The 13 fields, or the status text."""
        n = reading.board
        if reading.status is not None:
            return [Line(n, reading.status.encode("ascii", "replace") + b"\n")]
        if self._waiting[n]:
            self._drive(n, self._waiting[n].popleft(), t)
        pF = [reading.pF[i] for i in SENSORS_OF[n]] + [0.0]
        enc = [reading.encoder[i] for i in MOTORS_OF[n]]
        imu = [*(reading.a_B / GRAVITY), *np.rad2deg(reading.w_WB)]
        text = " ".join([str(n), *map(_two, pF), *(str(round(finite(x))) for x in enc), *map(_two, imu)])
        return [Line(n, text.encode() + b"\n")]

    def announce(self, tick_us: int, t: float, *, first: bool) -> list[Line]:
        """A status text, which a host of a real board passes over."""
        return [Line(0, b"#lockstep %d\n" % tick_us, safe=True)]

    def _drive(self, board: int, line: bytes, t: float) -> None:
        """Twelve numbers set the two motors of the board; fewer than nine leave them as they are."""
        words = line.split()[_SKIPPED : _SKIPPED + _MOTORS]
        if len(words) == _MOTORS:
            asked = np.full(_MOTORS, np.nan)
            mine = list(MOTORS_OF[board])
            asked[mine] = np.trunc(_PWM * duties([like_strtod(words[i]) for i in mine], FULL)) / _PWM
            self._motors.command(asked, t)


def _two(x: float) -> str:
    return f"{finite(x):.2f}"
