"""Where `identify --with-effect ID` begins, told no value: every number that it frees does something there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import roma
import torch
from torch import Tensor

from r2s2r_cli.effects import CATALOGUE, FURTHER, Effect
from r2s2r_cli.engine import cap_lengths, sense
from r2s2r_cli.stages.identify.effects_asked import effects_asked
from r2s2r_cli.stages.identify.free import Mapping, select
from tests.support.engine import lowest_gap, simulator, threebar
from tests.support.phases import raised
from tests.support.variants import Variant, plugged, robot

FITTED = tuple(one for one in (*CATALOGUE, *FURTHER) if any(own.fitted for own in one.own))
SHARE = 1e-3
"""Of the sd of its prior, by which a number is moved."""
LEAST = 1e-5
"""[m] By which that sd must move something, in proportion."""
TICKS = 18


@pytest.fixture(scope="module")
def off() -> Variant:
    """The 3-bar robot with all effects, off."""
    return plugged(robot(), *CATALOGUE, *FURTHER, on=False)


def commands() -> Tensor:
    """At nearly full speed to and fro, then so slow as commands are on their way to rest: a dead zone is felt at its
    edge alone. (1, tick, winch)."""
    u = torch.sin(torch.arange(TICKS, dtype=torch.float64)[:, None] * 0.7 + torch.arange(6)).sign()[None] * 0.9
    u[:, 12:15] = 0.01
    return u


@pytest.mark.slow
@pytest.mark.parametrize("effect", FITTED, ids=lambda effect: effect.name)
def test_every_number_does_something_where_its_fit_begins(effect: Effect, off: Variant) -> None:
    """A gait, and again upside down: by a thousandth of its prior's sd each number moves an end cap, a length that is
    read, a cap that is seen, or the time at which commands or frames are taken to be."""
    around, mirror = off.start.q_WR.new_tensor([1.0, 0.0, 0.0, 0.0]), off.start.p_WB.new_tensor([1.0, -1.0, -1.0])
    turned = roma.quat_product(around.expand_as(off.start.q_WR), off.start.q_WR)
    over = replace(off.start, q_WR=turned, p_WB=off.start.p_WB * mirror)
    asked = effects_asked([effect.name], threebar())
    frees = select(asked.specs, threebar(), asked.ids)
    mapping = Mapping(threebar(), frees, asked.ids)
    rows = np.repeat(np.array([[free.start for free in frees]]), len(frees) + 1, axis=0)
    rows[1:] += SHARE * np.diag([free.prior_sd for free in frees])
    theta = off.theta.with_values(dict(mapping.theta(rows).extra))
    u = commands().expand(len(rows), -1, -1)
    runs = [simulator(off.structure).rollout(theta, start, u, step=1e-3, hold=100, every=20)
            for start in (off.start, raised(over, 0.001 - lowest_gap(off.theta, over)))]  # fmt: skip
    caps = torch.cat([run.observed() for run in runs], dim=1)
    ends = tuple((cable.caps[0], cable.caps[1]) for cable in threebar().cables)
    # Lengths to both sides of any end of a sensor's range, whatever this gait reaches.
    length = 0.5 * cap_lengths(ends, caps.detach())[:, -1], 1.3 * cap_lengths(ends, caps.detach())[:, -1]
    read = torch.cat([sense(off.structure, theta, one, 1.0) for one in length], dim=1)
    seen = torch.cat([caps.flatten(1), read], dim=1)
    late = [mapping.observation(row) for row in rows]
    for k, free in enumerate(frees, start=1):
        moved = float((seen[k] - seen[0]).abs().max()) / SHARE
        assert moved > LEAST or late[k] != late[0], (free.name, free.start, moved)
