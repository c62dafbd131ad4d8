"""The authors' older robot: lines of a BLE central on a serial port. No check, no clock, no watchdog."""

from __future__ import annotations

import re

import numpy as np

from r2s2r_cli.hardware.codec.authors import (
    ADC,
    CANNOT_STOP,
    MOTORS,
    SENSORS,
    number,
    refuse_other_robots,
    rig_line,
    wire_speeds,
)
from r2s2r_cli.hardware.codec.base import Corrupt, Event, G, Outgoing, Passed, Reading, Status

_COUNT = re.compile(r"0x[0-9a-f]{1,8}")
_PADDING = b" " * 10


class LegacyCodec:
    """Lines are padded with `*`, of which only the last matters."""

    name = "legacy"
    boards = 1
    watchdog: float | None = None
    numbered = False
    promise = CANNOT_STOP

    def __init__(self, *, sensors: int, motors: int) -> None:
        refuse_other_robots(self.name, sensors, motors)

    def decode(self, line: bytes) -> Event:
        """`S` and `A` are measurements, `q` is passed over, other letters are a status."""
        line = line.rpartition(b"*")[2].strip(b"\r\n \0")
        if (event := rig_line(line)) is not None:
            return event
        try:
            text = line.decode("ascii")
            kind, *tokens = text.split() or [""]
            if kind == "S":
                return _sensors(tokens)
            if kind == "A":
                return _acceleration(tokens)
        except ValueError as error:  # UnicodeDecodeError is one
            return Corrupt(why=str(error)[:80])
        if kind == "q":
            return Passed()
        readable = text.isprintable() and sum(c.isalpha() for c in text) > 2
        return Status(text=text[:80]) if readable else Corrupt(why="no line of this protocol")

    def hello(self) -> None:
        """The robot just speaks."""

    def command(self, duty: np.ndarray) -> Outgoing:
        """One line a motor; all six every time, for a lost one is not noticed."""
        speeds = wire_speeds(duty)
        return Outgoing(b"".join(_PADDING + f"d {i + 1} {u:.2f}\n".encode("ascii") for i, u in enumerate(speeds)))

    def stop(self) -> Outgoing:
        """All six."""
        return Outgoing(_PADDING + b"s\n")

    def emergency(self) -> Outgoing:
        """As `stop`: the robot has no latch, ours is in the host."""
        return self.stop()

    def reset(self) -> None:
        """There is nothing to reset on the robot."""

    def tick(self, k: int) -> Outgoing:
        """Understood by a rig only."""
        return Outgoing(_PADDING + b"#tick %d\n" % k)


def _sensors(tokens: list[str]) -> Reading:
    if len(tokens) != SENSORS or not all(_COUNT.fullmatch(token) for token in tokens):
        raise ValueError("not nine hexadecimal counts")
    counts = np.array([int(token, 16) for token in tokens], dtype=np.float64)
    capacitance = ADC / np.where(counts > 0, counts, np.nan)
    return Reading(board=0, t_board=float("nan"), capacitance=capacitance, encoder=np.full(MOTORS, np.nan))


def _acceleration(tokens: list[str]) -> Reading:
    if len(tokens) != 3:
        raise ValueError(f"{len(tokens)} accelerations, not 3")
    a_B = np.array([number(token) for token in tokens]) * G
    return Reading(board=0, t_board=float("nan"), capacitance=np.full(SENSORS, np.nan),
                   encoder=np.full(MOTORS, np.nan), measures=False, a_B=a_B)  # fmt: skip
