"""`boards`, whose motors nothing stops but a stop that arrives: on connecting, and with two robots on the air."""

from __future__ import annotations

import time

import numpy as np
import pytest

from r2s2r_cli.devices.link import LinkError
from r2s2r_cli.hardware.codec import codec
from r2s2r_cli.hardware.link import Link
from r2s2r_cli.hardware.transport import Message
from tests.support.fake_robot import calibrated

ROBOT = calibrated("threebar-330")
SENSORS = ((4, 2, 8), (3, 1, 7), (5, 0, 6))
"""Of each board, as its lines have them."""


class Air:
    """What the boards of some robots send, in turn, and what each was told last; they begin as a host that died left
    them."""

    name, overlong = "udp://air", 0

    def __init__(self, robots: str) -> None:
        self._boards = [(robot, board) for robot in robots for board in range(3)]
        self.told = dict.fromkeys(self._boards, b"0 0 0 50 50 50 50 50 50 0 0 0")
        self._count = 0

    def open(self) -> None:
        """Nothing to do."""

    def close(self) -> None:
        """Nothing to do."""

    def receive(self, timeout: float) -> Message | None:
        """The next board's line, every few milliseconds."""
        time.sleep(min(timeout, 0.003))
        robot, board = self._boards[self._count % len(self._boards)]
        self._count += 1
        lines = [ROBOT.sensors[k] for k in SENSORS[board]]
        farads = [(s.slope_f_per_m or 0.0) * 0.14 + (s.offset_f or 0.0) for s in lines]
        values = " ".join(f"{1e12 * one + 0.01 * (self._count % 5):.2f}" for one in farads)
        return Message(f"{board} {values} 0 1 1 0 0 1 0 0 0".encode(), time.monotonic(), (robot, board))

    def send(self, data: bytes, to: tuple[str, int] | None = None) -> None:
        """A line to one board; without an address it reaches none."""
        if to is not None:
            self.told[to] = data.strip()


def link(air: Air) -> Link:
    """Not open yet."""
    return Link(air, codec("boards", sensors=9, motors=6), ROBOT)


def test_motors_that_run_are_stopped_on_connecting() -> None:
    """Where each board is nobody knows before it has spoken: once all have, all are told to stop."""
    air = Air("A")
    with link(air) as robot:
        assert set(air.told.values()) == {robot.codec.stop().data.strip()}


def test_two_robots_on_the_air_are_refused_and_both_stopped() -> None:
    """The second one would be driven by the sensors of the first."""
    air = Air("AB")
    with pytest.raises(LinkError, match="two robots send to this host") as caught, link(air) as robot:
        end = time.monotonic() + 5
        while time.monotonic() < end:
            sample = robot.read(0.05)
            if sample is not None and sample.due:
                robot.command(np.full(6, 0.5))
    assert "A:0" in caught.value.received and "B:0" in caught.value.received
    stop = codec("boards", sensors=9, motors=6).stop().data.strip()
    running = {place for place, told in air.told.items() if told != stop}
    # A board that nobody had heard yet has no address to be stopped at.
    assert not running & {("A", 0), ("B", 0)}


def test_a_board_that_starts_anew_may_have_another_port() -> None:
    """It speaks from there from then on, and from nowhere else."""
    air = Air("A")
    with link(air) as robot:
        robot.read(0.05)
        air._boards = [("A", 0), ("A", 1), ("C", 2)]
        air._count = 0
        air.told["C", 2] = b""
        for _ in range(12):
            sample = robot.read(0.05)
            if sample is not None and sample.due:
                robot.command(np.full(6, 0.5))
        assert air.told["C", 2] not in (b"", robot.codec.stop().data.strip())
