"""What a recording needs of the outside, as protocols: stages touch no port, `commands` pass these in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np


class Sample(Protocol):
    """What came from the robot at once: of all boards, or of one (the others' values are then NaN)."""

    @property
    def t_host(self) -> float:
        """`time.monotonic` of the host when it had come [s]."""

    @property
    def t_board(self) -> float:
        """Clock of the board [s], of unknown origin; NaN where the protocol has none."""

    @property
    def capacitance(self) -> np.ndarray:
        """[F], (sensor,); NaN: not in this sample."""

    @property
    def encoder(self) -> np.ndarray:
        """Counts, (actuated,); NaN: not in this sample."""

    @property
    def battery(self) -> float:
        """[V]; NaN: not in this sample."""

    @property
    def imu(self) -> Mapping[int, np.ndarray]:
        """By board: specific force [m/s^2] and angular velocity [rad/s], (6,), frame of the board; NaN: not there."""


class Link(Protocol):
    """The robot, connected and shaken hands with; opened and closed by `commands`."""

    def read(self, timeout: float) -> Sample | None:
        """The next sample; None where none came within `timeout` [s]. Raises HardwareError where the link is lost."""

    def command(self, speeds: np.ndarray) -> None:
        """Motor commands in [-1, 1], +1 reels in, (actuated,). Raises HardwareError."""

    def stop(self) -> None:
        """All motors off. Raises HardwareError where that could not be sent."""

    @property
    def statistics(self) -> Any:
        """Counts so far, with `LinkCounts`'s names."""


class LinkCounts(Protocol):
    """Lines or datagrams since the link was opened."""

    received: int
    lost: int
    repeated: int
    corrupt: int
    latency: float
    """Of the last answer [s]; NaN where the protocol cannot tell."""


class Frame(Protocol):
    """One picture, as `hardware.camera.base.Frame`."""

    @property
    def color(self) -> np.ndarray:
        """RGB uint8 (v, u, 3)."""

    @property
    def depth(self) -> np.ndarray:
        """Counts uint16 (v, u), 0 unknown."""

    @property
    def t_device(self) -> float:
        """Clock of the camera [s]."""

    @property
    def t_host(self) -> float:
        """`time.monotonic` of the host when it had come [s]."""

    @property
    def number(self) -> int:
        """Counted by the camera; a gap is a lost frame."""


class Camera(Protocol):
    """An open camera."""

    def read(self, timeout_s: float = 1.0) -> Frame | None:
        """The next frame; None where none came in time. Raises HardwareError where the camera is gone."""


class Pid(Protocol):
    """The low-level controller: latched `done`, started afresh at every target."""

    def restart(self) -> None:
        """A new target: nothing summed, nothing done."""

    def tick(self, length: np.ndarray, target: np.ndarray) -> np.ndarray:
        """Motor commands (actuated,) in [-1, 1], +1 reels in, of lengths [m] and targets [1], (actuated,) each."""

    @property
    def done(self) -> np.ndarray:
        """Latched, (actuated,), bool."""


class Guard(Protocol):
    """The duties of the host: stale sensors, lengths out of range, time limit, emergency stop."""

    def check(self, now: float, length: np.ndarray, heard: np.ndarray) -> None:
        """now [s] on the clock of the run; length [m] and when it was last heard [s], (actuated,) each.

        Raises HardwareError that says which duty ended the run; the caller stops the motors.
        """


class Sink(Protocol):
    """Takes rows in the order in which they come, from several threads: `store.journal.Journal.append`."""

    def __call__(self, stream: str, row: Mapping[str, Any]) -> None:
        """One row of a stream of `layout`. Raises ArtifactError on a full disk."""
