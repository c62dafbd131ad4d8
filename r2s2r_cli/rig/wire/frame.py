"""The frame of a checked line: `seq,type,field,...*CRC\\n`."""

from __future__ import annotations

import binascii
import re
from collections.abc import Sequence
from dataclasses import dataclass

from r2s2r_cli.rig.wire.base import LINE_MAX

SEQ_COUNT = 65536
"""Numbers of lines before they begin again at 0."""

_FRAME = re.compile(rb"(0|[1-9][0-9]{0,4}),([A-Z])((?:,[!-)+\--~]*)*)\*([0-9A-F]{4})\n")
"""Fields: printable ASCII but space, comma and asterisk."""
_NUMBER = re.compile(r"-?[0-9]{1,15}(\.[0-9]{1,15})?")


@dataclass(frozen=True)
class Frame:
    """A line that arrived whole."""

    seq: int
    type: str
    fields: tuple[str, ...]


def parse(line: bytes) -> Frame | None:
    """The frame in a line, newline included; None where anything is wrong with it. Never raises."""
    if len(line) > LINE_MAX:
        return None
    found = _FRAME.fullmatch(line)
    if found is None or int(found[4], 16) != _crc(line[: found.start(4) - 1]) or int(found[1]) >= SEQ_COUNT:
        return None
    fields = tuple(found[3].decode("ascii").split(",")[1:])
    return Frame(int(found[1]), found[2].decode("ascii"), fields)


def build(seq: int, kind: str, fields: Sequence[str]) -> bytes:
    """The line of a frame. The fields are taken as they are."""
    body = ",".join([str(seq), kind, *fields]).encode("ascii")
    return b"%s*%04X\n" % (body, _crc(body))


def number(text: str) -> float | None:
    """A number of the protocol; None: it is none."""
    return float(text) if _NUMBER.fullmatch(text) else None


def newer(seq: int, last: int | None) -> bool:
    """Whether a line comes after the last one that was taken, on the circle of numbers."""
    return last is None or 0 < (seq - last) % SEQ_COUNT < SEQ_COUNT // 2


def _crc(data: bytes) -> int:
    return binascii.crc_hqx(data, 0xFFFF)
