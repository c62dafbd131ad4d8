"""A device gone mad: the duties of the host go by its own clock, whatever is there to be read."""

from __future__ import annotations

import time

import numpy as np
import pytest

from r2s2r_cli.devices.link import SafetyStop
from r2s2r_cli.hardware.codec import codec
from r2s2r_cli.hardware.guard import GuardedLink
from r2s2r_cli.hardware.link import Link
from r2s2r_cli.hardware.transport import Message
from tests.support.wire_robot import FakeRobot


class Mad(FakeRobot):
    """It sends lines that mean nothing, as fast as they are read, until `sane_from` [s]."""

    sane_from = 0.0

    def receive(self, timeout: float) -> Message | None:
        now = time.monotonic()
        return Message(b"boot", now) if now < self.sane_from else super().receive(timeout)


def test_lines_without_end_do_not_keep_the_host_from_its_duties() -> None:
    """No sample comes among them: the motors are told to stop as if nothing came."""
    robot = Mad()
    link = Link(robot, codec("checked", sensors=9, motors=6), robot.robot, handshake_timeout=0.3)
    with GuardedLink(link, robot.robot) as guarded:
        robot.sample()
        assert guarded.read(1.0) is not None
        guarded.command(np.ones(6))
        begin, stops = time.monotonic(), robot.stops
        robot.sane_from = begin + 3.0  # so that the test has an end
        with pytest.raises(SafetyStop, match="stale sensors"):
            guarded.read(10.0)
        assert time.monotonic() - begin < 1.0 and robot.stops > stops
        robot.sane_from = 0.0


def test_a_sample_behind_other_lines_is_found() -> None:
    """A read that does not wait goes through what is no sample: behind it is what the host drives on."""
    robot = Mad()
    with Link(robot, codec("checked", sensors=9, motors=6), robot.robot, handshake_timeout=0.3) as link:
        robot.out.extend([b"boot"] * 20)
        robot.sample()
        assert link.read(0.0) is not None
