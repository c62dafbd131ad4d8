"""A winch that training does not show is as the others are, as far as they are alike."""

from __future__ import annotations

import math
from dataclasses import make_dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import t

from r2s2r_cli.stages.identify.alike import as_the_others
from r2s2r_cli.stages.identify.free import select
from r2s2r_cli.stages.identify.residuals import FIXED_SD, CapResiduals
from r2s2r_cli.stages.identify.rounds import Fit
from tests.support.engine import threebar

ROBOT = threebar()
SOLUTION = make_dataclass("Solution", ["z"], frozen=True)
"""As much of one as is changed."""
OUT = tuple(f"motor_speed_out.{k},~0.2" for k in range(6))
RATIOS = np.array([0.72, 0.78, 0.75, 0.71, 1.0, 0.74])
"""Of each rate to robot.toml's; the fifth is held."""


def fitted(specs: tuple[str, ...], held: tuple[str, ...], ratios: np.ndarray, offsets: int = 2) -> Fit:
    """A fit of these numbers, those of `held` at their starts, with nuisances behind them."""
    frees = select(specs, ROBOT)
    values = np.array([free.start for free in frees]) * ratios
    z = np.array([free.to_z(value) for free, value in zip(frees, values.tolist(), strict=True)])
    start = np.array([free.to_z(free.start) for free in frees])
    sd = [FIXED_SD if free.name in held else free.prior_sd for free in frees]
    problem = SimpleNamespace(
        frees=frees, held=held, predictor=SimpleNamespace(mapping=SimpleNamespace(robot=ROBOT)), _width=len(frees),
        prior_mean=np.concatenate([start, np.zeros(offsets)]), prior_sd=np.array([*sd, *[0.1] * offsets]),
    )  # fmt: skip
    problem.starting = partial(CapResiduals.starting, cast(Any, problem))
    solution = SOLUTION(np.concatenate([z, np.full(offsets, 0.05)]))
    return Fit(cast(Any, problem), cast(Any, solution), values)


def test_it_is_as_the_median_of_the_others() -> None:
    """Value, unknown, start and prior; how far it may lie from there is the t interval of one more draw from five; the
    others, the nuisances and the width that holds it stay."""
    before = fitted(OUT, ("motor_speed_out.4",), RATIOS)
    found = as_the_others(before)
    own = np.log(np.delete(RATIOS, 4))
    free = found.problem.frees[4]
    assert found.values[4] == pytest.approx(before.problem.frees[4].start * math.exp(np.median(own)))
    assert free.start == found.values[4]
    assert free.to_z(free.start) == pytest.approx(found.solution.z[4]) == pytest.approx(found.problem.prior_mean[4])
    half = t.ppf(0.975, 4) * own.std(ddof=1) * math.sqrt(1 + 1 / 5)
    assert 1.959964 * free.prior_sd == pytest.approx(half)
    rest = [0, 1, 2, 3, 5, 6, 7]
    for after, was in ((found.solution.z, before.solution.z), (found.problem.prior_mean, before.problem.prior_mean)):
        np.testing.assert_array_equal(after[rest], was[rest])
    np.testing.assert_array_equal(found.problem.prior_sd, before.problem.prior_sd)
    np.testing.assert_array_equal(found.problem.z0, found.problem.prior_mean)
    assert found.alike == {"motor_speed_out.4": 5}
    assert before.values[4] == before.problem.frees[4].start


def test_others_that_differ_much_say_no_more_than_the_prior() -> None:
    """Two that differ by half: the draw is as wide as the prior was."""
    held = tuple(f"motor_speed_out.{k}" for k in (2, 3, 4, 5))
    found = as_the_others(fitted(OUT, held, np.array([0.6, 1.0, 1.0, 1.0, 1.0, 1.0])))
    assert [free.prior_sd for free in found.problem.frees[2:]] == [pytest.approx(0.2)] * 4
    assert found.values[2] == pytest.approx(found.problem.frees[1].start * math.sqrt(0.6))


@pytest.mark.parametrize(
    ("specs", "held"),
    [
        (OUT, ()),
        (OUT, tuple(f"motor_speed_out.{k}" for k in range(1, 6))),
        ((*OUT[:4], "motor_speed_out.4=0.5", OUT[5]), ("motor_speed_out.4",)),
        ((*OUT[:4], "motor_speed_in.4", OUT[5]), ("motor_speed_in.4",)),
        (("rest_length.6", "rest_length.7", "rest_length.8"), ("rest_length.7",)),
    ],
)
def test_nothing_changes(specs: tuple[str, ...], held: tuple[str, ...]) -> None:
    """Where all are shown or one alone; where somebody said where it starts; of the other way; of what is no winch."""
    before = fitted(specs, held, RATIOS[: len(specs)])
    assert as_the_others(before) is before


def test_what_begins_at_none_is_no_share_of_anything() -> None:
    """Places of payloads, of which one is held: none of them is divided by its start, which is 0."""
    before = fitted(tuple(f"payload.place_m.{k}" for k in range(3)), ("payload.place_m.2",), np.ones(3))
    assert as_the_others(before) is before
