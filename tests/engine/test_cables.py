"""Cables and winches: static stretch, pendulums, damping that cannot push, slack, and how a winch winds."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import Parameters, State, Structure
from r2s2r_cli.engine.reading import energy, momentum, read
from tests.support.engine import MASS, TRANSVERSE, G, after, parameters, simulate, state, vector

LENGTH, HALF_SPREAD = 0.4, 0.12
"""Of the two cables from the anchor, and half their distance along the rod [m]."""
HUNG = Structure(n_rods=2, cable_rods=((0, 1), (0, 1)), actuated=(), rod_contact=False)
"""Rod 0, a heavy anchor that lies on two large caps, and rod 1 that hangs from it on two cables."""
WINCHED = replace(HUNG, actuated=(0, 1))
ANCHOR_HEIGHT = 2.0


def hung(structure: Structure = HUNG, *, spread: float = HALF_SPREAD, **numbers: float | Tensor) -> Parameters:
    """The anchor weighs 10^6 kg: it moves less than a picometre. Attachments lie on the axes of the rods."""
    half = torch.tensor([[0.0, 0.0, -2.0], [0.0, 0.0, 2.0]], dtype=torch.float64)
    rod = parameters(HUNG)
    inertia = torch.stack([4e6 * torch.eye(3, dtype=torch.float64), rod.inertia[0, 0]])
    ends = torch.tensor([-spread, spread], dtype=torch.float64)
    sites = torch.zeros(2, 2, 3, dtype=torch.float64)
    sites[:, 0, 2], sites[:, 1, 2] = ends, torch.tensor([-HALF_SPREAD, HALF_SPREAD], dtype=torch.float64)
    fixed = {
        "mass": vector(1e6, MASS), "inertia": inertia, "p_BE": torch.stack([half, rod.p_BE[0, 0]]),
        "cap_radius": torch.tensor([[ANCHOR_HEIGHT] * 2, [0.01] * 2], dtype=torch.float64), "p_BS": sites,
    }  # fmt: skip
    return parameters(structure, **{**fixed, **numbers})


def hanging(drop: Tensor | float, *, structure: Structure = HUNG, rest: Tensor | None = None) -> State:
    """Both rods along x, at rest, rod 1 `drop` below the anchor, (..., 3) or straight down [m]."""
    drop = drop if isinstance(drop, Tensor) else vector(0.0, 0.0, -drop)
    top = vector(0.0, 0.0, ANCHOR_HEIGHT).expand_as(drop)
    return state(structure, torch.stack([top, top + drop], dim=-2), rest=rest)


LAWS = {
    "linear": (HUNG, {"stiffness": 800.0}),
    "cubic": (replace(HUNG, cubic=True), {"stiffness": 300.0, "stiffness2": -500.0, "stiffness3": 4e5}),
    "tendon": (replace(HUNG, tendons=True), {"stiffness": 500.0, "tendon_stiffness": 20.0, "tendon_rest": 0.38}),
}


def balance(law: str) -> float:
    """Length of each cable at which it carries half the weight of rod 1, by bisection of the closed law [m]."""
    numbers = LAWS[law][1]

    def force(length: float) -> float:
        x = max(length - LENGTH, 0.0)
        pull = numbers["stiffness"] * x + numbers.get("stiffness2", 0.0) * x**2 + numbers.get("stiffness3", 0.0) * x**3
        return pull + numbers.get("tendon_stiffness", 0.0) * max(length - numbers.get("tendon_rest", 1e9), 0.0)

    low, high = LENGTH - 0.05, LENGTH + 0.05
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if force(middle) < MASS * G / 2 else (low, middle)
    return low


@pytest.mark.parametrize("law", list(LAWS))
def test_static_stretch(law: str) -> None:
    """A rod on two cables hangs where k x + k2 x^2 + k3 x^3 (plus the sensor tendon) carries its weight: from there it
    does not move, and from above it comes there; the step length does not shift the balance."""
    structure, numbers = LAWS[law]
    theta, length = hung(structure, rest=LENGTH, **numbers), balance(law)
    still = simulate(structure, theta, hanging(length, structure=structure), 1000, 2e-3).at(-1)
    assert float((still.p_WB[0, 1] - hanging(length).p_WB[0, 1]).abs().max()) < 1e-9
    damped = replace(theta, damping=torch.full_like(theta.damping, 8.0))
    end = simulate(structure, damped, hanging(length - 0.004, structure=structure), 2000, 2e-3).at(-1)
    assert float(ANCHOR_HEIGHT - end.p_WB[0, 1, 2]) == pytest.approx(length, abs=1e-6)


def test_sag_of_slanted_cables() -> None:
    """Two cables that slant by 30 degrees carry a rod with tensions m g / (2 cos 30), read as such."""
    slant = math.radians(30)
    tension = MASS * G / (2 * math.cos(slant))
    spread = HALF_SPREAD + LENGTH * math.sin(slant)
    theta = hung(spread=spread, rest=LENGTH - tension / 2000.0)
    start = hanging(LENGTH * math.cos(slant))
    end = after(HUNG, theta, start, 100, 1e-3)
    assert float((end.p_WB - start.p_WB).abs().max()) < 1e-9
    assert read(HUNG, theta, end).tension[0].tolist() == pytest.approx([tension] * 2, rel=1e-6)


def full_period(z: Tensor, h: float) -> float:
    """Twice the time [s] between the first two passes of a signal (frame,) through 0, by linear interpolation."""
    passes = torch.nonzero(z[:-1] * z[1:] < 0)[:, 0]
    times = (passes + z[passes] / (z[passes] - z[passes + 1])) * h
    return 2 * float(times[1] - times[0])


def elliptic_period(length: float, amplitude: float) -> float:
    """Period of a pendulum of any amplitude [rad]: 2 pi sqrt(l / g) over the arithmetic-geometric mean of 1 and
    cos(amplitude / 2)."""
    a, b = 1.0, math.cos(amplitude / 2)
    while abs(a - b) > 1e-15:
        a, b = (a + b) / 2, math.sqrt(a * b)
    return 2 * math.pi * math.sqrt(length / G) / a


def test_pendulum() -> None:
    """Rod 1 swings sideways on two parallel cables, without turning: a mathematical pendulum. Its period at 10 and 60
    degrees is the elliptic one within 0.1 %, and its energy stays within 0.5 %."""
    amplitude = torch.tensor([10.0, 60.0], dtype=torch.float64).deg2rad()
    drop = LENGTH * torch.stack([0 * amplitude, torch.sin(amplitude), -torch.cos(amplitude)], -1)
    theta, h = hung(rest=LENGTH, stiffness=1e5, damping=20.0), 1e-3
    run = simulate(HUNG, theta, hanging(drop), 1100, h)
    y = run.states.p_WB[:, :, 1, 1]
    for k, angle in enumerate(amplitude.tolist()):
        assert full_period(y[k], h) == pytest.approx(elliptic_period(LENGTH, angle), rel=1e-3)
    low = MASS * G * (ANCHOR_HEIGHT - LENGTH)
    E = [energy(HUNG, theta, s) - 1e6 * G * ANCHOR_HEIGHT - low for s in (run.at(0), run.at(-1))]
    assert torch.allclose(E[1], E[0], rtol=5e-3, atol=0)


def test_bifilar_pendulum() -> None:
    """Turned about the vertical, rod 1 swings back with the period 2 pi sqrt(It L / (m g)) / b of a bifilar pendulum;
    amplitude 0.06 rad, within 0.2 %."""
    theta, h, turn = hung(rest=LENGTH, stiffness=1e5, damping=20.0), 1e-3, 0.06
    start = hanging(LENGTH)
    twist = vector(-math.sin(turn / 2), 0.0, 0.0)  # the rod's own x axis points down
    q = torch.cat([twist, vector(math.cos(turn / 2))])
    q0 = start.q_WR[0, 1]
    v = torch.linalg.cross(q0[:3], q[:3]) + q0[3] * q[:3] + q[3] * q0[:3]
    turned = torch.stack([q0, torch.cat([v, (q0[3] * q[3] - q0[:3] @ q[:3])[None]])])
    w = simulate(HUNG, theta, replace(start, q_WR=turned[None]), 1200, h).states.w_R[0, :, 1, 0]
    period = 2 * math.pi * math.sqrt(TRANSVERSE * LENGTH / (MASS * G)) / HALF_SPREAD
    assert full_period(w, h) == pytest.approx(period, rel=2e-3)


def test_slack_cables_do_nothing() -> None:
    """Rods joined by slack cables fall as if there were none, bit by bit, whatever stiffness and damping."""
    start = replace(hanging(0.2), v_WB=vector(0.3, 0.2, 0.1).expand(1, 2, 3))
    ends = [after(HUNG, hung(rest=0.5, stiffness=k, damping=c), start, 50, 1e-3) for k, c in ((10.0, 0.0), (1e5, 50.0))]
    assert torch.equal(ends[0].p_WB, ends[1].p_WB)
    assert torch.equal(ends[0].w_R, ends[1].w_R)


def test_damping_never_pushes() -> None:
    """A taut cable whose ends run together faster than its damping can bear has no tension at all."""
    theta = hung(rest=LENGTH, stiffness=100.0, damping=50.0, gravity=vector(0.0, 0.0, 0.0))
    speed = torch.linspace(0.0, 2.0, 21, dtype=torch.float64)
    start = hanging(vector(0.0, 0.0, -LENGTH - 0.01).expand(21, 3))
    v = torch.zeros(21, 2, 3, dtype=torch.float64)
    v[:, 1, 2] = speed
    tension = read(HUNG, theta, replace(start, v_WB=v)).tension
    assert bool((tension >= 0).all())
    assert float(tension[0, 0]) == pytest.approx(1.0)
    assert bool((tension[speed > 0.1] == 0).all())


def test_cables_conserve_momentum() -> None:
    """Two free rods joined by taut, damped cables at odd points: linear and angular momentum stay, energy falls."""
    structure = Structure(n_rods=2, cable_rods=((0, 1), (1, 0), (0, 1)), actuated=(), rod_contact=False)
    sites = torch.randn(3, 2, 3, generator=torch.Generator().manual_seed(5), dtype=torch.float64)
    sites = sites * vector(0.01, 0.01, 0.1)
    theta = parameters(structure, gravity=vector(0.0, 0.0, 0.0), p_BS=sites, rest=0.1, stiffness=300.0, damping=2.0)
    start = state(structure, torch.stack([vector(0.0, 0.0, 1.0), vector(0.1, 0.2, 1.2)]), w=vector(1.0, 2.0, 3.0))
    (p0, L0), E0, changes = momentum(theta, start), energy(structure, theta, start), []
    for h in (5e-4, 2.5e-4):
        run = simulate(structure, theta, start, round(0.05 / h), h)
        p1, L1 = momentum(theta, run.at(-1))
        assert torch.allclose(p1, p0, rtol=0, atol=1e-13)
        assert float(energy(structure, theta, run.at(-1))) < float(E0)
        changes.append(float(torch.linalg.vector_norm(L1 - L0) / torch.linalg.vector_norm(L0)))
    # The thin rods come to spin at 140 rad/s; the arms of a step's impulses are those of its start: first order.
    assert changes[0] < 0.12
    assert changes[0] / changes[1] > 1.8


def test_winches_wind_at_their_speed_and_stop_at_their_ends() -> None:
    """Rest lengths follow -speed u: in at one speed, out at another, commands beyond 1 count as 1, ends are kept."""
    theta = hung(WINCHED, speed_in=0.05, speed_out=0.08, rest_min=0.38, rest_max=0.45)
    start = hanging(LENGTH, structure=WINCHED, rest=vector(0.4, 0.4)).select(slice(0, 1))
    for u, expected in (
        ((1.0, -1.0), (-0.05, 0.08)),
        ((0.5, -0.25), (-0.025, 0.02)),
        ((3.0, -9.0), (-0.05, 0.08)),
        ((0.0, 0.0), (0.0, 0.0)),
    ):
        end = simulate(WINCHED, theta, start, 100, 1e-3, u=vector(*u)[None]).at(-1)
        assert (end.rest - start.rest)[0].tolist() == pytest.approx([0.1 * x for x in expected], abs=1e-12)
    end = simulate(WINCHED, theta, start, 700, 1e-3, u=vector(1.0, -1.0)[None]).at(-1)
    assert end.rest[0].tolist() == [0.38, 0.45]


def test_winches_lag() -> None:
    """With a time constant the winding rate approaches its command as 1 - exp(-t / tau), closer with shorter steps."""
    structure, tau, t = replace(WINCHED, lag=True), 0.05, 0.04
    theta = hung(structure, speed_in=0.06, lag=tau)
    start = hanging(LENGTH, structure=structure, rest=vector(0.4, 0.4))
    u = vector(1.0, 1.0)[None]
    exact = 0.06 * (1 - math.exp(-t / tau))
    errors = [
        abs(float(after(structure, theta, start, round(t / h), h, u=u).winding[0, 0]) / exact - 1) for h in (2e-3, 1e-3)
    ]
    assert errors[1] < 0.01
    assert 1.8 < errors[0] / errors[1] < 2.2


def test_winches_droop_under_load() -> None:
    """A loaded winch reels in slower by droop times tension, pays out at full speed, and never runs backwards."""
    structure = replace(WINCHED, droop=True)
    start = hanging(LENGTH, structure=structure, rest=vector(LENGTH, LENGTH) - MASS * G / 2 / 2000.0)
    for droop, rates in ((0.5, (0.06 * (1 - 0.5 * MASS * G / 2), -0.06)), (9.0, (0.0, -0.06))):
        end = after(structure, hung(structure, droop=droop), start, 1, 1e-3, u=vector(1.0, -1.0)[None])
        assert end.winding[0].tolist() == pytest.approx(rates, abs=1e-9)
