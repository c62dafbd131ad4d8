"""The authors' older robot: a BLE bridge on a serial port. Lines `S`, `q`, `A` to the host, `d`, `s` from it."""

from __future__ import annotations

import math
import re

import numpy as np

from r2s2r_cli.rig.wire.authors import FULL, GRAVITY, AuthorsCodec, finite, like_strtod, tick_asked
from r2s2r_cli.rig.wire.base import BoardReading, Line, Motors, Received, duties

MOTORS = 6
_PF_PER_COUNT = 42.0 * 1024.0 / 3.3
"""A capacitance [pF] is this over the converter's count."""
_COUNT_MAX = 0xFFFF
_IMUS = 2
_PADDING = b"*" * 4
_DRIVE = re.compile(rb" *d +([1-6]) +(\S+) *\n?")
_STOP = re.compile(rb" *s *\n?")


class LegacyCodec(AuthorsCodec):
    """Device side of `legacy`. The samples of several boards are gathered: a line `S` has all nine."""

    def __init__(self, motors: Motors, *, sensors: int, board: int = 0) -> None:
        self._motors = motors
        self._pF = np.full(sensors, np.nan)
        self._board = board

    def receive(self, line: bytes, board: int | None, t: float) -> Received:
        """One motor, or the stop; everything else is passed over."""
        tick = tick_asked(line)
        if tick is not None:
            return Received(tick=tick)
        if _STOP.fullmatch(line):
            self._motors.stop()
        elif found := _DRIVE.fullmatch(line):
            asked = np.full(MOTORS, np.nan)
            asked[int(found[1]) - 1] = duties([like_strtod(found[2])], FULL)[0]
            self._motors.command(asked, t)
        return Received()

    def sample(self, reading: BoardReading, t: float) -> list[Line]:
        """Capacitances of all sensors with every reading of the board that leads, attitude and force with each."""
        if reading.status is not None:
            return []
        fresh = np.isfinite(reading.pF)
        self._pF[fresh] = reading.pF[fresh]
        lines = []
        if reading.board == self._board:
            lines.append("S " + " ".join(f"0x{_count(x):x}" for x in self._pF))
            lines.append("A " + " ".join(f"{finite(x / GRAVITY):.2f}" for x in reading.a_B))
        if reading.q_WB is not None and reading.board < _IMUS:
            x, y, z, w = (finite(number) for number in reading.q_WB)
            lines.append(f"q {reading.board + 1} {w:.4f} {x:.4f} {y:.4f} {z:.4f}")
        return [Line(reading.board, _PADDING + line.encode() + b"\n") for line in lines]

    def announce(self, tick_us: int, t: float, *, first: bool) -> list[Line]:
        """A line that no host of the real robot knows."""
        return [Line(self._board, b"#lockstep %d\n" % tick_us, safe=True)]


def _count(pF: float) -> int:
    """The converter's count; 0: nothing was measured yet."""
    return min(round(_PF_PER_COUNT / pF), _COUNT_MAX) if math.isfinite(pF) and pF > 0 else 0
