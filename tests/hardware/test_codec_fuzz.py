"""10,000 damaged lines for every codec: no crash, and nothing comes out that the controller could not take."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.devices.lengths import Lengths
from r2s2r_cli.devices.pid import WirePid
from r2s2r_cli.hardware.codec import codec
from r2s2r_cli.hardware.codec.base import Event, Reading
from r2s2r_cli.hardware.codec.checked import crc
from r2s2r_cli.hardware.wiring import Picture, Wiring
from schemas.robot import Robot

LINES = 10_000
_HEAD = b"7,S,0,20000,1,7400," + b",".join([b"20.000"] * 9 + [b"5"] * 6 + [b"0.1"] * 6)
SEEDS = {
    "checked": (
        _HEAD + b"*" + crc(_HEAD), b"1,H,1,threebar,v2,3,6,9,250,0,0*0000", b"3,K,9,4,1500000*0000", b"5,T,7,1*0000",
    ),
    "boards": (
        b"1 20.10 21.20 22.30 0.20 -120 340 0.00 -1.00 0.50 18.00 0.00 -9.00", b"MPR121 NOT FOUND", b"#tick 7 1",
    ),
    "legacy": (b"****S" + b" 0x28c" * 9, b"**q 1 1.0 0.0 0.0 0.0", b"*A 0.00 0.00 -1.00", b"#lockstep 20000"),
}  # fmt: skip
ALPHABET = b"0123456789.,-+*# xSKHBTAqdnaifeE_\0\r\n\xff\x80"


def damaged(draw: np.random.Generator, seed: bytes) -> bytes:
    """A line with bytes changed, taken out, put in, doubled; sometimes cut, joined, or sealed again."""
    line = bytearray(seed)
    for _ in range(int(draw.integers(0, 6))):
        at = int(draw.integers(0, len(line) + 1))
        match draw.integers(0, 5):
            case 0:
                line[at : at + 1] = bytes([ALPHABET[draw.integers(len(ALPHABET))]])
            case 1:
                del line[at : at + int(draw.integers(1, 9))]
            case 2:
                line[at:at] = bytes(draw.integers(0, 256, int(draw.integers(1, 9)), dtype=np.uint8))
            case 3:
                line[at:at] = line[at : at + 9] * int(draw.integers(1, 60))
            case _:
                line = line[:at] if draw.random() < 0.5 else line + line
    if draw.random() < 0.3:
        head = bytes(line).rpartition(b"*")[0]
        return head + b"*" + crc(head)  # the sum is right: the fields must be looked at all the same
    return bytes(line)


@pytest.mark.parametrize("protocol", SEEDS)
def test_no_crash_and_no_speed_out_of_range(protocol: str, threebar: Robot) -> None:
    """Every damaged line gives an event; a controller fed with what passes never leaves -1 .. 1."""
    made = codec(protocol, sensors=9, motors=6)
    wiring, lengths, pid = Wiring.of(threebar), Lengths.of(threebar), WirePid.of(threebar)
    picture = Picture(wiring, 0.02)
    draw = np.random.default_rng(len(protocol))
    taken = 0
    for i in range(LINES):
        event = made.decode(damaged(draw, SEEDS[protocol][int(draw.integers(len(SEEDS[protocol])))]))
        assert isinstance(event, Event)
        if isinstance(event, Reading):
            taken += 1
            assert event.capacitance.shape == (9,) and not np.isinf(event.capacitance).any()
            assert not (event.capacitance < 0).any()
            sample = picture.add(event, 0.02 * i)
            duty = wiring.duty(pid.tick(lengths(sample.capacitance)[:6], np.ones(6)))
            assert made.command(duty).data and (np.abs(duty) <= 1).all()
    assert taken > LINES / 100, "the damage leaves nothing to look at"
