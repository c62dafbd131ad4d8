"""Impacts on the ground: how high a rod bounces, when it does not, and the derivative of a bounce."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import State
from r2s2r_cli.engine.reading import energy
from tests.support.engine import HALF, RADIUS, G, after, free_rods, lowest_gap, parameters, simulate, state, vector

ROD = free_rods(rod_contact=False)
DROPS = torch.linspace(0.25, 0.4, 7, dtype=torch.float64)
"""Heights [m] of a drop; several, so that impacts fall on different shares of a step."""


def dropped(heights: Tensor, axis: Tensor | None = None, reach: float = 0.0) -> State:
    """Rods at rest whose lowest points are `heights` above the ground; reach: of the lower cap below the centre [m]."""
    z = heights + RADIUS + reach
    return state(ROD, torch.stack([0 * z, 0 * z, z], -1)[:, None], axis=axis)


def apex_ratio(e: float, h: float, axis: Tensor, reach: float) -> Tensor:
    """Height of the first bounce over e^2 times the drop, for every drop of DROPS."""
    theta, start = parameters(ROD, restitution=e), dropped(DROPS, axis, reach)
    states = simulate(ROD, theta, start, round(0.295 * (1 + e) / h), h).states
    z, v = states.p_WB[:, :, 0, 2], states.v_WB[:, :, 0, 2]
    bounced = torch.cummax((v > 0).to(z.dtype), dim=1).values > 0
    assert bool(((v < 0) & bounced).any(1).all()), "every drop is followed past its apex"
    return torch.where(bounced, z - RADIUS - reach, torch.zeros_like(z)).amax(1) / (e * e * DROPS)


@pytest.mark.parametrize("e", [0.7, 0.9])
@pytest.mark.parametrize(("axis", "reach"), [((1.0, 0.0, 0.0), 0.0), ((0.0, 0.0, 1.0), HALF)], ids=["flat", "upright"])
def test_a_dropped_rod_bounces_to_e_squared_of_its_height(
    e: float, axis: tuple[float, float, float], reach: float
) -> None:
    """Both caps at once or one, drops of 0.25 to 0.4 m: within 0.01 % at 1 ms, and what is missing shrinks faster than
    the step (second order)."""
    errors = [float((apex_ratio(e, h, vector(*axis), reach) - 1).abs().max()) for h in (2e-3, 1e-3, 5e-4)]
    assert errors[1] < 1e-4
    assert errors[0] / errors[2] > 8.0


def test_without_restitution_a_rod_stays_down() -> None:
    """e = 0: a dropped rod, flat or upright, is at rest on the ground from its impact on, to rounding."""
    for axis, reach in ((vector(1.0, 0.0, 0.0), 0.0), (vector(0.0, 0.0, 1.0), HALF)):
        end = after(ROD, parameters(ROD), dropped(DROPS, axis, reach), 310, 1e-3)
        assert float(lowest_gap(parameters(ROD), end).abs().max()) < 1e-10
        assert float(end.v_WB.abs().max()) < 1e-9


def test_slow_impacts_do_not_bounce() -> None:
    """Below `impact_speed` no restitution, at twice that speed all of it, and no jump in between."""
    v = torch.linspace(-0.14, -0.01, 53, dtype=torch.float64)
    start = state(ROD, vector(0.0, 0.0, RADIUS).expand(len(v), 1, 3), v=torch.stack([0 * v, 0 * v, v], -1)[:, None])
    theta = parameters(ROD, restitution=0.5, gravity=vector(0.0, 0.0, 0.0))
    out = after(ROD, theta, start, 1, 1e-3).v_WB[:, 0, 2]
    share = torch.clamp(-v / 0.05 - 1.0, 0.0, 1.0)
    assert torch.allclose(out, -0.5 * share * v, rtol=1e-5, atol=1e-9)


def test_an_impact_off_centre() -> None:
    """A slanted rod without friction and gravity falls on one cap: the impulse (1 + e) v / W, W = 1/m + x^2/It with x
    the horizontal distance of cap and centre, gives its velocity and spin."""
    slant = math.pi / 5
    axis, e, v = vector(math.cos(slant), 0.0, math.sin(slant)), 0.6, -1.3
    theta = parameters(ROD, restitution=e, friction=0.0, gravity=vector(0.0, 0.0, 0.0))
    height = RADIUS + HALF * math.sin(slant)
    start = state(ROD, vector(0.0, 0.0, height).expand(1, 1, 3), axis=axis, v=vector(0.0, 0.0, v))
    end = after(ROD, theta, start, 1, 1e-3)
    x, mass, inertia = HALF * math.cos(slant), float(theta.mass), float(theta.inertia[0, 0, 0, 0])
    impulse = (1 + e) * -v / (1 / mass + x * x / inertia)
    assert torch.allclose(end.v_WB[0, 0], vector(0.0, 0.0, v + impulse / mass), rtol=0, atol=1e-6)
    assert float(torch.linalg.vector_norm(end.w_R)) == pytest.approx(impulse * x / inertia, rel=1e-6)
    assert float(energy(ROD, theta, end)) < float(energy(ROD, theta, start))


def flight(z0: Tensor, e: Tensor, h: float) -> Tensor:
    """Height of a flat rod 0.4 s after its drop from z0, one bounce on its way [m]."""
    start = state(ROD, torch.stack([0 * z0, 0 * z0, z0 + RADIUS], -1)[:, None])
    theta = replace(parameters(ROD), restitution=e[:, None])
    return after(ROD, theta, start, round(0.4 / h), h).p_WB[:, 0, 2] - RADIUS


def test_the_derivative_of_a_bounce_is_that_of_the_closed_form() -> None:
    """Height 0.4 s after a drop from 0.3 m at e = 0.8: dz/dz0 = +0.311 and dz/de = +0.370, sign and size within 2 %
    at 1 ms and 0.5 % at 0.25 ms, and equal to the central difference of the simulation itself."""
    e, z0, t = 0.8, 0.3, 0.4
    t1 = math.sqrt(2 * z0 / G)
    exact = ((e * (t - 2 * t1) + (t - t1)) / t1, G * t1 * (t - t1))
    assert exact == pytest.approx((0.3114, 0.3704), abs=1e-4)
    worst = {}
    for h in (1e-3, 2.5e-4):
        x = vector(z0).requires_grad_(), vector(e).requires_grad_()
        found = [float(g) for g in torch.autograd.grad(flight(*x, h).sum(), x)]
        worst[h] = max(abs(g / want - 1) for g, want in zip(found, exact, strict=True))
        shift = 1e-7 * vector(1.0, -1.0, 0.0, 0.0)
        z = flight(z0 + shift, e + shift.flip(0), h)
        assert found == pytest.approx([float(z[0] - z[1]) / 2e-7, float(z[3] - z[2]) / 2e-7], rel=1e-5)
    assert worst[1e-3] < 0.02
    assert worst[2.5e-4] < 0.005
