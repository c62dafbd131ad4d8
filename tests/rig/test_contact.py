"""Contact of the MuJoCo model against closed forms: what a soft contact keeps of them, and how much it misses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.rig.model import STIFF, Options, rest_pose
from r2s2r_cli.rig.model.options import damping_ratio
from r2s2r_cli.rig.model.sim import MujocoSim
from tests.support.rig_robots import two_rods

SLOPE = math.radians(20.0)
G = 9.81


@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("options", [Options(), STIFF], ids=["default", "stiff"])
def test_bounce_height(restitution: float, options: Options) -> None:
    """A flat rod dropped from 0.3 m rebounds with the restitution of robot.toml, at most 0.08 too low, never higher."""
    sim = MujocoSim(two_rods(restitution=restitution), options)
    pose = rest_pose(sim.robot)
    sim.reset(replace(pose, p_WR=pose.p_WR + np.array([0.0, 0.0, 0.3])))
    heights = []
    for _ in range(200):
        sim.step(count=round(0.004 / options.timestep_s))
        heights.append(sim.data.qpos[2] - 0.0175)
    landed = int(np.argmax(np.array(heights) < 0.02))
    rebound = math.sqrt(max(heights[landed + 5 :]) / 0.3)
    assert restitution - 0.08 < rebound < restitution


def test_no_restitution_hardly_bounces() -> None:
    """A robot with restitution 0 rebounds to less than a hundredth of its height."""
    sim = MujocoSim(two_rods(restitution=0.0))
    pose = rest_pose(sim.robot)
    sim.reset(replace(pose, p_WR=pose.p_WR + np.array([0.0, 0.0, 0.3])))
    sim.step(count=260)  # it lands after 247 ms
    heights = []
    for _ in range(200):
        sim.step()
        heights.append(sim.data.qpos[2] - 0.0175)
    assert max(heights) < 0.003


@pytest.mark.parametrize("ratio", [0.05, 0.2, 0.5, 0.9])
def test_damping_ratio_gives_the_rebound_of_a_released_spring(ratio: float) -> None:
    """Integrating x'' = -max(0, x'' of spring and damper) in small steps rebounds with what the formula inverts."""
    h, x, v, force = 1e-5, 0.0, -1.0, 0.0
    while x <= 0.0 and (force := -x - 2 * ratio * v) >= 0.0:
        v += h * force
        x += h * v
    assert damping_ratio(v) == pytest.approx(ratio, rel=1e-3)


def test_damping_ratio_at_the_ends() -> None:
    """Critical damping for all that rebounds less than it does, nearly none for a perfect rebound."""
    assert damping_ratio(0.0) == damping_ratio(math.exp(-2)) == 1.0
    assert damping_ratio(1.0) == 1e-3


def slope(friction: float, options: Options) -> MujocoSim:
    """Two flat rods along the line of fall of a plane tilted by 20 degrees, simulated for 0.1 s."""
    gravity = (G * math.sin(SLOPE), 0.0, -G * math.cos(SLOPE))
    sim = MujocoSim(two_rods(friction=friction), replace(options, gravity=gravity))
    sim.step(count=round(0.1 / options.timestep_s))
    return sim


@pytest.mark.parametrize("friction", [0.2, 0.3])
@pytest.mark.parametrize("options", [Options(), STIFF], ids=["default", "stiff"])
def test_a_rod_slides_above_the_friction_angle(friction: float, options: Options) -> None:
    """Acceleration g (sin - mu cos), within 2 per cent of g sin."""
    sim = slope(friction, options)
    before = sim.read().v_WR[:, 0]
    sim.step(count=round(0.5 / options.timestep_s))
    acceleration = (sim.read().v_WR[:, 0] - before) / 0.5
    expected = G * (math.sin(SLOPE) - friction * math.cos(SLOPE))
    np.testing.assert_allclose(acceleration, expected, atol=0.02 * G * math.sin(SLOPE))


def test_a_sliding_rod_hops() -> None:
    """MuJoCo's convex friction turns sliding into lifting: the faster a rod slides the higher it hops over the flat
    ground, 0.02 mm per m/s and more, where Coulomb's law keeps it down. Harder contacts do not help."""
    for options in (Options(), STIFF):
        sim = slope(0.2, options)
        heights = []
        for _ in range(500):
            sim.step(count=round(0.001 / options.timestep_s))
            heights.append(sim.read().p_WE[:, 2].max() - 0.0175)
        first, last = max(heights[:100]), max(heights[-100:])
        assert last > 2 * first > 0
        assert last > 2e-5


@pytest.mark.parametrize(("options", "creep"), [(Options(), 5e-4), (STIFF, 5e-8)], ids=["default", "stiff"])
def test_a_rod_creeps_below_the_friction_angle(options: Options, creep: float) -> None:
    """It does not slide, but MuJoCo's soft friction creeps: 0.35 mm/s by default, 0.04 um/s where it is stiff."""
    sim = slope(0.6, options)
    before = sim.read().p_WR[:, 0]
    sim.step(count=round(1.0 / options.timestep_s))
    moved = sim.read().p_WR[:, 0] - before
    assert (moved < creep).all()
    assert (moved > creep / 100).all()


def test_a_tilted_ground_is_tilted_gravity() -> None:
    """A plane that falls towards x, off the origin, slides the rod as level ground with tilted gravity does."""
    level = slope(0.2, Options())
    level.step(count=300)
    normal = (math.sin(SLOPE), 0.0, math.cos(SLOPE))
    R_WG = np.array([[math.cos(SLOPE), 0, math.sin(SLOPE)], [0, 1, 0], [-math.sin(SLOPE), 0, math.cos(SLOPE)]])
    sim = MujocoSim(two_rods(friction=0.2), Options(ground_normal=normal, ground_offset_m=0.25))
    pose = rest_pose(sim.robot)
    q = np.array([0.0, math.sin(SLOPE / 2), 0.0, math.cos(SLOPE / 2)])
    q_WR = np.array([_product(q, p) for p in pose.q_WR])
    sim.reset(replace(pose, p_WR=pose.p_WR @ R_WG.T + 0.25 * np.array(normal), q_WR=q_WR))
    sim.step(count=400)
    moved = (sim.read().p_WE - 0.25 * np.array(normal)) @ R_WG
    np.testing.assert_allclose(moved, level.read().p_WE, atol=1e-6)


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    v = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.append(v, a[3] * b[3] - a[:3] @ b[:3])


def test_rods_collide_only_where_they_should() -> None:
    """Two crossed rods that meet push each other away; with rod contact switched off they pass through."""
    ends = {}
    for rod_contact in (True, False):
        sim = MujocoSim(two_rods(), Options(rod_contact=rod_contact, gravity=(0.0, 0.0, 0.0)))
        pose = rest_pose(sim.robot)
        s = math.sqrt(0.5)
        q_WR = np.stack([pose.q_WR[0], _product(np.array([0.0, 0.0, s, s]), pose.q_WR[0])])
        p_WR = np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 0.55]])
        sim.reset(replace(pose, p_WR=p_WR, q_WR=q_WR), v_WR=np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]))
        hits = 0
        for _ in range(150):
            sim.step()
            hits += sim.read().collisions
        seen = sim.read()
        ends[rod_contact] = seen.p_WR[1, 2] - seen.p_WR[0, 2]
        assert (hits > 0) == rod_contact
        assert seen.v_WR[:, 2].sum() == pytest.approx(1.0, abs=1e-6)
    assert ends[False] == pytest.approx(0.05 - 0.15, abs=1e-9)
    assert ends[True] > 0
