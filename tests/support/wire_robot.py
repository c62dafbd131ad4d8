"""A robot at the other end of a wire, for tests of the host: scripted, in memory, or on a real port in a thread."""

from __future__ import annotations

import binascii
import time
import tomllib
from collections import deque
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from r2s2r_cli.devices.link import LinkError
from r2s2r_cli.hardware.transport import Message
from r2s2r_cli.stages.calibrate.apply import with_sensor_line
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import Robot

SLOPE, OFFSET = 30e-12, 14e-12
"""[F/m], [F] of every sensor."""


@lru_cache
def calibrated(name: str = "threebar") -> Robot:
    """A robot of `init` whose sensors all have the same line."""
    text = robot_toml(name, "surface")
    count = len(tomllib.loads(text)["sensors"])
    return Robot.model_validate(tomllib.loads(with_sensor_line(text, dict.fromkeys(range(count), (SLOPE, OFFSET)))))


class FakeRobot:
    """A robot of the protocol `checked`, in memory: the transport and the device behind it.

    It answers what it is sent at once. Set the fields to make it misbehave; `duties` are the commands that it obeyed.
    """

    def __init__(self, robot: Robot | None = None, *, lock_us: int = 0) -> None:
        self.robot = robot or calibrated()
        self.name = "/dev/fake"
        self.overlong = 0
        self.lock_us, self.watchdog_ms = lock_us, 250
        self.lengths = np.full(9, 0.15)
        self.version, self.motors, self.calls = 1, 6, "threebar"
        self.deaf = self.mute = self.dead = self.latched = False
        self.stops = self.emergencies = self.opened = 0
        self.duties: list[list[float]] = []
        self.heard: list[str] = []
        self.state, self.seq, self.k = 0, 0, 0
        self.out: deque[bytes] = deque()

    def open(self) -> None:
        """A new connection."""
        if self.dead:
            raise LinkError("the port cannot be opened", where=self.name, hint="plug it in")
        self.opened += 1
        self.out.clear()

    def close(self) -> None:
        """As if unplugged for a moment."""

    def receive(self, timeout: float) -> Message | None:
        """What it has said."""
        if self.dead:
            raise LinkError("the link to the robot broke", where=self.name, received="gone", hint="plug it in")
        if self.out:
            return Message(self.out.popleft(), time.monotonic())
        time.sleep(min(timeout, 0.002))
        return None

    def send(self, data: bytes, to: object = None) -> None:
        """What it is told."""
        if self.dead:
            raise LinkError("the link to the robot broke", where=self.name, received="gone", hint="plug it in")
        for line in data.splitlines():
            self.obey(line.decode("ascii"))

    def say(self, *fields: object) -> None:
        """A line, numbered and sealed."""
        self.seq = (self.seq + 1) % 65536
        text = ",".join(str(field) for field in (self.seq, *fields))
        if not self.mute:
            self.out.append(f"{text}*{binascii.crc_hqx(text.encode(), 0xFFFF):04X}".encode())

    def sample(self, *, board: int = 0, capacitance: Sequence[float] | None = None, state: int | None = None) -> None:
        """A sample with these capacitances [pF], or those of its lengths."""
        pf = (SLOPE * self.lengths + OFFSET) * 1e12 if capacitance is None else capacitance
        values = [f"{c:.3f}" if c == c else "" for c in pf]
        self.say("S", board, self.seq * 1000, self.state if state is None else state, 7400, *values,
                 *range(6), 0, 0, 9.807, 0, 0, 0)  # fmt: skip

    def obey(self, line: str) -> None:
        """A line of the host."""
        self.heard.append(line)
        seq, kind, *fields = line.partition("*")[0].split(",")
        if self.deaf:
            return
        code = 1 if self.latched and kind in "CH" else 0
        if kind == "H":
            self.state = 3 if self.latched else 1
        elif kind == "C" and not code:
            self.duties.append([float(field) for field in fields])
        elif kind == "X":
            self.stops += 1
        elif kind == "E":
            self.emergencies += 1
            self.latched = True
        elif kind == "R":
            code, self.latched, self.state = 0 if self.latched else 6, False, 0
        elif kind == "T":
            self.k = int(fields[0])
            self.sample(board=0)
            self.sample(board=1)
            return self.say("T", self.k, self.k * self.lock_us)
        self.say("K", seq, code, self.seq * 1000)
        if kind == "H":
            self.say("H", self.version, self.calls, "v2", 1, self.motors, 9, self.watchdog_ms, self.state, self.lock_us)
        return None
