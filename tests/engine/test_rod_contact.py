"""Two rods that collide: momentum, restitution, friction between them, and no passing through."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import Parameters, State, end_caps
from r2s2r_cli.engine.reading import energy, momentum
from tests.support.engine import (
    HALF,
    MASS,
    RADIUS,
    TRANSVERSE,
    after,
    free_rods,
    parameters,
    roll,
    simulate,
    state,
    track,
    vector,
)

PAIR = free_rods(2)
SHAFT = 2e-3
WEIGHTLESS = vector(0.0, 0.0, 0.0)
X, Y, Z = vector(1.0, 0.0, 0.0), vector(0.0, 1.0, 0.0), vector(0.0, 0.0, 1.0)


def rods(**numbers: float | Tensor) -> Parameters:
    """Two rods far from any ground."""
    return parameters(PAIR, gravity=WEIGHTLESS, **numbers)


def facing(offset: Tensor, axes: tuple[Tensor, Tensor], speed: float) -> State:
    """Rod 1 at `offset` from rod 0; each moves towards the other along y with half of `speed` [m/s]."""
    p = torch.stack([Z, Z + offset])
    v = torch.stack([0.5 * speed * Y, -0.5 * speed * Y])
    return state(PAIR, p, axis=torch.stack(axes), v=v)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_central_collision_of_crossed_rods(e: float) -> None:
    """Two crossed shafts that meet in their middles fly apart with e times their speed, without turning."""
    start = facing(vector(0.0, 2 * SHAFT + 0.003, 0.0), (X, Z), 1.0)
    end = after(PAIR, rods(restitution=e), start, 10, 1e-3)
    assert torch.allclose(end.v_WB[0, :, 1], vector(-0.5 * e, 0.5 * e), rtol=0, atol=1e-9)
    assert float(end.w_R.abs().max()) < 1e-9


def test_equal_rods_exchange_velocities_end_to_end() -> None:
    """e = 1, cap against cap along the common axis: the moving rod stops, the other takes its velocity."""
    gap = 2 * HALF + 2 * RADIUS + 0.002
    start = state(PAIR, torch.stack([Z, Z + gap * X]), axis=X, v=torch.stack([0.8 * X, 0 * X]))
    end = after(PAIR, rods(restitution=1.0), start, 8, 1e-3)
    assert torch.allclose(end.v_WB[0], torch.stack([0 * X, 0.8 * X]), rtol=0, atol=1e-9)


def test_a_cap_that_hits_a_shaft_off_centre() -> None:
    """A rod flies end first at another, 0.1 m off its middle, without friction: the impulse
    (1 + e) v / (1/m + 1/m + x^2 / It) gives both velocities and the spin."""
    x, e, v = 0.1, 0.4, 1.2
    start = state(
        PAIR, torch.stack([Z + vector(x, -HALF - RADIUS - SHAFT - 0.001, 0.0), Z]), axis=torch.stack([Y, X]),
        v=torch.stack([v * Y, 0 * Y]),
    )  # fmt: skip
    end = after(PAIR, rods(restitution=e, rod_friction=0.0), start, 2, 1e-3)
    impulse = (1 + e) * v / (2 / MASS + x * x / TRANSVERSE)
    assert torch.allclose(end.v_WB[0], torch.stack([(v - impulse / MASS) * Y, impulse / MASS * Y]), rtol=0, atol=1e-6)
    assert float(torch.linalg.vector_norm(end.w_R[0, 1])) == pytest.approx(impulse * x / TRANSVERSE, rel=1e-5)


def test_friction_between_rods() -> None:
    """Crossed shafts that meet in their middles while one slides along itself: the slide loses mu times the normal
    impulse, divided by the mass, to the other rod."""
    mu, slide = 0.3, 2.0
    start = facing(vector(0.0, 2 * SHAFT + 5e-4, 0.0), (X, Z), 1.0)
    start = State(
        start.p_WB, start.q_WR, start.v_WB + torch.stack([slide * X, 0 * X]), start.w_R, start.rest, start.winding
    )
    end = after(PAIR, rods(rod_friction=mu), start, 1, 1e-3)
    # Both masses stop along y: the normal impulse is m / 2 times the closing speed of 1 m/s.
    normal = MASS / 2
    assert float(end.v_WB[0, 0, 0]) == pytest.approx(slide - mu * normal / MASS, abs=1e-6)
    assert float(end.v_WB[0, 1, 0]) == pytest.approx(mu * normal / MASS, abs=1e-6)


def colliding(n: int, seed: int) -> State:
    """Pairs of rods at random angles that fly at each other, points of their shafts 15 mm apart, spinning a little."""
    generator = torch.Generator().manual_seed(seed)

    def random(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    axes = torch.nn.functional.normalize(random(n, 2, 3) + vector(0.0, 0.0, 0.2), dim=-1)
    normal = torch.nn.functional.normalize(torch.linalg.cross(axes[:, 0], axes[:, 1]), dim=-1)
    along = 0.2 * HALF * random(n, 2, 1).clamp(-3, 3) * axes
    first = vector(0.0, 0.0, 2.0).expand(n, 3)
    second = first + along[:, 0] - along[:, 1] + 0.015 * normal
    v = torch.stack([0.7 * normal, -0.7 * normal], dim=1) + 0.2 * random(n, 2, 3)
    return state(PAIR, torch.stack([first, second], dim=1), axis=axes, v=v, w=0.5 * random(n, 2, 3))


@pytest.mark.parametrize("e", [0.0, 0.6])
def test_collisions_conserve_momentum_and_lose_energy(e: float) -> None:
    """400 random collisions with friction: linear momentum stays to rounding, angular momentum to what flight alone
    changes in a step, energy never grows by more than that, and nearly every pair was turned round."""
    start, theta = colliding(400, 7), rods(restitution=e, rod_friction=0.4)
    h, n = 2.5e-4, 120
    end = after(PAIR, theta, start, n, h)
    (p0, L0), (p1, L1) = momentum(theta, start), momentum(theta, end)
    assert torch.allclose(p1, p0, rtol=0, atol=1e-13)
    free = after(free_rods(2, rod_contact=False), theta, start, n, h)
    touched = (end.v_WB - free.v_WB).abs().amax((1, 2)) > 1e-3
    assert float(touched.to(torch.float64).mean()) > 0.9
    spread = float(torch.linalg.vector_norm(L0, dim=1).median())
    assert float((L1 - L0).abs().max()) < 0.02 * spread
    E0, E1 = energy(PAIR, theta, start), energy(PAIR, theta, end)
    assert float(((E1 - E0) / E0).max()) < 2e-3


def test_rods_do_not_pass_through_each_other() -> None:
    """Random pairs at 1.4 m/s and 1 ms: at most 2 in 100 shafts sink into each other by 0.02 mm, none by 1 mm."""
    start, theta = colliding(200, 8), rods()
    least = torch.full((200,), math.inf, dtype=torch.float64)
    for s in roll(PAIR, theta, start, 40, 1e-3):
        least = torch.minimum(least, shaft_distance(theta, s))
    assert float((least > 2 * SHAFT - 2e-5).to(torch.float64).mean()) >= 0.98
    assert float(least.min()) > 2 * SHAFT - 1e-3
    assert float(least.median()) < 2 * SHAFT + 1e-4


def shaft_distance(theta: Parameters, s: State) -> Tensor:
    """Least distance of the axes of two rods [m], (B,), found by sampling one and projecting on the other."""
    caps = end_caps(theta, s)
    share = torch.linspace(0.0, 1.0, 801, dtype=torch.float64)[:, None]
    points = caps[:, None, 0] * (1 - share) + caps[:, None, 1] * share
    line = caps[:, 3] - caps[:, 2]
    t = ((points - caps[:, None, 2]) * line[:, None]).sum(-1, keepdim=True) / (line * line).sum(-1)[:, None, None]
    near = caps[:, None, 2] + t.clamp(0.0, 1.0) * line[:, None]
    return torch.linalg.vector_norm(points - near, dim=-1).amin(1)


def test_rods_that_do_not_meet_move_as_if_alone() -> None:
    """Far from each other the contact between rods changes nothing, bit by bit."""
    start = facing(vector(0.0, 0.3, 0.0), (X, Z), 0.5)
    with_contact, without = (roll(free_rods(2, rod_contact=on), rods(), start, 20, 1e-3) for on in (True, False))
    assert torch.equal(track(with_contact), track(without))


def test_a_rod_lies_on_two_others() -> None:
    """Rod 0 across rods 1 and 2 on the ground, with gravity: it comes to rest on their shafts, its centre 4 mm above
    theirs, and the pile stays."""
    pile = free_rods(3)
    theta = parameters(pile, cap_radius=torch.tensor([[2e-3] * 2, [0.0175] * 2, [0.0175] * 2], dtype=torch.float64))
    p = torch.stack([vector(0.0, 0.0, 0.0175 + 2 * SHAFT + 1e-3), vector(-0.1, 0.0, 0.0175), vector(0.1, 0.0, 0.0175)])
    p_WB = simulate(pile, theta, state(pile, p, axis=torch.stack([X, Y, Y])), 3000, 1e-3, every=1000).states.p_WB[0]
    assert float(p_WB[-1, 0, 2]) == pytest.approx(0.0175 + 2 * SHAFT, abs=2e-4)
    assert float((p_WB[-1] - p_WB[-2]).abs().max()) < 1e-4


def test_axes_that_cross_are_pushed_apart() -> None:
    """Two rods whose axes cross in one point have no direction between them: the step stays finite and parts them."""
    structure = free_rods(2)
    theta = parameters(structure)
    start = state(structure, vector(0.0, 0.0, 1.0).expand(2, 3), axis=torch.stack([vector(1, 0, 0), vector(0, 1, 0)]))
    end = after(structure, theta, start, 20, 1e-3)
    assert torch.isfinite(end.p_WB).all() and torch.isfinite(end.v_WB).all()
    assert float((end.p_WB[0, 1] - end.p_WB[0, 0]).abs().max()) > 1e-4
