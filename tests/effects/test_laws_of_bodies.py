"""The laws of masses, contact, ground and world against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import roma
import torch
from torch import Tensor

from r2s2r_cli.effects.cap_friction import CapFriction
from r2s2r_cli.effects.cap_radius import CapRadius
from r2s2r_cli.effects.com_offset import ComOffset
from r2s2r_cli.effects.friction_field import FrictionField
from r2s2r_cli.effects.ground_slope import GroundSlope
from r2s2r_cli.effects.payload import Payload
from r2s2r_cli.effects.rolling_resistance import RollingResistance
from r2s2r_cli.effects.soft_ground import SoftGround
from r2s2r_cli.effects.tether_drag import TetherDrag
from r2s2r_cli.engine import State, end_caps, energy, read, tilted
from r2s2r_cli.engine.centred import weighed
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
    track,
    vector,
)
from tests.support.lone_rod import lone_rod

H = 1e-3


def test_com_offset_is_another_body_frame() -> None:
    """A thrown, tumbling rod with its centre of mass 2 cm off is the rod whose caps lie 2 cm the other way in the frame
    of its centre of mass, started from the same motion: same caps, and the true centre flies a parabola."""
    structure, theta = lone_rod(ComOffset(), {"axial_m": 0.02})
    plain = free_rods(1, rod_contact=False)
    shift = vector(0.0, 0.0, 0.02)
    other = replace(parameters(plain), p_BE=parameters(plain).p_BE - shift)
    q = vector(0.1, 0.5, -0.2, 0.8)
    q = (q / q.norm()).expand(1, 1, 4)
    w, v = vector(3.0, -2.0, 1.0).expand(1, 1, 3), vector(0.4, 0.1, 1.0).expand(1, 1, 3)
    start = state(structure, vector(0.0, 0.0, 1.0)[None], q=q, v=v, w=w)
    R = roma.unitquat_to_rotmat(q)
    twin = state(plain, start.p_WB[0] + (R @ shift[:, None])[0, :, :, 0], q=q,
                 v=v + (R @ torch.linalg.cross(w, shift.expand_as(w))[..., None])[..., 0], w=w)  # fmt: skip
    ours, theirs = roll(structure, theta, start, 60, H)[-1], roll(plain, other, twin, 60, H)[-1]
    assert torch.allclose(end_caps(theta, ours), end_caps(other, theirs), rtol=0, atol=1e-12)
    centre = ours.p_WB + (roma.unitquat_to_rotmat(ours.q_WR) @ shift[:, None])[..., 0]
    t = 60 * H
    flown = twin.p_WB + t * twin.v_WB - 0.5 * G * t * (t + H) * vector(0.0, 0.0, 1.0)
    assert torch.allclose(centre, flown, rtol=0, atol=1e-12)


def test_payload_by_parallel_axes() -> None:
    """Mass, centre and inertia of rod and payload: both bodies about their common centre (Steiner)."""
    structure, theta = lone_rod(Payload(), {"mass_kg": 0.05, "place_m": 0.11})
    found, centre = weighed(structure, theta)
    c = 0.05 * 0.11 / (MASS + 0.05)
    assert float(found.mass) == pytest.approx(MASS + 0.05, rel=1e-14)
    assert centre is not None
    assert centre[0, 0].numpy() == pytest.approx([0.0, 0.0, c], abs=1e-15)
    across = TRANSVERSE + MASS * c**2 + 0.05 * (0.11 - c) ** 2
    assert np.diag(found.inertia[0, 0].numpy()) == pytest.approx([across, across, AXIAL], rel=1e-12)


def test_payload_keeps_energy_in_flight() -> None:
    """A tumbling rod with a payload keeps its energy: the kinetic one is counted about the true centre."""
    structure, theta = lone_rod(Payload(), {"mass_kg": 0.05, "place_m": 0.11})
    start = state(structure, vector(0.0, 0.0, 1.0)[None], w=vector(4.0, 1.0, 2.0).expand(1, 1, 3))
    states = roll(structure, theta, start, 40, H, every=40)
    before, after = (float(energy(structure, theta, one)) for one in states)
    assert after == pytest.approx(before, rel=2e-3)
    assert before > 0.5 * TRANSVERSE * 17


def test_payload_carries_its_weight() -> None:
    """At rest on both caps, the ground bears rod and payload, and more of it at the nearer cap (the lever)."""
    structure, theta = lone_rod(Payload(), {"mass_kg": 0.05, "place_m": 0.08})
    force = read(structure, theta, lying(structure)).ground[0, :, 2]
    right = (MASS * HALF + 0.05 * (HALF + 0.08)) * G / (2 * HALF)
    assert force.numpy() == pytest.approx([(MASS + 0.05) * G - right, right], rel=1e-6)


def test_friction_field() -> None:
    """A rod slides with mu(x) g where it is, on the gradient and half way out of the patch; far away as without."""
    x = {"gradient_x_per_m": 0.5, "gradient_y_per_m": -0.2, "patch_factor": 0.4, "patch_x_m": 3.0, "patch_y_m": 0.0,
         "patch_radius_m": 0.2}  # fmt: skip
    structure, theta = lone_rod(FrictionField(), x, friction=0.3)
    places = vector(0.0, 1.0, 3.2, -1.0)
    p = torch.stack([places, torch.zeros(4).double(), torch.full((4,), RADIUS).double()], dim=-1)[:, None]
    v = vector(1.0, 0.0, 0.0).expand(4, 1, 3)
    start = state(structure, p, axis=vector(0.0, 1.0, 0.0), v=v)
    after = roll(structure, theta, start, 1, H)[-1].v_WB[:, 0, 0]
    # Its caps lie at y of +-HALF: what the gradient along y makes of them cancels.
    d2 = (places - 3.0) ** 2 + HALF**2
    patch = 1 + (0.4 - 1) / (1 + (d2 / 0.04) ** 2)
    expected = 0.3 * G * (1 + 0.5 * places) * patch
    assert ((1.0 - after) / H).numpy() == pytest.approx(expected.numpy(), rel=1e-3)


def test_cap_friction() -> None:
    """A sliding rod is braked by the mean of its two caps' friction."""
    structure, theta = lone_rod(CapFriction(), {}, friction=0.5)
    theta = theta.with_values({"cap_friction.factor": torch.tensor([[0.4, 1.0]], dtype=torch.float64)})
    after = roll(
        structure, theta, lying(structure, axis=vector(0.0, 1.0, 0.0), v=vector(1.0, 0.0, 0.0).expand(1, 1, 3)), 1, H
    )[-1]
    assert float(1.0 - after.v_WB[0, 0, 0]) / H == pytest.approx(0.5 * 0.7 * G, rel=1e-6)


@pytest.mark.parametrize(("name", "axis", "inertia"), [("rolling_m", 0, AXIAL), ("torsion_m", 2, TRANSVERSE)])
def test_rolling_resistance(name: str, axis: int, inertia: float) -> None:
    """Without friction a rod that rolls, or turns on the spot, loses rho m g / I of its speed a second, until it
    stands."""
    rho = 0.001
    structure, theta = lone_rod(RollingResistance(), {name: rho}, friction=0.0)
    spin = 2.0
    w = torch.zeros(1, 1, 3, dtype=torch.float64)
    start = lying(structure)
    # The rod lies along x: rolling is about its own axis, turning about the vertical.
    R = roma.unitquat_to_rotmat(start.q_WR)[0, 0]
    w[0, 0] = R.T @ (spin * torch.eye(3, dtype=torch.float64)[axis])
    force = {"rolling_resistance.force": torch.full((1, 2), MASS * G / 2, dtype=torch.float64)}
    start = replace(start, w_R=w, extra=force)
    rate = rho * MASS * G / inertia
    steps = 40
    states = roll(structure, theta, start, steps, H)
    speed = torch.linalg.vector_norm(track(states, "w_R")[0, :, 0], dim=-1)
    t = H * torch.arange(steps + 1, dtype=torch.float64)
    expected = torch.relu(spin - rate * t)
    assert torch.allclose(speed, expected, rtol=0, atol=2 * rate * H * 1e-2 + 1e-9)
    assert float(speed[-1]) == pytest.approx(max(0.0, spin - rate * 0.04), abs=1e-6)


def test_soft_ground_is_a_kelvin_voigt_foundation() -> None:
    """A rod put on to soft ground sinks to compliance times its load, with the time constant; lifted off, the ground
    comes back with it."""
    s, tau = 1e-4, 0.05
    structure, theta = lone_rod(SoftGround(), {"compliance_m_per_n": s, "tau_s": tau})
    start = lying(structure)
    states = roll(structure, theta, start, 80, H)
    load = MASS * G / 2
    t = H * torch.arange(81, dtype=torch.float64)
    sunk = track_extra(states, "soft_ground.sunk")[0, :, 0]
    assert torch.allclose(sunk, s * load * (1 - torch.exp(-t / tau)), rtol=0, atol=0.04 * s * load)
    height = track(states)[0, :, 0, 2]
    assert torch.allclose(height, RADIUS - sunk, rtol=0, atol=1e-6)
    lifted = replace(states[-1], p_WB=states[-1].p_WB + vector(0.0, 0.0, 1.0))
    back = roll(structure, theta, lifted, 50, H, every=50)[-1].extra["soft_ground.sunk"]
    assert float(back[0, 0]) == pytest.approx(float(sunk[-1]) * math.exp(-1), rel=0.02)


def test_soft_ground_creeps_sideways() -> None:
    """A rod that friction would hold on a slope along its axis moves down it at creep times what each cap holds, once
    that stops it; beyond the cone it slides as ever."""
    creep, slope = 0.01, 0.2
    structure, theta = lone_rod(SoftGround(), {"creep_m_per_ns": creep})
    along = vector(G * math.sin(slope), 0.0, -G * math.cos(slope)).expand(1, 3)
    states = roll(structure, replace(theta, gravity=along), lying(structure), 100, H)
    held = MASS * G * math.sin(slope) / 2
    number = torch.arange(1, 101, dtype=torch.float64)
    speed = torch.stack([one.v_WB[0, 0, 0] for one in states[1:]])
    expected = creep * held * (1 - (1 + 2 * H / (creep * MASS)) ** -number)  # implicit in the step
    assert torch.allclose(speed, expected, rtol=1e-3, atol=0)  # caps of unequal loads share a little unequally
    steep = vector(G * math.sin(1.3), 0.0, -G * math.cos(1.3)).expand(1, 3)
    plain, _ = lone_rod(SoftGround(), {})
    slid, free = (
        roll(plain, replace(one, gravity=steep), lying(plain), 20, H)[-1].v_WB
        for one in (theta, theta.with_values({"soft_ground.creep_m_per_ns": torch.zeros_like(along[:, :1])}))
    )
    assert torch.allclose(slid, free, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_soft_ground_is_stable_when_very_soft() -> None:
    """A dropped rod on ground that gives 4 mm a newton with hardly any time constant comes to rest at its depth."""
    structure, theta = lone_rod(SoftGround(), {"compliance_m_per_n": 0.004, "tau_s": 0.02})
    start = lying(structure, v=vector(0.0, 0.0, -0.5).expand(1, 1, 3))
    states = roll(structure, theta, start, 1500, H, every=100)
    assert float(states[-1].p_WB[0, 0, 2]) == pytest.approx(RADIUS - 0.004 * MASS * G / 2, abs=1e-4)
    assert float(states[-1].v_WB.abs().max()) < 1e-3


def track_extra(states: list[State], name: str) -> Tensor:
    """A memory of all states, (B, F, n)."""
    return torch.stack([one.extra[name] for one in states], dim=1)


def test_cap_radius() -> None:
    """A rod with caps 2 mm smaller comes to lie 2 mm lower."""
    structure, theta = lone_rod(CapRadius(), {"change_m": -0.002})
    states = roll(structure, theta, lying(structure), 60, H, every=60)
    assert float(states[-1].p_WB[0, 0, 2]) == pytest.approx(RADIUS - 0.002, abs=1e-9)


def test_slope_agrees_with_a_tilted_ground() -> None:
    """ground_slope is what the engine's tilted plane gives in the ground's own frame."""
    _, theta, _ = threebar_engine()
    x = {"angle_x_rad": theta.mass.new_tensor([[0.05]]), "angle_y_rad": theta.mass.new_tensor([[-0.03]])}
    by_effect = GroundSlope().parameters(x, theta).gravity[0]
    ground = tilted(0.05, -0.03)
    normal = ground.normal / torch.linalg.vector_norm(ground.normal)
    by_ground = ground.parameters(theta).gravity[0]
    assert by_effect[2] == pytest.approx(float(by_ground[2]), rel=1e-12)
    assert float(normal @ theta.gravity[0]) == pytest.approx(float(by_effect[2]), rel=1e-12)
    assert by_effect[:2] == pytest.approx(by_ground[:2].numpy(), rel=2e-3)  # the frames differ by a turn about z


def test_tether() -> None:
    """A free rod falls, and is drawn to the anchor with F / m."""
    anchor = {"anchor_x_m": 0.3, "anchor_y_m": -0.4, "anchor_z_m": 1.0}
    structure, theta = lone_rod(TetherDrag(), {"force_n": 0.26, **anchor})
    start = state(structure, vector(0.0, 0.0, 1.0)[None])
    after = roll(structure, theta, start, 1, H)[-1]
    # 0.5 m away, of which the 2 cm near the anchor take a part.
    pull = 0.26 / MASS * vector(0.3, -0.4, 0.0) / math.hypot(0.5, 0.02)
    assert torch.allclose(after.v_WB[0, 0] / H, pull - vector(0.0, 0.0, G), rtol=0, atol=1e-9)
