"""The ground plane in any orientation is a change of coordinates, and nothing else."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import EngineInputError, Ground, State, end_caps, tilted
from tests.support.engine import RADIUS, G, free_rods, lying, parameters, random_gait, simulate, simulator, vector
from tests.support.robots import rested, subject

PLANES = {
    "level": (0.0, 0.0, 0.0), "raised": (0.0, 0.0, 0.3), "tilted": (0.3, -0.2, 0.0), "both": (-0.4, 0.7, -0.25),
    "steep": (1.4, 0.9, 0.1), "upside down": (math.pi, 0.0, 0.2),
}  # fmt: skip


@pytest.fixture(params=PLANES)
def ground(request: pytest.FixtureRequest) -> Ground:
    """A plane, some of them far from level."""
    return tilted(*PLANES[request.param])


def gait() -> Tensor:
    """0.2 s of random motor commands."""
    return random_gait(10, 6, batch=1, seed=5)


def test_the_frame_of_the_plane(ground: Ground) -> None:
    """R_GW is a rotation that takes the normal to z, and the origin of G is the point of the plane nearest to W's."""
    R_GW = ground.R_GW()
    torch.testing.assert_close(R_GW @ R_GW.T, torch.eye(3, dtype=torch.float64), rtol=0, atol=1e-12)
    assert float(torch.det(R_GW)) == pytest.approx(1.0)
    torch.testing.assert_close(R_GW @ ground.normal, vector(0.0, 0.0, 1.0), rtol=0, atol=1e-12)
    assert float(ground.normal @ ground.p_WG()) == pytest.approx(float(ground.offset))
    torch.testing.assert_close(ground.p_WG(), ground.normal * ground.offset)


def test_there_and_back(ground: Ground) -> None:
    """A state in motion in W, taken to G and back, is what it was."""
    start = subject().simulator.rollout(subject().theta, rested().state, gait(), hold=20, every=200).at(1)
    back = ground.to_world(ground.to_ground(start))
    for name in ("p_WB", "v_WB", "w_R", "rest"):
        torch.testing.assert_close(getattr(back, name), getattr(start, name), rtol=0, atol=1e-12)
    assert float((back.q_WR * start.q_WR).sum(-1).abs().min()) == pytest.approx(1.0)


def test_heights_are_distances_from_the_plane(ground: Ground) -> None:
    """The z of every cap in G is n . x - offset in W."""
    theta, state = subject().theta, rested().state
    height = end_caps(theta, ground.to_ground(state))[..., 2]
    torch.testing.assert_close(height, end_caps(theta, state) @ ground.normal - ground.offset, rtol=0, atol=1e-12)


def test_a_tilted_world_is_the_level_one_turned(ground: Ground) -> None:
    """The same gait, on a plane tilted with gravity and robot, is the level run in turned coordinates; bounded by
    rounding, which contacts amplify over the 0.2 s."""
    robot = subject()
    level = robot.simulator.rollout(robot.theta, rested().state, gait(), hold=20, every=20)
    tilted_theta = replace(robot.theta, gravity=robot.theta.gravity @ ground.R_GW())
    start = ground.to_world(rested().state)
    run = robot.simulator.rollout(tilted_theta, start, gait(), hold=20, every=20, ground=ground)
    expected = level.end_caps() @ ground.R_GW() + ground.p_WG()
    torch.testing.assert_close(run.end_caps(), expected, rtol=0, atol=1e-9)
    torch.testing.assert_close(run.states.v_WB, level.states.v_WB @ ground.R_GW(), rtol=0, atol=1e-7)


def test_a_rod_slides_down_a_slope_in_the_world() -> None:
    """Plane tilted about y by a, gravity straight down: a = g (sin a - mu cos a) along it, and no motion off it."""
    structure, angle, mu, seconds = free_rods(), 0.6, 0.3, 0.5
    plane = tilted(0.0, angle)
    theta = parameters(structure, friction=mu)
    start = plane.to_world(lying(structure, axis=vector(0.0, 1.0, 0.0)))
    u = torch.zeros(1, 1, 0, dtype=torch.float64)
    run = simulator(structure).rollout(theta, start, u, step=1e-3, hold=500, every=500, ground=plane)
    moved = run.at(1).p_WB[0, 0] - run.at(0).p_WB[0, 0]
    along = vector(math.cos(angle), 0.0, -math.sin(angle))
    # The rod slides and does not roll: it lies across the slope, so that friction also turns it about its axis.
    assert float(moved @ plane.normal) == pytest.approx(0.0, abs=1e-6)
    assert float(moved[1]) == pytest.approx(0.0, abs=1e-9)
    sliding = 0.5 * G * (math.sin(angle) - mu * math.cos(angle)) * seconds**2
    rolling = 0.5 * G * math.sin(angle) * seconds**2
    assert sliding * 0.98 < float(moved @ along) < rolling


def test_a_raised_plane_carries_at_its_height() -> None:
    """A rod dropped on the plane z = 0.3 m comes to rest a cap radius above it."""
    structure = free_rods()
    plane = tilted(0.0, 0.0, 0.3)
    theta = parameters(structure)
    start = lying(structure)
    start = replace(start, p_WB=start.p_WB + vector(0.0, 0.0, 0.35))
    u = torch.zeros(1, 1, 0, dtype=torch.float64)
    run = simulator(structure).rollout(theta, start, u, hold=1000, every=1000, ground=plane)
    assert float(run.at(1).p_WB[0, 0, 2]) == pytest.approx(0.3 + RADIUS, abs=1e-5)


def test_level_ground_changes_nothing() -> None:
    """With the plane z = 0 the run is bit for bit the one without a plane."""
    structure = free_rods()
    theta = parameters(structure)
    start: State = lying(structure, v=vector(0.4, 0.1, 0.0))
    u = torch.zeros(1, 1, 0, dtype=torch.float64)
    on = simulator(structure).rollout(theta, start, u, hold=100, every=100, substeps=1, ground=tilted(0.0, 0.0)).at(1)
    plain = simulate(structure, theta, start, 100, 1e-3, every=100).at(1)
    assert torch.equal(on.p_WB, plain.p_WB)


def test_a_normal_needs_a_direction_not_a_length() -> None:
    """A normal of any length and its offset in the same unit name one plane; a zero normal is refused."""
    one, two = (Ground(k * vector(0.6, 0.0, 0.8), k * torch.tensor(0.1, dtype=torch.float64)) for k in (1.0, 2.5))
    torch.testing.assert_close(one.R_GW(), two.R_GW())
    torch.testing.assert_close(one.p_WG(), two.p_WG())
    with pytest.raises(EngineInputError) as caught:
        Ground(vector(0.0, 0.0, 0.0), torch.tensor(0.0, dtype=torch.float64)).R_GW()
    assert caught.value.field == "ground.normal"


def test_the_slope_can_be_learned() -> None:
    """Of a rod sliding on a slope, the derivative of where it gets by the tilt, against central differences."""
    structure = free_rods()
    theta = parameters(structure, friction=0.2)
    u = torch.zeros(1, 1, 0, dtype=torch.float64)

    def reached(a: Tensor) -> Tensor:
        zero = torch.zeros_like(a)
        plane = Ground(torch.stack([torch.sin(a), zero, torch.cos(a)]), zero)
        start = lying(structure, axis=vector(1.0, 0.0, 0.0))
        start = replace(start, p_WB=start.p_WB.clone())
        run = simulator(structure).rollout(plane.parameters(theta), start, u, hold=20, every=20, substeps=1)
        return run.states.p_WB[0, -1, 0, 0]

    at = torch.tensor(0.5, dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(reached(at), at)
    with torch.no_grad():
        difference = (reached(at + 1e-6) - reached(at - 1e-6)) / 2e-6
    assert float(slope) == pytest.approx(float(difference), rel=1e-6)
    # Gravity along the slope less friction: d/da of g (sin a - mu cos a) t (t + h) / 2.
    closed = 0.5 * G * (math.cos(0.5) + 0.2 * math.sin(0.5)) * 0.020 * 0.021
    assert float(slope) == pytest.approx(closed, rel=1e-3)
