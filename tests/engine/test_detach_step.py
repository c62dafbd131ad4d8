"""What `Structure.detach` leaves out of the derivative of a step: nothing, the contact geometry, or the impulse."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import Simulator, State, Structure
from r2s2r_cli.engine.structure import Detach
from tests.support.engine import HALF, MASS, RADIUS, G, after, free_rods, parameters, state, vector

H = 1e-3
SPEED = 0.7
MODES = {detach: replace(free_rods(rod_contact=False), detach=detach) for detach in Detach}


def landing(structure: Structure, v: Tensor) -> State:
    """An upright rod with its lower cap on the ground, moving with v [m/s], (3,)."""
    up = vector(0.0, 0.0, 1.0)
    return state(structure, vector(0.0, 0.0, RADIUS + HALF)[None], axis=up, v=v[None, None])


def slope(value: Tensor, of: Tensor) -> list[float]:
    """Derivative of a scalar, zero where no graph leads to it."""
    (found,) = torch.autograd.grad(value, of, allow_unused=True)
    return [0.0] * of.numel() if found is None else found.flatten().tolist()


def test_no_mode_changes_a_value() -> None:
    """Forty steps of a tilted rod that lands and slips agree in all modes: in torch to the last bit, in machine
    code to rounding (a detached product is not fused with the sum that follows)."""
    ends = []
    for structure in MODES.values():
        start = state(
            structure, vector(0.0, 0.0, 0.1)[None], axis=vector(0.8, 0.1, 0.6), v=vector(0.5, 0.2, -1.0)[None, None]
        )
        theta, idle = parameters(structure), torch.zeros(1, 40, 0, dtype=torch.float64)
        ends.append(Simulator(structure, native=False).rollout(theta, start, idle, step=H, every=40).at(-1))
        compiled = after(structure, theta, start, 40, H)
        assert torch.allclose(compiled.p_WB, ends[-1].p_WB, rtol=0, atol=1e-12)
    assert ends[0].p_WB[0, 0, 2].item() < 0.099
    for end in ends[1:]:
        for name in ("p_WB", "q_WR", "v_WB", "w_R"):
            assert torch.equal(getattr(end, name), getattr(ends[0], name))


@pytest.mark.parametrize(("detach", "kept"), [(Detach.NONE, 0.0), (Detach.GEOMETRY, 0.0), (Detach.IMPULSE, 1.0)])
def test_velocity_through_a_landing(detach: Detach, kept: float) -> None:
    """dv'_z/dv_z of a rod that lands (e = 0) is 0: the ground takes it. Impulse detached: 1, free fall."""
    v = vector(0.0, 0.0, -SPEED).requires_grad_()
    end = after(MODES[detach], parameters(MODES[detach]), landing(MODES[detach], v), 1, H)
    assert end.v_WB[0, 0, 2].abs().item() < 1e-6
    assert slope(end.v_WB[0, 0, 2], v) == pytest.approx([0.0, 0.0, kept], abs=1e-6)


@pytest.mark.parametrize("detach", list(Detach))
def test_mass_of_a_landing_rod(detach: Detach) -> None:
    """A rod stops dead whatever its mass. Detached geometry or impulse keep the impulse of the present mass, so that
    dv'_z/dm is v*/m, with the free velocity v* = v_z - g h."""
    mass = torch.tensor([[MASS]], dtype=torch.float64, requires_grad=True)
    end = after(
        MODES[detach], parameters(MODES[detach], mass=mass), landing(MODES[detach], vector(0.0, 0.0, -SPEED)), 1, H
    )
    intended = 0.0 if detach is Detach.NONE else (-SPEED - G * H) / MASS
    assert slope(end.v_WB[0, 0, 2], mass) == pytest.approx([intended], abs=1e-5)


@pytest.mark.parametrize(("detach", "share"), [(Detach.NONE, 0.0), (Detach.GEOMETRY, 0.0), (Detach.IMPULSE, 1.0)])
def test_trend_of_a_rod_held_by_friction(detach: Detach, share: float) -> None:
    """A lying rod that sticks does not follow a sideways pull; with the impulse detached its velocity has the trend h
    of the pull, as in Algorithm 2 of the paper."""
    structure = MODES[detach]
    gravity = torch.tensor([[0.5, 0.0, -G]], dtype=torch.float64, requires_grad=True)
    start = state(structure, vector(0.0, 0.0, RADIUS)[None])
    end = after(structure, parameters(structure, gravity=gravity), start, 1, H)
    assert end.v_WB.abs().max().item() < 1e-6
    assert slope(end.v_WB[0, 0, 0], gravity)[0] == pytest.approx(share * H, abs=1e-8)
