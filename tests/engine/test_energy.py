"""Without a motor nothing gains energy: 10,000 random states of the robot, in flight and on the ground."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from r2s2r_cli.engine import Parameters, State, Structure
from r2s2r_cli.engine.reading import energy
from tests.support.engine import lowest_gap, shaken, simulator, threebar_engine

STATES = 10_000
DURATION = 8e-3
"""[s] of motion that is looked at."""


def random_robots() -> tuple[Structure, Parameters, State]:
    """Robots thrown about at random, half with one cap exactly on the ground, the others up to 0.1 m above; rest
    lengths, friction and restitution 0 to 1, and damping 0 to 4 N s/m at random."""
    structure, theta, rest = threebar_engine()
    generator = torch.Generator().manual_seed(11)

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand(STATES, *shape, generator=generator, dtype=torch.float64)

    start = shaken(rest, STATES, seed=12, position=0.004, angle=0.1, speed=0.3, spin=1.0)
    start = replace(start, rest=start.rest + uniform(-0.01, 0.01, 6))
    above = torch.where(torch.arange(STATES) % 2 == 0, torch.zeros(STATES, dtype=torch.float64), uniform(0.0, 0.1))
    lift = above - lowest_gap(theta, start)
    start = replace(start, p_WB=start.p_WB + lift[:, None, None] * torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64))
    theta = theta.map(lambda x: x.expand(STATES, *x.shape[1:]))
    friction = uniform(0.0, 1.0, 1, 1).expand(-1, 3, 2)
    damping = theta.damping * uniform(0.0, 1.0, 1)
    return structure, replace(theta, friction=friction, damping=damping, restitution=uniform(0.0, 1.0, 1)), start


def growth(structure: Structure, theta: Parameters, start: State, h: float) -> Tensor:
    """Largest growth of the energy above that of the start within DURATION [J], (B,)."""
    n = round(DURATION / h)
    commands = start.p_WB.new_zeros(len(start.p_WB), 1, structure.n_actuated)
    run = simulator(structure).rollout(theta, start, commands, step=h, hold=n, every=n // 4, substeps=1)
    E = torch.stack([energy(structure, theta, run.at(k)) for k in range(5)], dim=1)
    return (E - E[:, :1]).amax(1)


def stored(theta: Parameters, start: State, E: Tensor) -> Tensor:
    """Kinetic and elastic energy [J], (B,)."""
    return E + (theta.mass[..., None] * theta.gravity[:, None] * start.p_WB).sum((-2, -1))


def test_energy_grows_by_no_more_than_a_bound_that_vanishes_with_the_step() -> None:
    """Over 8 ms no state of the 10,000 gains more than 60/s times the step of its kinetic and elastic energy (mean
    1.5 J), and half the step leaves at most 0.6 of the largest growth."""
    structure, theta, start = random_robots()
    whole = stored(theta, start, energy(structure, theta, start))
    steps = (1e-3, 5e-4, 2.5e-4)
    worst = [float((growth(structure, theta, start, h) / whole).max()) for h in steps]
    assert all(w < 60.0 * h for w, h in zip(worst, steps, strict=True))
    assert worst[1] < 0.6 * worst[0]
    assert worst[2] < 0.6 * worst[1]
