"""Losses of the three-bar robot in closed loop: derivatives, detachment, signs, and what each loss compares."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
import torch

from r2s2r_cli.engine import Detach, State
from r2s2r_cli.stages.identify.free import select
from r2s2r_cli.stages.identify.paper import (
    Demonstration,
    Flight,
    Loss,
    Norm,
    Preset,
    compare,
    fly,
    fly_side_by_side,
    paired,
    preset,
    seen,
    simulated,
    synthetic,
)
from r2s2r_cli.stages.identify.paper.losses import between
from tests.support.robots import rested, subject

TRUTH = 0.5
TARGETS = np.array([[0.2, 1.0, 0.4, 0.5, 1.0, 0.6], [1.0, 0.5, 1.0, 1.0, 0.3, 1.0]])
"""Two shapes, each two thirds of a second at the true motor speed."""


@lru_cache
def made() -> Preset:
    """The paper's synthetic task: only the motor speed is free; whole derivatives, so that quotients can check them."""
    own = preset(subject().robot, select(["motor_speed"], subject().robot), detach=Detach.NONE)
    assert own.numbers.structure == subject().structure
    return replace(own, world=replace(own.world, simulator=subject().simulator))  # compiled once a session


def start() -> State:
    """The robot at rest."""
    return rested().state


@lru_cache
def flown(speed: float) -> Flight:
    """The closed loop at a motor speed."""
    return fly(made().world, made().numbers.theta(np.array([speed])), start(), TARGETS)


@lru_cache
def demo() -> Demonstration:
    """Motor speed 0.5."""
    truth = flown(TRUTH)
    p_WE = seen(made().world, made().numbers.theta(np.array([TRUTH])), truth.states)
    return synthetic(made().world.simulator, truth, p_WE.numpy(), TARGETS)


def parts(loss: Loss, speed: float, flight: Flight, **options: Any) -> tuple[torch.Tensor, torch.Tensor]:
    """The motor speed and the loss of every window."""
    x = torch.tensor([speed], dtype=torch.float64, requires_grad=True)
    return x, compare(loss, made().world, made().numbers.theta(x), flight, demo(), **options).value.parts


def sizes(loss: Loss, speed: float) -> torch.Tensor:
    """The loss of every window of the closed loop at a motor speed [m^2]."""
    return parts(loss, speed, flown(speed))[1].detach()


def slopes(loss: Loss, speed: float, flight: Flight, **options: Any) -> list[float]:
    """Derivative of each window's loss by the motor speed."""
    x, found = parts(loss, speed, flight, **options)
    return [float(torch.autograd.grad(part, x, retain_graph=True)[0]) for part in found]


@pytest.mark.parametrize("loss", [Loss.KEY_FRAME, Loss.ALL_STEP, Loss.LAST_STEP, Loss.NAIVE])
def test_losses_vanish_at_the_truth(loss: Loss) -> None:
    """Every loss that starts where the run started is 0 for the true motor speed, and not beside it."""
    assert float(sizes(loss, TRUTH).max()) < 1e-14
    assert float(sizes(loss, 0.8).min()) > 1e-6


def test_the_replay_is_the_closed_loop() -> None:
    """Windows simulated again with the commands of the loop come where the loop came."""
    flight = flown(0.8)
    keys = paired(flight, demo())
    caps = seen(made().world, made().numbers.theta(np.array([0.8])), flight.states)
    at = (keys.start_sim + keys.tau) / made().world.pid.period
    defects = between(caps, at) - torch.as_tensor(demo().p_WE[keys.frame])
    _, found = parts(Loss.KEY_FRAME, 0.8, flight)
    assert torch.allclose(found.detach(), (defects**2).sum(-1).mean(-1), rtol=0, atol=1e-10)


@pytest.mark.parametrize(("speed", "sign"), [(0.3, -1), (0.4, -1), (0.65, 1), (0.8, 1)])
def test_key_frames_pull_towards_the_truth(speed: float, sign: int) -> None:
    """Each segment's derivative has the sign of the error of the motor speed."""
    assert [np.sign(slope) for slope in slopes(Loss.KEY_FRAME, speed, flown(speed))] == [sign] * 2


def test_derivatives_of_detached_windows() -> None:
    """Central differences of a window, its start and its commands held: what detaching means, window by window."""
    flight, eps = flown(0.65), 1e-5
    above, below = (parts(Loss.KEY_FRAME, 0.65 + d, flight)[1].detach() for d in (eps, -eps))
    quotients = ((above - below) / (2 * eps)).tolist()
    assert slopes(Loss.KEY_FRAME, 0.65, flight) == pytest.approx(quotients, rel=2e-2)


def test_attached_windows_carry_the_first_into_the_second() -> None:
    """Attached, the first window's derivative is the same and the second's is another: that of one long simulation."""
    flight, eps = flown(0.65), 1e-5
    cut, joined = slopes(Loss.KEY_FRAME, 0.65, flight), slopes(Loss.LAST_STEP, 0.65, flight)
    assert joined[0] == pytest.approx(cut[0], rel=1e-6)
    assert abs(joined[1] / cut[1] - 1) > 0.05
    above, below = (parts(Loss.LAST_STEP, 0.65 + d, flight)[1].detach() for d in (eps, -eps))
    assert joined == pytest.approx(((above - below) / (2 * eps)).tolist(), rel=2e-2)
    again = slopes(Loss.LAST_STEP, 0.65, flight, attached=False)
    assert again == pytest.approx(cut, rel=1e-9)


def test_multiple_shooting_starts_from_observed_states() -> None:
    """At the truth its defects are those of velocities from differences, under 2 mm; a wrong speed leaves more."""
    at_truth, beside = sizes(Loss.MULTIPLE_SHOOTING, TRUTH), sizes(Loss.MULTIPLE_SHOOTING, 0.8)
    assert len(at_truth) == 4
    assert float(at_truth.mean()) < 4e-6
    assert float(beside.mean()) > 10 * float(at_truth.mean())


def test_command_replay_needs_no_mask() -> None:
    """Recorded commands give the durations: the truth comes back, and the mask says that it does not apply."""
    theta = made().numbers.theta(torch.tensor([TRUTH], dtype=torch.float64))
    flight = simulated(made().world, theta, demo(), start(), closed_loop=False)
    found = compare(Loss.KEY_FRAME, made().world, theta, flight, demo())
    assert found.value.total.item() < 1e-14
    assert found.mask is not None
    assert "not applicable" in found.mask.words
    assert found.value.kept.all()


def test_interpolation_is_linear_and_differentiable() -> None:
    """Rows of a line at fractional ticks, also at the last one; weights are the derivatives."""
    rows = torch.tensor([[0.0], [2.0], [6.0]], dtype=torch.float64, requires_grad=True)
    found = between(rows, np.array([0.25, 1.0, 2.0]))
    assert found[:, 0].tolist() == pytest.approx([0.5, 2.0, 6.0])
    (weights,) = torch.autograd.grad(found[0, 0], rows)
    assert weights[:, 0].tolist() == pytest.approx([0.75, 0.25, 0.0])


def test_side_by_side_each_flies_as_if_alone() -> None:
    """Two motor speeds in one batch: the faster is through first and cut there, both are what they are alone."""
    both = fly_side_by_side(made().world, made().numbers.theta(np.array([[0.5], [0.8]])), start(), TARGETS)
    for flight, alone in zip(both, (flown(0.5), flown(0.8)), strict=True):
        assert np.array_equal(flight.control, alone.control)
        assert torch.allclose(flight.states, alone.states, rtol=0, atol=1e-9)
    assert len(both[0].t) > len(both[1].t)


def test_distances_pull_like_squares() -> None:
    """The norm changes the size of a derivative, not its sign; at the truth the distance is 0 and its slope finite."""
    slow, fast = (slopes(Loss.KEY_FRAME, v, flown(v), norm=Norm.DISTANCE) for v in (0.4, 0.65))
    assert (np.sign(slow).tolist(), np.sign(fast).tolist()) == ([-1, -1], [1, 1])
    x, found = parts(Loss.KEY_FRAME, TRUTH, flown(TRUTH), norm=Norm.DISTANCE)
    assert float(found.detach().max()) < 1e-7
    assert np.isfinite(float(torch.autograd.grad(found.sum(), x)[0]))
