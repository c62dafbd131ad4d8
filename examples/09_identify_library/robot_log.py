"""A log to learn from where none is at hand: the engine plays a robot whose numbers are not those of its robot.toml."""

from __future__ import annotations

import tomllib

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.stages.estimate import estimate
from r2s2r_cli.stages.identify.free import with_values
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.simulate import Request, simulate
from schemas.config import SimulateSettings
from schemas.estimate import EstimateSettings
from schemas.policy import PolicyFile
from schemas.robot import Robot

TRUTH = {"motor_speed": 0.8, "friction": 0.6}
"""What the played robot has; robot.toml says 0.64 and 0.76."""
TARGETS = ([1.0, 0.3, 1.0, 1.0, 0.4, 1.0], [0.2, 1.0, 1.0, 0.3, 1.0, 1.0], [1.0, 1.0, 0.3, 1.0, 1.0, 0.2],
           [1.0, 1.0, 1.0, 1.0, 1.0, 1.0], [1.0, 0.3, 1.0, 1.0, 0.4, 1.0])  # fmt: skip
PERIOD_S, NOISE_M = 0.05, 0.001


def threebar() -> Robot:
    """The 3-bar robot with motors that are said to be a fifth too slow."""
    robot = Robot.model_validate(tomllib.loads(robot_toml("threebar")))
    return with_values(robot, {"motor_speed": 0.64})[0]


def log(robot: Robot, seed: int = 0) -> tuple[ArtifactData, ArtifactData]:
    """Recording and estimate of a gait of the true robot, run `gait`: as 10-record.h5 and 20-estimate.h5 hold them."""
    real, _ = with_values(robot, TRUTH)
    steps = [{"target": target} for target in TARGETS]
    policy = PolicyFile.model_validate({"schema_version": 1, "robot": robot.name, "name": "gait", "steps": steps})
    made, _ = simulate(real, [Request(policy)], SimulateSettings())
    frames, commands = made.groups["runs/gait/frames"], made.groups["runs/gait/commands"]
    t = np.arange(0.0, frames["t"][-1], PERIOD_S)
    seen = frames["p_WE"][np.searchsorted(frames["t"], t - 1e-9)]
    in_force = np.maximum(np.searchsorted(commands["t"], t + 1e-9, side="right") - 1, 0)
    rng = np.random.default_rng(seed)
    facts = {"origin": "simulation", "nature": "simulated", "source": "the engine", "robot": robot.name}
    recording = ArtifactData("recording", {
        "runs/gait": Group({}, facts),
        "runs/gait/caps": Group({
            "t": t, "p_WE": seen + NOISE_M * rng.normal(size=seen.shape), "drop_reason": np.zeros(len(t), np.uint8),
            "source_row": np.arange(len(t)), "noise_sd": np.full(seen.shape[1:], NOISE_M),
        }),
        "runs/gait/commands": Group({
            "t": t, "target": commands["target"][in_force], "control": np.nan_to_num(commands["control"][in_force]),
        }),
    })  # fmt: skip
    states, _ = estimate(recording, robot, EstimateSettings())
    return recording, states
