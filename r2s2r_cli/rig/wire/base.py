"""What a device codec is, and what it stands between: lines of the wire on one side, boards and motors on the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

LINE_MAX = 512
"""Longest line [bytes], newline included."""


class BoardReading(Protocol):
    """What one board measured at one instant.

    board: its number. t_board: its own clock [s]. pF: capacitances [pF], (sensor,), and encoder: counts, (motor,), both
    NaN where this board does not measure. a_B: specific force [m/s^2], w_WB: angular velocity [rad/s], (3,), in the
    board's axes. q_WB: attitude by its own reckoning, xyzw, (4,), None: it reckons none. battery [V], NaN: not
    measured. status: the board has no sample to send but this text; None: it has.
    """

    @property
    def board(self) -> int: ...  # noqa: D102
    @property
    def t_board(self) -> float: ...  # noqa: D102
    @property
    def pF(self) -> np.ndarray: ...  # noqa: D102
    @property
    def encoder(self) -> np.ndarray: ...  # noqa: D102
    @property
    def a_B(self) -> np.ndarray: ...  # noqa: D102
    @property
    def w_WB(self) -> np.ndarray: ...  # noqa: D102
    @property
    def q_WB(self) -> np.ndarray | None: ...  # noqa: D102
    @property
    def battery(self) -> float: ...  # noqa: D102
    @property
    def status(self) -> str | None: ...  # noqa: D102


class Motors(Protocol):
    """The motor drivers of all boards."""

    def command(self, duty: np.ndarray, t: float) -> None:
        """Set the PWM. duty: -1 .. 1 with the sign of the wire, (motor,); NaN: as it was. t: the world's time [s]."""

    def stop(self) -> None:
        """All PWM to 0."""


@dataclass(frozen=True)
class Line:
    """A line on its way to the host. board: which sends it. safe: no fault of the wire touches it (lock-step)."""

    board: int
    data: bytes
    safe: bool = False


@dataclass(frozen=True)
class Received:
    """What came of a line from the host: answers, and in lock-step the number of the tick that it asks for."""

    lines: tuple[Line, ...] = ()
    tick: int | None = None


class DeviceCodec(Protocol):
    """The robot's end of a protocol. Times are the world's [s] and never run backwards.

    datagrams_end: a datagram ends with a newline, as every line of a stream does.
    """

    datagrams_end: bool

    def opened(self, t: float) -> None:
        """A host has come (byte streams: it opened the port)."""

    def closed(self, t: float) -> None:
        """The host has gone (byte streams)."""

    def tick_of(self, line: bytes) -> int | None:
        """The tick that a line of the host asks for; None: it is another line."""

    def untouched(self, line: bytes) -> bool:
        """Whether no fault of the wire may touch this line: one without which time would stand still for ever."""

    def receive(self, line: bytes, board: int | None, t: float) -> Received:
        """Obey one line of the host, as it came, its newline included if it had one.

        board: at which board it arrived; None: at all of them (byte streams). Never raises, whatever the bytes.
        """

    def advance(self, t: float) -> list[Line]:
        """What time alone brings: the watchdog, heartbeats."""

    def sample(self, reading: BoardReading, t: float) -> list[Line]:
        """The lines that a board sends for one reading."""

    def announce(self, tick_us: int, t: float, *, first: bool) -> list[Line]:
        """The lines that tell a host of lock-step with ticks of this length [us].

        first: the device speaks first (datagrams), else it may leave it to what it will answer.
        """

    def ticked(self, k: int, t: float, board: int) -> Line:
        """The answer at the end of tick k, from the board that was asked."""


def duties(words: Sequence[float], full: float) -> np.ndarray:
    """Numbers of the wire as duties: cut to -1 .. 1, (motor,)."""
    return np.clip(np.asarray(words, dtype=float) / full, -1.0, 1.0)
