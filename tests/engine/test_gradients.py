"""Gradients of rollouts against central differences, in every phase of contact where the derivative exists.

Every number of start and robot is differentiated: the adjoint of a random combination of the end state against the
central difference of the same simulation, in float64. A phase is entered off its kinks: a cap that is to stick or slide
starts a little above the ground and lands first, since at gap 0 exactly there are two one-sided derivatives.
"""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import Parameters, State, Structure, pack_parameters, pack_state
from r2s2r_cli.engine.reading import read
from tests.support.engine import (
    HALF,
    MASS,
    RADIUS,
    parameters,
    random_gait,
    shaken,
    simulator,
    slope,
    state,
    threebar_engine,
    vector,
)  # fmt: skip

H = 1e-3
EPSILON = 1e-6
TOLERANCE = 1e-5
"""Of difference quotients with the relative step EPSILON: one-sided ones are off by its product with a curvature."""
LEASHED = Structure(n_rods=2, cable_rods=((0, 1),), actuated=(), rod_contact=False)
"""Rod 0 and, by a cable, rod 1 far away."""
HUNG = Structure(n_rods=2, cable_rods=((0, 1), (0, 1)), actuated=(0, 1), rod_contact=False)
"""Rod 0, heavy and high on large caps, and rod 1 that its winches can lift."""


def discrepancy(structure: Structure, theta: Parameters, start: State, steps: int, u: Tensor | None = None) -> float:
    """Largest difference of adjoint and difference quotient over all numbers, each times its own size, relative to the
    largest such product.

    A cap in lasting contact is at gap 0 but for rounding, where left and right derivatives differ by a little: a number
    counts as right if one of the quotients (central, to the right, to the left) is met, and at most one number in ten
    may need another than the central one. The forward sensitivity along a random direction must equal the adjoint's.
    """
    sim = simulator(structure)
    u = torch.zeros(1, 1, structure.n_actuated, dtype=torch.float64) if u is None else u[None, None]
    s, p = pack_state(structure, start), pack_parameters(structure, theta)
    weights = torch.randn(s.shape[1], generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    size = torch.where(p.abs() > 0, p.abs(), torch.full_like(p, 0.01))
    size = torch.cat([torch.full_like(s, 0.1), size], dim=1)[0]

    def value(s: Tensor, p: Tensor) -> Tensor:
        return sim.advance(s, u.expand(len(s), -1, -1), p, h=H, hold=steps, every=steps)[:, -1] @ weights

    x = (s.clone().requires_grad_(), p.clone().requires_grad_())
    adjoint = torch.cat(torch.autograd.grad(value(*x).sum(), x), dim=1)[0]
    direction = size * torch.randn(size.shape, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    ds, dp = direction[:, None].split([s.shape[1], p.shape[1]])
    tangents = sim.kernels.jvp(s, u, p, h=H, hold=steps, every=steps, ds0=ds[None], dp=dp[None])[1]
    assert float(tangents[0, -1, :, 0] @ weights) == pytest.approx(float(adjoint @ direction), rel=1e-9, abs=1e-12)

    offsets = torch.diag(EPSILON * size)
    around = torch.cat([s, p], dim=1) + torch.cat([offsets, -offsets, torch.zeros_like(offsets[:1])])
    right, left, here = value(*around.split([s.shape[1], p.shape[1]], dim=1)).split([len(size), len(size), 1])
    quotients = torch.stack([(right - left) / 2, right - here, here - left]) / EPSILON
    largest = float((adjoint * size).abs().max())
    assert largest > 1e-3, "something depends on something"
    errors = (quotients - adjoint * size).abs() / largest
    assert float((errors[0] < TOLERANCE).to(torch.float64).mean()) >= 0.9
    return float(errors.amin(0).max())


def leashed(p: Tensor, *, cable: float = 100.0, **how: Tensor) -> tuple[State, float]:
    """Rod 0 at p, rod 1 five metres off in the air; the rest length of the cable [m]."""
    far = vector(5.0, 0.0, 3.0)
    named = {key: torch.stack([value, torch.zeros_like(value)]) for key, value in how.items() if key != "axis"}
    axis = torch.stack([how.get("axis", vector(1.0, 0.0, 0.0)), vector(0.0, 1.0, 0.0)])
    return state(LEASHED, torch.stack([p, far]), axis=axis, **named), cable


def test_free_flight() -> None:
    """Two rods that tumble in the air on a taut, damped cable at odd points."""
    theta = parameters(LEASHED, p_BS=torch.tensor([[[0.01, 0.02, 0.1], [0.0, -0.01, -0.12]]], dtype=torch.float64))
    start = state(
        LEASHED,
        torch.stack([vector(0.0, 0.0, 2.0), vector(0.3, 0.1, 2.1)]),
        v=vector(0.1, 0.2, 0.3),
        w=vector(3.0, 2.0, 5.0),
    )
    assert float(read(LEASHED, theta, start).tension[0, 0]) > 1.0
    assert discrepancy(LEASHED, theta, start, 30) < 1e-7


@pytest.mark.parametrize("e", [0.0, 0.6])
def test_impact(e: float) -> None:
    """A slanted, spinning rod with friction hits the ground with one cap in the middle of a step, and flies on."""
    slant = vector(1.0, 0.3, 0.7)
    reach = HALF * 0.7 / float(torch.linalg.vector_norm(slant))
    start, cable = leashed(
        vector(0.0, 0.0, RADIUS + reach + 0.01), axis=slant, v=vector(0.3, 0.1, -1.0), w=vector(1.0, -0.5, 2.0)
    )
    theta = parameters(LEASHED, rest=cable, restitution=e, friction=0.5)
    before, after = (
        simulator(LEASHED).rollout(theta, start, torch.zeros(1, n, 0, dtype=torch.float64)).at(-1) for n in (8, 12)
    )
    assert float(after.v_WB[0, 0, 2] - before.v_WB[0, 0, 2]) > 0.2
    assert discrepancy(LEASHED, theta, start, 15) < TOLERANCE


def test_stick() -> None:
    """A rod lands on a slope of 15 degrees and sticks: it is at rest, and its friction coefficient has no influence."""
    theta = parameters(LEASHED, rest=100.0, gravity=slope(math.radians(15)))
    start, _ = leashed(vector(0.0, 0.0, RADIUS + 2e-5), v=vector(0.01, 0.0, -0.02))
    end = simulator(LEASHED).rollout(theta, start, torch.zeros(1, 20, 0, dtype=torch.float64)).at(-1)
    assert float(end.v_WB[0, 0].abs().max()) < 1e-6
    assert discrepancy(LEASHED, theta, start, 20) < TOLERANCE


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (1.0, 0.4, 0.0), (1.0, 0.4, 0.5)])
def test_slip(axis: tuple[float, float, float]) -> None:
    """A rod lands and slides, on both caps along and across itself, or on one cap while the other comes down."""
    direction = vector(*axis)
    reach = HALF * axis[2] / float(torch.linalg.vector_norm(direction))
    start, cable = leashed(vector(0.0, 0.0, RADIUS + reach + 3e-5), axis=direction, v=vector(0.7, 0.2, -0.03))
    theta = parameters(LEASHED, rest=cable, friction=0.4)
    end = simulator(LEASHED).rollout(theta, start, torch.zeros(1, 25, 0, dtype=torch.float64)).at(-1)
    assert 0.3 < float(end.v_WB[0, 0, 0]) < 0.69
    assert discrepancy(LEASHED, theta, start, 25) < TOLERANCE


def test_lift_off() -> None:
    """Winches pull a rod off the ground, one cap first: both stand at the start and fly at the end."""
    rod = parameters(HUNG)
    theta = parameters(
        HUNG, mass=vector(1e6, MASS), inertia=torch.stack([4e6 * torch.eye(3, dtype=torch.float64), rod.inertia[0, 0]]),
        p_BE=torch.stack([12.5 * rod.p_BE[0, 0], rod.p_BE[0, 0]]),
        cap_radius=torch.tensor([[2.0] * 2, [RADIUS] * 2], dtype=torch.float64),
        p_BS=torch.tensor([[[0.0, 0.0, -0.1], [0.0, 0.0, -0.095]], [[0.0, 0.0, 0.1], [0.0, 0.005, 0.105]]]).double(),
        speed_in=vector(0.06, 0.05), rest_max=5.0,
    )  # fmt: skip
    p, rest = torch.stack([vector(0.0, 0.0, 2.0 + 5e-6), vector(0.001, 0.0, RADIUS + 2e-5)]), 2.0 - RADIUS
    start = state(
        HUNG, p, v=-0.02 * torch.stack([vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 1.0)]), rest=vector(rest, rest)
    )
    u = vector(1.0, 1.0)
    run = simulator(HUNG).rollout(theta, start, u[None, None], hold=25, substeps=1)
    first, last = (read(HUNG, theta, run.at(k)).ground[0, 2:, 2] for k in (4, 25))
    assert float(first.min()) > 0.01
    assert float(last.max()) == 0.0
    assert float(read(HUNG, theta, run.at(25)).gap[0, 2:].min()) > 1e-4
    assert discrepancy(HUNG, theta, start, 25, u) < TOLERANCE


def test_robot_on_the_ground() -> None:
    """The three-bar robot, thrown a little, lands, sticks, slips and lifts under its winches for 60 ms: every
    derivative is right in 7 of 8 random windows; one may hold a switch within the reach of the differences."""
    structure, theta, rest = threebar_engine()
    starts = shaken(rest, 8, seed=9, position=0.001, angle=0.01, speed=0.1, spin=0.3)
    u = random_gait(1, 6, batch=8, seed=10)[:, 0]
    found = [discrepancy(structure, theta, starts.select(k), 60, u[k]) for k in range(8)]
    assert sorted(found)[-2] < TOLERANCE


def test_torch_and_machine_code_give_one_gradient() -> None:
    """Autograd through the torch step and the compiled adjoint agree on a gait's first 20 steps to 1e-9."""
    structure, theta, rest = threebar_engine()
    start = shaken(rest, 2, seed=11, position=0.001, angle=0.01, speed=0.1, spin=0.3)
    u = random_gait(1, 6, batch=2, seed=12)
    grads = []
    for native in (True, False):
        stiffness = theta.stiffness.clone().requires_grad_()
        friction = theta.friction.clone().requires_grad_()
        numbers = replace(theta, stiffness=stiffness, friction=friction)
        sim = simulator(structure) if native else type(simulator(structure))(structure, native=False)
        end = sim.rollout(numbers, start, u, hold=20, every=20, substeps=1).states
        grads.append(torch.autograd.grad(end.p_WB[:, -1].sum() + end.w_R[:, -1].sum(), (stiffness, friction)))
    for one, other in zip(*grads, strict=True):
        assert torch.allclose(one, other, rtol=1e-9, atol=1e-12)
