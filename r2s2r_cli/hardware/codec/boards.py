"""The authors' newer robot: three boards, a line of 13 numbers from each, about 50 a second. No check, no watchdog."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.hardware.codec.authors import (
    CANNOT_STOP,
    MOTORS,
    SENSORS,
    number,
    refuse_other_robots,
    rig_line,
    wire_speeds,
)
from r2s2r_cli.hardware.codec.base import PICO, Corrupt, Event, G, Outgoing, Reading, Status

SENSORS_OF = ((4, 2, 8), (3, 1, 7), (5, 0, 6))
"""Sensors on C0, C1, C2 of each board."""
MOTORS_OF = ((2, 4), (1, 3), (0, 5))
"""Motors of enc1, enc2 of each board."""
FIELDS = 13
MOST_PF = 1000.0
"""[pF] beyond which, or below 0, a line is damaged: the sensors have about 20."""


class BoardsCodec:
    """Damage that leaves 13 plausible numbers goes unseen: there is no check sum."""

    name = "boards"
    boards = len(SENSORS_OF)
    watchdog: float | None = None
    numbered = False
    promise = CANNOT_STOP

    def __init__(self, *, sensors: int, motors: int) -> None:
        refuse_other_robots(self.name, sensors, motors)

    def decode(self, line: bytes) -> Event:
        """A reading of 13 numbers; any other text is a status."""
        line = line.strip(b"\r\n \0")
        if (event := rig_line(line)) is not None:
            return event
        try:
            text = line.decode("ascii")
        except UnicodeDecodeError:
            return Corrupt(why="not ASCII")
        tokens = text.split()
        if len(tokens) != FIELDS:
            readable = bool(text) and text.isprintable() and any(c.isalpha() for c in text)
            return Status(text=text[:80]) if readable else Corrupt(why=f"{len(tokens)} fields, not {FIELDS}")
        try:
            values = [number(token) for token in tokens[1:]]
        except ValueError as error:
            return Corrupt(why=str(error))
        return self._reading(tokens[0], np.array(values))

    @staticmethod
    def _reading(name: str, values: np.ndarray) -> Event:
        if name not in ("0", "1", "2"):
            return Corrupt(why="no such board")
        if (values[:3] < 0).any() or (values[:3] > MOST_PF).any():
            return Corrupt(why="a capacitance that no sensor has")
        board = int(name)
        capacitance, encoder = np.full(SENSORS, np.nan), np.full(MOTORS, np.nan)
        capacitance[list(SENSORS_OF[board])] = values[:3] * PICO
        encoder[list(MOTORS_OF[board])] = values[4:6]
        return Reading(board=board, t_board=float("nan"), capacitance=capacitance, encoder=encoder,
                       a_B=values[6:9] * G, w_WB=np.radians(values[9:12]))  # fmt: skip

    def hello(self) -> None:
        """The boards speak first."""

    def command(self, duty: np.ndarray) -> Outgoing:
        """Every board gets all six speeds and takes its two."""
        return self._line([f"{u:.2f}" for u in wire_speeds(duty)])

    def stop(self) -> Outgoing:
        """Twelve zeros."""
        return self._line(["0"] * MOTORS)

    def emergency(self) -> Outgoing:
        """As `stop`: the boards have no latch, ours is in the host."""
        return self.stop()

    def reset(self) -> None:
        """There is nothing to reset on the boards."""

    def tick(self, k: int) -> Outgoing:
        """Any one board will do."""
        return Outgoing(b"#tick %d\n" % k)

    @staticmethod
    def _line(speeds: list[str]) -> Outgoing:
        text = " ".join(["0"] * 3 + speeds + ["0"] * 3)
        return Outgoing(text.encode("ascii") + b"\n", every_board=True)
