"""The paper's robot, ready to plan for."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from r2s2r_cli.stages.plan.belief import assumed
from r2s2r_cli.stages.plan.executor import Executor
from r2s2r_cli.stages.plan.placement import Reference, reference_of
from r2s2r_cli.stages.plan.standing import Standing
from r2s2r_cli.stages.plan.symmetry import symmetry_group
from tests.support.robots import subject


@lru_cache
def bench() -> tuple[Executor, Reference, Standing]:
    """The paper's robot with its own numbers, at rest, and the reference."""
    robot = subject().robot
    belief = assumed(robot)
    executor = Executor(robot, belief, belief.draws(1, np.random.default_rng(0)), step=1e-3, timeout_s=2.2)
    executor.simulator = subject().simulator
    at = executor.standing(np.array(robot.rest_caps_m)[None], np.zeros(1, dtype=int))
    return executor, reference_of(executor.caps(at)[0], symmetry_group(robot)), at
