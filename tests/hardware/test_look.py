"""Hints that lead to the robot: pasted as they are they look at the same port, in the protocol that it speaks."""

from __future__ import annotations

import errno
import shlex

import numpy as np
import pytest

from r2s2r_cli.devices.link import LinkError, SafetyStop
from r2s2r_cli.hardware.codec import codec
from r2s2r_cli.hardware.guard import GuardedLink
from r2s2r_cli.hardware.link import Link
from r2s2r_cli.hardware.transport.gone import hung_up, port_errors
from tests.support.wire_robot import FakeRobot, calibrated

PORT = "/tmp/my rig/robot"
LOOK = ["r2s2r", "doctor", "ports", PORT]


class Legacy(FakeRobot):
    """One of the authors', which just speaks."""

    def open(self) -> None:
        self.name = PORT
        self.out.extend([b"S" + b" 0x28c" * 9] * 2)

    def obey(self, line: str) -> None:
        self.heard.append(line)


def link_to(robot: FakeRobot) -> Link:
    """In the protocol `legacy`."""
    return Link(robot, codec("legacy", sensors=9, motors=6), calibrated(), handshake_timeout=0.5)


def test_a_broken_link_is_looked_at_in_its_own_protocol(monkeypatch: pytest.MonkeyPatch) -> None:
    """The port itself knows none: with the default one a healthy robot would be taken for another."""
    robot = Legacy()

    def die(_: float) -> None:
        raise hung_up(PORT)

    with link_to(robot) as link:
        monkeypatch.setattr(robot, "receive", die)
        with pytest.raises(LinkError) as caught:
            link.read(0.1)
    assert shlex.split(caught.value.hint) == [*LOOK, "--protocol", "legacy"]


def test_an_emergency_stop_is_taken_off_by_its_hint() -> None:
    """The command that the guide names, not one that is refused for the latch."""
    with GuardedLink(link_to(Legacy()), calibrated()) as link:
        link.emergency_stop()
        with pytest.raises(SafetyStop) as caught:
            link.command(np.zeros(6))
    assert shlex.split(caught.value.hint) == [*LOOK, "--reset", "--protocol", "legacy"]


def test_who_holds_a_port_is_asked_by_its_whole_name() -> None:
    """A name with a blank is one word."""
    with pytest.raises(LinkError) as caught, port_errors(PORT, "opening"):
        raise OSError(errno.EBUSY, "busy")
    assert shlex.split(caught.value.hint) == ["fuser", "-v", PORT]
