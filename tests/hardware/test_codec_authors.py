"""The two protocols of the authors, the host's side: bytes written down by hand from the page of the protocols."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.errors import UsageError
from r2s2r_cli.hardware.codec import codec
from r2s2r_cli.hardware.codec.base import Corrupt, LockStep, Passed, Reading, Status, TickDone
from r2s2r_cli.hardware.codec.boards import BoardsCodec
from r2s2r_cli.hardware.codec.legacy import LegacyCodec

BOARDS = BoardsCodec(sensors=9, motors=6)
LEGACY = LegacyCodec(sensors=9, motors=6)
NAN = float("nan")


def test_a_board_tells_three_sensors_two_motors_and_its_imu() -> None:
    """Board 1 has sensors 3, 1, 7 and motors 1, 3; pF, g and deg/s become SI; C3 is left out."""
    event = BOARDS.decode(b"1 20.10 21.20 22.30 99.00 -120 340 0.00 -1.00 0.50 180.00 0.00 -90.00")
    assert isinstance(event, Reading)
    assert event.board == 1 and event.seq is None and np.isnan(event.t_board) and event.voltage is None
    expected = np.array([NAN, 21.2, NAN, 20.1, NAN, NAN, NAN, 22.3, NAN]) * 1e-12
    np.testing.assert_allclose(event.capacitance, expected, rtol=1e-12)
    np.testing.assert_array_equal(event.encoder, [NAN, -120, NAN, 340, NAN, NAN])
    assert event.a_B is not None and event.w_WB is not None
    np.testing.assert_allclose(event.a_B, [0, -9.80665, 4.903325])
    np.testing.assert_allclose(event.w_WB, [np.pi, 0, -np.pi / 2])


def test_every_sensor_and_motor_belongs_to_one_board() -> None:
    """The three boards together tell nine sensors and six encoders, none of them twice."""
    found = [BOARDS.decode(b"%d 20 21 22 0 1 2 0 0 1 0 0 0" % board) for board in range(3)]
    readings = [event for event in found if isinstance(event, Reading)]
    np.testing.assert_array_equal(sum(np.isfinite(event.capacitance).astype(int) for event in readings), np.ones(9))
    np.testing.assert_array_equal(sum(np.isfinite(event.encoder).astype(int) for event in readings), np.ones(6))


def test_other_lines_of_boards() -> None:
    """Status texts are told on, an overflow of Arduino is no reading, anything else is damage."""
    assert BOARDS.decode(b"MPR121 NOT FOUND\r\n") == Status(text="MPR121 NOT FOUND")
    overflow = BOARDS.decode(b"0 inf 21.2 ovf 0 1 2 0 0 1 0 0 0")
    assert isinstance(overflow, Reading)
    assert np.isfinite(overflow.capacitance).sum() == 1
    for line in (
        b"", b"3 20 21 22 0 1 2 0 0 1 0 0 0", b"0 20 21 22 0 1 2 0 0 1 0 0", b"0 -1 21 22 0 1 2 0 0 1 0 0 0",
        b"0 20 2x 22 0 1 2 0 0 1 0 0 0", b"0 20 2_1 22 0 1 2 0 0 1 0 0 0", b"\xff\xfe", b"1e3 " * 13,
    ):  # fmt: skip
        assert isinstance(BOARDS.decode(line), Corrupt), line


def test_speeds_of_boards_are_parts_of_99() -> None:
    """Twelve fields with the six speeds in the middle; stop is twelve zeros; both go to every board."""
    line = BOARDS.command(np.array([1, -1, 0.5, 0, 0.01, -0.7]))
    assert line.data == b"0 0 0 99.00 -99.00 49.50 0.00 0.99 -69.30 0 0 0\n"
    assert BOARDS.stop().data == b"0 0 0 0 0 0 0 0 0 0 0 0\n"
    assert line.every_board and BOARDS.stop().every_board and BOARDS.emergency().every_board
    assert BOARDS.hello() is None and BOARDS.reset() is None


def test_legacy_counts_become_farad() -> None:
    """42 x 1024 / 3.3 / adc pF of hexadecimal counts behind any number of stars; a count of 0 is no reading."""
    event = LEGACY.decode(b"****S 0x28c 0x0 0x1 0x28c 0x28c 0x28c 0x28c 0x28c 0x3ff\r")
    assert isinstance(event, Reading) and event.measures
    np.testing.assert_allclose(event.capacitance[[0, 2, 8]], np.array([42 * 1024 / 3.3]) / [652, 1, 1023] * 1e-12)
    assert np.isnan(event.capacitance[1])
    acceleration = LEGACY.decode(b"*A 0.00 0.00 -1.00")
    assert isinstance(acceleration, Reading) and not acceleration.measures and acceleration.a_B is not None
    np.testing.assert_allclose(acceleration.a_B, [0, 0, -9.80665])
    assert LEGACY.decode(b"*****q 1 1.0000 0.0000 0.0000 0.0000") == Passed()
    for line in (
        b"S 0x1 0x2",
        b"S 1 2 3 4 5 6 7 8 9",
        b"S" + b" 0xZZ" * 9,
        b"A 1 2",
        b"A 1 2 nan3",
        b"",
        b"***",
        b"S\xff",
    ):
        assert isinstance(LEGACY.decode(line), Corrupt), line


def test_legacy_speeds_go_motor_by_motor() -> None:
    """Ten spaces, `d`, the motor from 1, the speed; `s` stops all."""
    data = LEGACY.command(np.array([1, -1, 0.5, 0, 0, 0])).data
    assert data.splitlines()[:3] == [b" " * 10 + b"d 1 99.00", b" " * 10 + b"d 2 -99.00", b" " * 10 + b"d 3 49.50"]
    assert data.count(b"\n") == 6 and LEGACY.stop().data == b" " * 10 + b"s\n"


@pytest.mark.parametrize("of", [BOARDS, LEGACY])
def test_lock_step_of_the_rig_in_the_authors_protocols(of: BoardsCodec | LegacyCodec) -> None:
    """The announcement, the question and the answer."""
    assert of.decode(b"#lockstep 20000") == LockStep(period=0.02)
    assert of.decode(b"#tick 7 140000") == TickDone(k=7, t=0.14)
    assert of.tick(7).data.strip() == b"#tick 7"


@pytest.mark.parametrize("of", [BOARDS, LEGACY])
def test_these_protocols_say_what_they_cannot_do(of: BoardsCodec | LegacyCodec) -> None:
    """No watchdog, and a sentence for people about it."""
    assert of.watchdog is None and "cannot guarantee a stop" in of.promise


@pytest.mark.parametrize("duty", [[1.01] + [0] * 5, [np.nan] * 6, [0] * 5])
@pytest.mark.parametrize("of", [BOARDS, LEGACY])
def test_no_speed_out_of_range_is_ever_said(of: BoardsCodec | LegacyCodec, duty: list[float]) -> None:
    """As in our own protocol."""
    with pytest.raises(ValueError, match="speeds"):
        of.command(np.array(duty))


def test_a_protocol_by_name() -> None:
    """An unknown name, and a robot that does not fit the authors' lines, are errors of usage."""
    assert codec("checked", sensors=24, motors=24).name == "checked"
    for name, sensors, motors in (("boats", 9, 6), ("boards", 24, 24), ("legacy", 9, 5)):
        with pytest.raises(UsageError):
            codec(name, sensors=sensors, motors=motors)
