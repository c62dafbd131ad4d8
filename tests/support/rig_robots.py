"""Robots for tests of the rig: the known ones, edited ones, and two rods that lie side by side."""

from __future__ import annotations

import copy
import functools
import tomllib
from typing import Any

from r2s2r_cli.stages.init.attachment import Mode
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import Robot


def values(name: str = "threebar", attachment: Mode = "surface") -> dict[str, Any]:
    """The parsed `robot.toml` of a known robot, free to be edited."""
    return copy.deepcopy(_parsed(name, attachment))


def known(name: str = "threebar", attachment: Mode = "surface") -> Robot:
    """A known robot."""
    return Robot.model_validate(values(name, attachment))


def two_rods(*, friction: float = 0.5, restitution: float = 0.0) -> Robot:
    """Two rods flat on the ground along x, 0.2 m apart, joined by one cable that never gets taut."""
    robot = values()
    robot["rods"] = robot["rods"][:2]
    half, r = robot["rods"][0]["length_m"] / 2, robot["rods"][0]["cap_radius_m"]
    robot["rest_caps_m"] = [[side * half, y, r] for y in (-0.1, 0.1) for side in (-1.0, 1.0)]
    slack = {"caps": [0, 2], "kind": "passive", "rest_length_m": 1.0, "sites_m": [[0.0, 0.0, -half]] * 2}
    robot["cables"] = [{**slack, "stiffness_n_per_m": 100.0, "damping_n_s_per_m": 0.0}]
    robot["motors"], robot["sensors"], robot["colors"] = [], [], []
    robot["contact"] = {"friction": friction, "restitution": restitution}
    return Robot.model_validate(robot)


@functools.cache
def _parsed(name: str, attachment: Mode) -> dict[str, Any]:
    return tomllib.loads(robot_toml(name, attachment))
