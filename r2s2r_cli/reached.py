"""How the robot is reached, in commands that are shown: its port, its protocol, and the camera at hand there."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from schemas.config import LinkSettings

PORT = "--port /dev/ttyUSB0 --protocol legacy"
"""The robot of the paper."""
REAL_CAMERA, RIG_CAMERA = "--camera realsense", "--camera rig://127.0.0.1:9000"
ROBOT = f"{PORT} {REAL_CAMERA}"
RIG_REMARK = "the camera as `r2s2r rig --camera-port 9000` prints it"
_VIRTUAL = re.compile(r"(socket|udp)://(127\.[\d.]+|localhost|\[::1\])(:|$)|/dev/pts/")
"""Ports of this very machine at which no board can be: a rig's."""


def virtual(port: str) -> bool:
    """Whether the robot at this port is a rig, as far as its address says."""
    return _VIRTUAL.match(port) is not None


def camera(*, rig: bool) -> str:
    """The option that names the camera: a rig has its own, and no other one sees it."""
    return RIG_CAMERA if rig else REAL_CAMERA


def reached(link: LinkSettings | None = None) -> str:
    """The options for the robot of a project: what its project.toml says is not typed again."""
    if link is None or not link.port:
        return ROBOT
    return camera(rig=virtual(link.port))
