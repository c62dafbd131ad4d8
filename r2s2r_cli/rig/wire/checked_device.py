"""What a device of our own protocol does with a valid line: its state, the watchdog, the latched emergency stop."""

from __future__ import annotations

import re
from collections.abc import Callable
from enum import IntEnum

import numpy as np

from r2s2r_cli.rig.wire.base import Motors
from r2s2r_cli.rig.wire.frame import Frame, number

VERSION = "1"
WATCHDOG_S = 0.24
"""Without a valid command for this long the motors stop: they are still before 0.25 s are over."""
ROUNDING_S = 1e-9
"""Times that differ by less [s] are the same: ticks are sums of steps."""
_NAME = re.compile(r"[A-Za-z0-9_.-]{1,32}")


class State(IntEnum):
    """What the device does with a command."""

    WAIT = 0
    RUN = 1
    HELD = 2
    ESTOP = 3


class Code(IntEnum):
    """What became of a line, as its acknowledgement says it."""

    DONE = 0
    LATCHED = 1
    RANGE = 2
    NO_HELLO = 3
    NOT_NEWER = 4
    VERSION = 5
    NO_RESET = 6
    COUNT = 7


class CheckedDevice:
    """The motors, and whether commands reach them: `state`."""

    def __init__(self, motors: Motors, n_motors: int) -> None:
        self._motors, self._n_motors = motors, n_motors
        self.state = State.WAIT
        self._commanded: float | None = None
        self._answers: dict[str, Callable[[Frame, float], Code | None]] = {
            "H": self._hello, "C": self._command, "X": self._stop, "E": self._latch, "R": self._reset, "B": self._beat,
        }  # fmt: skip

    def knows(self, frame: Frame) -> bool:
        """Whether there is such a type of line."""
        return frame.type in self._answers

    def obey(self, frame: Frame, t: float) -> Code | None:
        """What became of a line of a known type, at t [s]; None for one whose fields are wrong."""
        return self._answers[frame.type](frame, t)

    def left(self) -> None:
        """The host has gone: stop."""
        self._halt()
        if self.state is not State.ESTOP:
            self.state = State.WAIT

    def watch(self, t: float) -> None:
        """Stop the motors where no command came in time before t [s]."""
        silent = None if self._commanded is None else t - self._commanded
        if self.state is State.RUN and silent is not None and silent >= WATCHDOG_S - ROUNDING_S:
            self._halt()
            self.state = State.HELD

    def _hello(self, frame: Frame, t: float) -> Code | None:
        if len(frame.fields) != 2 or not _NAME.fullmatch(frame.fields[1]):
            return None
        self._halt()
        if frame.fields[0] != VERSION:
            return Code.VERSION
        if self.state is State.ESTOP:
            return Code.LATCHED
        self.state = State.RUN
        return Code.DONE

    def _command(self, frame: Frame, t: float) -> Code | None:
        speeds = [number(text) for text in frame.fields]
        if None in speeds:
            return None
        if self.state is State.ESTOP:
            return Code.LATCHED
        if self.state is State.WAIT:
            return Code.NO_HELLO
        if len(speeds) != self._n_motors:
            self._halt()
            return Code.COUNT
        duty = np.array(speeds, dtype=float)
        if (np.abs(duty) > 1).any():
            self._halt()
            return Code.RANGE
        self.state, self._commanded = State.RUN, t
        self._motors.command(duty, t)
        return Code.DONE

    def _stop(self, frame: Frame, t: float) -> Code | None:
        if frame.fields:
            return None
        self._halt()
        return Code.DONE

    def _latch(self, frame: Frame, t: float) -> Code | None:
        if frame.fields:
            return None
        self._halt()
        self.state = State.ESTOP
        return Code.DONE

    def _reset(self, frame: Frame, t: float) -> Code | None:
        if len(frame.fields) != 1:
            return None
        if self.state is not State.ESTOP or frame.fields[0] != "RESET":
            return Code.NO_RESET
        self.state = State.WAIT
        return Code.DONE

    def _beat(self, frame: Frame, t: float) -> Code | None:
        return None if frame.fields else Code.DONE

    def _halt(self) -> None:
        self._motors.stop()
        self._commanded = None
