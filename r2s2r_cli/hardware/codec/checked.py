"""Our own protocol: numbered lines with a CRC-16, acknowledgements, a device that stops by itself."""

from __future__ import annotations

import binascii
import re

import numpy as np

from r2s2r_cli.hardware.codec.base import (
    PICO,
    Ack,
    Beat,
    Corrupt,
    DeviceState,
    Event,
    Greeting,
    Outgoing,
    Passed,
    Reading,
    TickDone,
    checked_duty,
)

VERSION = 1
HOST = "r2s2r"
_LINE = re.compile(rb"(0|[1-9][0-9]{0,4}),([A-Z])((?:,[^,*\s]*)*)\*([0-9A-F]{4})")
_NUMBER = re.compile(r"-?[0-9]{1,18}(\.[0-9]{1,9})?")
_COUNT = re.compile(r"[0-9]{1,18}")
_NAME = re.compile(r"[A-Za-z0-9_.-]{1,64}")
_MOST = 512
"""Bytes of a line, newline included."""


def crc(data: bytes) -> bytes:
    """CRC-16/CCITT-FALSE as four capital hexadecimal digits."""
    return b"%04X" % binascii.crc_hqx(data, 0xFFFF)


class CheckedCodec:
    """Every line damaged on the way is known: the CRC finds any three wrong bits, and any 16 in a row."""

    name = "checked"
    watchdog: float | None = 0.25
    numbered = True
    promise = ""

    def __init__(self, *, sensors: int, motors: int) -> None:
        self.boards = 1  # what is needed to begin; the greeting tells how many there are
        self._sensors = sensors
        self._motors = motors
        self._seq = 0

    def decode(self, line: bytes) -> Event:
        """The meaning of a line without its newline; Corrupt unless every rule of the page holds."""
        match = _LINE.fullmatch(line)
        if match is None or len(line) >= _MOST:
            return Corrupt(why="no line of this protocol")
        head, _, check = line.rpartition(b"*")
        if crc(head) != check:
            return Corrupt(why="check sum")
        seq = int(match[1])
        if seq > 65535:
            return Corrupt(why="number beyond 65535")
        try:
            fields = match[3].decode("ascii").split(",")[1:]
            return self._event(match[2].decode("ascii"), seq, fields)
        except (ValueError, KeyError) as error:
            return Corrupt(why=str(error))

    def _event(self, kind: str, seq: int, fields: list[str]) -> Event:
        match kind:
            case "S":
                return self._reading(seq, fields)
            case "K":
                of, code, us = (_count(field) for field in _some(fields, 3))
                return Ack(seq=seq, of=of, code=code, t_board=us / 1e6)
            case "B":
                us, now, bad, missed = (_count(field) for field in _some(fields, 4))
                return Beat(seq=seq, t_board=us / 1e6, state=DeviceState(now), bad=bad, missed=missed)
            case "T":
                k, us = (_count(field) for field in _some(fields, 2))
                return TickDone(seq=seq, k=k, t=us / 1e6)
            case "H":
                version, robot, firmware, boards, motors, sensors, watchdog, state, lock = _some(fields, 9)
                return Greeting(
                    seq=seq, version=_count(version), robot=_name(robot), firmware=_name(firmware),
                    boards=_count(boards), motors=_count(motors), sensors=_count(sensors),
                    watchdog=_count(watchdog) / 1e3, state=DeviceState(_count(state)), lock_step=_count(lock) / 1e6,
                )  # fmt: skip
        return Passed(seq=seq)

    def _reading(self, seq: int, fields: list[str]) -> Reading:
        sensors, motors = self._sensors, self._motors
        board, t, state, battery, *rest = _some(fields, 4 + sensors + motors + 6)
        values = np.array([_number(field) for field in rest])
        capacitance, encoder, a_B, w_WB = np.split(values, [sensors, sensors + motors, sensors + motors + 3])
        return Reading(
            seq=seq, board=_count(board), t_board=_count(t) / 1e6, state=DeviceState(_count(state)),
            voltage=_count(battery) / 1e3 if battery else None, capacitance=capacitance * PICO, encoder=encoder,
            a_B=None if np.isnan(a_B).all() else a_B, w_WB=None if np.isnan(w_WB).all() else w_WB,
        )  # fmt: skip

    def hello(self) -> Outgoing:
        """Version and name; the device numbers anew from here."""
        return self._line("H", VERSION, HOST)

    def command(self, duty: np.ndarray) -> Outgoing:
        """Duties to four decimals."""
        return self._line("C", *(f"{u:.4f}" for u in checked_duty(duty, self._motors)))

    def stop(self) -> Outgoing:
        """Obeyed in every state."""
        return self._line("X")

    def emergency(self) -> Outgoing:
        """Latched on the device."""
        return self._line("E")

    def reset(self) -> Outgoing:
        """The device waits for a hello afterwards."""
        return self._line("R", "RESET")

    def tick(self, k: int) -> Outgoing:
        """Answered by TickDone."""
        seq = self._next()
        return Outgoing(_sealed(f"{seq},T,{k}"))  # no acknowledgement comes

    def _line(self, *fields: object) -> Outgoing:
        seq = self._next()
        return Outgoing(_sealed(",".join(str(field) for field in (seq, *fields))), seq=seq)

    def _next(self) -> int:
        self._seq = (self._seq + 1) % 65536
        return self._seq


def _sealed(text: str) -> bytes:
    head = text.encode("ascii")
    return head + b"*" + crc(head) + b"\n"


def _some(fields: list[str], count: int) -> list[str]:
    if len(fields) != count:
        raise ValueError(f"{len(fields)} fields, not {count}")
    return fields


def _count(field: str) -> int:
    if not _COUNT.fullmatch(field):
        raise ValueError(f"no count: {field[:20]!r}")
    return int(field)


def _number(field: str) -> float:
    if not field:
        return float("nan")
    if not _NUMBER.fullmatch(field):
        raise ValueError(f"no number: {field[:20]!r}")
    return float(field)


def _name(field: str) -> str:
    if not _NAME.fullmatch(field):
        raise ValueError(f"no name: {field[:20]!r}")
    return field
