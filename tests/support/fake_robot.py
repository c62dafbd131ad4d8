"""A robot of straight lines for the tests of `record`: cables follow commands, sensors their lines; no waiting."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from types import TracebackType
from typing import Self

import numpy as np

from r2s2r_cli.devices.link import LinkFacts, LinkState, LinkStatistics, Sample
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import Robot

SLOPE, OFFSET = 30e-12, 12e-12
"""[F/m], [F] of every sensor: of the size that the real ones have."""
FULL_SPEED = 0.06
"""Of a cable at full command [m/s]."""


def calibrated(name: str = "threebar") -> Robot:
    """A robot of `init` whose sensors have lines, each another one."""
    robot = Robot.model_validate(tomllib.loads(robot_toml(name, "surface")))
    sensors = [
        sensor.model_copy(update={"slope_f_per_m": SLOPE * (1 + 0.02 * i), "offset_f": OFFSET + 0.1e-12 * i})
        for i, sensor in enumerate(robot.sensors)
    ]
    return robot.model_copy(update={"sensors": tuple(sensors)})


class FakeLink:
    """A `RobotLink` in its own time: every `read` brings the next sample, `period` [s] later; boards take turns if > 1.

    on_read: called with the number of the sample; may raise, or return a sample in place of the true one.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        boards: int = 1,
        lock_step: bool = False,
        on_read: Callable[[int, Sample], Sample] | None = None,
    ) -> None:
        self.robot, self.boards, self.on_read = robot, boards, on_read
        self.period = 1.0 / robot.pid.rate_hz
        self.length = np.full(len(robot.cables), 0.25)
        self.length[list(robot.actuated)] = robot.pid.min_length_m + 0.8 * robot.pid.range_m
        self.facts = LinkFacts(port="fake", protocol="checked", watchdog=0.25, lock_step=lock_step)
        self.state = LinkState.RUNNING
        self.t, self.count = 100.0, 0
        self.commands: list[np.ndarray] = []
        self.driven = np.zeros(len(robot.actuated))
        self.stops = 0
        self.t_sensor = np.full(len(robot.sensors), np.nan)
        self.capacitance = np.full(len(robot.sensors), np.nan)

    @property
    def statistics(self) -> LinkStatistics:
        """Every sample arrived."""
        return LinkStatistics(received=self.count, sent=len(self.commands), lost=0, repeated=0, reordered=0)

    def now(self) -> float:
        """Its own time [s]."""
        return self.t

    def read(self, timeout: float) -> Sample | None:
        """The next one; none where nobody waits for it."""
        if timeout <= 0:
            return None
        step = self.period / self.boards
        self.t += step
        self.length[list(self.robot.actuated)] -= FULL_SPEED * step * self.driven
        board = self.count % self.boards
        fresh = np.arange(len(self.robot.sensors)) % self.boards == board
        true = np.array([s.slope_f_per_m * self.length[s.cable] + s.offset_f for s in self.robot.sensors])
        self.capacitance = np.where(fresh, true, self.capacitance)
        self.t_sensor = np.where(fresh, self.t, self.t_sensor)
        motors = np.arange(len(self.robot.actuated))
        sample = Sample(
            t_host=self.t, board=board, t_board=self.t - 90.0 + board, due=board == self.boards - 1,
            capacitance=self.capacitance, t_sensor=self.t_sensor, fresh=fresh,
            encoder=np.where(motors % self.boards == board, motors + self.count, np.nan),
            a_B=np.array([0.0, 0.0, 9.81]),
            w_WB=np.zeros(3), voltage=7.4,
        )  # fmt: skip
        self.count += 1
        return sample if self.on_read is None else self.on_read(self.count, sample)

    def command(self, speed: np.ndarray) -> None:
        """Held until the next one."""
        assert speed.shape == self.driven.shape and np.all(np.abs(speed) <= 1)
        self.commands.append(speed)
        self.driven = speed

    def stop(self) -> None:
        """Motors off."""
        self.stops += 1
        self.driven = np.zeros_like(self.driven)

    def emergency_stop(self) -> None:
        """As `stop`: nothing is latched here."""
        self.stop()

    def reset(self) -> None:
        """Nothing to take off."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


class Rows:
    """A sink that keeps everything, by stream."""

    def __init__(self) -> None:
        self.of: dict[str, list[dict[str, object]]] = {}

    def __call__(self, stream: str, row: object) -> None:
        """Keep it; arrays as they are now."""
        self.of.setdefault(stream, []).append(
            {k: np.copy(v) if not isinstance(v, bytes) else v for k, v in dict(row).items()}
        )  # type: ignore[call-overload]

    def column(self, stream: str, name: str) -> np.ndarray:
        """All values of a dataset."""
        return np.array([row[name] for row in self.of[stream]])
