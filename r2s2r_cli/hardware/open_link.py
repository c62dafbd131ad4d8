"""A link by the name of its port: what the commands call."""

from __future__ import annotations

from typing import TYPE_CHECKING

from r2s2r_cli.hardware.codec import codec
from r2s2r_cli.hardware.link import Link
from r2s2r_cli.hardware.transport import transport

if TYPE_CHECKING:
    from schemas.robot import Robot


def open_link(port: str, robot: Robot, *, protocol: str = "checked", handshake_timeout: float = 5.0) -> Link:
    """The link to a robot, not yet connected: enter it. Most callers want it guarded, see `guard.py`.

    port: a device file, socket://HOST:PORT or udp://HOST:PORT (docs/reference/protocols.md). Raises UsageError for a
    name that is no port, an unknown protocol, or a robot that the protocol cannot carry.
    """
    made = codec(protocol, sensors=len(robot.sensors), motors=len(robot.motors))
    return Link(transport(port), made, robot, handshake_timeout=handshake_timeout)
