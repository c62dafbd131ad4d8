"""Friction where the winched cables leave their rods: Euler and Eytelwein, and whose number is whose."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.effects.capstan_friction import SLIDE_M, CapstanFriction
from r2s2r_cli.engine import read
from r2s2r_cli.engine.hooks import CableTerms
from tests.support.engine import simulator
from tests.support.variants import Variant, pair, plugged, robot

EFFECT, H = CapstanFriction(), 1e-3
K = 2000.0


def column(*values: float) -> Tensor:
    """Numbers (1, n)."""
    return torch.tensor([values], dtype=torch.float64)


def pulled(way: Tensor, rate: float, wrap: Tensor, passive: Tensor, stretch: float = 0.005) -> tuple[Tensor, Tensor]:
    """Forces [N] and directions of cables that all change their length at this rate [m/s] within 1 ms."""
    one = torch.ones_like(passive)
    terms = CableTerms(stretch * one, rate * one, K * max(stretch, 0.0) * one, K * one, passive)
    force, z = EFFECT.cable({"wrap": wrap}, {"way": way}, terms, column(H))
    return force, z["way"]


def test_euler_and_eytelwein() -> None:
    """Once it slides, exp(-wrap) of the tension gets through while the cable shortens, exp(+wrap) of it while it
    lengthens: between both ways lies exp(2 wrap)."""
    still = column(0.0)
    out, _ = pulled(still, 100.0, column(0.3), column(0.0))
    in_, _ = pulled(still, -100.0, column(0.3), column(0.0))
    assert float(out) == pytest.approx(K * 0.005 * math.exp(0.3), rel=1e-12)
    assert float(in_) == pytest.approx(K * 0.005 * math.exp(-0.3), rel=1e-12)


def test_it_turns_round_within_the_slide() -> None:
    """A reversal of the whole friction takes motion and no time: half the slide undoes half of it, and two more are
    all of it to 10 %; a cable that stands keeps it."""
    wrap, passive = column(0.2), column(0.0)
    _, way = pulled(column(1.0), -0.5 * SLIDE_M / H, wrap, passive)
    assert float(way) == pytest.approx(0.5, abs=1e-12)
    held, same = pulled(way, 0.0, wrap, passive)
    assert torch.equal(way, same)
    assert float(held) == pytest.approx(K * 0.005 * math.exp(0.2 * 0.5), rel=1e-12)
    _, turned_ = pulled(way, -2.0 * SLIDE_M / H, wrap, passive)
    assert -1.0 < float(turned_) < -0.9


def test_whose_number_is_whose() -> None:
    """The k-th number is that of the k-th winched cable, in every row of a batch; passive cables have none."""
    passive = column(1.0, 0.0, 1.0, 0.0, 0.0).expand(2, -1)
    wrap = torch.tensor([[0.1, 0.2, 0.3], [0.0, 0.4, 0.05]], dtype=torch.float64)
    force, _ = pulled(torch.ones_like(passive), 0.0, wrap, passive)
    factors = torch.zeros_like(passive)
    factors[:, [1, 3, 4]] = wrap
    assert torch.allclose(force, 10.0 * torch.exp(factors), rtol=1e-14)


def test_a_slack_cable() -> None:
    """It does not pull, and keeps its direction however it moves."""
    force, way = pulled(column(0.4), 3.0, column(0.3), column(0.0), stretch=-0.001)
    assert float(force) == 0.0
    assert float(way) == 0.4


def test_it_takes_energy() -> None:
    """A cable pulled out and let back again and again takes energy in every round: with a winch that keeps its pull,
    the integral of the law over both ways, by a long stroke 2 sinh(wrap) times pull and stroke; with a winch that
    holds, some as well."""
    stroke, n, wrap = 10 * SLIDE_M, 1000, 0.2
    steps = torch.cat([torch.full((n,), stroke / n), torch.full((n,), -stroke / n)]).double().tolist()
    for follows in (True, False):
        way, stretch, force, taken = column(0.0), 0.01, column(0.0), []
        for _ in range(3):
            work = 0.0
            for ds in steps:
                before, stretch = force, stretch + (0.0 if follows else ds)
                force, way = pulled(way, ds / H, column(wrap), column(0.0), stretch=stretch)
                work += 0.5 * float(before + force) * ds
            taken.append(work)
        assert min(taken[1:]) > 0.0
        if follows:
            v = torch.linspace(0.0, stroke / SLIDE_M - 1.0, 20001, dtype=torch.float64)
            turning = (2.0 - 2.0 * math.cosh(wrap)) / wrap  # back to the middle, once each way
            there = float(torch.trapezoid(2.0 * torch.sinh(wrap * torch.tanh(v)), v))
            assert taken[2] == pytest.approx(K * 0.01 * SLIDE_M * (turning + there), rel=1e-4)
            assert 0.7 < taken[2] / (K * 0.01 * stroke * 2 * math.sinh(wrap)) < 1.0


def test_what_slides_is_never_pushed() -> None:
    """On a random path with a winch that works, the friction is against the motion wherever it has turned round."""
    generator = torch.Generator().manual_seed(2)
    way, against = column(0.0), 0
    for _ in range(500):
        rate, stretch = (0.3 * torch.randn(2, generator=generator, dtype=torch.float64)).tolist()
        force, way = pulled(way, rate, column(0.3), column(0.0), stretch=abs(stretch) / 30)
        friction = float(force) - K * abs(stretch) / 30
        assert float(way) * friction >= 0.0
        if float(way) * rate > 0:
            assert friction * rate >= 0.0
            against += 1
    assert against > 50


def test_the_engine_pulls_with_it() -> None:
    """The tension of the winched cable of two rods is the spring's times exp(wrap way); the others' is the same."""
    plain = pair(rod_contact=False)
    length = read(plain.structure, plain.theta, plain.start).length
    plain = replace(
        plain, start=replace(plain.start, rest=length[:, [1]] - 0.004),
        theta=replace(plain.theta, rest=length[:, [0, 2]] - 0.004, damping=torch.zeros_like(plain.theta.damping)),
    )  # fmt: skip
    model = plugged(plain, EFFECT, on=False)
    theta = model.theta.with_values({"capstan_friction.wrap": column(0.25)})
    way = replace(model.start, extra={"capstan_friction.way": column(0.7, 0.7, 0.7)})
    before, now = (read(model.structure, theta, one).tension for one in (model.start, way))
    assert torch.allclose(now, before * torch.exp(0.25 * 0.7 * column(0.0, 1.0, 0.0)), rtol=1e-12)


@pytest.mark.slow
def test_lengths_depend_on_where_they_came_from() -> None:
    """The 3-bar robot with its winches at one length each, reached by reeling in or by letting out: without friction it
    comes to the same shape, with it the cables are longer after reeling in, the more the more they are wrapped."""
    model = plugged(robot(), EFFECT, on=False)
    apart = [float(lengths(model, wrap, 1.0) - lengths(model, wrap, -1.0)) for wrap in (0.0, 0.2, 0.4)]
    assert abs(apart[0]) < 2e-5
    assert 5 * abs(apart[0]) < apart[1] < apart[2]


def lengths(model: Variant, wrap: float, way: float) -> Tensor:
    """Mean length of the winched cables [m], 1.5 s after they reached 6 mm less than in the rest pose, from the other
    side of that: way +1 reels in, from the rest pose; -1 lets out, from 12 mm less."""
    theta = model.theta.with_values({"capstan_friction.wrap": torch.full((1, 6), wrap, dtype=torch.float64)})
    speed = float(theta.speed_in[0, 0])
    rows = [1.0] if way > 0 else [1.0, 1.0, -1.0]
    commands = torch.tensor([*rows, *[0.0] * 15], dtype=torch.float64)[None, :, None].expand(1, -1, 6).clone()
    commands[:, : len(rows)] *= 0.006 / (0.1 * speed)
    run = simulator(model.structure).rollout(theta, model.start, commands, step=1e-3, hold=100, every=100)
    last = run.at(-1)
    assert torch.allclose(last.rest, model.start.rest - 0.006, rtol=0, atol=1e-9)
    return read(model.structure, theta, last).length[0, :6].mean()
