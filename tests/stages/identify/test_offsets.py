"""Offsets of start states: what they move, and how much each by its derivative."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from r2s2r_cli.engine import end_caps, pack_state, unpack_state
from r2s2r_cli.engine.flat import state_slots
from r2s2r_cli.stages.identify.offsets import StartSpread, count, displaced, displacement, displacement_jacobian
from tests.support.engine import shaken, threebar_engine

STRUCTURE, THETA, REST = threebar_engine()
RODS, WINCHES = 3, 6


def states(batch: int = 4) -> Tensor:
    """Flat states about the rest pose, moving, (batch, NS)."""
    return pack_state(STRUCTURE, shaken(REST, batch, seed=1, position=0.05, angle=0.7, speed=0.3, spin=2.0))


def offsets(batch: int = 4, *, times: float = 1.0) -> Tensor:
    """Random offsets of the default spread, (batch, offset)."""
    draws = np.random.default_rng(2).normal(size=(batch, count(STRUCTURE)))
    return torch.as_tensor(times * draws * StartSpread().sd(STRUCTURE))


def test_no_offset_is_the_identity() -> None:
    """Zero offsets give the states back."""
    torch.testing.assert_close(displaced(STRUCTURE, states(), 0 * offsets()), states(), rtol=0, atol=1e-15)


def test_the_offsets_between_two_states_lead_from_one_to_the_other() -> None:
    """Also where a quaternion has changed its sign, which is the same turn."""
    n = offsets(times=2.0)
    other = displaced(STRUCTURE, states(), n)
    torch.testing.assert_close(displacement(STRUCTURE, states(), other), n, rtol=0, atol=1e-12)
    slot = state_slots(STRUCTURE)["q_WR"]
    other[:, slot.start : slot.start + slot.size] *= -1.0
    torch.testing.assert_close(displacement(STRUCTURE, states(), other), n, rtol=0, atol=1e-12)


def test_quaternions_stay_unit() -> None:
    """Also after turns of more than a revolution."""
    slot = state_slots(STRUCTURE)["q_WR"]
    moved = displaced(STRUCTURE, states(), offsets(times=60.0))[:, slot.start : slot.start + slot.size]
    norms = torch.linalg.vector_norm(moved.view(-1, RODS, 4), dim=-1)
    torch.testing.assert_close(norms, torch.ones_like(norms), rtol=0, atol=1e-12)


def test_each_offset_moves_its_own() -> None:
    """Places, velocities, rates and rest lengths are added; a turn about the rod's axis leaves its caps, one across the
    rod by 0.1 rad moves them by 0.1 of half the rod; their order is that of the spread."""
    before = unpack_state(STRUCTURE, states(1))
    n = torch.zeros(1, count(STRUCTURE), dtype=torch.float64)
    n[0, 3:6] = torch.tensor([0.01, 0.02, 0.03], dtype=torch.float64)  # place of rod 1
    n[0, 9 + 2] = 0.3  # roll of rod 0
    n[0, 9 + 6] = 0.1  # tilt of rod 2
    n[0, 18:21] = 0.5  # velocity of rod 0
    n[0, 27 + 8] = 2.0  # roll rate of rod 2
    n[0, 36 + 5] = 0.004  # winch 5
    after = unpack_state(STRUCTURE, displaced(STRUCTURE, pack_state(STRUCTURE, before), n))
    caps, moved = (end_caps(THETA, one)[0].view(RODS, 2, 3) for one in (before, after))
    shift = (moved - caps).numpy()
    np.testing.assert_allclose(shift[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(shift[1], [[0.01, 0.02, 0.03]] * 2, atol=1e-12)
    half = float(torch.linalg.vector_norm(caps[2, 1] - caps[2, 0])) / 2
    np.testing.assert_allclose(np.linalg.norm(shift[2], axis=-1), 2 * half * np.sin(0.05), rtol=1e-9)
    np.testing.assert_allclose(shift[2, 0], -shift[2, 1], atol=1e-12)
    assert (after.v_WB - before.v_WB)[0].tolist() == [[0.5] * 3, [0.0] * 3, [0.0] * 3]
    assert (after.w_R - before.w_R)[0].abs().sum().item() == 2.0
    np.testing.assert_allclose((after.rest - before.rest)[0].numpy(), [0, 0, 0, 0, 0, 0.004], atol=1e-15)
    assert torch.equal(after.winding, before.winding)


def test_the_spread_has_the_order_of_the_offsets() -> None:
    """One sd an offset: 3 of place and of turn, of velocity and of rate a rod, then the winches; roll is its own."""
    sd = StartSpread(position=1.0, tilt=2.0, roll=3.0, velocity=4.0, tilt_rate=5.0, roll_rate=6.0, rest=7.0)
    expected = [1] * 9 + [2, 2, 3] * 3 + [4] * 9 + [5, 5, 6] * 3 + [7] * WINCHES
    assert sd.sd(STRUCTURE).tolist() == expected
    assert len(expected) == count(STRUCTURE)


def test_the_derivative_is_the_difference() -> None:
    """Central differences of the flat state by every offset, at offsets that are not 0 and at 0."""
    for times in (1.0, 0.0):
        s, n, eps = states(), offsets(times=times), 1e-6
        found = displacement_jacobian(STRUCTURE, s, n)
        assert found.shape == (4, s.shape[1], count(STRUCTURE))
        for k in range(count(STRUCTURE)):
            step = torch.zeros_like(n)
            step[:, k] = eps
            quotient = (displaced(STRUCTURE, s, n + step) - displaced(STRUCTURE, s, n - step)) / (2 * eps)
            torch.testing.assert_close(found[..., k], quotient, rtol=0, atol=1e-8)
