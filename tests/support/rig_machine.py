"""Boards that know no physics: they say what they are told to, and note what reaches their motors."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

SENSORS, MOTORS = 9, 6
PER_ROD = (((4, 2, 8), (2, 4)), ((3, 1, 7), (1, 3)), ((5, 0, 6), (0, 5)))
"""Sensors and motors of the authors' three boards."""


@dataclass(frozen=True)
class Reading:
    """A BoardReading."""

    board: int = 0
    t_board: float = 0.0
    pF: np.ndarray = field(default_factory=lambda: np.full(SENSORS, np.nan))
    encoder: np.ndarray = field(default_factory=lambda: np.full(MOTORS, np.nan))
    a_B: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 9.80665]))
    w_WB: np.ndarray = field(default_factory=lambda: np.zeros(3))
    q_WB: np.ndarray | None = None
    battery: float = math.nan
    status: str | None = None


def reading(board: int, t: float = 0.0, **more: object) -> Reading:
    """What a board of the three sends: sensor i has 10 + i pF, motor i has 100 i counts."""
    sensors, motors = PER_ROD[board]
    pF, encoder = np.full(SENSORS, np.nan), np.full(MOTORS, np.nan)
    pF[list(sensors)] = 10.0 + np.array(sensors)
    encoder[list(motors)] = 100.0 * np.array(motors)
    return Reading(**{"board": board, "t_board": t + board, "pF": pF, "encoder": encoder, **more})  # type: ignore[arg-type]


class Machine:
    """Three boards that send every 20 ms, each at its own phase. log: (time, duty) of every change at the motors."""

    def __init__(self) -> None:
        self.duty = np.zeros(MOTORS)
        self.log: list[tuple[float, np.ndarray]] = []
        self.stops = 0
        self.t = 0.0

    def command(self, duty: np.ndarray, t: float) -> None:
        """Keep where NaN."""
        self.duty = np.where(np.isnan(duty), self.duty, duty)
        self.log.append((t, self.duty))

    def stop(self) -> None:
        """All off."""
        self.duty = np.zeros(MOTORS)
        self.stops += 1
        self.log.append((self.t, self.duty))

    def tick(self, t: float) -> list[Reading]:
        """What was measured since the last time."""
        due = []
        for board in range(3):
            first = math.floor((self.t - 0.005 * board) / 0.02 + 1e-6) + 1
            last = math.floor((t - 0.005 * board) / 0.02 + 1e-6)
            due += [(0.02 * k + 0.005 * board, board) for k in range(max(first, 0), last + 1)]
        self.t = t
        return [reading(board, at) for at, board in sorted(due)]
