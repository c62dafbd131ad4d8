"""A step that is taken to be stable is: for robots and poses near those that were asked about."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from r2s2r_cli.engine.flat import pack_state, unpack_state
from r2s2r_cli.engine.reading import longest_step
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.stable import ROOM, Stable
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.identify.offsets import StartSpread, displaced
from r2s2r_cli.stages.model import rest_state
from tests.support.builders import robot

MODEL = Model(nominal(robot()))
STRUCTURE = MODEL.structure
PAST = {f"{effect.name}.{name}": torch.zeros(1, size, dtype=torch.float64)
        for effect in STRUCTURE.effects for name, size in effect.state_sizes(STRUCTURE).items()}  # fmt: skip
REST = pack_state(STRUCTURE, replace(rest_state(robot()), extra=PAST))


def about(count: int, seed: int, *, away: float = 0.0) -> torch.Tensor:
    """A pose first, then starts as far from it as those of a piece are, (count, NS). away: of the pose from that of
    robot.toml, times as far."""
    rng, sd = np.random.default_rng(seed), StartSpread().sd(STRUCTURE)
    by = rng.standard_normal((count, len(sd))) * sd
    by[0] = 0.0
    middle = torch.as_tensor(away * rng.standard_normal((1, len(sd))) * sd)
    start = displaced(STRUCTURE, REST.expand(1, -1), middle)
    return displaced(STRUCTURE, start.expand(count, -1), torch.as_tensor(by))


def values(count: int, seed: int) -> np.ndarray:
    """Robots within what is thought possible of the nominal one, (count, n)."""
    rng = np.random.default_rng(seed)
    sd = np.array([number.sd for number in MODEL.numbers])
    low, high = (np.array([getattr(number, end) for number in MODEL.numbers]) for end in ("lower", "upper"))
    return np.clip(MODEL.values0 + sd * rng.standard_normal((count, len(sd))), low, high)


@pytest.mark.parametrize("away", [0.0, 5.0])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_said_to_be_stable_is(seed: int, away: float) -> None:
    """Never longer than the longest stable step of any of these robots in any of these poses."""
    starts, theta = about(40, seed, away=away), MODEL.theta(values(40, seed))
    stable = Stable(STRUCTURE, MODEL.theta(MODEL.values0))
    stable.learn("rest", starts[0])
    said = stable.step({"rest"}, theta)
    assert 0 < said <= longest_step(STRUCTURE, theta, unpack_state(STRUCTURE, starts))


def test_stiffer_cables_ask_for_shorter_steps() -> None:
    """Of four times the stiffness half the step; of the nominal robot in a learned pose ROOM of the longest."""
    start = about(1, 0)[0]
    theta = MODEL.theta(MODEL.values0)
    stable = Stable(STRUCTURE, theta)
    stable.learn("rest", start)
    stable.learn("rest", 2.0 * start)  # known already
    longest = longest_step(STRUCTURE, theta, unpack_state(STRUCTURE, start[None]))
    assert stable.step({"rest"}, theta) == pytest.approx(ROOM * longest)
    stiff = theta.with_values({"stiffness": 4.0 * theta.stiffness})
    assert stable.step({"rest"}, stiff) == pytest.approx(0.5 * ROOM * longest)
