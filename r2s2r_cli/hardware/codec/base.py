"""What a codec gives: events of one line of the robot, and the bytes of what the host wants to say."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

import numpy as np

PICO = 1e-12
"""Farad in a picofarad: the wire has pF, we have F."""
G = 9.80665
"""[m/s^2] in the g of the authors' boards."""


class DeviceState(IntEnum):
    """What a device of the protocol `checked` says that it is doing."""

    WAIT = 0
    RUN = 1
    HELD = 2
    ESTOP = 3


@dataclass(frozen=True, kw_only=True)
class Event:
    """What a line of the robot means. seq: its number, where the protocol has numbers."""

    seq: int | None = None


@dataclass(frozen=True, kw_only=True)
class Reading(Event):
    """Measurements of one board. capacitance [F], (sensor,), and encoder (motor,): NaN where not in this line.

    t_board [s]: NaN where the protocol has no clock. measures: the line carries capacitances (of any value).
    """

    board: int
    t_board: float
    capacitance: np.ndarray
    encoder: np.ndarray
    measures: bool = True
    a_B: np.ndarray | None = None
    w_WB: np.ndarray | None = None
    voltage: float | None = None
    state: DeviceState | None = None


@dataclass(frozen=True, kw_only=True)
class Greeting(Event):
    """The device introduces itself. watchdog, lock_step [s]; lock_step is 0 in real time."""

    version: int
    robot: str
    firmware: str
    boards: int
    motors: int
    sensors: int
    watchdog: float
    state: DeviceState
    lock_step: float


@dataclass(frozen=True, kw_only=True)
class Ack(Event):
    """Our line `of` was taken (code 0) or refused; t_board [s]: when."""

    of: int
    code: int
    t_board: float


@dataclass(frozen=True, kw_only=True)
class Beat(Event):
    """Sign of life. bad, missed: invalid lines and gaps that the device counted in what we sent."""

    t_board: float
    state: DeviceState
    bad: int
    missed: int


@dataclass(frozen=True, kw_only=True)
class LockStep(Event):
    """The device is a rig that waits for our ticks, of `period` [s]."""

    period: float


@dataclass(frozen=True, kw_only=True)
class TickDone(Event):
    """Tick k is over; t: the world's time [s]."""

    k: int
    t: float


@dataclass(frozen=True, kw_only=True)
class Status(Event):
    """A text for people."""

    text: str


@dataclass(frozen=True, kw_only=True)
class Passed(Event):
    """A line of the protocol that we have no use for."""


@dataclass(frozen=True, kw_only=True)
class Corrupt(Event):
    """Not a line of this protocol, or damaged on the way; never acted upon."""

    why: str


@dataclass(frozen=True)
class Outgoing:
    """Bytes to send. seq: under which an acknowledgement will come, None: none will. every_board: each must get it."""

    data: bytes
    seq: int | None = None
    every_board: bool = False


class Codec(Protocol):
    """One protocol. Stateless but for the numbers of what it sends.

    name: as on the command line. boards: how many speak. watchdog [s]: the device stops by itself after it, None: it
    never does. numbered: lines carry numbers, so losses are counted. promise: what this protocol cannot do, for people;
    "" where it can stop a robot whose host has died.
    """

    name: str
    boards: int
    watchdog: float | None
    numbered: bool
    promise: str

    def decode(self, line: bytes) -> Event:
        """The meaning of a line without its newline. Never raises, whatever the bytes are."""
        ...

    def hello(self) -> Outgoing | None:
        """Begin a conversation; None where the device just speaks."""
        ...

    def command(self, duty: np.ndarray) -> Outgoing:
        """Duties of all motors in -1 .. 1, (motor,), sign of the wire. Raises ValueError for any other number."""
        ...

    def stop(self) -> Outgoing:
        """All motors off."""
        ...

    def emergency(self) -> Outgoing:
        """All motors off and latched, or just off where the protocol has no latch."""
        ...

    def reset(self) -> Outgoing | None:
        """Take the latch off; None where the device has none."""
        ...

    def tick(self, k: int) -> Outgoing:
        """In lock-step: go on for tick k."""
        ...


def checked_duty(duty: np.ndarray, motors: int) -> np.ndarray:
    """The same numbers. Raises ValueError unless they are (motors,), finite, and in -1 .. 1: nothing else is sent."""
    duty = np.asarray(duty, dtype=np.float64)
    if duty.shape != (motors,):
        raise ValueError(f"expected {motors} speeds, received an array of shape {duty.shape}")
    if not np.isfinite(duty).all() or (np.abs(duty) > 1).any():
        raise ValueError(f"speeds must lie in -1 to 1, received {duty.tolist()}")
    return duty
