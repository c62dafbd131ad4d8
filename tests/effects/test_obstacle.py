"""A ridge in the floor against closed forms: energy is kept over it, in sliding and in rolling, and what is too slow
comes back."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import roma
import torch
from torch import Tensor

from r2s2r_cli.effects.obstacle import Obstacle
from r2s2r_cli.engine import Parameters, State, Structure, energy
from tests.support.engine import (
    AXIAL,
    HALF,
    MASS,
    RADIUS,
    G,
    after,
    lying,
    pointing,
    roll,
    simulate,
    state,
    vector,
)
from tests.support.lone_rod import lone_rod

H, HEIGHT, WIDTH = 1e-3, 0.005, 0.03
ACROSS, ALONG = vector(0.0, 1.0, 0.0), vector(1.0, 0.0, 0.0)
"""A rod that lies along the ridge, so that both of its caps meet it at once, and one across."""


FIELDS = ("p_WB", "q_WR", "v_WB", "w_R", "rest", "winding")


def rod(*, friction: float = 0.0, **values: float) -> tuple[Structure, Parameters]:
    """One free rod on a floor with a ridge along y: through the origin unless the values say otherwise."""
    return lone_rod(Obstacle(), {"height_m": HEIGHT, "ridge_width_m": WIDTH, **values}, friction=friction)


def coming(structure: Structure, speed: float, *, at: float = -0.15, spin: float = 0.0) -> State:
    """The rod that lies along y at x, on its way along x. spin [rad/s] about y."""
    made = lying(structure, axis=ACROSS, v=vector(speed, 0.0, 0.0).expand(1, 1, 3))
    R_WR = roma.unitquat_to_rotmat(made.q_WR)[0, 0]
    w = (R_WR.T @ vector(0.0, spin, 0.0)).expand(1, 1, 3)
    return replace(made, p_WB=made.p_WB + vector(at, 0.0, 0.0), w_R=w)


def height(x: Tensor, ridge: float = HEIGHT, width: float = WIDTH) -> Tensor:
    """Of the floor [m] at x."""
    return ridge * torch.exp(-0.5 * (x / width) ** 2)


def test_a_rod_that_slides_is_lifted_and_pays_for_it() -> None:
    """Without friction it follows the floor to 50 um, is slower by what the height takes of its energy (to 5 %), and
    leaves as fast as it came."""
    structure, theta = rod()
    states = simulate(structure, theta, coming(structure, 0.5), 700, H).states
    x, z, v = states.p_WB[0, :, 0, 0], states.p_WB[0, :, 0, 2] - RADIUS, states.v_WB[0, :, 0]
    assert float(x[-1]) > 4 * WIDTH
    assert float((z - height(x)).abs().max()) < 5e-5
    kept = 0.25 - 2 * G * height(x)
    assert float(((v * v).sum(-1) - kept).abs().max()) < 0.05 * 2 * G * HEIGHT
    assert float(v[:, 0].min()) == pytest.approx(math.sqrt(0.25 - 2 * G * HEIGHT), rel=1e-3)
    assert float(v[-1, 0]) == pytest.approx(0.5, rel=1e-3)


def test_one_that_is_too_slow_comes_back() -> None:
    """Below sqrt(2 g height) it turns round, at the height that its energy reaches, and leaves as fast as it came."""
    structure, theta = rod()
    speed = 0.9 * math.sqrt(2 * G * HEIGHT)
    states = simulate(structure, theta, coming(structure, speed), 1300, H).states
    x, z = states.p_WB[0, :, 0, 0], states.p_WB[0, :, 0, 2] - RADIUS
    assert float(x.max()) < 0
    assert float(z.max()) == pytest.approx(speed**2 / (2 * G), rel=0.01)
    assert float(states.v_WB[0, -1, 0, 0]) == pytest.approx(-speed, rel=1e-3)
    assert float(x[-1]) < -0.12


def test_a_rod_that_rolls_has_its_turning_as_well() -> None:
    """Without slip it is slower on top by what height takes of the energy of moving and turning: the floor comes up as
    the cap's centre moves, though its lowest point stands still."""
    structure, theta = rod(friction=1.0, height_m=0.003, ridge_width_m=0.05)
    states = simulate(structure, theta, coming(structure, 0.6, at=-0.25, spin=0.6 / RADIUS), 800, H).states
    top = int(states.p_WB[0, :, 0, 2].argmax())
    inertia = AXIAL / (MASS * RADIUS**2)
    assert float(states.p_WB[0, top, 0, 2]) == pytest.approx(RADIUS + 0.003, abs=1e-5)
    expected = math.sqrt(0.36 - 2 * G * 0.003 / (1 + inertia))
    assert float(states.v_WB[0, top, 0, 0]) == pytest.approx(expected, rel=1e-3)
    assert float(states.v_WB[0, -1, 0, 0]) == pytest.approx(0.6, rel=1e-3)


def test_friction_holds_a_cap_on_the_slope_or_does_not() -> None:
    """A rod across the ridge, one cap at the steepest place, the other on the level floor. Without friction it slides
    down with that cap's half of the weight times the slope; where friction exceeds half of it, it stays."""
    slope = HEIGHT / WIDTH * math.exp(-0.5)
    up = HEIGHT * math.exp(-0.5)
    axis = vector(math.sqrt(4 * HALF**2 - up**2), 0.0, -up)
    middle = vector(WIDTH, 0.0, RADIUS + up) + 0.5 * axis
    moved = []
    for friction in (0.0, 2 * slope):
        structure, theta = rod(friction=friction)
        start = state(structure, middle[None], q=pointing(axis))
        moved.append(simulate(structure, theta, start, 100, H, every=20))
    # The push of a step is that of the load before: one step less.
    assert float(moved[0].at(1).v_WB[0, 0, 0]) == pytest.approx(19 * H * 0.5 * G * slope, rel=0.03)
    assert float((moved[1].at(-1).p_WB[0, 0] - middle).abs().max()) < 2e-5
    assert float(moved[1].at(-1).v_WB.abs().max()) < 1e-4


def test_friction_and_slope_add_up() -> None:
    """Uphill a sliding rod is braked by friction and by the ridge: it loses both works of its energy."""
    mu = 0.1
    structure, theta = rod(friction=mu)
    # It must not roll: caps of hardly any radius.
    theta = replace(theta, cap_radius=torch.full_like(theta.cap_radius, 1e-4))
    start = coming(structure, 1.0, at=-0.1)
    start = replace(start, p_WB=start.p_WB + vector(0.0, 0.0, 1e-4 - RADIUS))
    states = simulate(structure, theta, start, 400, H).states
    x = states.p_WB[0, :, 0, 0]
    top = int((x > 0).nonzero()[0, 0])
    way = float(x[top] - x[0])
    speed = states.v_WB[0, top]
    # The load differs from the weight on the way, and by nothing in the mean of a slope that begins and ends level.
    assert float((speed * speed).sum()) == pytest.approx(1.0 - 2 * G * (HEIGHT + mu * way), rel=0.005)


@pytest.mark.parametrize(
    ("high", "wide", "friction", "share"),
    [(0.005, 0.03, 0.0, 1e-3), (0.01, 0.03, 0.6, 1e-3), (0.02, 0.01, 0.0, 0.02), (0.02, 0.01, 0.6, 0.02)],
)
def test_no_energy_comes_out_of_it(high: float, wide: float, friction: float, share: float) -> None:
    """Rods that tumble on to it: what the push of a step gives, the impact of the step before has taken; the two
    together add 0.1 % of the energy at most, on the steepest ridge that there is 2 %, and all of it ends in impacts."""
    structure, theta = rod(friction=friction, height_m=high, ridge_width_m=wide)
    generator = torch.Generator().manual_seed(0)
    n = 8
    p = 0.05 * torch.randn(n, 1, 3, generator=generator, dtype=torch.float64)
    p[..., 2] = 0.2
    v, w = (size * torch.randn(n, 1, 3, generator=generator, dtype=torch.float64) for size in (0.5, 3.0))
    q = torch.randn(n, 1, 4, generator=generator, dtype=torch.float64)
    start = state(structure, p, q=roma.quat_normalize(q), v=v, w=w)
    states = simulate(structure, theta, start, 400, H).states
    flat = State(**{name: getattr(states, name).flatten(0, 1) for name in FIELDS})
    e = energy(replace(structure, effects=()), theta, flat).unflatten(0, (n, -1))
    gained = e[:, 2:] - torch.maximum(e[:, 1:-1], e[:, :-2])
    assert float(gained.max()) < share * float(e[:, 0].mean())
    assert float((e[:, 0] - e[:, -1]).min()) > 0.05 * float(e[:, 0].mean())


def test_the_line_can_lie_anywhere() -> None:
    """Turned about the vertical and shifted with its robot, the motion is the same, turned and shifted."""
    angle, distance = 0.7, 0.3
    plain, theta = rod(friction=0.2)
    turned, other = rod(friction=0.2, ridge_angle_rad=angle, ridge_distance_m=distance)
    start = coming(plain, 0.5, at=-0.1)
    q = roma.rotvec_to_unitquat(vector(0.0, 0.0, angle))
    R = roma.unitquat_to_rotmat(q)
    shift = distance * R[:, 0] + 0.4 * R[:, 1]  # along the ridge nothing changes
    twin = replace(
        start, p_WB=start.p_WB @ R.T + shift, v_WB=start.v_WB @ R.T,
        q_WR=roma.quat_product(q.expand_as(start.q_WR), start.q_WR),
    )  # fmt: skip
    ours, theirs = after(plain, theta, start, 300, H), after(turned, other, twin, 300, H)
    assert float(ours.p_WB[0, 0, 0]) > -0.02
    assert float((theirs.p_WB - ours.p_WB @ R.T - shift).abs().max()) < 1e-6
    assert float((theirs.v_WB - ours.v_WB @ R.T).abs().max()) < 1e-5


def test_far_away_there_is_nothing() -> None:
    """A rod that slides 40 widths away from the line moves as on a level floor, bit by bit."""
    structure, theta = rod(friction=0.3, ridge_distance_m=1.5)
    level, none = rod(friction=0.3, height_m=0.0)
    start = coming(structure, 0.3)
    ours, theirs = roll(structure, theta, start, 50, H)[-1], roll(level, none, start, 50, H)[-1]
    assert torch.equal(ours.p_WB, theirs.p_WB)
    assert torch.equal(ours.v_WB, theirs.v_WB)
    near = roll(*rod(friction=0.3), start, 50, H)[-1]
    assert float((near.p_WB - theirs.p_WB).abs().max()) > 1e-9


def test_it_bears_the_weight() -> None:
    """A rod that stands still on top weighs what it weighs, half on each cap, and is remembered so."""
    structure, theta = rod(friction=0.5)
    start = coming(structure, 0.0, at=0.0)
    start = replace(start, p_WB=start.p_WB + vector(0.0, 0.0, HEIGHT))
    end = roll(structure, theta, start, 10, H)[-1]
    assert end.extra["obstacle.force"][0].numpy() == pytest.approx([MASS * G / 2, MASS * G / 2], rel=1e-6)
    assert float(end.p_WB[0, 0, 2]) == pytest.approx(RADIUS + HEIGHT, abs=1e-9)
