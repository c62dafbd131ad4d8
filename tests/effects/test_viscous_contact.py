"""Viscous drag of the contact against closed forms: sliding, the speed of a descent, and what it leaves alone."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.effects.viscous_contact import SLOW, ViscousContact
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

H, FRICTION = 1e-3, 0.2


def rod(drag: float) -> tuple[Structure, Parameters]:
    """One free rod on a floor of this drag."""
    return lone_rod(ViscousContact(), {"drag_s_per_m": drag}, friction=FRICTION)


def coefficients(v: Tensor, drag: Tensor) -> Tensor:
    """Friction of caps that slip so, v (n, 3), (n,)."""
    v = v.reshape(1, 1, -1, 3)
    terms = ContactTerms(torch.zeros_like(v), v, torch.zeros_like(v[..., 0]))
    return ViscousContact().contact({"drag_s_per_m": drag.reshape(1, 1)}, terms, FRICTION + terms.gap).flatten()


def test_the_curve() -> None:
    """The plain coefficient at rest, exactly, and drag times speed more in a slip; vertical speed does not count."""
    v = torch.tensor([[0, 0, 0], [0, 0, -3], [0.6, 0.8, 0], [-0.06, 0.08, 5]], dtype=torch.float64)
    found = coefficients(v, vector(1.5))
    assert found[:2].tolist() == [FRICTION, FRICTION]
    assert found[2:].numpy() == pytest.approx([FRICTION + 1.5, FRICTION + 0.15], rel=1e-4)


def test_the_curve_is_smooth() -> None:
    """Derivatives by velocity and drag are those of central differences, at rest (where there is no corner), at the
    bend and in a slip."""
    for v in (torch.zeros(1, 3).double(), vector(0.5 * SLOW, -SLOW, 0.1)[None], vector(0.3, 0.1, 0.0)[None]):
        inputs = (v.requires_grad_(), vector(1.4).requires_grad_())
        assert torch.autograd.gradcheck(coefficients, inputs, eps=1e-7, atol=1e-5)


def test_a_thrown_rod_slides_by_the_closed_form() -> None:
    """Thrown along itself it goes v / (c g) - mu / (c^2 g) ln(1 + c v / mu), and its speed falls by h g (mu + c v) a
    step."""
    drag, v0 = 1.5, 0.8
    structure, theta = rod(drag)
    h = 2e-4
    run = simulate(structure, theta, lying(structure, v=vector(v0, 0.0, 0.0).expand(1, 1, 3)), 900, h)
    speed = run.states.v_WB[0, :, 0, 0]
    assert abs(float(speed[-1])) < 1e-9
    fast = speed[:-1] > 0.1
    fall = h * G * (FRICTION + drag * speed[:-1])
    assert torch.allclose((speed[:-1] - speed[1:])[fast], fall[fast], rtol=1e-4, atol=0)
    stop = v0 / (drag * G) - FRICTION / (drag**2 * G) * math.log(1 + drag * v0 / FRICTION)
    assert stop < 0.5 * v0**2 / (2 * FRICTION * G)  # half of what it would be without
    assert float(run.at(-1).p_WB[0, 0, 0]) == pytest.approx(stop, rel=5e-3)


def test_on_a_slope_it_nears_the_speed_of_a_viscous_descent() -> None:
    """Let go on a slope beyond friction a rod nears (tan a - mu) / c from below and from above."""
    drag, angle = 2.0, 0.4
    structure, theta = rod(drag)
    theta = replace(theta, gravity=slope(angle)[None])
    end = (math.tan(angle) - FRICTION) / drag
    v = torch.stack([vector(0.0, 0.0, 0.0), vector(0.5, 0.0, 0.0)])[:, None]
    speed = simulate(structure, theta, lying(structure, batch=2, v=v), 900, H).states.v_WB[:, :, 0, 0]
    assert speed[:, -1].numpy() == pytest.approx([end, end], rel=1e-4)
    assert float(speed[0].max()) <= end * (1 + 1e-4)
    assert float(speed[1].min()) >= end * (1 - 1e-4)


def test_what_is_held_does_not_creep() -> None:
    """On a slope that friction holds, a rod stays where it is, as exactly as without drag."""
    structure, theta = rod(10.0)
    held = slope(math.atan(0.97 * FRICTION))[None]
    with_drag, without = (
        after(structure, replace(one, gravity=held), lying(structure), 300, H).p_WB for one in (theta, rod(0.0)[1])
    )
    assert torch.allclose(with_drag, without, rtol=0, atol=1e-12)
    assert float((with_drag - lying(structure).p_WB).abs().max()) < 1e-6


def test_drag_never_turns_a_slip_round() -> None:
    """At the largest drag and steps of 20 ms, which would send an explicit force back and forth, a rod that is thrown
    stops and does not come back."""
    structure, theta = rod(10.0)
    run = simulate(structure, theta, lying(structure, v=vector(1.0, 0.0, 0.0).expand(1, 1, 3)), 40, 0.02)
    assert 0.02 * 10.0 * G > 1.9  # the gain of such a force
    assert float(run.states.v_WB[0, :, 0, 0].min()) > -1e-6


def test_every_direction_alike() -> None:
    """Thrown along itself a rod goes as far in every direction of the room."""
    structure, theta = rod(1.5)
    ways = torch.tensor([0.0, 0.9, 2.5, -1.3], dtype=torch.float64)
    axis = torch.stack([torch.cos(ways), torch.sin(ways), torch.zeros_like(ways)], dim=-1)[:, None]
    start = state(structure, vector(0.0, 0.0, RADIUS).expand(4, 1, 3), q=pointing(axis), v=0.4 * axis)
    gone = after(structure, theta, start, 100, H).p_WB
    assert torch.allclose(gone[..., :2], gone[:1, :, :1] * axis[..., :2], rtol=0, atol=1e-9)


def test_sliding_only_loses_energy() -> None:
    """Lying rods thrown and turned every way lose energy in every step, and on the whole more of it than without."""
    structure, theta = rod(3.0)
    v = torch.randn(30, 1, 3, generator=torch.Generator().manual_seed(4), dtype=torch.float64) * vector(0.5, 0.5, 0.0)
    start = replace(lying(structure, batch=30, v=v), w_R=vector(2.0, 0.0, 0.0).expand(30, 1, 3))
    run = simulate(structure, theta, start, 60, H)
    kept = torch.stack([energy(structure, theta, run.at(k)) for k in range(61)])
    assert float(torch.diff(kept, dim=0).max()) < ROUNDING
    off = energy(structure, theta, after(structure, rod(0.0)[1], start, 60, H))
    assert float(kept[-1].sum() / off.sum()) < 0.99


def test_the_air_is_left_alone() -> None:
    """What touches nothing flies as without."""
    structure, theta = rod(10.0)
    start = state(structure, vector(0.0, 0.0, 2.0)[None], v=vector(0.5, 0.2, 0.0).expand(1, 1, 3))
    ends = [after(structure, one, start, 50, H) for one in (theta, rod(0.0)[1])]
    assert torch.equal(ends[0].p_WB, ends[1].p_WB)
