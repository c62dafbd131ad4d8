"""Cables in MuJoCo: they pull by the law of robot.toml, and never push."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.rig.model import rest_pose
from r2s2r_cli.rig.model.sim import MujocoSim
from schemas.robot import Robot
from tests.support.rig_robots import known, values


def test_tension_follows_the_law_of_robot_toml() -> None:
    """Linear winched, linear and cubic passive cables, and a sensor tendon beside one, in the rest pose at rest."""
    robot = values()
    robot["cables"][7] |= {"stiffness2_n_per_m2": 30.0, "stiffness3_n_per_m3": 500.0}
    robot["sensors"][2] |= {"stiffness_n_per_m": 25.0, "rest_length_m": 0.11}
    sim = MujocoSim(Robot.model_validate(robot))
    pose = rest_pose(sim.robot)
    sim.reset(replace(pose, rest=pose.rest - 0.003))
    seen = sim.read()
    expected = np.full(9, 2000.0 * 0.003)
    expected[2] += 25.0 * (seen.span[2] - 0.11)
    stretch = seen.span[6:] - 0.165
    expected[6:] = 100.0 * stretch
    expected[7] += 30.0 * stretch[1] ** 2 + 500.0 * stretch[1] ** 3
    np.testing.assert_allclose(seen.tension, expected, rtol=1e-10)


def test_damping_adds_to_the_tension_of_a_cable_that_lengthens() -> None:
    """Rods that move apart at a known speed stretch their cables at it: force = k x + c v."""
    sim = MujocoSim(known())
    pose = rest_pose(sim.robot)
    step = 1e-7
    v_WR = np.random.default_rng(1).normal(scale=0.2, size=(3, 3))
    sim.reset(replace(pose, rest=pose.rest - 0.003), v_WR=v_WR)
    now = sim.read()
    sim.reset(replace(pose, p_WR=pose.p_WR + step * v_WR, rest=pose.rest - 0.003))
    rate = (sim.read().span - now.span) / step
    damping = np.array([cable.damping_n_s_per_m for cable in sim.robot.cables])
    sim.reset(replace(pose, rest=pose.rest - 0.003))
    np.testing.assert_allclose(now.tension - sim.read().tension, damping * rate, atol=1e-5)
    assert np.abs(damping * rate).max() > 0.1


def test_a_cable_never_pushes() -> None:
    """In 300 random poses with random velocities no tension is negative, and many cables are slack."""
    sim = MujocoSim(known())
    pose = rest_pose(sim.robot)
    generator = np.random.default_rng(2)
    tensions = []
    for _ in range(300):
        p_WR = pose.p_WR + generator.normal(scale=0.05, size=(3, 3))
        v_WR, w_R = generator.normal(scale=1.0, size=(2, 3, 3))
        sim.reset(replace(pose, p_WR=p_WR), v_WR=v_WR, w_R=w_R)
        tensions.append(sim.read().tension)
    assert np.min(tensions) == 0.0
    assert 0.2 < np.mean(np.array(tensions) == 0.0) < 0.8


def test_a_slack_robot_falls_apart() -> None:
    """Without tension no force holds the rods: at rest in mid-air all cables paid out leave every rod in free fall."""
    robot = values()
    for cable in robot["cables"][6:]:
        cable["rest_length_m"] = 0.4
    sim = MujocoSim(Robot.model_validate(robot))
    pose = rest_pose(sim.robot)
    sim.reset(replace(pose, p_WR=pose.p_WR + np.array([0.0, 0.0, 1.0]), rest=pose.rest + 0.05))
    sim.step(count=100)
    np.testing.assert_allclose(sim.read().v_WR, np.tile([0.0, 0.0, -0.981], (3, 1)), atol=1e-12)


def test_winches_wind_at_their_speed_and_stop_at_their_limits() -> None:
    """Full command shortens by speed times time, half command by half; nobody winds beyond the limits."""
    sim = MujocoSim(known())
    start = sim.rest
    speed = 23.038 * 0.8 * 0.0035
    sim.wind(np.array([1.0, 0.5, 0.0, -1.0, 7.0, -0.25]), count=100)
    expected = start - 0.1 * speed * np.array([1.0, 0.5, 0.0, -1.0, 1.0, -0.25])
    np.testing.assert_allclose(sim.rest, expected, atol=1e-12)
    low, high = start - sim.model.actuator_ctrlrange[:6, ::-1].T
    sim.step(np.full(6, 1.0))
    np.testing.assert_allclose(sim.rest, high, atol=1e-15)
    sim.step(np.zeros(6))
    np.testing.assert_allclose(sim.rest, low, atol=1e-15)


@pytest.mark.parametrize("command", [0.6, 1.0])
def test_a_shortened_triangle_gets_shorter(command: float) -> None:
    """Reeling in one cable brings its two caps together and leaves them so."""
    sim = MujocoSim(known())
    sim.step(count=500)
    before = sim.read()
    sim.wind(command * np.eye(6)[1], count=1000)
    after = sim.read()
    assert after.length[1] < before.length[1] - 0.5 * command * 0.0645
    assert after.tension[1] > 0
