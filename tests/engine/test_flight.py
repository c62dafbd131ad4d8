"""Rods that touch nothing: free fall, torque-free rotation, and what is conserved."""

from __future__ import annotations

import math

import pytest
import roma
import torch
from torch import Tensor

from r2s2r_cli.engine import State, Structure
from r2s2r_cli.engine.reading import energy, momentum
from tests.support.engine import AXIAL, TRANSVERSE, G, after, free_rods, parameters, roll, state, vector

ROD = free_rods(rod_contact=False)
BOX = free_rods(rod_contact=False, axial=False)
"""A rod whose inertia is that of no body of revolution."""
BOX_INERTIA = torch.diag(vector(3.0e-3, 2.0e-3, 1.2e-3))
WEIGHTLESS = vector(0.0, 0.0, 0.0)


def spinning(structure: Structure, w: Tensor, *, tilt: Tensor | None = None) -> State:
    """A rod 1 m up that spins with w, rod axes [rad/s]."""
    return state(structure, vector(0.0, 0.0, 1.0).expand(1, 1, 3), axis=tilt, w=w)


def test_free_fall_is_exact_up_to_the_step() -> None:
    """Velocities are v0 + g t to rounding; positions differ from the parabola by g h t / 2 and by nothing else."""
    theta, v0, h, n = parameters(ROD), vector(0.4, -0.3, 1.2), 1e-3, 300
    end = after(ROD, theta, state(ROD, vector(0.0, 0.0, 5.0).expand(1, 1, 3), v=v0, w=vector(0.0, 0.0, 3.0)), n, h)
    t, g = n * h, vector(0.0, 0.0, -G)
    assert torch.allclose(end.v_WB[0, 0], v0 + g * t, rtol=0, atol=1e-12)
    parabola = vector(0.0, 0.0, 5.0) + v0 * t + g * t * t / 2
    assert torch.allclose(end.p_WB[0, 0], parabola + g * h * t / 2, rtol=0, atol=1e-12)


def test_free_fall_does_not_depend_on_mass() -> None:
    """Rods of all masses and inertias fall alike."""
    theta = parameters(ROD, mass=vector(0.01, 0.13, 50.0)[:, None])
    start = state(ROD, vector(0.0, 0.0, 5.0).expand(3, 1, 3))
    z = after(ROD, theta, start, 50, 1e-3).p_WB[:, 0, 2]
    assert float(z.max() - z.min()) < 1e-14


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_rotation_about_a_principal_axis(axis: int) -> None:
    """Spin about a principal axis stays as it is, and turns by 2 atan(h w / 2) a step: (h w)^2 / 12 less than w h."""
    rate, h, n = 9.0, 1e-3, 300
    w = vector(*(rate if k == axis else 0.0 for k in range(3)))
    start = spinning(BOX, w, tilt=vector(0.3, 0.4, 0.6))
    end = after(BOX, parameters(BOX, inertia=BOX_INERTIA, gravity=WEIGHTLESS), start, n, h)
    assert torch.allclose(end.w_R[0, 0], w, rtol=0, atol=1e-12)
    turn = roma.unitquat_to_rotvec(roma.quat_product(roma.quat_conjugation(start.q_WR), end.q_WR))[0, 0]
    assert float(turn[axis]) == pytest.approx(n * 2 * math.atan(h * rate / 2), abs=1e-11)
    assert float(turn[axis]) == pytest.approx(n * h * rate, rel=(h * rate) ** 2 / 10)


def test_free_precession_of_a_rod() -> None:
    """The spin of a body of revolution turns, in rod axes, at (It - Ia) / It of the axial rate, and its axis precesses
    about the angular momentum at |L| / It; what is left shrinks at least as fast as the step."""
    w, n, h = vector(2.0, 0.0, 30.0), 200, torch.tensor([[1e-3], [5e-4], [2.5e-4]], dtype=torch.float64)
    theta, t = parameters(ROD, gravity=WEIGHTLESS), n * h
    start = state(ROD, torch.ones(3, 1, 3, dtype=torch.float64), w=w)
    end = roll(ROD, theta, start, n, h, every=n)[-1]
    angle = (TRANSVERSE - AXIAL) / TRANSVERSE * 30.0 * t
    turned = torch.cat([2.0 * torch.cos(angle), -2.0 * torch.sin(angle), torch.full_like(angle, 30.0)], dim=1)
    spin = roma.rotvec_to_rotmat(momentum(theta, start)[1] / TRANSVERSE * t)
    axis = torch.einsum("bij,bj->bi", spin, roma.unitquat_to_rotmat(start.q_WR)[:, 0, :, 2])
    for found, exact in ((end.w_R[:, 0], turned), (roma.unitquat_to_rotmat(end.q_WR)[:, 0, :, 2], axis)):
        # Errors a second of flight, for steps of 1, 1/2 and 1/4 ms.
        error = torch.linalg.vector_norm(found - exact, dim=1) / t[:, 0]
        assert float(error[0]) < 0.1
        assert float(error[0] / error[1]) > 1.8
        assert float(error[1] / error[2]) > 1.8


def drift(structure: Structure, inertia: Tensor, w: Tensor, h: float) -> tuple[float, float]:
    """Relative changes of energy and of the angular momentum vector over 0.2 s of torque-free flight."""
    theta = parameters(structure, inertia=inertia, gravity=WEIGHTLESS)
    start = spinning(structure, w, tilt=vector(0.3, 0.4, 0.6))
    end = after(structure, theta, start, round(0.2 / h), h)
    E = [float(energy(structure, theta, x)) for x in (start, end)]
    L = [momentum(theta, x)[1][0] for x in (start, end)]
    return abs(E[1] / E[0] - 1), float(torch.linalg.vector_norm(L[1] - L[0]) / torch.linalg.vector_norm(L[0]))


@pytest.mark.parametrize(
    ("structure", "inertia"), [(ROD, torch.diag(vector(1.5e-3, 1.5e-3, 4e-5))), (BOX, BOX_INERTIA)]
)
def test_torque_free_rotation_keeps_energy_and_angular_momentum(structure: Structure, inertia: Tensor) -> None:
    """A tumbling body at 10 rad/s: energy and the angular momentum in the world change by parts in a million and in a
    thousand at 1 ms, and the less the shorter the step (second and first order, or better)."""
    coarse, fine = (drift(structure, inertia, vector(4.0, 0.3, 9.0), h) for h in (2e-3, 1e-3))
    assert fine[0] < 2e-6
    assert fine[1] < 4e-3
    assert coarse[0] / fine[0] > 3.5
    assert coarse[1] / fine[1] > 1.8


def test_linear_momentum_moves_by_gravity_alone() -> None:
    """A tumbling rod's momentum is m v0 + m g t, to rounding; its angular momentum about its own centre is not touched
    by gravity."""
    theta, n, h = parameters(ROD), 200, 1e-3
    start = state(ROD, vector(0.0, 0.0, 9.0).expand(1, 1, 3), v=vector(1.0, 2.0, 3.0), w=vector(3.0, 2.0, 8.0))
    states = roll(ROD, theta, start, n, h, every=n)
    change = momentum(theta, states[-1])[0] - momentum(theta, start)[0]
    assert torch.allclose(change, theta.mass * vector(0.0, 0.0, -G) * n * h, rtol=0, atol=1e-13)
    weightless = after(ROD, parameters(ROD, gravity=WEIGHTLESS), start, n, h)
    assert torch.allclose(weightless.q_WR, states[-1].q_WR, rtol=0, atol=1e-14)
