"""What both protocols of the authors have in common: plain numbers, no check, no watchdog, a way to ask for ticks."""

from __future__ import annotations

import math
import re

from r2s2r_cli.rig.wire.base import Line

FULL = 99.0
"""A speed on the wire at full PWM."""

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


def finite(x: float) -> float:
    """The number, 0 for what is none."""
    return float(x) if math.isfinite(x) else 0.0


class AuthorsCodec:
    """The part of a device's side that knows neither its host nor when it is gone: motors keep what they have."""

    datagrams_end = False

    def opened(self, t: float) -> None:
        """Nothing: the device does not know its host."""

    def closed(self, t: float) -> None:
        """Nothing: the motors keep what they have."""

    def tick_of(self, line: bytes) -> int | None:
        """The tick that a line asks for."""
        return tick_asked(line)

    def untouched(self, line: bytes) -> bool:
        """A tick is."""
        return tick_asked(line) is not None

    def advance(self, t: float) -> list[Line]:
        """Nothing: there is no watchdog."""
        return []

    def ticked(self, k: int, t: float, board: int) -> Line:
        """A status text at the end of a tick, which a host of the real robot passes over."""
        return Line(board, b"#tick %d %d\n" % (k, round(t * 1e6)), safe=True)
