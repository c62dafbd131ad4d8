"""With all effects off the rig is the MuJoCo twin, and as far from the engine as that is: the rig's numerics floor."""

from __future__ import annotations

import logging

import numpy as np
import pytest
import torch

from r2s2r_cli.commands import bench_gait
from r2s2r_cli.engine import Simulator
from r2s2r_cli.rig.model import STIFF, Options
from r2s2r_cli.rig.model.frames import Pose
from r2s2r_cli.rig.model.sim import MujocoSim
from r2s2r_cli.rig.plant import Plant
from r2s2r_cli.rig.world import World
from r2s2r_cli.stages.model import parameters_of, rest_state, structure_of
from tests.support.rig_robots import known

LOG = logging.getLogger(__name__)
ROBOT = known()
SPEED = np.array([motor.speed for motor in ROBOT.motors])
GAITS, STARTED, ROWS = 32, 2, 50
"""Random gaits, the second at which each is compared, and motor commands a second."""


@pytest.mark.parametrize(("stiff", "options"), [(False, Options()), (True, STIFF)])
def test_without_effects_the_plant_is_the_twin(stiff: bool, options: Options) -> None:
    """Commands as duties (speed times command) give the motion of `MujocoSim.wind`, to rounding."""
    plant = Plant(ROBOT, World.model_validate({"stiff": stiff, "start": {"settle_s": 0.0}}))
    twin = MujocoSim(ROBOT, options)
    rng = np.random.default_rng(0)
    for _ in range(8):
        u = rng.choice([-1.0, 0.0, 1.0], size=6)
        plant.advance(0.02, SPEED * u)
        twin.wind(u, count=round(0.02 / options.timestep_s))
    np.testing.assert_allclose(plant.truth().p_WE, twin.read().p_WE, atol=1e-8)
    np.testing.assert_allclose(plant.truth().rest, twin.rest, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("stiff", "median", "worst"), [(True, 2.5, 10.0), (False, 2.5, 10.0)])
def test_a_gait_step_ends_where_the_engines_does(stiff: bool, median: float, worst: float) -> None:
    """32 random gait steps of 1 s from the same states in mid-gait: caps end as near to the engine's as it was measured
    for the twin (docs/concepts/mujoco.md: median 1.8, worst 7.2 mm), far nearer than they have moved."""
    structure, theta = structure_of(ROBOT), parameters_of(ROBOT)
    u = bench_gait.commands(ROBOT, theta.speed_in[0].numpy(), STARTED + 1.0, range(GAITS))
    engine = Simulator(structure)
    still = torch.zeros(1, 3 * ROWS, 6, dtype=torch.float64)
    settled = engine.rollout(theta, rest_state(ROBOT), still, hold=20, every=1000).at(-1)
    start = engine.rollout(theta, settled, torch.as_tensor(u), hold=20, every=1000).at(STARTED)
    step = torch.as_tensor(u[:, STARTED * ROWS :])
    ours = engine.rollout(theta, start, step, step=2.5e-4, hold=80, every=4000).end_caps()[:, -1].numpy()
    plant = Plant(ROBOT, World.model_validate({"stiff": stiff, "start": {"settle_s": 0.0}}))
    theirs, moved = [], []
    for k, rows in enumerate(u[:, STARTED * ROWS :]):
        place(
            plant,
            Pose(*(x[k].numpy() for x in (start.p_WB, start.q_WR, start.rest))),
            start.v_WB[k].numpy(),
            start.w_R[k].numpy(),
        )
        before = plant.truth().p_WE
        for row in rows:
            plant.advance(1 / ROWS, SPEED * row)
        theirs.append(plant.truth().p_WE)
        moved.append(rms(before, theirs[-1]))
    apart = np.array([rms(a, b) for a, b in zip(ours, theirs, strict=True)])
    LOG.info(
        "stiff %s: moved %.1f mm, apart median %.2f, worst %.2f mm",
        stiff,
        np.median(moved),
        np.median(apart),
        apart.max(),
    )
    assert np.median(apart) < median
    assert apart.max() < worst
    assert np.median(moved) > 20.0


def place(plant: Plant, pose: Pose, v_WR: np.ndarray, w_R: np.ndarray) -> None:
    """Put a plant without laws into a state."""
    plant.sim.reset(pose, v_WR=v_WR, w_R=w_R)
    plant.winches.rest = plant.winches.acting = pose.rest.copy()


def rms(a: np.ndarray, b: np.ndarray) -> float:
    """Distance over the caps [mm]."""
    return float(1e3 * np.sqrt(((a - b) ** 2).sum(-1).mean(-1)))
