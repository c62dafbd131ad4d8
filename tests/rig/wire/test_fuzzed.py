"""Ten thousand spoilt lines for each device codec: none fails, none drives a motor beyond its range."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.rig.transport.base import LineBuffer
from r2s2r_cli.rig.wire import PROTOCOLS, device_codec
from r2s2r_cli.rig.wire.checked import CheckedCodec
from tests.support.rig_host import line
from tests.support.rig_machine import Machine, reading
from tests.support.rig_robots import known

COUNT = 10_000


def valid(protocol: str, rng: np.random.Generator, k: int) -> bytes:
    """A line that a host may send."""
    speeds = rng.uniform(-1, 1, 6)
    if protocol == "checked":
        kinds = ["C," + ",".join(f"{x:.3f}" for x in speeds), "X", "E", "R,RESET", "B", "H,1,fuzz", f"T,{k}"]
        return line(f"{k % 65536},{kinds[rng.choice(7, p=[0.7, 0.05, 0.05, 0.05, 0.05, 0.05, 0.05])]}")
    if protocol == "boards":
        return ("0 0 0 " + " ".join(f"{99 * x:.2f}" for x in speeds) + " 0 0 0\n").encode()
    return b" " * 10 + (b"s\n" if rng.random() < 0.2 else b"d %d %.2f\n" % (rng.integers(1, 7), 99 * speeds[0]))


def spoilt(data: bytes, rng: np.random.Generator) -> bytes:
    """One to eight bytes changed, taken out, doubled or put in; now and then the end is cut off."""
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 9))):
        at, kind = int(rng.integers(len(out) + 1)), int(rng.integers(4))
        if kind == 0:
            out[at : at + 1] = rng.bytes(1)
        elif kind == 1:
            del out[at : at + 1]
        elif kind == 2:
            out[at:at] = out[at : at + int(rng.integers(1, 200))]
        else:
            out[at:at] = rng.choice([b"-", b"9", b"e", b".", b"nan", b"inf", b"1e999", b"\x00", b"\xff", b"\n", b"\r"])
    return bytes(out[: int(rng.integers(len(out) + 1))] if rng.random() < 0.1 else out)


@pytest.mark.slow
@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_spoilt_lines_do_no_harm(protocol: str) -> None:
    """Nine of ten lines are spoilt; duties stay finite and in range after each, and ours counts the bad ones.

    In our protocol nothing but a whole line moves a motor: one in 65536 spoilt ones may have a right CRC by chance.
    """
    rng = np.random.default_rng(7)
    machine, buffer = Machine(), LineBuffer()
    codec = device_codec(protocol, known(), machine, boards=3)
    codec.receive(line("0,H,1,fuzz"), None, 0.0)
    bad = 0
    for k in range(COUNT):
        good = rng.random() < 0.1
        data = valid(protocol, rng, k)
        for one in buffer.feed(data if good else spoilt(data, rng)):
            before = len(machine.log)
            codec.receive(one, None, 0.001 * k)
            moved = any(duty.any() for _, duty in machine.log[before:])
            assert one == data or not moved or protocol != "checked", "a spoilt line moved a motor"
            codec.sample(reading(k % 3), 0.001 * k)
        bad += not good
    duties = np.array([duty for _, duty in machine.log])
    assert np.isfinite(duties).all()
    assert np.abs(duties).max() <= 1
    assert duties.any()
    if isinstance(codec, CheckedCodec):
        assert codec.bad > bad / 2
