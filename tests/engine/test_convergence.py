"""How fast the simulation approaches its limit when the step is halved."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import Parameters, State, Structure, end_caps
from tests.support.engine import random_gait, shaken, simulator, threebar_engine, vector

STEPS = (1e-3, 5e-4, 2.5e-4, 1.25e-4)


def caps_at_the_end(
    structure: Structure, theta: Parameters, start: State, u: Tensor, h: float, seconds: float
) -> Tensor:
    """End caps after commands u (B, row, actuated) over `seconds`, (B, cap, 3) [m]."""
    hold = round(seconds / h / u.shape[1])
    run = simulator(structure).rollout(theta, start, u, step=h, hold=hold, every=hold, substeps=1)
    return end_caps(theta, run.at(-1))


def errors(structure: Structure, theta: Parameters, start: State, u: Tensor, seconds: float) -> list[float]:
    """Median over the batch of the largest cap error against a quarter of the shortest step [m]."""
    truth = caps_at_the_end(structure, theta, start, u, STEPS[-1] / 4, seconds)
    found = [caps_at_the_end(structure, theta, start, u, h, seconds) for h in STEPS]
    return [float(torch.linalg.vector_norm(x - truth, dim=-1).amax(1).median()) for x in found]


def test_flight_converges_with_first_order() -> None:
    """A robot that tumbles in the air with taut cables and running winches: half the step leaves half the
    error, or less."""
    structure, theta, rest = threebar_engine()
    theta = replace(theta, gravity=vector(0.0, 0.0, 0.0)[None])
    start = shaken(rest, 16, seed=1, position=0.002, angle=0.02, speed=0.1, spin=0.5)
    start = replace(start, p_WB=start.p_WB + vector(0.0, 0.0, 1.0))
    found = errors(structure, theta, start, random_gait(2, 6, batch=16, seed=2), 0.2)
    assert found[0] < 3e-4
    assert all(coarse / fine > 1.8 for coarse, fine in pairwise(found))


@pytest.mark.slow
def test_gaits_converge_with_first_order() -> None:
    """Crawling on the ground, with impacts, stick and slip: the median error over 24 gaits of 1 s is below 0.2 mm at
    1 ms and falls at least by 1.5 a halving on average."""
    structure, theta, rest = threebar_engine()
    start = simulator(structure).rollout(theta, rest, torch.zeros(1, 2000, 6, dtype=torch.float64), every=2000).at(-1)
    found = errors(structure, theta, start, random_gait(4, 6, batch=24, seed=3), 1.0)
    assert found[0] < 2e-4
    assert (found[0] / found[-1]) ** (1 / 3) > 1.5


def test_substeps_equal_shorter_steps() -> None:
    """n substeps of a step are the same as n steps of an n-th, bit by bit."""
    structure, theta, rest = threebar_engine()
    u = random_gait(3, 6, batch=1, seed=4)
    sim = simulator(structure)
    one = sim.rollout(theta, rest, u, step=3e-3, hold=20, every=60, substeps=3).at(-1)
    other = sim.rollout(theta, rest, u, step=1e-3, hold=60, every=180, substeps=1).at(-1)
    assert torch.equal(one.p_WB, other.p_WB)


def test_stiff_cables_get_substeps_and_stay_stable() -> None:
    """Cables ten times as stiff at 5 ms: the simulator splits the step by its own rule, and the robot, left alone for
    2 s, stays where 1 ms leaves it, within 0.3 mm."""
    structure, theta, rest = threebar_engine()
    stiff = replace(theta, stiffness=theta.stiffness * vector(*[10.0] * 6, 1.0, 1.0, 1.0))
    sim, still = simulator(structure), torch.zeros(1, 1, 6, dtype=torch.float64)
    coarse = sim.rollout(stiff, rest, still, step=5e-3, hold=400, every=400)
    fine = sim.rollout(stiff, rest, still, step=1e-3, hold=2000, every=2000, substeps=5)
    assert coarse.substeps > 3
    assert float((coarse.end_caps()[:, -1] - fine.end_caps()[:, -1]).abs().max()) < 3e-4
    assert sim.substeps(theta, rest, 1e-3) == 1
