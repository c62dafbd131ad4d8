"""What is read off a state, against numbers made by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import (
    Parameters,
    State,
    Structure,
    cap_lengths,
    energy,
    longest_step,
    momentum,
    pose_state,
    read,
    step,
)
from r2s2r_cli.engine.reading import always_stable_step
from tests.support.engine import (
    AXIAL,
    HALF,
    MASS,
    RADIUS,
    TRANSVERSE,
    G,
    free_rods,
    lying,
    parameters,
    roll,
    state,
    threebar_engine,
    vector,
)
from tests.support.robots import frames, rested, subject

K, C, REST, LENGTH = 300.0, 4.0, 0.2, 0.23


def two_masses(**numbers: float | Tensor) -> tuple[Structure, Parameters, State]:
    """Two rods along z, high above the ground, a winched cable between their centres of mass: a 1-D spring along x."""
    structure = Structure(n_rods=2, cable_rods=((0, 1),), actuated=(0,), cubic="stiffness3" in numbers,
                          rod_contact=False)  # fmt: skip
    theta = parameters(structure, **{"stiffness": K, "damping": 0.0, "gravity": torch.zeros(3), **numbers})
    p = torch.stack([vector(0.0, 0.0, 2.0), vector(LENGTH, 0.0, 2.0)])
    return structure, theta, state(structure, p, axis=vector(0.0, 0.0, 1.0), rest=torch.tensor([REST]))


def test_tension_is_stiffness_times_stretch() -> None:
    """k x for a taut cable, nothing for a slack one, and the lengths as they are."""
    structure, theta, start = two_masses()
    reading = read(structure, theta, start)
    assert float(reading.length) == pytest.approx(LENGTH)
    assert float(reading.rest) == pytest.approx(REST)
    assert float(reading.tension) == pytest.approx(K * (LENGTH - REST), rel=1e-4)
    slack = replace(start, rest=torch.full_like(start.rest, 0.25))
    assert float(read(structure, theta, slack).tension) == 0


def test_tension_of_a_cubic_cable_and_its_sensor_tendon() -> None:
    """k x + k2 x^2 + k3 x^3, plus the sensor tendon from its own rest length on."""
    structure, theta, start = two_masses(
        stiffness2=torch.tensor([500.0]), stiffness3=torch.tensor([9000.0]), tendon_stiffness=40.0, tendon_rest=0.1
    )
    structure = replace(structure, tendons=True)
    x = LENGTH - REST
    expected = K * x + 500 * x**2 + 9000 * x**3 + 40 * (LENGTH - 0.1)
    assert float(read(structure, theta, start).tension) == pytest.approx(expected, rel=1e-6)


def test_damping_pulls_more_in_a_stretching_cable_and_never_pushes() -> None:
    """k x + c v while stretching; a cable shortening fast has tension 0, not less."""
    structure, theta, start = two_masses(damping=C)
    for speed, expected in ((0.5, K * 0.03 + C * 0.5), (-50.0, 0.0)):
        v = torch.stack([vector(0.0, 0.0, 0.0), vector(speed, 0.0, 0.0)])[None]
        tension = float(read(structure, theta, replace(start, v_WB=v), h=1e-7).tension)
        assert tension == pytest.approx(expected, rel=1e-3)


def test_a_lying_rod_presses_with_its_weight() -> None:
    """Half the weight on each cap, nothing sideways, gap 0; in the air nothing at all."""
    structure = free_rods()
    theta = parameters(structure)
    reading = read(structure, theta, lying(structure))
    expected = vector(0.0, 0.0, 0.5 * MASS * G).expand(1, 2, 3)
    torch.testing.assert_close(reading.ground, expected, rtol=0, atol=1e-6)
    torch.testing.assert_close(reading.gap, torch.zeros_like(reading.gap), rtol=0, atol=1e-15)
    high = state(structure, vector(0.0, 0.0, 1.0))
    assert not read(structure, theta, high).ground.any()
    assert float(read(structure, theta, high).gap[0, 0]) == pytest.approx(1.0 - RADIUS)


def test_friction_is_read_as_a_force_against_the_motion() -> None:
    """Each cap of a rod sliding along x is held back by mu times its load, with nothing across."""
    structure = free_rods()
    theta = parameters(structure, friction=0.25)
    reading = read(structure, theta, lying(structure, v=vector(1.0, 0.0, 0.0)))
    assert float(reading.ground[..., 2].min()) > 0
    torch.testing.assert_close(reading.ground[..., 0], -0.25 * reading.ground[..., 2], rtol=1e-9, atol=0)
    torch.testing.assert_close(reading.ground[..., 1], torch.zeros(1, 2, dtype=torch.float64), rtol=0, atol=1e-9)


def test_what_is_read_is_what_the_step_does() -> None:
    """Momentum of the robot after one step, less before, is h times weight plus the ground forces that were read."""
    robot = subject()
    u = torch.tensor([[1.0, 0.0, -1.0, 0.0, 1.0, 0.0]], dtype=torch.float64)
    start = roll(robot.structure, robot.theta, rested().state, 20, 1e-3, u=u)[-1]
    reading = read(robot.structure, robot.theta, start, 1e-3)
    after = step(robot.structure, robot.theta, start, u, torch.tensor([[1e-3]], dtype=torch.float64))
    gained = (momentum(robot.theta, after)[0] - momentum(robot.theta, start)[0]) / 1e-3
    weight = robot.theta.mass.sum() * robot.theta.gravity
    torch.testing.assert_close(gained, reading.ground.sum(1) + weight, rtol=0, atol=1e-9)


def test_cap_lengths_are_distances_of_cap_centres() -> None:
    """A 3-4-5 triangle, with any leading axes."""
    p_WE = torch.tensor([[0.0, 0, 0], [3, 0, 0], [0, 4, 0], [9, 9, 9]], dtype=torch.float64)
    pairs = ((0, 1), (0, 2), (1, 2))
    assert cap_lengths(pairs, p_WE).tolist() == [3.0, 4.0, 5.0]
    assert cap_lengths(pairs, p_WE.expand(2, 5, 4, 3)).shape == (2, 5, 3)


def test_energy_of_a_tumbling_rod() -> None:
    """m v^2 / 2 + (transverse w_x^2 + transverse w_y^2 + axial w_z^2) / 2 + m g z."""
    structure = free_rods()
    theta = parameters(structure)
    start = state(structure, vector(0.1, 0.2, 0.7), v=vector(1.0, -2.0, 0.5), w=vector(3.0, 1.0, 20.0))
    expected = 0.5 * MASS * 5.25 + 0.5 * (TRANSVERSE * 10.0 + AXIAL * 400.0) + MASS * G * 0.7
    assert float(energy(structure, theta, start)) == pytest.approx(expected, rel=1e-12)


def test_energy_of_a_stretched_cable() -> None:
    """k x^2 / 2 + k2 x^3 / 3 + k3 x^4 / 4 + tendon; its slope by the length is the tension."""
    structure, theta, start = two_masses(
        stiffness2=torch.tensor([500.0]), stiffness3=torch.tensor([9000.0]), tendon_stiffness=40.0, tendon_rest=0.1
    )
    structure, x = replace(structure, tendons=True), LENGTH - REST
    expected = K * x**2 / 2 + 500 * x**3 / 3 + 9000 * x**4 / 4 + 20 * (LENGTH - 0.1) ** 2
    assert float(energy(structure, theta, start)) == pytest.approx(expected, rel=1e-6)

    def at(dx: float) -> float:
        moved = start.p_WB.clone()
        moved[:, 1, 0] += dx
        return float(energy(structure, theta, replace(start, p_WB=moved)))

    slope = (at(1e-5) - at(-1e-5)) / 2e-5
    assert slope == pytest.approx(float(read(structure, theta, start).tension), rel=1e-6)


def test_momentum_of_a_moving_rod() -> None:
    """Linear m v; angular about the origin p x m v, plus the spin turned into the ground frame."""
    structure = free_rods()
    theta = parameters(structure)
    # The rod's axis along x of the ground frame: a spin about the axis is one about x.
    start = state(structure, vector(0.0, 0.0, 2.0), v=vector(0.0, 3.0, 0.0), w=vector(0.0, 0.0, 7.0))
    linear, angular = momentum(theta, start)
    torch.testing.assert_close(linear, MASS * vector(0.0, 3.0, 0.0)[None])
    torch.testing.assert_close(angular, vector(-2.0 * 3.0 * MASS + 7.0 * AXIAL, 0.0, 0.0)[None], rtol=0, atol=1e-12)


def test_longest_step_of_two_masses() -> None:
    """A spring k between two masses m has the eigenvalue 2 k / m: the step is 1.1 sqrt(m / 2 k)."""
    structure, theta, start = two_masses()
    assert longest_step(structure, theta, start) == pytest.approx(1.1 * math.sqrt(MASS / (2 * K)), rel=1e-9)


def test_longest_step_of_a_cable_beside_the_centre() -> None:
    """Tied at a distance a from the centre the cable also turns the rod: 1/m + a^2 / I instead of 1/m."""
    a = HALF / 2
    sites = torch.tensor([[[0.0, 0.0, a], [0.0, 0.0, 0.0]]], dtype=torch.float64)
    structure, theta, start = two_masses(p_BS=sites)
    start = replace(start, p_WB=start.p_WB + torch.stack([vector(0.0, 0.0, -a), vector(0.0, 0.0, 0.0)]))
    eigenvalue = K * (2 / MASS + a * a / TRANSVERSE)
    assert longest_step(structure, theta, start) == pytest.approx(1.1 / math.sqrt(eigenvalue), rel=1e-9)


def test_longest_step_reads_the_slope_of_a_cubic_cable() -> None:
    """The stiffness that counts is the tangent, k + 3 k3 x^2, and that of the sensor tendon."""
    structure, theta, start = two_masses(stiffness3=torch.tensor([9000.0]), tendon_stiffness=40.0)
    structure, x = replace(structure, tendons=True), LENGTH - REST
    k = K + 3 * 9000 * x**2 + 40
    assert longest_step(structure, theta, start) == pytest.approx(1.1 * math.sqrt(MASS / (2 * k)), rel=1e-6)


@pytest.mark.parametrize("field", ["stiffness", "rest", "mass", "inertia", "p_BS"])
def test_longest_step_of_many_robots_from_one_start(field: str) -> None:
    """A batch of robots that differ in one field and share a start: the shortest step of any of them."""
    structure, theta, start = threebar_engine()
    # Cubic cables, so that rest lengths count as well.
    structure, theta = replace(structure, cubic=True), replace(theta, stiffness3=torch.full_like(theta.stiffness, 1e5))
    start = replace(start, rest=start.rest - 0.01)
    factors = torch.tensor([1.0, 1.3, 0.8], dtype=torch.float64)
    number = getattr(theta, field)
    robots = [replace(theta, **{field: number * factor}) for factor in factors]
    many = replace(theta, **{field: torch.cat([getattr(one, field) for one in robots])})
    alone = [longest_step(structure, one, start) for one in robots]
    assert longest_step(structure, many, start) == pytest.approx(min(alone), rel=1e-9)
    assert min(alone) < max(alone)


def test_without_cables_any_step_will_do() -> None:
    """Free rods have no cables to be unstable."""
    structure = free_rods(2)
    start = state(structure, vector(0.0, 0.0, 1.0).expand(2, 3))
    assert longest_step(structure, parameters(structure), start) == math.inf


@pytest.mark.parametrize(("share", "stable"), [(0.55, True), (0.98, True), (1.02, False)])
def test_the_limit_is_where_an_explicit_spring_blows_up(share: float, stable: bool) -> None:
    """Symplectic Euler is stable below h = 2 / omega and grows without bound above; the longest step is 0.55 of that.

    The masses circle each other, so that the cable stays taut: m w^2 L / 2 = k x; near the limit they swing widely."""
    structure, theta, start = two_masses(rest_min=-1.0)
    limit = 2.0 * math.sqrt(MASS / (2 * K))
    assert longest_step(structure, theta, start) == pytest.approx(0.55 * limit, rel=1e-9)
    w = math.sqrt(2 * K * (LENGTH - REST) / (MASS * LENGTH))
    v = torch.stack([vector(0.0, -w * LENGTH / 2, 0.0), vector(0.0, w * LENGTH / 2, 0.0)])[None]
    spun = replace(start, v_WB=v)
    states = roll(structure, theta, spun, 120, share * limit)
    farthest = max(float((s.p_WB[:, 1] - s.p_WB[:, 0]).norm()) for s in states)
    assert (farthest < 10) if stable else (farthest > 1e6)
    assert share > 0.55 or farthest < 0.26


def test_the_step_that_is_always_stable_is_a_lower_bound() -> None:
    """In random poses of the robot no exact limit is below the one that holds in every pose, and that is not idle."""
    model = subject()
    always = always_stable_step(model.structure, model.theta)
    generator = torch.Generator().manual_seed(2)
    for _ in range(20):
        p_WE = model.p_WE + 0.05 * torch.randn(model.p_WE.shape, generator=generator, dtype=torch.float64)
        lying = pose_state(model.structure, model.theta, p_WE, frames(p_WE), rest=rested().state.rest)
        assert longest_step(model.structure, model.theta, lying) >= always
    assert always > 1e-3
