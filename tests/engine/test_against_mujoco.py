"""Engine and MuJoCo: one limit in flight and without friction; with friction MuJoCo differs, and it is MuJoCo.

Three codes that share no line of physics: the engine, the rig's MuJoCo model (`STIFF`, contacts nearly as hard), and
the penalty integration at 2 us. They run random gait steps of 1 s from the same states. Rod contact is off: the
penalty integration has none. The numbers: `pytest -m slow tests/engine/test_against_mujoco.py --log-cli-level=INFO`.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import torch

from r2s2r_cli.commands import bench_gait
from r2s2r_cli.engine import Simulator, State
from r2s2r_cli.rig.model import STIFF, Options, rest_pose
from r2s2r_cli.rig.model.frames import Pose
from r2s2r_cli.rig.model.options import Integrator
from r2s2r_cli.rig.model.sim import MujocoSim
from r2s2r_cli.stages.model import parameters_of, rest_state, structure_of
from tests.support.penalty import Penalty
from tests.support.rig_robots import known

LOG = logging.getLogger(__name__)
ROBOT = known()
STRUCTURE, THETA = replace(structure_of(ROBOT), rod_contact=False), parameters_of(ROBOT)
GAITS, STARTED, ROWS = 32, 2, 50
"""Random gaits, the second at which each is compared, and motor commands a second."""


@pytest.mark.parametrize(("integrator", "least", "most"), [("Euler", 0.0, 1.0), ("implicitfast", 10.0, 50.0)])
def test_both_have_one_limit_in_flight(integrator: Integrator, least: float, most: float) -> None:
    """Thrown, spinning, with winches at work and without a ground, the caps differ after 0.3 s by less than 1 mm at
    1 ms, and by half of it at half the step: first order, towards one motion. `implicitfast`, which brakes falling
    robots, is tens of times further away."""
    generator = np.random.default_rng(0)
    v_WR, w_R = generator.normal(scale=[[[0.3]], [[2.0]]], size=(2, 3, 3)) + np.array([[[0.0, 0, 1.5]], [[0.0, 0, 0]]])
    u, up = generator.choice([-1.0, 1.0], size=6), np.array([0.0, 0.0, 1.0])
    pose, state = rest_pose(ROBOT), rest_state(ROBOT)
    state = replace(state, p_WB=state.p_WB + torch.as_tensor(up), v_WB=_row(v_WR), w_R=_row(w_R))
    apart = []
    for h in (1e-3, 5e-4):
        steps = round(0.3 / h)
        ours = engine().rollout(THETA, state, _row(u)[None], step=h, hold=steps, every=steps).end_caps()[0, -1].numpy()
        sim = MujocoSim(ROBOT, Options(timestep_s=h, integrator=integrator))
        sim.reset(replace(pose, p_WR=pose.p_WR + up), v_WR=v_WR, w_R=w_R)
        sim.wind(u, count=steps)
        apart.append(1e3 * np.abs(sim.read().p_WE - ours).max())
    assert least < apart[0] < most
    assert apart[0] / apart[1] == pytest.approx(2.0, abs=0.1)


@pytest.mark.slow
def test_without_friction_all_three_agree() -> None:
    """At a friction of 0.01 the gaits move the caps by 40 mm, and the three codes end within 0.25 mm of each other:
    cables, inertias, winches, gravity, impacts and the normal contact are the same."""
    ours, mujoco, penalty = ends(0.01)
    for name, apart in (("engine", rms(ours, penalty)), ("mujoco", rms(mujoco, penalty)), ("both", rms(mujoco, ours))):
        LOG.info("friction %g, %s: median %.3f, worst %.3f mm", 0.01, name, np.median(apart), apart.max())
        assert np.median(apart) < 0.15, name
        assert apart.max() < 0.25, name
    assert np.median(rms(start_caps(), penalty)) > 20.0


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.3, 0.76])
def test_with_friction_mujoco_differs_from_both(friction: float) -> None:
    """MuJoCo is some mm away from the engine, and as far, gait by gait, from the penalty integration, to which the
    engine is more than five times closer. So the difference is MuJoCo's; it grows with friction, whose convex form
    makes sliding caps hop (tests/rig/test_contact.py)."""
    ours, mujoco, penalty = ends(friction)
    own, foreign, both = rms(ours, penalty), rms(mujoco, penalty), rms(mujoco, ours)
    for name, apart in (("engine", own), ("mujoco", foreign), ("both", both)):
        LOG.info("friction %g, %s: median %.3f, worst %.3f mm", friction, name, np.median(apart), apart.max())
    assert np.median(own) < 0.15
    assert own.max() < 0.3
    assert 5 * np.median(own) < np.median(foreign) < 4.0
    assert foreign.max() < 12.0
    assert np.abs(both - foreign).max() < 0.3
    frictionless = rms(ends(0.01)[1], ends(0.01)[2])
    assert np.median(foreign) > 4 * np.median(frictionless)


@lru_cache(maxsize=1)
def engine() -> Simulator:
    """The engine, compiled once."""
    return Simulator(STRUCTURE)


@lru_cache(maxsize=1)
def walks() -> tuple[np.ndarray, State]:
    """Motor commands (gait, row, actuated) of 1 s, and the states in mid-gait where they begin."""
    u = bench_gait.commands(ROBOT, THETA.speed_in[0].numpy(), STARTED + 1.0, range(GAITS))
    still = torch.zeros(1, 3 * ROWS, 6, dtype=torch.float64)
    settled = engine().rollout(THETA, rest_state(ROBOT), still, hold=20, every=1000).at(-1)
    walked = engine().rollout(THETA, settled, torch.as_tensor(u), hold=20, every=1000).at(STARTED)
    return u[:, STARTED * ROWS :], walked


@lru_cache(maxsize=3)
def ends(friction: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """End caps (gait, cap, 3) after 1 s: the engine at 0.25 ms, MuJoCo, the penalty integration."""
    u, start = walks()
    theta = replace(THETA, friction=torch.full_like(THETA.friction, friction))
    ours = engine().rollout(theta, start, torch.as_tensor(u), step=2.5e-4, hold=80, every=4000).end_caps()[:, -1]
    penalty = Penalty(STRUCTURE, theta).caps(start, torch.as_tensor(u), seconds=1 / ROWS, frames=1)[:, -1]
    sim = MujocoSim(ROBOT, replace(STIFF, friction=friction, rod_contact=False))
    mujoco = []
    for k, commands in enumerate(u):
        pose = Pose(*(x[k].numpy() for x in (start.p_WB, start.q_WR, start.rest)))  # masses lie in the middles
        sim.reset(pose, v_WR=start.v_WB[k].numpy(), w_R=start.w_R[k].numpy())
        for row in commands:
            sim.wind(row, count=round(1 / ROWS / STIFF.timestep_s))
        mujoco.append(sim.read().p_WE)
    return ours.numpy(), np.array(mujoco), penalty.numpy()


def start_caps() -> np.ndarray:
    """End caps (gait, cap, 3) where the gait steps begin."""
    _, start = walks()
    return Penalty(STRUCTURE, THETA).caps_of(Penalty(STRUCTURE, THETA).flat(start)).numpy()


def rms(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distance over the caps [mm], (gait,)."""
    return np.asarray(1e3 * np.sqrt(((a - b) ** 2).sum(-1).mean(-1)))


def _row(x: np.ndarray) -> torch.Tensor:
    return torch.as_tensor(x)[None]
