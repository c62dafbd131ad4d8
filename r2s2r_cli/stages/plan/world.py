"""What a plan is made for: the request, and the engine with its numbers and start poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from r2s2r_cli.stages.plan.belief import Belief
from r2s2r_cli.stages.plan.executor import Executor
from r2s2r_cli.stages.plan.goal import Goal
from r2s2r_cli.stages.plan.placement import Reference, reference_of
from r2s2r_cli.stages.plan.rewards import Reward
from r2s2r_cli.stages.plan.robust import start_poses
from r2s2r_cli.stages.plan.standing import Standing
from r2s2r_cli.stages.plan.symmetry import symmetry_group
from schemas.config import PlanSettings
from schemas.robot import Robot

SLOW = 1.5
"""Times the time that the slowest winch takes for its whole range, after which the search gives a target up."""
FEW = 8
"""Pairs of numbers and start poses that long policies are made and judged on."""


@dataclass(frozen=True)
class Request:
    """What is to be planned. rewards: behaviours by name; goals: places to go by the name of their policy; reach: how
    far a long policy without a goal may take the robot from its start [m]."""

    belief: Belief
    rewards: Mapping[str, Reward]
    goals: Mapping[str, Goal] = field(default_factory=dict)
    seed: int = 0
    reach: float = math.inf


Progress = Callable[[str, int, int], None]
"""Called with the part of the work, and how many of how many of its steps are done."""


class World:
    """The engine with its numbers and starts. best: with the best numbers, start: its robot at rest; executor: with all
    draws, pairs: its robots from all start poses, the first as `start`; few: some of these. restless: pairs left out
    because their robot does not come to rest."""

    def __init__(
        self, robot: Robot, request: Request, settings: PlanSettings, cache_dir: Path | None, threads: int
    ) -> None:
        generator = np.random.default_rng(request.seed)
        draws = replace(request.belief, doubt=settings.doubt).draws(settings.draws, generator)
        self.robot = robot
        group = symmetry_group(robot)
        shared: dict[str, Any] = {
            "step": settings.step_s, "rod_contact": settings.rod_contact, "cache_dir": cache_dir, "threads": threads,
        }  # fmt: skip
        bias = settings.sensor_sd_m * generator.standard_normal((settings.draws, len(robot.cables)))
        bias[0] = 0.0
        self.executor = Executor(robot, request.belief, draws, bias=bias, **shared)
        slowest = float(self.executor.theta.speed_in[0].min())
        limit = SLOW * robot.pid.range_m / slowest + float(self.executor.delay[0])
        self.best = Executor(
            robot, request.belief, draws[:1], timeout_s=min(limit, robot.pid.step_timeout_s), hurried=True, **shared
        )
        self.best.simulator = self.executor.simulator
        self.start: Standing = self.best.standing(np.array(robot.rest_caps_m)[None], np.zeros(1, dtype=int))
        self.reference: Reference = reference_of(self.best.caps(self.start)[0], group)
        self.pairs = start_poses(self.executor, robot, settings.starts, generator)
        self.restless = len(draws) * settings.starts - len(self.pairs)
        self.few = self.pairs.take(np.unique(np.linspace(0, len(self.pairs) - 1, FEW).round().astype(int)))
