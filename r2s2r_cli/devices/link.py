"""The robot at the other end of a link, as `record` and `execute` see it: `RobotLink`, its `Sample` and its errors.

All arrays are NumPy float64, SI. Speeds have the order of `Robot.actuated`, sensors that of `Robot.sensors`. A speed of
+1 reels in (shortens) at the full speed of that motor in robot.toml; signs, scales and numbers of the wire are the
codec's business.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Protocol, Self, runtime_checkable

import numpy as np

from r2s2r_cli.errors import HardwareError

if TYPE_CHECKING:
    from types import TracebackType


WATCHDOG_S = 0.25
"""Longest watchdog of a device of which it is said that it stops by itself [s]: what our protocol promises."""


class LinkState(Enum):
    """Where a link is in its life: closed -> connecting -> handshake -> running -> lost -> connecting ... -> closed."""

    CLOSED = "closed"
    CONNECTING = "connecting"
    HANDSHAKE = "handshake"
    RUNNING = "running"
    LOST = "lost"


STOPS = 5
"""How often a stop is said at the end, where nobody acknowledges it: one that is lost leaves the motors as they are."""
STOP_PAUSE = 0.02
"""[s] between them: a board reads one datagram a turn."""
EMERGENCY = "emergency stop"
"""The reason of a stop that the device latches as well, where it can."""


class LinkError(HardwareError):
    """The port died, the robot does not answer, or it answers something else. Exit code 5.

    `where` begins with the port. A stop was sent, or tried, before this is raised.
    """


class SafetyStop(HardwareError):
    """The host stopped the robot by itself: emergency stop, stale or impossible sensors, time limit. Exit code 5.

    Latched: every later command is refused until `reset`.
    """


@dataclass(frozen=True)
class Sample:
    """All that is known of the robot after one message from it.

    t_host: arrival [s], on the clock of `RobotLink.now`. board: number of the board that sent it, 0 where there is one.
    t_board: the board's own clock [s], NaN where the protocol has none. due: a control tick is due; a controller acts
    on these samples and on no others, once each. capacitance: the latest of every sensor [F], (sensor,), NaN: never
    received. t_sensor: arrival of each of them [s], (sensor,), NaN: never. fresh: they came with this message,
    (sensor,), bool. encoder: counts of the latest message, (actuated,), NaN: none. a_B: specific force of this board's
    IMU [m/s^2], w_WB: angular velocity [rad/s], in board axes, (3,), None: the message has none. voltage: battery [V],
    None: not told. doubt: why a guard holds the motors for now (it sends zeros, whatever is asked for), "" where it
    does not.
    """

    t_host: float
    board: int
    t_board: float
    due: bool
    capacitance: np.ndarray
    t_sensor: np.ndarray
    fresh: np.ndarray
    encoder: np.ndarray
    a_B: np.ndarray | None = None
    w_WB: np.ndarray | None = None
    voltage: float | None = None
    doubt: str = ""

    @property
    def complete(self) -> bool:
        """Every sensor was received at least once."""
        return bool(np.isfinite(self.t_sensor).all())


@dataclass(frozen=True)
class LinkStatistics:
    """Health of a link since it was opened. A number that the protocol cannot tell is None.

    received: good messages; sent: commands and stops. lost, repeated, reordered: by sequence number. corrupt: a wrong
    check sum, or no line of the protocol. other: status texts. overlong: lines cut. reconnects: how often the port was
    opened again. refused: commands that the device did not take; held: how often its watchdog stopped the motors;
    device_corrupt, device_lost: what it counted in our lines. latency_median, latency_p99: a line of ours to its
    acknowledgement [s]. clock_offset: host minus board clock [s], clock_drift: its slope [1]; clock_jumps: how often a
    board's clock jumped, or the board started anew. gap_max: longest silence while running [s]. last_status: the last
    text that a board said.
    """

    received: int = 0
    sent: int = 0
    lost: int | None = None
    repeated: int | None = None
    reordered: int | None = None
    corrupt: int = 0
    other: int = 0
    overlong: int = 0
    reconnects: int = 0
    refused: int | None = None
    held: int | None = None
    device_corrupt: int | None = None
    device_lost: int | None = None
    latency_median: float | None = None
    latency_p99: float | None = None
    clock_offset: float | None = None
    clock_drift: float | None = None
    clock_jumps: int = 0
    gap_max: float = 0.0
    last_status: str = ""


@dataclass(frozen=True)
class LinkFacts:
    """What the handshake told, and what the protocol promises.

    port: as the user gave it. protocol: checked | boards | legacy. version, device, robot: as the device says, "" where
    it does not. watchdog: seconds after which the device stops by itself, as it says or its protocol promises; None or
    0: it never does, so a stop cannot be guaranteed once the link is gone. lock_step: the device waits for us, time is
    the device's. sensors, motors: how many the protocol carries.
    """

    port: str
    protocol: str
    version: str = ""
    device: str = ""
    robot: str = ""
    watchdog: float | None = None
    lock_step: bool = False
    sensors: int = 0
    motors: int = 0
    remarks: tuple[str, ...] = field(default=())

    @property
    def stops_by_itself(self) -> bool:
        """Whether the device does, in time: a watchdog of five seconds lets the motors tear the cables."""
        return self.watchdog is not None and 0 < self.watchdog <= WATCHDOG_S


@runtime_checkable
class RobotLink(Protocol):
    """One robot. A context manager: entering connects and shakes hands, any exit stops the motors and closes.

    Not for several threads, but for `stop` and `emergency_stop`, which any thread may call.
    """

    @property
    def facts(self) -> LinkFacts:
        """What the handshake told; before it, what is known of the protocol."""
        ...

    @property
    def state(self) -> LinkState:
        """Where the link is in its life."""
        ...

    @property
    def statistics(self) -> LinkStatistics:
        """Health so far, a snapshot."""
        ...

    def now(self) -> float:
        """The clock of `Sample.t_host` [s]: monotonic, of the host; in lock-step the device's."""
        ...

    def read(self, timeout: float) -> Sample | None:
        """The next message as a sample, in order of arrival; None where none came within `timeout` [s].

        Raises LinkError where the port died; SafetyStop where a guard stops the robot.
        """
        ...

    def command(self, speed: np.ndarray) -> None:
        """Ask for motor speeds in -1 .. 1, (actuated,), +1 reels in. One call for every sample that is `due`.

        Raises LinkError where the port died; ValueError for a shape, a NaN or a number out of range: never clipped.
        """
        ...

    def stop(self) -> None:
        """Stop all motors, now. Never raises; may be called at any time and repeatedly."""
        ...

    def emergency_stop(self) -> None:
        """Stop all motors and latch it: on the device where its protocol can, in any case here. Never raises.

        Every later `read` and `command` raises SafetyStop until `reset`.
        """
        ...

    def reset(self) -> None:
        """Take the latch off, by intent and by nothing else. Raises LinkError where the device does not do it."""
        ...

    def reconnect(self, timeout: float = 10.0) -> None:
        """After a LinkError: open the port again, shake hands, motors stopped. Raises LinkError after `timeout` [s]."""
        ...

    def __enter__(self) -> Self:
        """Connect and shake hands. Raises LinkError."""
        ...

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop and close, whatever happened."""
        ...
