"""Our protocol, device side, against docs/reference/protocols.md. The host's lines are made here, by hand."""

from __future__ import annotations

import binascii

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from r2s2r_cli.rig.wire.base import Line
from r2s2r_cli.rig.wire.checked import CheckedCodec
from r2s2r_cli.rig.wire.checked_device import WATCHDOG_S, Code, State
from tests.support.rig_machine import MOTORS, SENSORS, Machine, reading


def line(body: str) -> bytes:
    """A line as a host sends it; the CRC from the standard library, as the page has it."""
    return f"{body}*{binascii.crc_hqx(body.encode(), 0xFFFF):04X}\n".encode()


def command(seq: int, *speeds: float) -> bytes:
    """A command line."""
    return line(",".join([str(seq), "C", *map(str, speeds)]))


def fields(sent: Line) -> list[str]:
    """Fields of a line of the device, number first; its CRC is checked."""
    body, _, crc = sent.data.decode("ascii").removesuffix("\n").partition("*")
    assert int(crc, 16) == binascii.crc_hqx(body.encode(), 0xFFFF)
    return body.split(",")


class Device:
    """A codec and its motors, greeted unless told otherwise."""

    def __init__(self, *, greeted: bool = True) -> None:
        self.machine = Machine()
        self.codec = CheckedCodec(self.machine, robot="three bar", boards=3, n_motors=MOTORS, n_sensors=SENSORS)
        if greeted:
            self.hear(line("100,H,1,test"))

    def hear(self, data: bytes, t: float = 0.0) -> list[list[str]]:
        """The answers to a line."""
        return [fields(sent) for sent in self.codec.receive(data, None, t).lines]

    def code(self, data: bytes, t: float = 0.0) -> Code:
        """The code of the acknowledgement of a line."""
        answer = self.hear(data, t)[0]
        assert answer[1] == "K"
        return Code(int(answer[3]))


def test_the_crc_is_that_of_the_standard() -> None:
    """CRC-16/CCITT-FALSE has the check value 29B1; the page's example line is right."""
    assert line("123456789")[-5:-1] == b"29B1"
    assert line("17,B") == b"17,B*B5A5\n"


def test_hello_tells_what_the_device_is() -> None:
    """A hello is acknowledged and answered by version, robot, counts, watchdog, state, tick."""
    device = Device(greeted=False)
    done, hello = device.hear(line("7,H,1,test"))
    assert done[1:4] == ["K", "7", "0"]
    assert hello[1:] == ["H", "1", "three_bar", "r2s2r-rig", "3", "6", "9", "240", "1", "0"]
    assert int(hello[0]) == int(done[0]) + 1


def test_another_version_is_refused() -> None:
    """The device of version 1 does not run for a host of version 2, and says which it has."""
    device = Device(greeted=False)
    refused, hello = device.hear(line("7,H,2,test"))
    assert refused[3] == str(int(Code.VERSION))
    assert hello[2] == "1"
    assert device.codec.state is State.WAIT


def test_a_command_reaches_the_motors() -> None:
    """Six speeds are acknowledged with 0 and become the duty."""
    device = Device()
    assert device.code(command(101, 1, -1, 0.5, 0, 0.25, -0.125)) is Code.DONE
    assert device.machine.duty.tolist() == [1, -1, 0.5, 0, 0.25, -0.125]


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (command(101, 1.001, 0, 0, 0, 0, 0), Code.RANGE),
        (command(101, 0, 0, 0, 0, 0, -1e3), Code.RANGE),
        (command(101, 1, 1, 1), Code.COUNT),
        (line("101,C"), Code.COUNT),
        (command(100, 1, 1, 1, 1, 1, 1), Code.NOT_NEWER),
        (command(99, 1, 1, 1, 1, 1, 1), Code.NOT_NEWER),
        (line("101,R,RESET"), Code.NO_RESET),
    ],
)
def test_what_is_refused_does_not_move(data: bytes, code: Code) -> None:
    """Speeds out of range or too few of them, repeated and late lines: the motors do not turn, the code says why."""
    device = Device()
    assert device.code(data) is code
    assert not device.machine.duty.any()


def test_impossible_speeds_stop_what_runs() -> None:
    """A command out of range stops the motors that the one before it had started."""
    device = Device()
    device.hear(command(101, 1, 1, 1, 1, 1, 1))
    device.hear(command(102, 2, 1, 1, 1, 1, 1))
    assert not device.machine.duty.any()


def test_before_the_hello_nothing_moves() -> None:
    """A command without a hello is refused, a stop is not."""
    device = Device(greeted=False)
    assert device.code(command(1, 1, 1, 1, 1, 1, 1)) is Code.NO_HELLO
    assert not device.machine.duty.any()
    assert device.code(line("2,X")) is Code.DONE


def test_the_watchdog_stops_before_a_quarter_second() -> None:
    """Without a valid command the motors stop within 0.25 s; heartbeats, spoilt lines and late ones do not count."""
    device = Device()
    device.hear(command(101, 1, 1, 1, 1, 1, 1), 10.0)
    for k in range(1, 250):
        t = 10.0 + k * 1e-3
        device.hear(line(f"{101 + k},B"), t)
        device.hear(command(102 + k, 1, 1, 1, 1, 1, 1).replace(b"C,1", b"C,0"), t)
        device.hear(command(101, 1, 1, 1, 1, 1, 1), t)
        device.codec.advance(t)
        assert device.machine.duty.any() == (t - 10.0 < WATCHDOG_S - 1e-9)
    assert device.codec.state is State.HELD
    assert device.code(command(500, 0.5, 0, 0, 0, 0, 0), 11.0) is Code.DONE
    assert device.codec.state is State.RUN


def test_commands_in_time_keep_it_running() -> None:
    """Commands every 0.2 s never meet the watchdog, however often it looks."""
    device = Device()
    for k in range(50):
        device.hear(command(101 + k, 1, 0, 0, 0, 0, 0), 0.2 * k)
        for part in range(20):
            device.codec.advance(0.2 * k + 0.01 * part)
        assert device.machine.duty.any()


def test_emergency_stop_is_latched() -> None:
    """After E neither commands nor a hello move anything; only R,RESET leads out, and then a hello must follow."""
    device = Device()
    device.hear(command(101, 1, 1, 1, 1, 1, 1))
    assert device.code(line("5,E")) is Code.DONE, "whatever its number"
    assert not device.machine.duty.any()
    assert device.code(command(102, 1, 1, 1, 1, 1, 1)) is Code.LATCHED
    assert device.code(line("103,H,1,test")) is Code.LATCHED
    assert device.code(line("104,R,reset")) is Code.NO_RESET
    device.codec.closed(0.0)
    device.codec.opened(0.0)
    assert device.codec.state is State.ESTOP
    assert device.code(line("105,R,RESET")) is Code.DONE
    assert device.code(command(106, 1, 1, 1, 1, 1, 1)) is Code.NO_HELLO
    assert not device.machine.duty.any()


def test_a_closed_port_stops() -> None:
    """The host leaves: the motors stop, and the next host must say hello."""
    device = Device()
    device.hear(command(101, 1, 1, 1, 1, 1, 1))
    device.codec.closed(0.0)
    assert not device.machine.duty.any()
    assert device.codec.state is State.WAIT


def test_numbers_go_round() -> None:
    """65535 is followed by 0; what lies behind on the circle is late."""
    device = Device(greeted=False)
    device.hear(line("65535,H,1,test"))
    assert device.code(command(0, 0, 0, 0, 0, 0, 0)) is Code.DONE
    assert device.code(command(65535, 1, 1, 1, 1, 1, 1)) is Code.NOT_NEWER
    assert device.codec.lost == 0
    device.hear(command(4, 0, 0, 0, 0, 0, 0))
    assert device.codec.lost == 3


def test_every_single_bit_flip_is_caught() -> None:
    """A command of which any one bit is turned over never moves a motor, and is counted."""
    good = command(101, 1, -1, 0.5, 0.25, 0.125, 1)
    for bit in range(8 * len(good)):
        device = Device()
        spoilt = bytearray(good)
        spoilt[bit // 8] ^= 1 << bit % 8
        for piece in bytes(spoilt).splitlines(keepends=True):
            device.hear(piece)
        assert not device.machine.duty.any(), bytes(spoilt)
        assert device.codec.bad >= 1


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=600))
def test_garbage_moves_nothing(data: bytes) -> None:
    """Whatever the bytes, the device neither fails nor moves nor answers."""
    device = Device()
    assert device.hear(data) == []
    assert not device.machine.duty.any()


@settings(max_examples=300, deadline=None)
@given(st.text(alphabet="0123456789.-+eE,CHXBRTEna _", max_size=60))
def test_right_crc_on_nonsense_moves_at_most_in_range(body: str) -> None:
    """Lines with a right CRC and any content never give a duty out of range."""
    device = Device()
    device.hear(line(body))
    assert np.isfinite(device.machine.duty).all()
    assert np.abs(device.machine.duty).max() <= 1


def test_a_sample_leaves_out_what_its_board_has_not() -> None:
    """A line S has the fields of all sensors and motors, empty where another board has them."""
    device = Device()
    sent = fields(device.codec.sample(reading(1, 0.25, battery=7.412), 0.25)[0])
    assert sent[1:6] == ["S", "1", "1250000", "1", "7412"]
    assert sent[6:15] == ["", "11.000", "", "13.000", "", "", "", "17.000", ""]
    assert sent[15:21] == ["", "100", "", "300", "", ""]
    assert sent[21:] == ["0.000", "0.000", "9.807", "0.0000", "0.0000", "0.0000"]


def test_heartbeats_fill_silence() -> None:
    """Ten heartbeats a second while no board sends, one a second while they do; a hello a second while waiting."""
    device = Device(greeted=False)
    quiet = [fields(sent)[1] for k in range(1000) for sent in device.codec.advance(0.001 * k)]
    assert quiet.count("B") == 10
    assert quiet.count("H") == 1
    busy = []
    for k in range(1000, 3001):
        if k % 20 == 0:
            device.codec.sample(reading(0), 0.001 * k)
        busy += [fields(sent)[1] for sent in device.codec.advance(0.001 * k)]
    assert busy.count("B") == 2
