"""Our protocol, the host's side: what is read, what is said, and that damage is always seen."""

from __future__ import annotations

import binascii

import numpy as np
import pytest

from r2s2r_cli.hardware.codec.base import Ack, Beat, Corrupt, DeviceState, Greeting, Passed, Reading, TickDone
from r2s2r_cli.hardware.codec.checked import CheckedCodec, crc


def sealed(text: str) -> bytes:
    """A line of the device, without its newline; the CRC is worked out bit by bit, not by the library."""
    value = 0xFFFF
    for byte in text.encode("ascii"):
        value ^= byte << 8
        for _ in range(8):
            value = ((value << 1) ^ 0x1021 if value & 0x8000 else value << 1) & 0xFFFF
    return f"{text}*{value:04X}".encode("ascii")


CODEC = CheckedCodec(sensors=3, motors=2)
SAMPLE = "65535,S,1,20000,1,7400,,21.250,,-40,,0.000,-9.807,0.125,,,"


def test_the_check_sum_is_the_one_of_the_page() -> None:
    """CRC-16/CCITT-FALSE: check value, and the example of the page."""
    assert crc(b"123456789") == b"29B1"
    assert sealed("17,B") == b"17,B*B5A5"
    assert binascii.crc_hqx(b"17,B", 0xFFFF) == 0xB5A5


def test_a_sample_in_si_with_nan_for_what_is_not_there() -> None:
    """pF become F, microseconds seconds, millivolts volts; an empty field is NaN, a missing IMU None."""
    event = CODEC.decode(sealed(SAMPLE))
    assert isinstance(event, Reading)
    assert (event.seq, event.board, event.t_board, event.voltage) == (65535, 1, 0.02, 7.4)
    assert event.state is DeviceState.RUN
    np.testing.assert_allclose(event.capacitance, [np.nan, 21.25e-12, np.nan], rtol=1e-12)
    np.testing.assert_array_equal(event.encoder, [-40, np.nan])
    assert event.a_B is not None
    np.testing.assert_array_equal(event.a_B, [0, -9.807, 0.125])
    assert event.w_WB is None


def test_the_other_lines_of_the_device() -> None:
    """Acknowledgement, heartbeat, greeting, tick, and a type that we do not know."""
    assert CODEC.decode(sealed("3,K,9,4,1500000")) == Ack(seq=3, of=9, code=4, t_board=1.5)
    assert CODEC.decode(sealed("4,B,1000000,3,2,5")) == Beat(
        seq=4, t_board=1.0, state=DeviceState.ESTOP, bad=2, missed=5
    )
    assert CODEC.decode(sealed("5,T,7,140000")) == TickDone(seq=5, k=7, t=0.14)
    assert CODEC.decode(sealed("6,Z,1")) == Passed(seq=6)
    hello = CODEC.decode(sealed("0,H,1,threebar,v2,3,2,3,250,0,20000"))
    assert hello == Greeting(
        seq=0, version=1, robot="threebar", firmware="v2", boards=3, motors=2, sensors=3, watchdog=0.25,
        state=DeviceState.WAIT, lock_step=0.02,
    )  # fmt: skip


@pytest.mark.parametrize(
    "text",
    [
        SAMPLE + ",1", SAMPLE.removesuffix(","), SAMPLE.replace("21.250", "nan"), SAMPLE.replace("21.250", "1e3"),
        SAMPLE.replace("21.250", "+1.0"), SAMPLE.replace("21.250", "1_0.0"), SAMPLE.replace("21.250", " 21.250"),
        SAMPLE.replace("65535", "65536"), SAMPLE.replace("65535", "07"), "3,K,9,x,0", "3,K,9,-1,0", "3,B,1,9,0,0",
        "3,k,9,0,0", "3,H,1,three bar,v2,3,2,3,250,0,0", "", "3", "3,",
    ],
)  # fmt: skip
def test_a_line_that_breaks_a_rule_is_corrupt_though_its_sum_is_right(text: str) -> None:
    """Fields too many or too few, numbers in other forms, unknown states, a number beyond 65535."""
    assert isinstance(CODEC.decode(sealed(text)), Corrupt)


def test_the_sum_must_be_in_capitals_and_the_line_end_bare() -> None:
    """Lower case may be a flipped bit; so may a carriage return, or bytes behind the sum."""
    good = sealed("17,B,1,1,0,0")
    head, _, check = good.rpartition(b"*")
    lower = head + b"*" + check.lower()
    assert isinstance(CODEC.decode(good), Beat)
    for line in (*([lower] if lower != good else []), good + b"\r", good + b" ", b"\0" + good, good[:-1], good * 2):
        assert isinstance(CODEC.decode(line), Corrupt)


def test_every_flipped_bit_and_every_pair_of_them_is_seen() -> None:
    """All single flips of a sample line, all pairs of a short one, and 5,000 random triples."""
    line = sealed(SAMPLE)

    def flipped(of: bytes, *bits: int) -> bytes:
        out = bytearray(of)
        for bit in bits:
            out[bit // 8] ^= 1 << bit % 8
        return bytes(out)

    assert all(isinstance(CODEC.decode(flipped(line, i)), Corrupt) for i in range(8 * len(line)))
    short = sealed("17,K,9,0,5")
    pairs = [(i, j) for i in range(8 * len(short)) for j in range(i)]
    assert all(isinstance(CODEC.decode(flipped(short, *pair)), Corrupt) for pair in pairs)
    draw = np.random.default_rng(5)
    for _ in range(5000):
        bits = draw.choice(8 * len(line), 3, replace=False)
        assert isinstance(CODEC.decode(flipped(line, *bits)), Corrupt)


def test_what_we_say_is_numbered_and_sealed() -> None:
    """Hello, command, stops, reset and tick: one number after the other, round from 65535 to 0."""
    codec = CheckedCodec(sensors=3, motors=2)
    codec._seq = 65530
    said = [
        codec.hello(), codec.command(np.array([-1.0, 0.25])), codec.stop(), codec.emergency(), codec.reset(),
        codec.tick(12), codec.stop(),
    ]  # fmt: skip
    expected = [
        "65531,H,1,r2s2r",
        "65532,C,-1.0000,0.2500",
        "65533,X",
        "65534,E",
        "65535,R,RESET",
        "0,T,12",
        "1,X",
    ]
    assert [line.data for line in said] == [sealed(text) + b"\n" for text in expected]
    assert [line.seq for line in said] == [65531, 65532, 65533, 65534, 65535, None, 1]


@pytest.mark.parametrize("duty", [[1.0001, 0], [0, -2], [np.nan, 0], [np.inf, 0], [0], [0, 0, 0]])
def test_no_speed_out_of_range_is_ever_said(duty: list[float]) -> None:
    """Neither clipped nor sent: a caller that asks for it is wrong."""
    with pytest.raises(ValueError, match="speeds"):
        CODEC.command(np.array(duty))
