"""`python -m r2s2r_cli.commands.bench_probe SIDE PLAN`: what only a fresh process can tell, its start and its memory.

SIDE is `ours` or `mujoco`, PLAN the JSON of a `Plan`. Prints one JSON object: `seconds` of processor time by what was
called for the first time, imports not counted, and `peak`, the most resident memory of the process in bytes.
"""

from __future__ import annotations

import json
import sys
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

from r2s2r_cli.commands import bench_gait
from r2s2r_cli.commands.bench_sides import Job, MujocoSide, OurSide
from r2s2r_cli.rig.model.options import Integrator
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import Robot


@dataclass(frozen=True)
class Plan:
    """Robot by name, step [s], length of the single runs [s], (environments, seconds) of each batch,
    MuJoCo's integrator, and a folder for machine code."""

    robot: str
    step_s: float
    run_s: float
    batches: tuple[tuple[int, float], ...]
    integrator: Integrator
    cache_dir: str

    def load(self) -> Robot:
        """The robot."""
        return Robot.model_validate(tomllib.loads(robot_toml(self.robot)))


def probe(side: str, plan: Plan) -> dict[str, object]:
    """Every job of the benchmark once; each kind first with as little work as it can have."""
    import numpy as np

    robot = plan.load()
    tick = np.zeros((1, 1, len(robot.actuated)))
    seconds = {}
    if side == "ours":
        _import_ours()
        clock = time.process_time()
        ours = OurSide(robot, plan.step_s, Path(plan.cache_dir))
        seconds["forward"] = time.process_time() - clock
        seconds["backward"] = _timed(ours.gradient(tick))
        seconds["tangents"] = _timed(ours.jacobian(tick))
        seconds["forward, batch"] = _timed(ours.forward(np.repeat(tick, plan.batches[-1][0], axis=0)))
        made: OurSide | MujocoSide = ours
    else:
        made = MujocoSide(robot, plan.step_s, plan.integrator)
    u = bench_gait.commands(robot, made.speed, plan.run_s, range(1))
    for size, length in plan.batches:
        made.forward(bench_gait.commands(robot, made.speed, length, range(size)))()
    made.forward(u)()
    made.gradient(u)()
    if isinstance(made, OurSide):
        made.jacobian(u)()
    return {"seconds": seconds, "peak": _peak_bytes()}


def _import_ours() -> None:
    import torch  # noqa: F401

    from r2s2r_cli.engine import rollout  # noqa: F401
    from r2s2r_cli.stages import model  # noqa: F401


def _timed(job: Job) -> float:
    clock = time.process_time()
    job()
    return time.process_time() - clock


def _peak_bytes() -> int:
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


if __name__ == "__main__":
    print(json.dumps(probe(sys.argv[1], Plan(**json.loads(sys.argv[2])))))
