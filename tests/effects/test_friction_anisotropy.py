"""The ellipse of friction against closed forms: its radii, sliding distances, symmetry, and what holds and creeps."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import roma
import torch
from torch import Tensor

from r2s2r_cli.effects.friction_anisotropy import CREEP, FrictionAnisotropy
from r2s2r_cli.engine import Parameters, Structure, energy
from r2s2r_cli.engine.hooks import ContactTerms
from tests.support.engine import (
    RADIUS,
    G,
    after,
    lying,
    pointing,
    simulate,
    slope,
    state,
    vector,
)
from tests.support.lone_rod import ROUNDING, lone_rod

H, FRICTION = 1e-3, 0.4


def rod(ratio: float, angle: float) -> tuple[Structure, Parameters]:
    """One free rod on a floor with this grain."""
    return lone_rod(FrictionAnisotropy(), {"ratio": ratio, "angle_rad": angle}, friction=FRICTION)


def heading(angle: Tensor) -> Tensor:
    """Horizontal unit vectors (..., 3)."""
    return torch.stack([torch.cos(angle), torch.sin(angle), torch.zeros_like(angle)], dim=-1)


def coefficients(v: Tensor, ratio: Tensor, angle: Tensor) -> Tensor:
    """Factor on the friction of caps that slip so, v (n, 3), (n,)."""
    v = v.reshape(1, 1, -1, 3)
    terms = ContactTerms(torch.zeros_like(v), v, torch.zeros_like(v[..., 0]))
    x = {"ratio": ratio.reshape(1, 1), "angle_rad": angle.reshape(1, 1)}
    return FrictionAnisotropy().contact(x, terms, torch.ones_like(terms.gap)).flatten()


def test_the_radii_are_those_of_an_ellipse() -> None:
    """Drawn over the direction of a fast slip the coefficient is an ellipse with axes in the ratio, at the angle, and
    of the area of the circle."""
    ratio, angle = vector(1.7), vector(0.5)
    ways = torch.linspace(0.0, 2 * math.pi, 401, dtype=torch.float64)[:-1]
    radius = coefficients(50.0 * heading(ways), ratio, angle)
    x, y = radius * torch.cos(ways - 0.5), radius * torch.sin(ways - 0.5)
    assert torch.allclose(x * x / 1.7 + y * y * 1.7, torch.ones_like(x), rtol=0, atol=1e-8)
    axes = coefficients(50.0 * heading(vector(0.5, 0.5 + math.pi / 2)), ratio, angle)
    assert float(axes[0] / axes[1]) == pytest.approx(1.7, rel=1e-8)
    assert float((0.5 * radius**2).mean() * 2 * math.pi) == pytest.approx(math.pi, rel=1e-8)


def test_a_grain_has_no_sign_and_two_names() -> None:
    """Slip to and fro meets the same friction; 1 / ratio a quarter turn on is the same floor."""
    v = torch.randn(20, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    found = coefficients(v, vector(1.4), vector(0.3))
    assert torch.allclose(found, coefficients(-v, vector(1.4), vector(0.3)), rtol=1e-14, atol=0)
    assert torch.allclose(found, coefficients(v, vector(1 / 1.4), vector(0.3 - math.pi / 2)), rtol=1e-12, atol=0)


def test_rest_is_the_mean_and_smooth() -> None:
    """At rest the coefficient is the plain one, whatever the grain; derivatives by velocity, ratio and angle are those
    of central differences at rest, at a creep and at a slip."""
    assert float(coefficients(torch.zeros(1, 3).double(), vector(2.0), vector(0.4))) == 1.0
    rest = torch.zeros(1, 3, dtype=torch.float64)
    for v in (rest, vector(1e-3, -5e-4, 0.1)[None], vector(0.2, 0.1, 0.0)[None]):
        inputs = (v.requires_grad_(), vector(1.5).requires_grad_(), vector(0.4).requires_grad_())
        assert torch.autograd.gradcheck(coefficients, inputs, eps=1e-7, atol=1e-5)


def test_a_thrown_rod_slides_as_far_as_the_grain_lets_it() -> None:
    """Thrown along itself it goes v^2 / (2 mu g) straight on, with the ellipse's mu in its direction."""
    structure, theta = rod(2.0, 0.4)
    ways = torch.tensor([0.4, 0.4 + math.pi / 4, 0.4 + math.pi / 2, 3.0], dtype=torch.float64)
    axis = heading(ways)[:, None]
    start = state(structure, vector(0.0, 0.0, RADIUS).expand(4, 1, 3), q=pointing(axis), v=0.8 * axis)
    gone = after(structure, theta, start, 3300, 1e-4)
    assert float(gone.v_WB.abs().max()) < 1e-9
    mu = FRICTION / torch.sqrt(torch.cos(ways - 0.4) ** 2 / 2 + 2 * torch.sin(ways - 0.4) ** 2)
    stop = 0.5 * 0.8**2 / (mu * G)
    way = gone.p_WB[:, 0, :2]
    assert torch.allclose((way * heading(ways)[:, :2]).sum(-1), stop, rtol=1e-3, atol=0)
    assert float((way[:, 0] * torch.sin(ways) - way[:, 1] * torch.cos(ways)).abs().max()) < 1e-9


def test_turned_about_the_vertical_all_turns_with_it() -> None:
    """Rod, motion and grain turned together give the same motion, turned; the rod alone turned does not."""
    structure, theta = rod(1.8, 0.2)
    _, theirs = rod(1.8, 0.2 + 0.7)
    turn = vector(0.0, 0.0, math.sin(0.35), math.cos(0.35))
    spin = vector(1.0, 0.0, 0.5).expand(1, 1, 3)
    here = replace(lying(structure, v=vector(0.5, 0.3, 0.0).expand(1, 1, 3)), w_R=spin)
    R = roma.unitquat_to_rotmat(turn)
    there = replace(here, q_WR=roma.quat_product(turn.expand(1, 1, 4), here.q_WR), v_WB=here.v_WB @ R.T)
    ends = [after(structure, one, start, 60, H) for one, start in ((theta, here), (theirs, there), (theta, there))]
    assert torch.allclose(ends[1].p_WB, ends[0].p_WB @ R.T, rtol=0, atol=1e-10)
    assert float((ends[2].p_WB - ends[0].p_WB @ R.T).abs().max()) > 1e-4


def test_sliding_only_loses_energy() -> None:
    """Lying rods thrown and turned every way lose energy in every step until they stand."""
    structure, theta = rod(2.0, 0.3)
    generator = torch.Generator().manual_seed(4)
    v = torch.randn(30, 1, 3, generator=generator, dtype=torch.float64) * vector(0.5, 0.5, 0.0)
    start = replace(lying(structure, batch=30, v=v), w_R=vector(2.0, 0.0, 0.0).expand(30, 1, 3))
    run = simulate(structure, theta, start, 150, H)
    kept = torch.stack([energy(structure, theta, run.at(k)) for k in range(151)])
    assert float(torch.diff(kept, dim=0).max()) < ROUNDING
    assert float((kept[-1] / kept[0]).max()) < 0.99


@pytest.mark.parametrize(("share", "ratio"), [(0.95, 1.5), (1.1, 1.5), (0.95, 1 / 1.5), (1.05, 1 / 1.5)])
def test_what_holds_what_creeps_and_what_lets_go(share: float, ratio: float) -> None:
    """On a slope along the axis of the grain a rod holds up to the plain coefficient. Pushed by more, it creeps where
    the grain grips more than that, with the speed at which its friction is the push, and else it goes."""
    structure, theta = rod(ratio, 0.0)
    theta = replace(theta, gravity=slope(math.atan(share * FRICTION))[None])
    speed = simulate(structure, theta, lying(structure), 400, H).states.v_WB[0, :, 0, 0]
    if share < 1:
        assert float(speed.abs().max()) < 1e-6
    elif ratio > 1:
        # (1 + (1 / ratio - 1) s)^(-1/2) = share, with s = v^2 / (v^2 + CREEP^2)
        s = (1 - share**-2) / (1 - 1 / ratio)
        assert float(speed[-1]) == pytest.approx(CREEP * math.sqrt(s / (1 - s)), rel=1e-3)
    else:
        assert float(speed[-1]) > 0.2
