"""The engine against an independent penalty integration of the same equations at 2 us (tests/support/penalty.py)."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import lru_cache

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import Parameters, State, Structure, end_caps
from tests.support.engine import (
    RADIUS,
    after,
    free_rods,
    parameters,
    random_gait,
    shaken,
    simulate,
    simulator,
    state,
    threebar_engine,
    vector,
)  # fmt: skip
from tests.support.penalty import Penalty

GAITS, ROWS = 16, 6
"""Random gaits and steps of 1 s of each: 96 windows a seed."""
FRAMES = 25
TOUCH = 5e-4
"""[m] a cap this near to the ground stands on it."""


def robot() -> tuple[Structure, Parameters, State]:
    """The three-bar robot without contact between rods, which the penalty integration does not know."""
    structure, theta, rest = threebar_engine()
    return replace(structure, rod_contact=False), theta, rest


def joined(states: list[State]) -> State:
    """One batch of all."""
    names = [f.name for f in fields(State) if f.name != "extra"]
    return State(**{name: torch.cat([getattr(s, name) for s in states]) for name in names})


def windows(seed: int) -> tuple[State, Tensor]:
    """States at every second of random gaits, one command of a second each, and those commands (B, 1, actuated)."""
    structure, theta, rest = robot()
    settled = simulate(structure, theta, rest, 3000, 1e-3).at(-1)
    u = random_gait(ROWS, 6, batch=GAITS, seed=seed)
    run = simulator(structure).rollout(theta, settled, u, hold=1000, every=1000, substeps=1)
    starts = [run.at(k) for k in range(ROWS)]
    return joined(starts), torch.cat([u[:, [k]] for k in range(ROWS)])


@lru_cache(maxsize=1)
def compared() -> tuple[dict[float, Tensor], Tensor]:
    """Errors [m] at the end of 288 windows by engine step [s], (window,), and the windows that the robot spends on its
    feet: on three caps or more for nine tenths of the time. The others tip over or rock on an edge."""
    structure, theta, _ = robot()
    parts = [windows(seed) for seed in (1, 2, 3)]
    start = joined([s for s, _ in parts])
    u = torch.cat([x for _, x in parts])
    truth = Penalty(structure, theta).caps(start, u, seconds=1.0, frames=FRAMES)
    standing = ((truth[..., 2] - RADIUS < TOUCH).sum(-1) >= 3).to(torch.float64).mean(1) >= 0.9
    errors = {}
    for h in (1e-3, 2.5e-4):
        run = simulator(structure).rollout(theta, start, u, step=h, hold=round(1 / h), every=round(1 / h), substeps=1)
        errors[h] = torch.linalg.vector_norm(run.end_caps()[:, -1] - truth[:, -1], dim=-1).amax(1)
    return errors, standing


@pytest.mark.slow
def test_random_gait_steps_agree_with_the_penalty_integration() -> None:
    """288 random gait steps of 1 s (median motion 8 cm) at 1 ms: the median of the largest cap error is below 0.3 mm
    over all; where the robot stays on its feet 98 % are below 1 mm."""
    errors, standing = compared()
    assert float(errors[1e-3].median()) < 3e-4
    assert float(standing.to(torch.float64).mean()) > 0.7
    assert float((errors[1e-3][standing] < 1e-3).to(torch.float64).mean()) >= 0.98


@pytest.mark.slow
def test_the_difference_is_that_of_the_step() -> None:
    """At 0.25 ms the median is below 0.1 mm, and 99 % on their feet are below 0.5 mm: the equations are the same."""
    errors, standing = compared()
    assert float(errors[2.5e-4][standing].quantile(0.99)) < 5e-4
    assert float(errors[2.5e-4].median()) < 1e-4


def test_a_fall_and_a_few_steps_agree() -> None:
    """Robots thrown on the ground with running winches, 0.1 s: caps within 0.5 mm of the penalty integration at
    worst, 0.15 mm in the median; what is left is the give of the penalty's ground, for no step removes it."""
    structure, theta, rest = robot()
    start = shaken(rest, 8, seed=4, position=0.001, angle=0.01, speed=0.1, spin=0.3)
    start = replace(start, p_WB=start.p_WB + vector(0.0, 0.0, 0.004))
    u = random_gait(1, 6, batch=8, seed=5)
    truth = Penalty(structure, theta).caps(start, u, seconds=0.1, frames=1)
    run = simulator(structure).rollout(theta, start, u, step=2.5e-4, hold=400, every=400, substeps=1)
    error = torch.linalg.vector_norm(run.end_caps()[:, -1] - truth[:, -1], dim=-1).amax(1)
    assert float(error.median()) < 1.5e-4
    assert float(error.max()) < 5e-4


def test_the_penalty_integration_slides_as_coulomb_says() -> None:
    """The referee itself: a rod pushed along its axis slides v^2 / (2 mu g), but for its regularisation."""
    structure = Structure(n_rods=2, cable_rods=((0, 1),), actuated=(), rod_contact=False)
    theta = parameters(structure, friction=0.5, rest=10.0)
    p = torch.stack([vector(0.0, 0.0, RADIUS), vector(0.0, 4.0, RADIUS)])
    start = state(structure, p, v=torch.stack([vector(0.5, 0.0, 0.0), vector(0.0, 0.0, 0.0)]))
    u = torch.zeros(1, 1, 0, dtype=torch.float64)
    caps = Penalty(structure, theta).caps(start, u, seconds=0.2, frames=1)[0]
    distance = (caps[-1] - caps[0])[:2].mean(0)
    assert float(distance[0]) == pytest.approx(0.5**2 / (2 * 0.5 * 9.81), rel=3e-3)
    assert float((caps[-1] - caps[0])[2:].abs().max()) < 3e-5


def test_the_penalty_integration_flies_as_the_engine_does() -> None:
    """Without ground both integrate the same free motion of a tumbling rod: at 0.05 s and short steps within 10 um."""
    structure = free_rods(1, rod_contact=False)
    theta = parameters(structure)
    start = state(structure, vector(0.0, 0.0, 1.0).expand(1, 1, 3), v=vector(0.3, 0.2, 0.5), w=vector(3.0, 2.0, 9.0))
    penalty = Penalty(structure, theta)
    s, h = penalty.flat(start), torch.full((1, 1), 1e-4, dtype=torch.float64)
    for _ in range(500):
        s = penalty.step(s, torch.zeros(1, 0, dtype=torch.float64), torch.ones(1, 1, dtype=torch.float64), h)
    ours = end_caps(theta, after(structure, theta, start, 500, 1e-4))
    assert float((penalty.caps_of(s) - ours).abs().max()) < 1e-4
