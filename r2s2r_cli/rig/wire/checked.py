"""Our own protocol, device side: numbered and checked lines, acknowledgements, watchdog, latched emergency stop."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from enum import IntEnum

import numpy as np

from r2s2r_cli.rig.wire.base import BoardReading, Line, Motors, Received
from r2s2r_cli.rig.wire.frame import SEQ_COUNT, Frame, build, newer, number, parse

VERSION = "1"
FIRMWARE = "r2s2r-rig"
WATCHDOG_S = 0.24
"""Without a valid command for this long the motors stop: they are still before 0.25 s are over."""
_HELLO_S, _BUSY_BEAT_S, _IDLE_BEAT_S = 1.0, 1.0, 0.1
_NAME = re.compile(r"[A-Za-z0-9_.-]{1,32}")
_TICK = re.compile(r"[1-9][0-9]{0,9}")
_ROUNDING = 1e-9
"""Times that differ by less [s] are the same: ticks are sums of steps."""


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


class CheckedCodec:
    """Device side of `checked`. tick_us: length of a tick in lock-step [us], 0 in real time.

    board_clock: world's time [s] -> time of board 0 [s], for acknowledgements.
    """

    datagrams_end = True

    def __init__(
        self, motors: Motors, *, robot: str, boards: int, n_motors: int, n_sensors: int, tick_us: int = 0,
        board_clock: Callable[[float], float] = float,
    ) -> None:  # fmt: skip
        self._motors = motors
        self._hello_fields = (
            VERSION, re.sub(r"[^A-Za-z0-9_.-]", "_", robot)[:32] or "_", FIRMWARE, str(boards), str(n_motors),
            str(n_sensors), str(round(WATCHDOG_S * 1e3)),
        )  # fmt: skip
        self._n_motors, self._tick_us, self._clock = n_motors, tick_us, board_clock
        self.state = State.WAIT
        self.bad = self.lost = 0
        self._seq, self._last = -1, None  # type: int, int | None
        self._commanded: float | None = None
        self._hello_due = self._beat_due = 0.0
        self._sampled = -math.inf
        self._answers: dict[str, Callable[[Frame, float], Code | None]] = {
            "H": self._hello, "C": self._command, "X": self._stop, "E": self._latch, "R": self._reset, "B": self._beat,
        }  # fmt: skip

    def opened(self, t: float) -> None:
        """A host has come: say hello at once."""
        self._hello_due = t

    def closed(self, t: float) -> None:
        """The host has gone: stop."""
        self._halt()
        if self.state is not State.ESTOP:
            self.state = State.WAIT

    def tick_of(self, line: bytes) -> int | None:
        """The tick that a line asks for."""
        return _tick_of(parse(line))

    def untouched(self, line: bytes) -> bool:
        """A tick is, and in lock-step the hello before it, which could not arrive late."""
        frame = parse(line)
        return _tick_of(frame) is not None or (self._tick_us > 0 and frame is not None and frame.type == "H")

    def receive(self, line: bytes, board: int | None, t: float) -> Received:
        """Obey a valid line and answer it; count an invalid one."""
        frame = parse(line)
        answer = self._answers.get(frame.type) if frame else None
        tick = _tick_of(frame)
        if frame is None or (answer is None and tick is None):
            self.bad += 1
            return Received()
        at = board or 0
        if tick is not None:
            self._taken(frame.seq)
            return Received(tick=tick)
        assert answer is not None  # noqa: S101 - for the type checker: one of both is there
        if frame.type in "CRB" and not newer(frame.seq, self._last):
            return Received((self._acknowledge(frame, Code.NOT_NEWER, t, at),))
        code = answer(frame, t)
        if code is None:
            self.bad += 1
            return Received()
        if frame.type == "H":
            self._last = frame.seq
        else:
            self._taken(frame.seq)
        lines = [self._acknowledge(frame, code, t, at)]
        if frame.type == "H":
            lines.append(self._say_hello(t, at))
            lines = [replace(line, safe=self._tick_us > 0) for line in lines]
        return Received(tuple(lines))

    def advance(self, t: float) -> list[Line]:
        """Stop the motors where no command came in time; hello while nobody has answered; heartbeats."""
        silent = None if self._commanded is None else t - self._commanded
        if self.state is State.RUN and silent is not None and silent >= WATCHDOG_S - _ROUNDING:
            self._halt()
            self.state = State.HELD
        lines = []
        if self.state is State.WAIT and t >= self._hello_due - _ROUNDING:
            lines.append(self._say_hello(t, 0))
        if t >= self._beat_due - _ROUNDING:
            busy = t - self._sampled < _IDLE_BEAT_S
            self._beat_due = t + (_BUSY_BEAT_S if busy else _IDLE_BEAT_S)
            lines.append(self._line("B", self._us(t), str(int(self.state)), str(self.bad), str(self.lost)))
        return lines

    def sample(self, reading: BoardReading, t: float) -> list[Line]:
        """One line `S`; none while the board has a status text for it."""
        if reading.status is not None:
            return []
        if t - self._sampled >= _IDLE_BEAT_S:
            self._beat_due = t + _BUSY_BEAT_S
        self._sampled = t
        battery = str(round(reading.battery * 1e3)) if math.isfinite(reading.battery) else ""
        fields = [
            str(reading.board), str(round(reading.t_board * 1e6)), str(int(self.state)), battery,
            *(_text(x, 3) for x in reading.pF), *(_text(x, 0) for x in reading.encoder),
            *(_text(x, 3) for x in reading.a_B), *(_text(x, 4) for x in reading.w_WB),
        ]  # fmt: skip
        return [self._line("S", *fields, board=reading.board)]

    def announce(self, tick_us: int, t: float, *, first: bool) -> list[Line]:
        """The hello, which has the tick. It is not counted, so that the bytes after it do not depend on how many of it
        the wall's clock made: it has the number of the line before. A stream's host hears it as the answer to its own.
        """
        return [Line(0, build(self._seq % SEQ_COUNT, "H", self._hello_now()), safe=True)] if first else []

    def ticked(self, k: int, t: float, board: int) -> Line:
        """`T` at the end of a tick."""
        return self._line("T", str(k), str(round(t * 1e6)), board=board, safe=True)

    def _hello(self, frame: Frame, t: float) -> Code | None:
        if len(frame.fields) != 2 or not _NAME.fullmatch(frame.fields[1]):
            return None
        self._halt()
        if frame.fields[0] != VERSION:
            return Code.VERSION
        if self.state is State.ESTOP:
            return Code.LATCHED
        self.state, self.lost = State.RUN, 0
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
        self.state, self._hello_due = State.WAIT, t
        return Code.DONE

    def _beat(self, frame: Frame, t: float) -> Code | None:
        return None if frame.fields else Code.DONE

    def _halt(self) -> None:
        self._motors.stop()
        self._commanded = None

    def _taken(self, seq: int) -> None:
        """Note the number of a line that was taken, and how many before it never came."""
        if self._last is not None and newer(seq, self._last):
            self.lost += (seq - self._last) % SEQ_COUNT - 1
        if newer(seq, self._last):
            self._last = seq

    def _acknowledge(self, frame: Frame, code: Code, t: float, board: int) -> Line:
        return self._line("K", str(frame.seq), str(int(code)), self._us(t), board=board)

    def _say_hello(self, t: float, board: int) -> Line:
        self._hello_due = t + _HELLO_S
        return self._line("H", *self._hello_now(), board=board)

    def _hello_now(self) -> tuple[str, ...]:
        return (*self._hello_fields, str(int(self.state)), str(self._tick_us))

    def _line(self, kind: str, *fields: str, board: int = 0, safe: bool = False) -> Line:
        self._seq = (self._seq + 1) % SEQ_COUNT
        return Line(board, build(self._seq, kind, fields), safe)

    def _us(self, t: float) -> str:
        return str(round(self._clock(t) * 1e6))


def _tick_of(frame: Frame | None) -> int | None:
    if frame is None or frame.type != "T" or len(frame.fields) != 1 or not _TICK.fullmatch(frame.fields[0]):
        return None
    return int(frame.fields[0])


def _text(x: float, decimals: int) -> str:
    return f"{x:.{decimals}f}" if math.isfinite(x) else ""
