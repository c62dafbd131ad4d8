"""Friction on the ground: sliding and its distance, slopes below and above the angle of friction, rolling."""

from __future__ import annotations

import math

import pytest
import torch

from r2s2r_cli.engine import cap_velocities, middles
from tests.support.engine import (
    AXIAL,
    MASS,
    RADIUS,
    TRANSVERSE,
    G,
    after,
    free_rods,
    lying,
    parameters,
    roll,
    slope,
    state,
    track,
    vector,
)  # fmt: skip

ROD = free_rods(rod_contact=False)
H = 1e-3


def test_sliding_distance() -> None:
    """Pushed along its axis a rod slides v^2 / (2 mu g), for every mu and v, up to half a step's path."""
    v, mu = torch.meshgrid(vector(0.3, 0.6, 0.9), vector(0.3, 0.6, 1.0), indexing="ij")
    v, mu = v.flatten(), mu.flatten()
    start = lying(ROD, batch=len(v), v=torch.stack([v, 0 * v, 0 * v], -1)[:, None])
    end = after(ROD, parameters(ROD, friction=mu[:, None, None].expand(-1, 1, 2)), start, 320, H)
    assert float(end.v_WB.abs().max()) < 1e-7
    distance = v * v / (2 * mu * G)
    assert bool(((end.p_WB[:, 0, 0] - distance).abs() <= v * H / 2 + 1e-6).all())
    assert float(end.p_WB[:, 0, 1:].sub(vector(0.0, RADIUS)).abs().max()) < 1e-8


def test_the_derivative_of_a_sliding_distance() -> None:
    """dd/dv = v / (mu g) and dd/dmu = -v^2 / (2 mu^2 g), within the step's share of the slide."""
    v, mu = (torch.tensor([x], dtype=torch.float64, requires_grad=True) for x in (0.6, 0.6))
    start = lying(ROD, v=torch.stack([v, 0 * v, 0 * v], -1)[:, None])
    end = after(ROD, parameters(ROD, friction=mu[:, None, None].expand(1, 1, 2)), start, 110, H)
    found = torch.autograd.grad(end.p_WB[0, 0, 0], (v, mu))
    # The slide lasts 102 steps, and the last of them is cut.
    assert float(found[0]) == pytest.approx(0.6 / (0.6 * G), rel=0.01)
    assert float(found[1]) == pytest.approx(-(0.6**2) / (2 * 0.6**2 * G), rel=0.02)


def test_slope_below_and_above_the_angle_of_friction() -> None:
    """A rod along the fall line rests at 0.98 atan(mu) and slides at 1.02 atan(mu), with g (sin a - mu cos a)."""
    mu = vector(0.3, 0.6, 1.0).repeat(2)
    angle = torch.atan(mu) * vector(*[0.98] * 3, *[1.02] * 3)
    theta = parameters(ROD, friction=mu[:, None, None].expand(-1, 1, 2), gravity=slope(angle))
    end = after(ROD, theta, lying(ROD, batch=6), 300, H)
    assert float(end.p_WB[:3, 0, 0].abs().max()) < 1e-6
    assert float(end.v_WB[:3].abs().max()) < 1e-6
    along = G * (torch.sin(angle) - mu * torch.cos(angle))[3:]
    assert torch.allclose(end.v_WB[3:, 0, 0], 0.3 * along, rtol=0.01, atol=0)


def test_acceleration_on_a_steep_slope() -> None:
    """40 degrees, mu 0.6: the acceleration is g (sin a - mu cos a) within 0.1 %, straight down the slope; the rod does
    not rise or sink by more than two sweeps leave, 1 mm/s."""
    a = math.radians(40)
    end = after(ROD, parameters(ROD, friction=0.6, gravity=slope(a)), lying(ROD), 300, H)
    assert float(end.v_WB[0, 0, 0]) / 0.3 == pytest.approx(G * (math.sin(a) - 0.6 * math.cos(a)), rel=1e-3)
    assert abs(float(end.v_WB[0, 0, 1])) < 1e-9
    assert abs(float(end.v_WB[0, 0, 2])) < 1e-3


def test_slides_along_any_direction_of_the_plane() -> None:
    """The axes x and y of the plane mean nothing: a slope turned by any angle gives the turned slide."""
    yaw = torch.linspace(0.0, 2.5, 6, dtype=torch.float64)
    down = torch.stack([torch.cos(yaw), torch.sin(yaw), 0 * yaw], -1)
    gravity = 5.0 * down + vector(0.0, 0.0, -8.0)
    theta = parameters(ROD, friction=0.4, gravity=gravity)
    v = after(ROD, theta, lying(ROD, batch=6, axis=down[:, None]), 100, H).v_WB[:, 0]
    speed = (v[:, :2] * down[:, :2]).sum(1)
    assert torch.allclose(v[:, :2], speed[0] * down[:, :2], rtol=0, atol=1e-9)
    assert float(speed[0]) == pytest.approx(0.1 * (5.0 - 0.4 * 8.0), rel=0.01)


def test_a_rod_rolls_down_a_slope() -> None:
    """Across the fall line a rod rolls with g sin a / (1 + Ia / (m r^2)), its ground points at rest."""
    a = math.radians(15)
    theta = parameters(ROD, gravity=slope(a))
    end = after(ROD, theta, lying(ROD, axis=vector(0.0, 1.0, 0.0)), 300, H)
    speed = 0.3 * G * math.sin(a) / (1 + AXIAL / (MASS * RADIUS**2))
    assert float(end.v_WB[0, 0, 0]) == pytest.approx(speed, rel=1e-3)
    assert float(end.w_R[0, 0, 2].abs()) * RADIUS == pytest.approx(speed, rel=1e-3)


def test_an_oblique_rod_rolls_across_its_axis_only() -> None:
    """Turned by 50 degrees from the fall line, a rod rolls exactly across its axis: along it friction holds."""
    a, turn = math.radians(12), math.radians(50)
    axis, across = vector(math.cos(turn), math.sin(turn), 0.0), vector(math.sin(turn), -math.cos(turn), 0.0)
    end = after(ROD, parameters(ROD, gravity=slope(a)), lying(ROD, axis=axis), 300, H)
    speed = 0.3 * G * math.sin(a) * math.sin(turn) / (1 + AXIAL / (MASS * RADIUS**2))
    assert float(end.v_WB[0, 0] @ across) == pytest.approx(speed, rel=1e-3)
    assert abs(float(end.p_WB[0, 0] @ axis)) < 1e-6


def test_a_skidding_rod_comes_to_roll() -> None:
    """Pushed sideways, a rod skids until v = w r: from there on it rolls with v0 / (1 + Ia / (m r^2)), for every
    friction."""
    mu = vector(0.2, 0.5, 1.0)
    theta = parameters(ROD, friction=mu[:, None, None].expand(-1, 1, 2))
    start = lying(ROD, batch=3, axis=vector(0.0, 1.0, 0.0), v=vector(0.5, 0.0, 0.0))
    end = after(ROD, theta, start, 200, H)
    final = 0.5 / (1 + AXIAL / (MASS * RADIUS**2))
    assert torch.allclose(end.v_WB[:, 0, 0], torch.full((3,), final, dtype=torch.float64), rtol=1e-3, atol=0)


def test_a_spinning_rod_is_braked_by_friction() -> None:
    """A rod that lies on its caps and spins about the vertical slows down by mu m g l / It (l: half length): the cap
    spheres slide at the distance l."""
    rate, mu, n = 6.0, 0.4, 40
    start = state(ROD, vector(0.0, 0.0, RADIUS).expand(1, 1, 3), w=vector(-rate, 0.0, 0.0))
    theta = parameters(ROD, friction=mu)
    states = roll(ROD, theta, start, n, 5e-4)
    spin = torch.linalg.vector_norm(track(states, "w_R")[0, :, 0, :2], dim=-1)
    brake = mu * MASS * G * 0.16 / TRANSVERSE
    assert float(spin[-1]) == pytest.approx(rate - brake * n * 5e-4, rel=2e-3)
    assert float(torch.linalg.vector_norm(middles(theta, states[-1])[1])) < 1e-6


def test_friction_is_never_more_than_coulomb_allows() -> None:
    """No rod in any contact gets more tangential than mu times normal impulse, and none gains speed by it: 2,000 random
    single steps of a rod that touches the ground with one cap or both."""
    generator = torch.Generator().manual_seed(3)

    def random(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    n = 2000
    rise = torch.where(torch.arange(n) % 2 == 0, random(n).abs(), torch.zeros(n, dtype=torch.float64))
    axis = torch.nn.functional.normalize(torch.cat([random(n, 2), rise[:, None]], dim=1), dim=1)
    height = RADIUS + 0.16 * axis[:, 2]
    start = state(
        ROD,
        torch.stack([0 * height, 0 * height, height], -1)[:, None],
        axis=axis[:, None],
        v=random(n, 1, 3),
        w=3 * random(n, 1, 3),
    )
    mu = 0.3 + 0.7 * torch.rand(n, generator=generator, dtype=torch.float64)
    theta = parameters(ROD, friction=mu[:, None, None].expand(-1, 1, 2), gravity=vector(0.0, 0.0, 0.0))
    end = after(ROD, theta, start, 1, H)
    push = MASS * (end.v_WB - start.v_WB)[:, 0]
    assert bool((push[:, 2] >= -1e-15).all())
    assert bool((torch.linalg.vector_norm(push[:, :2], dim=1) <= mu * push[:, 2] * (1 + 1e-9) + 1e-15).all())
    kinetic = [
        (MASS * s.v_WB**2).sum((1, 2)) + (vector(TRANSVERSE, TRANSVERSE, AXIAL) * s.w_R**2).sum((1, 2))
        for s in (start, end)
    ]
    assert float((kinetic[1] / kinetic[0]).max()) < 1 + 1e-3
    assert float(cap_velocities(theta, end)[..., 2].amin()) > -10.0
