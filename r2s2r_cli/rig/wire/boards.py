"""The authors' newer robot: three boards, 13 fields to the host and 12 from it. No check, no watchdog."""

from __future__ import annotations

import math
import re
from collections import deque

import numpy as np

from r2s2r_cli.rig.wire.base import BoardReading, Line, Motors, Received, duties

SENSORS_OF: tuple[tuple[int, ...], ...] = ((4, 2, 8), (3, 1, 7), (5, 0, 6))
"""Sensors at C0, C1, C2 of boards 0 (red), 1 (green), 2 (blue)."""

MOTORS_OF: tuple[tuple[int, int], ...] = ((2, 4), (1, 3), (0, 5))
"""Motors of each board."""

FULL = 99.0
"""A speed on the wire at full PWM."""

_SKIPPED, _MOTORS = 3, 6
_PWM = 255
_BUFFERED, _BYTES = 8, 255
"""Datagrams that wait in a board, and how much of one is kept."""
GRAVITY = 9.80665
"""[m/s^2] of the unit g in which the boards send."""

_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?")
_TICK = re.compile(rb" *#tick ([1-9][0-9]{0,9})\n?")


def tick_asked(line: bytes) -> int | None:
    """The tick that a line of the authors' protocols asks for; None: it is another line."""
    found = _TICK.fullmatch(line)
    return int(found[1]) if found else None


def like_strtod(word: bytes) -> float:
    """The number a word begins with, 0 where it begins with none, as C's strtod has it (no hexadecimals)."""
    found = _NUMBER.match(word)
    value = float(found[0]) if found else 0.0
    return value if math.isfinite(value) else 0.0


class BoardsCodec:
    """Device side of `boards`. A board reads one datagram in each turn of its loop, just before it sends its sample."""

    datagrams_end = False

    def __init__(self, motors: Motors) -> None:
        self._motors = motors
        self._waiting: tuple[deque[bytes], ...] = tuple(deque() for _ in MOTORS_OF)

    def opened(self, t: float) -> None:
        """Nothing: a board does not know its host."""

    def closed(self, t: float) -> None:
        """Nothing: the motors keep what they have."""

    def tick_of(self, line: bytes) -> int | None:
        """The tick that a line asks for."""
        return tick_asked(line)

    def untouched(self, line: bytes) -> bool:
        """A tick is."""
        return tick_asked(line) is not None

    def receive(self, line: bytes, board: int | None, t: float) -> Received:
        """Leave it in the buffer of the board, or of all of them; where that is full, it is lost."""
        tick = tick_asked(line)
        if tick is not None:
            return Received(tick=tick)
        for waiting in self._waiting if board is None else (self._waiting[board],):
            if len(waiting) < _BUFFERED:
                waiting.append(line[:_BYTES])
        return Received()

    def advance(self, t: float) -> list[Line]:
        """Nothing: there is no watchdog."""
        return []

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
        text = " ".join([str(n), *map(_two, pF), *(str(round(_finite(x))) for x in enc), *map(_two, imu)])
        return [Line(n, text.encode() + b"\n")]

    def announce(self, tick_us: int, t: float, *, first: bool) -> list[Line]:
        """A status text, which a host of a real board passes over."""
        return [Line(0, b"#lockstep %d\n" % tick_us, safe=True)]

    def ticked(self, k: int, t: float, board: int) -> Line:
        """The same, at the end of a tick."""
        return Line(board, b"#tick %d %d\n" % (k, round(t * 1e6)), safe=True)

    def _drive(self, board: int, line: bytes, t: float) -> None:
        """Twelve numbers set the two motors of the board; fewer than nine leave them as they are."""
        words = line.split()[_SKIPPED : _SKIPPED + _MOTORS]
        if len(words) == _MOTORS:
            asked = np.full(_MOTORS, np.nan)
            mine = list(MOTORS_OF[board])
            asked[mine] = np.trunc(_PWM * duties([like_strtod(words[i]) for i in mine], FULL)) / _PWM
            self._motors.command(asked, t)


def _finite(x: float) -> float:
    return float(x) if math.isfinite(x) else 0.0


def _two(x: float) -> str:
    return f"{_finite(x):.2f}"
