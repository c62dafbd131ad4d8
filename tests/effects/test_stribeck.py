"""Static and kinetic friction against closed forms: let-go, sliding distance, and both on one slope."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.effects.stribeck import Stribeck
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


def rod(static: float, speed: float) -> tuple[Structure, Parameters]:
    """One free rod that holds with `static` times its kinetic friction."""
    return lone_rod(Stribeck(), {"static_factor": static, "speed_m_per_s": speed}, friction=FRICTION)


def coefficients(v: Tensor, static: Tensor, speed: Tensor) -> Tensor:
    """Factor on the friction of caps that slip so, v (n, 3), (n,)."""
    v = v.reshape(1, 1, -1, 3)
    terms = ContactTerms(torch.zeros_like(v), v, torch.zeros_like(v[..., 0]))
    x = {"static_factor": static.reshape(1, 1), "speed_m_per_s": speed.reshape(1, 1)}
    return Stribeck().contact(x, terms, torch.ones_like(terms.gap)).flatten()


def test_the_curve() -> None:
    """The static factor at rest, 1/e of its excess at the speed, nothing of it in a fast slip; vertical speed and the
    direction do not count, and no speed of a fall makes a number that is none."""
    v = torch.tensor(
        [[0, 0, 0], [0.02, 0, 0], [-0.012, 0.016, 3], [0, 0.2, 0], [0, 0, -2], [40, 0, 0]], dtype=torch.float64
    )
    e = math.exp(-1)
    expected = vector(1.5, 1 + 0.5 * e, 1 + 0.5 * e, 1.0, 1.5, 1.0)
    assert torch.allclose(coefficients(v, vector(1.5), vector(0.02)), expected, rtol=1e-12, atol=0)


def test_the_curve_is_smooth() -> None:
    """Derivatives by velocity, factor and speed are those of central differences, at rest (where there is no corner),
    on the way down and in a slip."""
    for v in (torch.zeros(1, 3).double(), vector(0.01, -0.02, 0.1)[None], vector(0.3, 0.1, 0.0)[None]):
        inputs = (v.requires_grad_(), vector(1.4).requires_grad_(), vector(0.02).requires_grad_())
        assert torch.autograd.gradcheck(coefficients, inputs, eps=1e-7, atol=1e-5)


def test_a_thrown_rod_stops_short_by_what_is_left_of_the_static_friction() -> None:
    """Thrown along itself it goes s^2 / (2 mu g) ln((e^(v^2/s^2) + k) / (1 + k)), k the excess at rest, s the speed:
    the integral of v dv over its friction."""
    speed, k, v0 = 0.2, 0.6, 0.3
    structure, theta = rod(1 + k, speed)
    h = 1e-4
    gone = after(structure, theta, lying(structure, v=vector(v0, 0.0, 0.0).expand(1, 1, 3)), 800, h)
    assert abs(float(gone.v_WB[0, 0, 0])) < 1e-9
    stop = speed**2 / (2 * FRICTION * G) * math.log((math.exp((v0 / speed) ** 2) + k) / (1 + k))
    assert stop < 0.85 * v0**2 / (2 * FRICTION * G)  # what it would be without
    assert float(gone.p_WB[0, 0, 0]) == pytest.approx(stop, abs=h * v0)


@pytest.mark.parametrize("share", [1.3, 1.49, 1.53])
def test_one_slope_holds_and_lets_slide(share: float) -> None:
    """Between both coefficients a rod at rest holds, without creeping, and one that slides goes on with the kinetic
    one; beyond the static one nothing holds."""
    structure, theta = rod(1.5, 0.02)
    angle = math.atan(share * FRICTION)
    theta = replace(theta, gravity=slope(angle)[None])
    at_rest = simulate(structure, theta, lying(structure), 300, H).states.v_WB[0, :, 0, 0]
    if share < 1.5:
        assert float(at_rest.abs().max()) < 1e-6
    else:
        assert float(at_rest[-1]) > 0.05
    pushed = after(structure, theta, lying(structure, v=vector(0.1, 0.0, 0.0).expand(1, 1, 3)), 300, H)
    gain = 0.3 * G * (math.sin(angle) - FRICTION * math.cos(angle))
    assert float(pushed.v_WB[0, 0, 0]) == pytest.approx(0.1 + gain, rel=1e-4)


def test_every_direction_alike() -> None:
    """Thrown along itself a rod goes as far in every direction of the room."""
    structure, theta = rod(1.5, 0.1)
    ways = torch.tensor([0.0, 0.9, 2.5, -1.3], dtype=torch.float64)
    axis = torch.stack([torch.cos(ways), torch.sin(ways), torch.zeros_like(ways)], dim=-1)[:, None]
    start = state(structure, vector(0.0, 0.0, RADIUS).expand(4, 1, 3), q=pointing(axis), v=0.2 * axis)
    gone = after(structure, theta, start, 60, H).p_WB
    assert torch.allclose(gone[..., :2], gone[:1, :, :1] * axis[..., :2], rtol=0, atol=1e-9)


def test_sliding_only_loses_energy() -> None:
    """Lying rods thrown and turned every way lose energy in every step, and on the whole more of it than without."""
    structure, theta = rod(1.6, 0.2)
    v = torch.randn(30, 1, 3, generator=torch.Generator().manual_seed(4), dtype=torch.float64) * vector(0.3, 0.3, 0.0)
    start = replace(lying(structure, batch=30, v=v), w_R=vector(2.0, 0.0, 0.0).expand(30, 1, 3))
    run = simulate(structure, theta, start, 40, H)
    kept = torch.stack([energy(structure, theta, run.at(k)) for k in range(41)])
    assert float(torch.diff(kept, dim=0).max()) < ROUNDING
    off = energy(structure, theta, after(structure, rod(1.0, 0.2)[1], start, 40, H))
    assert float(kept[-1].sum() / off.sum()) < 0.998
