"""Which board measures and drives what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from schemas.robot import Robot


@dataclass(frozen=True)
class Post:
    """One board: the rod it sits on, its sensors (places in `Robot.sensors`) and motors (places in `Robot.motors`)."""

    rod: int
    sensors: tuple[int, ...]
    motors: tuple[int, ...]


_AUTHORS = (Post(0, (4, 2, 8), (2, 4)), Post(1, (3, 1, 7), (1, 3)), Post(2, (5, 0, 6), (0, 5)))
"""The newer robot's boards, red, green, blue: docs/reference/protocols.md, `boards`."""


def posts(robot: Robot, layout: Literal["per_rod", "central"]) -> tuple[Post, ...]:
    """The boards of a robot.

    `per_rod`: the authors' three where the numbers of rods, sensors and motors are theirs; on another robot one a rod,
    with sensors and motors dealt out in turn. `central`: one that has everything.
    """
    sensors, motors, rods = len(robot.sensors), len(robot.motors), len(robot.rods)
    if layout == "central":
        return (Post(0, tuple(range(sensors)), tuple(range(motors))),)
    if (rods, sensors, motors) == (3, 9, 6):
        return _AUTHORS
    return tuple(Post(i, tuple(range(i, sensors, rods)), tuple(range(i, motors, rods))) for i in range(rods))
