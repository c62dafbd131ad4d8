"""Rigs in processes of their own, to be killed: `python -m tests.support.rig_farm` forks one for each line it reads.

A fork takes milliseconds where a new process imports MuJoCo for a second. In: `link protocol`. Out: `pid address`.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class RigFarm:
    """The other end of the pipe."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self._alive: set[int] = set()

    def grow(self, link: str, protocol: str = "checked") -> tuple[int, str]:
        """A new rig: its process and its address."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(f"{link} {protocol}\n")
        self._process.stdin.flush()
        pid, address = self._process.stdout.readline().split()
        self._alive.add(int(pid))
        return int(pid), address

    def kill(self, pid: int) -> None:
        """SIGKILL: the rig has no time to say goodbye."""
        self._alive.discard(pid)
        os.kill(pid, signal.SIGKILL)

    def raze(self) -> None:
        """Kill what is left."""
        for pid in list(self._alive):
            self.kill(pid)


@contextmanager
def rig_farm() -> Iterator[RigFarm]:
    """A farm; its rigs and itself are gone afterwards."""
    with subprocess.Popen(
        [sys.executable, "-m", "tests.support.rig_farm"], cwd=Path(__file__).parents[2], stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"},
    ) as process:  # fmt: skip
        farm = RigFarm(process)
        try:
            yield farm
        finally:
            farm.raze()
            assert process.stdin is not None
            process.stdin.close()
            process.wait()


def main() -> None:
    """Fork for every line; the children are reaped by nobody and die with a kill."""
    from r2s2r_cli.rig.assembly import Outlet, Rig
    from r2s2r_cli.rig.world import World
    from tests.support.host_rig import free_udp_port
    from tests.support.wire_robot import calibrated

    robot = calibrated()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # no zombies
    while line := sys.stdin.readline():
        link, protocol = line.split()
        if os.fork() == 0:
            port = free_udp_port() if link == "udp" else None
            with Rig(robot, World(), Outlet(link=link, protocol=protocol, port=port)) as rig:
                os.write(1, f"{os.getpid()} {rig.address}\n".encode())
                rig.serve(lambda: False)


if __name__ == "__main__":
    main()
