"""Free motion, rest and symmetry of the MuJoCo model, and the seam around it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from r2s2r_cli.errors import NumericalError, UsageError
from r2s2r_cli.rig.model import STIFF, Options, rest_pose
from r2s2r_cli.rig.model.frames import rotation
from r2s2r_cli.rig.model.sim import MujocoSim
from tests.support.rig_robots import known


def centre(sim: MujocoSim) -> np.ndarray:
    """Centre of mass of the robot [m]; rods of the known robots have theirs in the middle and weigh the same."""
    return sim.read().p_WR.mean(axis=0)


def test_the_centre_of_mass_falls_freely() -> None:
    """Whatever the cables do inside, in the air it follows v t - g t (t + h) / 2, exactly what the integrator sums."""
    sim = MujocoSim(known())
    pose = rest_pose(sim.robot)
    v = np.array([0.3, -0.2, 1.5])
    sim.reset(replace(pose, p_WR=pose.p_WR + np.array([0.0, 0.0, 2.0]), rest=pose.rest - 0.01), v_WR=np.tile(v, (3, 1)))
    start, h, t = centre(sim), sim.model.opt.timestep, 0.5
    sim.step(count=500)
    expected = start + v * t + [0.0, 0.0, -9.81 * t * (t + h) / 2]
    np.testing.assert_allclose(centre(sim), expected, atol=1e-9)
    assert np.ptp(sim.read().v_WR, axis=0).max() > 1e-3


def test_implicitfast_falls_too_slowly() -> None:
    """Why Euler is the default: MuJoCo's implicit damping drops what couples two bodies, so that a cable's damping
    brakes each of its rods against the world; the robot falls 4 to 7 per cent too slowly at 1 ms."""
    sim = MujocoSim(known(), Options(integrator="implicitfast"))
    pose = rest_pose(sim.robot)
    sim.reset(replace(pose, p_WR=pose.p_WR + np.array([0.0, 0.0, 2.0]), rest=pose.rest - 0.01))
    sim.step(count=500)
    speed = sim.read().v_WR.mean(axis=0)[2] / (-9.81 * 0.5)
    assert 0.93 < speed < 0.96


@pytest.mark.parametrize("name", ["threebar", "sixbar"])
@pytest.mark.parametrize("options", [Options(), STIFF], ids=["default", "stiff"])
def test_the_robot_settles_on_the_ground(name: str, options: Options) -> None:
    """After 3 s it rests near its rest pose on at least three caps, carried by its weight, not below the ground."""
    robot = known(name)
    sim = MujocoSim(robot, options)
    sim.step(count=round(3.0 / options.timestep_s))
    seen = sim.read()
    assert np.abs(seen.p_WE - np.array(robot.rest_caps_m)).max() < 0.08
    assert np.abs(seen.v_WR).max() < 0.1
    assert seen.contact.sum() >= 3
    radius = robot.rods[0].cap_radius_m
    assert seen.p_WE[:, 2].min() > radius - 1e-4


def test_the_ground_carries_the_weight() -> None:
    """The normal forces under the resting robot add up to its weight."""
    sim = MujocoSim(known())
    sim.step(count=4000)
    total, force = 0.0, np.zeros(6)
    for i in range(sim.data.ncon):
        mujoco.mj_contactForce(sim.model, sim.data, i, force)
        total += force[0]
    assert total == pytest.approx(9.81 * sim.model.body_mass.sum(), rel=0.01)


def test_three_fold_symmetry() -> None:
    """With every rod's name moved on to the next, the same motion comes out under the new names.

    Cables at the rod ends, so that the robot is symmetric; with a kick, winches at work, rod and ground contacts.
    """
    robot = known("threebar", "rod_end")
    sim = MujocoSim(robot)
    pose, generator = rest_pose(robot), np.random.default_rng(4)
    v_WR = generator.normal(scale=0.2, size=(3, 3))
    u = generator.choice([-1.0, 1.0], size=6)
    caps = [cable.caps for cable in robot.cables]
    next_cable = [caps.index(_ordered(caps, ((a + 2) % 6, (b + 2) % 6))) for a, b in caps]

    def run(shift: int) -> np.ndarray:
        to_rod = np.roll(np.arange(3), -1)  # rod i becomes rod i + 1
        p, q, v, rest, command = pose.p_WR, pose.q_WR, v_WR, pose.rest, u
        for _ in range(shift):
            p, q, v = (_moved(x, to_rod) for x in (p, q, v))
            rest, command = (_moved(x, np.array(next_cable[:6])) for x in (rest, command))
        sim.reset(replace(pose, p_WR=p, q_WR=q, rest=rest), v_WR=v)
        sim.wind(command, count=400)
        seen = sim.read()
        return np.roll(seen.p_WE, -2 * shift, axis=0)

    first = run(0)
    assert np.abs(first - np.array(robot.rest_caps_m)).max() > 0.01
    for shift in (1, 2):
        np.testing.assert_allclose(run(shift), first, atol=1e-6)


def _ordered(caps: list[tuple[int, int]], pair: tuple[int, int]) -> tuple[int, int]:
    return pair if pair in caps else pair[::-1]


def _moved(x: np.ndarray, to: np.ndarray) -> np.ndarray:
    out = np.empty_like(x)
    out[to] = x
    return out


def test_reading_changes_nothing() -> None:
    """A run that is read after every step ends in the same bits as one that is not."""
    ends = []
    for reads in (False, True):
        sim = MujocoSim(known())
        for _ in range(200):
            sim.wind(np.ones(6))
            if reads:
                sim.read()
        ends.append(np.concatenate([sim.data.qpos, sim.data.qvel]))
    np.testing.assert_array_equal(*ends)


def test_a_reset_forgets_everything() -> None:
    """After a reset the same run gives the same bits."""
    sim = MujocoSim(known())
    ends = []
    for _ in range(2):
        sim.reset()
        sim.wind(np.ones(6), count=300)
        ends.append(np.array(sim.data.qpos))
    np.testing.assert_array_equal(*ends)


def test_readings_hang_together() -> None:
    """Caps follow from poses, lengths from caps, velocities are the differences of the poses."""
    sim = MujocoSim(known())
    sim.wind(np.array([1.0, -1, 1, 0, 0, 1]), count=300)
    a = sim.read()
    sim.step()
    b = sim.read()
    np.testing.assert_allclose((b.p_WR - a.p_WR) / sim.model.opt.timestep, b.v_WR, atol=1e-9)
    np.testing.assert_allclose((a.p_WE[0::2] + a.p_WE[1::2]) / 2, a.p_WR, atol=1e-15)
    np.testing.assert_allclose(a.p_WE[1::2] - a.p_WE[0::2], 0.325 * rotation(a.q_WR)[..., 2], atol=1e-15)
    assert a.length[0] == pytest.approx(np.linalg.norm(a.p_WE[3] - a.p_WE[5]))
    mujoco.mj_forward(sim.model, sim.data)
    for cap in range(6):
        np.testing.assert_allclose(b.p_WE[cap], sim.data.site(f"centre{cap}").xpos, atol=1e-12)
    turned = rotation(a.q_WR).swapaxes(-1, -2) @ rotation(b.q_WR)
    odd = (turned - turned.swapaxes(-1, -2)) / 2
    w = np.stack([odd[:, 2, 1], odd[:, 0, 2], odd[:, 1, 0]], axis=-1) / sim.model.opt.timestep
    np.testing.assert_allclose(w, b.w_R, atol=1e-4)


def test_divergence_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo starts anew in silence when its numbers explode; here that is an error that says so, and no log file."""
    monkeypatch.chdir(tmp_path)
    sim = MujocoSim(known(), Options(timestep_s=0.2, integrator="Euler"))
    with pytest.raises(NumericalError, match="went wrong") as caught:
        sim.step(sim.rest - 0.1, count=2000)
    assert "unstable" in caught.value.received
    assert not Path("MUJOCO_LOG.TXT").exists()


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("p_WR", np.zeros((2, 3)), "shape (2, 3)"), ("q_WR", np.full((3, 4), np.nan), "not finite"),
        ("rest", np.zeros(9), "shape (9,)"), ("q_WR", np.ones((3, 4)), "2"),
    ],
)  # fmt: skip
def test_wrong_poses_are_refused(name: str, value: np.ndarray, says: str) -> None:
    """Wrong shapes, NaN and quaternions that are no rotations: the error names the field."""
    sim = MujocoSim(known())
    with pytest.raises(UsageError) as caught:
        sim.reset(replace(rest_pose(sim.robot), **{name: value}))
    assert name in caught.value.where
    assert says in caught.value.received
