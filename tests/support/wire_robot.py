"""A robot at the other end of a wire, for tests of the host: scripted, in memory, or on a real port in a thread."""

from __future__ import annotations

import tomllib
from functools import lru_cache

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
