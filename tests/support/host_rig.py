"""The rig in a thread, and a loop of the host on it: for tests of both sides of the wire together."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from r2s2r_cli.devices.lengths import Lengths
from r2s2r_cli.devices.link import RobotLink, Sample
from r2s2r_cli.devices.pid import WirePid
from r2s2r_cli.rig.assembly import Outlet, Rig
from r2s2r_cli.rig.world import World
from schemas.robot import Robot


def free_udp_port() -> int:
    """A port of this machine that nobody has."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def running_rig(
    robot: Robot, world: World | None = None, *, link: str = "pty", protocol: str = "checked", lock: bool = True,
    shared: bool = False, device: Path | None = None,
) -> Iterator[Rig]:  # fmt: skip
    """A rig that serves in a thread of this process. shared: one UDP socket for all boards. device: a name for the
    pty, which one that comes back keeps; its number may have been taken by then."""
    over = threading.Event()
    port = free_udp_port() if link == "udp" else None
    outlet = Outlet(link=link, protocol=protocol, port=port, lock=lock, shared=shared, device=device)
    with Rig(robot, world or World(), outlet) as rig:
        thread = threading.Thread(target=rig.serve, args=(over.is_set,))
        thread.start()
        try:
            yield rig
        finally:
            over.set()
            thread.join()


def follow(link: RobotLink, robot: Robot, target: np.ndarray, seconds: float) -> list[Sample]:
    """The controller on one target, (actuated,), for a time of the link's clock [s]; all samples."""
    lengths, pid = Lengths.of(robot), WirePid.of(robot)
    end, samples = link.now() + seconds, []
    while link.now() < end - 1e-9:
        sample = link.read(0.1)
        if sample is None:
            continue
        samples.append(sample)
        if sample.due:
            link.command(pid.tick(lengths(sample.capacitance)[list(robot.actuated)], target))
    return samples
