"""Random gaits: how deep caps sink in, and ten minutes without an accident."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine.reading import energy
from r2s2r_cli.engine.trajectory import Trajectory
from tests.support.engine import random_gait, simulator, threebar_engine

BATCH = 16


@pytest.mark.parametrize(("friction", "step"), [(0.3, 1e-3), (0.76, 1e-3), (1.0, 1e-3), (0.76, 2e-3)])
def test_no_cap_sinks_in(friction: float, step: float) -> None:
    """16 random gaits of 10 s from a drop of 5 cm, a new command every 0.5 s: no cap is ever 1 mm below the ground at
    any step, and after the landing none by 0.1 mm."""
    structure, theta, rest = threebar_engine()
    theta = replace(theta, friction=torch.full_like(theta.friction, friction))
    start = replace(rest, p_WB=rest.p_WB + torch.tensor([0.0, 0.0, 0.05], dtype=torch.float64))
    u = random_gait(20, 6, batch=BATCH, seed=5)
    run = simulator(structure).rollout(theta, start, u, step=step, hold=round(0.5 / step), substeps=1)
    gap = run.end_caps()[..., 2] - 0.0175
    assert float(gap.min()) > -1e-3
    assert float(gap[:, round(0.3 / step) :].min()) > -1e-4
    assert float(gap.min(dim=2).values[:, -1].max()) < 1e-3, "every robot is on the ground"


@pytest.mark.slow
def test_ten_minutes_of_random_gait() -> None:
    """16 robots, 600 s each, a new command every 0.5 s: finite, no robot leaves the ground or sinks in, and kinetic and
    elastic energy of the last minute are no larger than of the first by more than a third."""
    structure, theta, rest = threebar_engine()
    sim, state, kinetic, total = simulator(structure), rest, [], []
    for minute in range(10):
        u = random_gait(120, 6, batch=BATCH, seed=100 + minute)
        run = sim.rollout(theta, state, u, step=1e-3, hold=500, every=50, substeps=1)
        kinetic.append(float((theta.mass[..., None] * run.states.v_WB**2).sum((-2, -1)).quantile(0.99)))
        total.append(above_ground(run))
        caps = run.end_caps()[..., 2] - 0.0175
        assert float(caps.min()) > -1e-3
        assert float(caps.amin(2).max()) < 0.05
        state = run.at(-1)
    assert max(kinetic[5:]) < 1.33 * max(kinetic[:5])
    assert max(total[5:]) < 1.33 * max(total[:5])


def above_ground(run: Trajectory) -> float:
    """99th percentile of kinetic, elastic and gravitational energy [J] over all frames."""
    frames: list[Tensor] = [energy(run.structure, run.theta, run.at(k)) for k in range(0, run.t.numel(), 20)]
    return float(torch.stack(frames).quantile(0.99))
