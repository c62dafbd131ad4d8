"""Our own protocol, device side: numbered and checked lines, acknowledgements, heartbeats; ticks in lock-step."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace

from r2s2r_cli.rig.wire.base import BoardReading, Line, Motors, Received
from r2s2r_cli.rig.wire.checked_device import ROUNDING_S, VERSION, WATCHDOG_S, CheckedDevice, Code, State
from r2s2r_cli.rig.wire.frame import SEQ_COUNT, Frame, build, newer, parse

FIRMWARE = "r2s2r-rig"
_HELLO_S, _BUSY_BEAT_S, _IDLE_BEAT_S = 1.0, 1.0, 0.1
_TICK = re.compile(r"[1-9][0-9]{0,9}")


class CheckedCodec:
    """Device side of `checked`. tick_us: length of a tick in lock-step [us], 0 in real time.

    board_clock: world's time [s] -> time of board 0 [s], for acknowledgements.
    """

    datagrams_end = True

    def __init__(
        self, motors: Motors, *, robot: str, boards: int, n_motors: int, n_sensors: int, tick_us: int = 0,
        board_clock: Callable[[float], float] = float,
    ) -> None:  # fmt: skip
        self._device = CheckedDevice(motors, n_motors)
        self._hello_fields = (
            VERSION, re.sub(r"[^A-Za-z0-9_.-]", "_", robot)[:32] or "_", FIRMWARE, str(boards), str(n_motors),
            str(n_sensors), str(round(WATCHDOG_S * 1e3)),
        )  # fmt: skip
        self._tick_us, self._clock = tick_us, board_clock
        self.bad = self.lost = 0
        self._seq, self._last = -1, None  # type: int, int | None
        self._hello_due = self._beat_due = 0.0
        self._sampled = -math.inf

    @property
    def state(self) -> State:
        """What the device does with a command."""
        return self._device.state

    def opened(self, t: float) -> None:
        """A host has come: say hello at once."""
        self._hello_due = t

    def closed(self, t: float) -> None:
        """The host has gone: stop."""
        self._device.left()

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
        tick = _tick_of(frame)
        if frame is None or (tick is None and not self._device.knows(frame)):
            self.bad += 1
            return Received()
        at = board or 0
        if tick is not None:
            self._taken(frame.seq)
            return Received(tick=tick)
        if frame.type in "CRB" and not newer(frame.seq, self._last):
            return Received((self._acknowledge(frame, Code.NOT_NEWER, t, at),))
        code = self._device.obey(frame, t)
        if code is None:
            self.bad += 1
            return Received()
        if frame.type == "H":
            self._last = frame.seq
            self.lost = 0 if code is Code.DONE else self.lost
        else:
            self._taken(frame.seq)
        if frame.type == "R" and code is Code.DONE:
            self._hello_due = t
        lines = [self._acknowledge(frame, code, t, at)]
        if frame.type == "H":
            lines.append(self._say_hello(t, at))
            lines = [replace(line, safe=self._tick_us > 0) for line in lines]
        return Received(tuple(lines))

    def advance(self, t: float) -> list[Line]:
        """Stop the motors where no command came in time; hello while nobody has answered; heartbeats."""
        self._device.watch(t)
        lines = []
        if self.state is State.WAIT and t >= self._hello_due - ROUNDING_S:
            lines.append(self._say_hello(t, 0))
        if t >= self._beat_due - ROUNDING_S:
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
