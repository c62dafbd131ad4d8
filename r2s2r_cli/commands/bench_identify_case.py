"""The problem of `bench identify`: a robot with planted numbers, a gait, noise, and a wrong start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.commands import bench_gait
from schemas.robot import Robot

FRAME_S = 0.05
"""Between two observations of the end caps: 20 Hz."""
NOISE_M = 0.001
"""Standard deviation of an observed coordinate."""
SPREAD = 0.2
"""Planted values lie within this share of those of robot.toml."""
OFF = (0.15, 0.5)
"""A start is off by so much of the planted value at least, and at most."""
BOUNDS = (0.2, 4.0)
"""Of every fit, as shares of the values of robot.toml."""


@dataclass(frozen=True)
class Number:
    """A number that all motors, or all cables of a kind, share. edit: its name in `bench_gait`. read: its value in
    robot.toml. most: no robot has more."""

    edit: str
    read: Callable[[Robot], float]
    most: float = np.inf


def _cable(kind: str, field: str) -> Callable[[Robot], float]:
    return lambda robot: float(getattr(next(cable for cable in robot.cables if cable.kind == kind), field))


NUMBERS: dict[str, Number] = {
    "friction": Number("friction", lambda robot: robot.contact.friction),
    "stiffness_actuated": Number("stiffness, actuated", _cable("actuated", "stiffness_n_per_m")),
    "stiffness_passive": Number("stiffness, passive", _cable("passive", "stiffness_n_per_m")),
    "damping_actuated": Number("damping, actuated", _cable("actuated", "damping_n_s_per_m")),
    "motor_speed": Number("motor speed", lambda robot: robot.motors[0].speed, most=1.0),
}
"""What is free, by its name in `identify`."""


@dataclass(frozen=True)
class Case:
    """One problem. nominal: the robot as robot.toml has it, which is right about all other numbers.

    truth, start, lower, upper: values of NUMBERS, (n,). u: motor commands in [-1, 1], +1 reels in,
    (tick, actuated). t: of the observations [s], (frame,); noise: what is added to the end caps [m], (frame, cap, 3).
    """

    seed: int
    nominal: Robot
    truth: np.ndarray
    start: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    u: np.ndarray
    t: np.ndarray
    noise: np.ndarray

    def robot(self, values: np.ndarray) -> Robot:
        """The robot with these values."""
        return _with(self.nominal, values)


@dataclass(frozen=True)
class Fit:
    """What a tool found in one case. estimate, low, high: values and ends of the 95 % intervals, (n,); not finite: it
    gave none. cpu_s: processor time of the whole process [s]. rollouts: simulations of the whole gait, or as much of
    several shorter ones. rms_m: residual of one coordinate at the end [m]."""

    estimate: np.ndarray
    low: np.ndarray
    high: np.ndarray
    cpu_s: float
    rollouts: float
    rms_m: float


def make_case(robot: Robot, seed: int, *, run_s: float) -> Case:
    """The case of one seed: planted values, start, gait and noise are drawn from it.

    The gait is one of `bench_gait`, made for the winches as planted, so that they reach their targets.
    """
    draw = np.random.default_rng([seed, 5])
    nominal = np.array([number.read(robot) for number in NUMBERS.values()])
    low = BOUNDS[0] * nominal
    high = np.minimum(BOUNDS[1] * nominal, [number.most for number in NUMBERS.values()])
    truth = nominal * (1.0 + SPREAD * draw.uniform(-1.0, 1.0, len(nominal)))
    wrong = draw.uniform(*OFF, len(nominal)) * draw.choice([-1.0, 1.0], len(nominal))
    wrong = np.where(truth * (1.0 + wrong) < high, wrong, -wrong)
    planted = _with(robot, truth)
    u = bench_gait.commands(planted, _winch_speed(planted), run_s, range(seed, seed + 1))[0]
    t = FRAME_S * np.arange(1, round(run_s / FRAME_S) + 1)
    noise = NOISE_M * draw.standard_normal((len(t), 2 * len(robot.rods), 3))
    return Case(seed=seed, nominal=robot, truth=truth, start=truth * (1.0 + wrong), lower=low, upper=high,
                u=u, t=t, noise=noise)  # fmt: skip


def _with(robot: Robot, values: np.ndarray) -> Robot:
    for number, value in zip(NUMBERS.values(), values, strict=True):
        robot = bench_gait.varied(robot, number.edit, float(value) / number.read(robot))
    return robot


def _winch_speed(robot: Robot) -> np.ndarray:
    motors = {motor.cable: motor for motor in robot.motors}
    return np.array([m.no_load_rad_per_s * m.speed * m.winch_radius_m for m in (motors[k] for k in robot.actuated)])
