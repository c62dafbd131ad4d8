"""A robot of which no two numbers are alike, for tests that must notice which number was changed."""

from __future__ import annotations

import tomllib
from functools import lru_cache
from typing import Any

from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import Robot


@lru_cache
def varied(name: str = "threebar") -> Robot:
    """A robot of `init` with numbers of its own for every motor, cable, sensor tendon and rod; cubic passive cables,
    centres of mass off the middle, a ground that bounces."""
    document: dict[str, Any] = tomllib.loads(robot_toml(name))
    for k, motor in enumerate(document["motors"]):
        motor["speed"] = 0.5 + 0.03 * k
    for k, cable in enumerate(document["cables"]):
        cable["stiffness_n_per_m"] *= 1.0 + 0.05 * k
        cable["damping_n_s_per_m"] *= 1.0 + 0.04 * k
        if cable["kind"] == "passive":
            cable["rest_length_m"] *= 1.0 + 0.02 * k
            cable["stiffness2_n_per_m2"] = 40.0 + k
            cable["stiffness3_n_per_m3"] = 500.0 + k
    winched = [k for k, cable in enumerate(document["cables"]) if cable["kind"] == "actuated"]
    document["sensors"] = [
        {"cable": k, "stiffness_n_per_m": 20.0 + k, "rest_length_m": 0.06 + 0.001 * k} for k in winched
    ]
    for r, rod in enumerate(document["rods"]):
        for part in rod["parts"]:
            part["mass_kg"] *= 1.0 + 0.1 * r
        rod["parts"][0]["mass_kg"] *= 1.5
    document["contact"]["restitution"] = 0.2
    return Robot.model_validate(document)
