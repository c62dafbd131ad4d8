"""Inner friction of the tendons: its closed forms, and that it only ever takes energy."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest
import torch
from torch import Tensor

from r2s2r_cli.effects.tendon_hysteresis import TendonHysteresis
from r2s2r_cli.effects.turned import turned
from r2s2r_cli.engine import energy, read
from r2s2r_cli.engine.hooks import CableTerms
from tests.support.engine import after
from tests.support.variants import pair, plugged

K, FORCE, LENGTH = 100.0, 0.8, 0.004
EFFECT = TendonHysteresis()


def column(*values: float) -> Tensor:
    """Numbers (1, n)."""
    return torch.tensor([values], dtype=torch.float64)


X = {"force_n": column(FORCE), "length_m": column(LENGTH)}


def along(stretches: Tensor, *, h: float = 1e-3, passive: float = 1.0, turn: float = 0.0) -> tuple[Tensor, Tensor]:
    """Force [N] and memory after each piece of a path of stretches (n,) [m], (n - 1,) each."""
    z, found = {"turn": column(turn)}, []
    for last, now in pairwise(stretches):
        terms = CableTerms(
            now.reshape(1, 1), ((now - last) / h).reshape(1, 1), K * torch.relu(now).reshape(1, 1), column(K),
            column(passive),
        )  # fmt: skip
        force, z = EFFECT.cable(X, z, terms, column(h))  # type: ignore[assignment]
        found.append(torch.cat([force, z["turn"]], dim=1)[0])
    force, turn_ = torch.stack(found).unbind(1)
    return force, turn_


def path(*corners: float, n: int = 40) -> Tensor:
    """Straight pieces of n steps between stretches [m]."""
    pieces = [torch.linspace(a, b, n + 1, dtype=torch.float64)[1:] for a, b in pairwise(corners)]
    return torch.cat([torch.tensor(corners[:1], dtype=torch.float64), *pieces])


def test_closed_form_there_and_back() -> None:
    """Stretched from rest the friction is force tanh(s / length); after the turn it falls in a line to 0, and nears the
    other side as tanh of what is left of the way."""
    stretches = path(0.02, 0.03, 0.018)
    force, _ = along(stretches)
    there = (stretches[1:41] - 0.02) / LENGTH
    assert torch.allclose(force[:40] - K * stretches[1:41], FORCE * torch.tanh(there), rtol=0, atol=1e-12)
    back = (0.03 - stretches[41:]) / LENGTH
    top = math.tanh(0.01 / LENGTH)
    expected = torch.where(back < top, top - back, -torch.tanh(back - top))
    assert torch.allclose(force[40:] - K * stretches[41:], FORCE * expected, rtol=0, atol=1e-12)


def test_neither_speed_nor_step_counts() -> None:
    """The same path, ten times as fast or in a twentieth of the steps: the same force and memory at its corners."""
    corners = (0.02, 0.027, 0.024, 0.031, 0.015)
    ends = [along(path(*corners, n=n), h=h) for n, h in ((40, 1e-3), (40, 1e-4), (2, 1e-3))]
    for force, turn in ends[1:]:
        every = len(force) // 4
        assert torch.allclose(force[every - 1 :: every], ends[0][0][39::40], rtol=0, atol=1e-12)
        assert torch.allclose(turn[every - 1 :: every], ends[0][1][39::40], rtol=0, atol=1e-13)


def test_it_takes_energy_on_every_path() -> None:
    """On any path the friction takes no less work than its own spring, force length z^2 / 2, stores: what is lost grows
    with every piece, and a closed loop costs energy."""
    generator = torch.Generator().manual_seed(0)
    steps = 0.003 * torch.randn(4000, generator=generator, dtype=torch.float64)
    u, z, lost, stored = steps / LENGTH, column(0.0), [0.0], 0.0
    for du in u:
        z = turned(z, du.reshape(1, 1))
        now = 0.5 * float(z) ** 2
        lost.append(lost[-1] + float(z * du) - (now - stored))
        stored = now
    assert min(b - a for a, b in pairwise(lost)) > -1e-14
    assert lost[-1] > 10.0


def test_a_steady_loop() -> None:
    """Back and forth by 2 a, a far beyond the length: each time 2 force length (ln cosh(2 a / length - 1) - 1/2)."""
    a = 5 * LENGTH
    stretches = path(0.05 - a, 0.05 + a, 0.05 - a, 0.05 + a, n=2000)
    force, _ = along(stretches)
    steps = torch.diff(stretches)[2000:]
    # Trapezoids; the spring's own work cancels.
    work = float((0.5 * (force[1999:-1] + force[2000:]) * steps).sum())
    assert work == pytest.approx(2 * FORCE * LENGTH * (math.log(math.cosh(9.0)) - 0.5), rel=1e-4)


def test_it_is_bounded_and_never_pushes() -> None:
    """Whatever the motion, the memory stays within -1 and 1, and a cable that is all but slack does not push."""
    u = 50.0 * torch.randn(1, 1000, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    z = torch.rand_like(u) * 2 - 1
    assert float(turned(z, u).abs().max()) <= 1.0
    force, turn = along(path(0.02, 0.001))
    assert float(turn[-1]) < -0.99
    assert float(force.min()) == 0.0
    assert float(force.max()) > 1.0


def test_slack_and_winched_cables() -> None:
    """A slack cable keeps its memory; a winched one pulls as its spring does."""
    _, turn = along(torch.tensor([-0.02, -0.01, -0.03], dtype=torch.float64), turn=0.3)
    assert turn.tolist() == [0.3, 0.3]
    stretches = path(0.01, 0.03)
    force, turn = along(stretches, passive=0.0)
    assert torch.equal(force, K * stretches[1:])
    assert float(turn[-1]) > 0.9  # it is followed all the same


def test_derivatives_of_the_memory() -> None:
    """Those of central differences on all branches, finite and of motion at rest, and 0 at the bound."""
    z = column(-0.9, -0.4, 0.2, 0.7, -0.2, 0.9, 0.3, -0.6)
    u = column(0.3, 2.0, 0.5, 0.1, -0.3, -0.4, -1.5, -0.2)
    for k, at in enumerate((z, u)):
        moved = at.clone().requires_grad_()
        (ours,) = torch.autograd.grad(turned(*((moved, u) if k == 0 else (z, moved))).sum(), moved)
        d = 1e-6
        up, down = (turned(*((at + e, u) if k == 0 else (z, at + e))) for e in (d, -d))
        assert torch.allclose(ours, (up - down) / (2 * d), rtol=1e-8, atol=1e-9)
    still = torch.zeros(2, 1, dtype=torch.float64, requires_grad=True)
    (at_rest,) = torch.autograd.grad(turned(still[0], still[1]).sum(), still)
    assert at_rest.flatten().tolist() == [1.0, 1.0]
    end = column(1.0)
    moved = column(0.5).requires_grad_()
    (beyond,) = torch.autograd.grad(turned(end, moved).sum(), moved)
    assert float(beyond) == 0.0


def test_a_swing_dies_away() -> None:
    """Two rods that swing between undamped cables in the air keep their energy without the effect; with it they lose
    energy, but no more than they have."""
    plain = pair(rod_contact=False)
    length = read(plain.structure, plain.theta, plain.start).length
    theta = replace(
        plain.theta, gravity=torch.zeros_like(plain.theta.gravity), damping=torch.zeros_like(plain.theta.damping),
        rest=length[:, [0, 2]] - 0.006, stiffness=torch.full_like(plain.theta.stiffness, 300.0),
    )  # fmt: skip
    plain = replace(plain, theta=theta, start=replace(plain.start, rest=length[:, [1]] - 0.001))
    left = []
    for force in (0.0, 0.5):
        model = plugged(plain, EFFECT, on=False)
        theta = model.theta.with_values({"tendon_hysteresis.force_n": column(force)})
        end = after(model.structure, theta, model.start, 200, 2.5e-4)
        left.append([float(energy(model.structure, theta, one)) for one in (model.start, end)])
    assert left[0][1] == pytest.approx(left[0][0], rel=0.02)
    assert 0.0 < left[1][1] < 0.9 * left[0][1]
