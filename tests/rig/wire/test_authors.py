"""The authors' two protocols, device side, against docs/reference/protocols.md."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.rig.wire import PROTOCOLS, DeviceCodec, device_codec
from r2s2r_cli.rig.wire.boards import BoardsCodec
from r2s2r_cli.rig.wire.legacy import LegacyCodec
from tests.support.rig_machine import MOTORS, SENSORS, Machine, Reading, reading
from tests.support.rig_robots import known

PF = 42 * 1024 / 3.3


def test_a_board_sends_thirteen_fields() -> None:
    """Number, C0 to C2 of its sensors, an unused one, two encoders, force in g, turning in deg/s; two decimals."""
    codec = BoardsCodec(Machine())
    lines = [codec.sample(reading(n, w_WB=np.array([0.1, 0.0, -0.2])), 0.0)[0] for n in range(3)]
    assert lines[0].data == b"0 14.00 12.00 18.00 0.00 200 400 0.00 0.00 1.00 5.73 0.00 -11.46\n"
    assert lines[1].data.split()[1:4] == [b"13.00", b"11.00", b"17.00"]
    assert lines[2].data.split()[1:7] == [b"15.00", b"10.00", b"16.00", b"0.00", b"0", b"500"]
    assert [one.board for one in lines] == [0, 1, 2]


def test_a_board_drives_its_own_motors_when_it_sends() -> None:
    """Twelve fields wait in the board; its next turn cuts them to the range and takes its two of the six."""
    machine = Machine()
    codec = BoardsCodec(machine)
    codec.receive(b"0 0 0 99 -99 49.5 200 -1e9 33 0 0 0", 1, 0.0)
    codec.sample(reading(0), 0.0)
    assert not machine.duty.any()
    codec.sample(reading(1), 0.0)
    assert machine.duty.tolist() == [0, -1, 0, 1, 0, 0]
    codec.receive(b"0 0 0 99 -99 49.5 200 -1e9 33 0 0 0", None, 0.0)
    for n in range(3):
        codec.sample(reading(n), 0.0)
    np.testing.assert_allclose(machine.duty, [1, -1, 127 / 255, 1, -1, 85 / 255])


def test_a_board_reads_one_datagram_a_turn() -> None:
    """Three commands at once are obeyed in three turns; beyond eight that wait, they are lost."""
    machine = Machine()
    codec = BoardsCodec(machine)
    for speed in range(1, 13):
        codec.receive(f"0 0 0 0 0 {speed} 0 0 0 0 0 0".encode(), 0, 0.0)
    seen = []
    for _ in range(12):
        codec.sample(reading(0), 0.0)
        seen.append(round(machine.duty[2] * 99))
    assert seen == [1, 2, 3, 4, 5, 6, 7, 8, 8, 8, 8, 8]


def test_a_board_without_its_chip_says_so_and_does_nothing() -> None:
    """A status text stands for the sample, and commands are not read."""
    machine = Machine()
    codec = BoardsCodec(machine)
    codec.receive(b"0 0 0 99 99 99 99 99 99 0 0 0", None, 0.0)
    assert codec.sample(reading(0, status="MPR121 NOT FOUND"), 0.0)[0].data == b"MPR121 NOT FOUND\n"
    assert not machine.duty.any()


def test_no_authors_device_stops_by_itself() -> None:
    """There is no watchdog: an hour later the motors still have the last command."""
    machine = Machine()
    boards, legacy = BoardsCodec(machine), LegacyCodec(machine, sensors=SENSORS)
    boards.receive(b"0 0 0 99 99 99 99 99 99 0 0 0", None, 0.0)
    boards.sample(reading(0), 0.0)
    legacy.receive(b"          d 1 99\n", None, 0.0)
    before = machine.duty.copy()
    for codec in (boards, legacy):
        codec.closed(1.0)
        assert codec.advance(3600.0) == []
    assert machine.duty.tolist() == before.tolist()
    assert before[0] == 1.0


def test_the_old_robot_sends_counts_attitude_and_force() -> None:
    """S has nine hexadecimal counts, q is numbered from 1 with the scalar first, A is in g; all after asterisks."""
    codec = LegacyCodec(Machine(), sensors=SENSORS)
    whole = Reading(pF=np.array([*(PF / np.arange(100.0, 900.0, 100.0)), np.nan]), q_WB=np.array([0.1, 0.2, 0.3, 0.9]))
    texts = [sent.data.decode().rpartition("*")[2] for sent in codec.sample(whole, 0.0)]
    assert texts == [
        "S 0x64 0xc8 0x12c 0x190 0x1f4 0x258 0x2bc 0x320 0x0\n",
        "A 0.00 0.00 1.00\n",
        "q 1 0.9000 0.1000 0.2000 0.3000\n",
    ]


def test_a_chip_that_is_not_set_up_reads_a_fifth_of_a_picofarad() -> None:
    """0.20 pF comes through both: as text, and as the count 0xffff that it stands for."""
    dead = Reading(pF=np.full(SENSORS, 0.2))
    assert BoardsCodec(Machine()).sample(dead, 0.0)[0].data.split()[1] == b"0.20"
    sent = LegacyCodec(Machine(), sensors=SENSORS).sample(dead, 0.0)[0].data.decode()
    assert round(PF / int(sent.split()[1], 16), 2) == 0.20


def test_the_old_robot_is_driven_motor_by_motor() -> None:
    """`d i s` sets motor i of 1 to 6, the others keep theirs; `s` stops all; spaces do not matter."""
    machine = Machine()
    codec = LegacyCodec(machine, sensors=SENSORS)
    codec.receive(b"          d 1 99\n", None, 0.0)
    codec.receive(b"d 6 -49.5\n", None, 0.0)
    assert machine.duty.tolist() == [1, 0, 0, 0, 0, -0.5]
    for nonsense in (b"d 0 99\n", b"d 7 99\n", b"d 2\n", b"ds\n", b"d 22 9\n", b"\n", b"S 0x1\n"):
        codec.receive(nonsense, None, 0.0)
    assert machine.duty.tolist() == [1, 0, 0, 0, 0, -0.5]
    codec.receive(b"          s\n", None, 0.0)
    assert not machine.duty.any()


@pytest.mark.parametrize("name", ["boards", "legacy"])
@settings(max_examples=300, deadline=None)
@given(data=st.one_of(st.binary(max_size=600), st.text("0123456789.-+eE dsS#tick\n", max_size=80).map(str.encode)))
def test_any_bytes_give_a_duty_in_range(name: str, data: bytes) -> None:
    """Whatever arrives, the authors' devices neither fail nor drive a motor beyond its range."""
    machine = Machine()
    codec: DeviceCodec = BoardsCodec(machine) if name == "boards" else LegacyCodec(machine, sensors=SENSORS)
    codec.receive(data, None, 0.0)
    for n in range(3):
        codec.sample(reading(n), 0.0)
    assert np.isfinite(machine.duty).all()
    assert np.abs(machine.duty).max() <= 1


def test_only_six_motors_speak_the_authors_protocols() -> None:
    """Another robot is refused by both, and taken by ours; an unknown name is refused with those there are."""
    six = known("sixbar")
    for name in ("boards", "legacy"):
        with pytest.raises(InputError, match="no place for this robot"):
            device_codec(name, six, Machine(), boards=3)
    assert device_codec("checked", six, Machine(), boards=6).datagrams_end
    with pytest.raises(UsageError, match="checked, boards, legacy"):
        device_codec("can", known(), Machine(), boards=3)
    assert all(device_codec(name, known(), Machine(), boards=3) for name in PROTOCOLS)
    assert len(known().motors) == MOTORS
