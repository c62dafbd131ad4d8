"""Engine against the rig's MuJoCo model over random gait steps, all effects off: the floor's part that is numerics."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.commands import bench_gait

if TYPE_CHECKING:
    from r2s2r_cli.stages.floor.numerics import Numerics
    from schemas.robot import Robot

SETTLE_S = 3.0
BEFORE_S = 2.0
"""A gait has run so long where its step begins: the robot is in motion, not in its rest pose."""
STEP_S = 1.0
ENGINE_STEP_S = 2.5e-4


def numerics(robot: Robot, gaits: int, cache: Path | None = None) -> Numerics:
    """`gaits` random gait steps of one second from common states in mid-gait (seeds 0, 1, ...).

    The settings are those of docs/concepts/mujoco.md: the engine at 0.25 ms, MuJoCo with contacts nearly as hard.
    Friction is the robot's. The caller sees to MuJoCo (`require_mujoco`). Raises NumericalError where one of both
    diverges.
    """
    import torch

    from r2s2r_cli.engine import Simulator
    from r2s2r_cli.rig.model import STIFF
    from r2s2r_cli.rig.model.sim import MujocoSim
    from r2s2r_cli.stages.floor.numerics import Numerics, cap_rmse
    from r2s2r_cli.stages.model import parameters_of, rest_state, structure_of

    torch.set_num_threads(1)
    structure, theta = structure_of(robot), parameters_of(robot)
    engine = Simulator(structure, cache_dir=cache)
    hold = round(bench_gait.TICK_S / 1e-3)
    u = bench_gait.commands(robot, theta.speed_in[0].numpy(), BEFORE_S + STEP_S, range(gaits))
    rows = torch.as_tensor(u)
    before = round(BEFORE_S / bench_gait.TICK_S)
    still = torch.zeros(1, round(SETTLE_S / bench_gait.TICK_S), structure.n_actuated, dtype=torch.float64)
    rest = engine.rollout(theta, rest_state(robot), still, step=1e-3, hold=hold, every=hold).at(-1)
    start = engine.rollout(theta, rest, rows[:, :before], step=1e-3, hold=hold, every=hold).at(-1)
    fine = round(bench_gait.TICK_S / ENGINE_STEP_S)
    run = engine.rollout(theta, start, rows[:, before:], step=ENGINE_STEP_S, hold=fine, every=fine).end_caps().numpy()
    sim = MujocoSim(robot, replace(STIFF, friction=robot.contact.friction))
    ends = np.array([_mujoco(sim, start, run[k, 0], k, u[k, before:]) for k in range(gaits)])
    return Numerics(
        seed=np.arange(gaits), error=cap_rmse(run[:, -1], ends), way=cap_rmse(run[:, -1], run[:, 0]),
        engine_step=ENGINE_STEP_S, rig_step=sim.model.opt.timestep,
    )  # fmt: skip


def _mujoco(sim: Any, start: Any, caps: np.ndarray, k: int, u: np.ndarray) -> np.ndarray:
    """End caps (cap, 3) [m] after the commands u (tick, actuated), from state k of the engine with these caps."""
    from r2s2r_cli.rig.model.frames import Pose, rotation

    p_WB, q_WR, v_WB, w_R, rest = (getattr(start, name)[k].numpy() for name in ("p_WB", "q_WR", "v_WB", "w_R", "rest"))
    middle = 0.5 * (caps[0::2] + caps[1::2])  # the engine counts from the centre of mass, MuJoCo from the middle
    w_W = np.einsum("rij,rj->ri", rotation(q_WR), w_R)
    sim.reset(Pose(middle, q_WR, rest), v_WR=v_WB + np.cross(w_W, middle - p_WB), w_R=w_R)
    for row in u:
        sim.wind(row, count=round(bench_gait.TICK_S / sim.model.opt.timestep))
    return np.asarray(sim.read().p_WE)
