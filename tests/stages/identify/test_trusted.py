"""Intervals that hold what a profile found."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from r2s2r_cli.stages.identify.found import ProfileFound
from r2s2r_cli.stages.identify.rounds import Fit
from r2s2r_cli.stages.identify.trust.identifiability import Trust
from r2s2r_cli.stages.identify.trusted import Sureness, sureness, widened_by
from tests.stages.identify.trust.planted import planted, solved


def _sure() -> tuple[Fit, Sureness]:
    """A linear fit of three numbers, normal noise."""
    case = planted(3, p=3)
    problem = cast(Any, case.problem)
    problem.frees, problem.cluster, problem.held = case.frees, case.cluster, ()
    fitted = Fit(problem, solved(case.problem), solved(case.problem).z[:3])
    return fitted, sureness(fitted, np.zeros((0, 3)), loss="none", seed=0)


def _profile(sure: Sureness, below: float, above: float) -> ProfileFound:
    """Of the second number, its ends so many standard deviations from the value."""
    one = sure.parameters[1]
    grid = one.value + one.sd * np.array([-4.0, 0.0, 4.0])
    return ProfileFound(1, grid, np.zeros(3), (one.value + below * one.sd, one.value + above * one.sd))


def test_the_interval_reaches_as_far_as_the_profile() -> None:
    """Further above: the end is the profile's, the sd grows by the same share, correlations and the others stay."""
    fitted, sure = _sure()
    before = sure.parameters[1]
    found = widened_by(fitted, sure, [_profile(sure, -1.0, 5.0)])
    after = found.parameters[1]
    assert after.lower == before.lower
    assert after.upper == pytest.approx(before.value + 5.0 * before.sd)
    assert after.sd / before.sd == pytest.approx((after.upper - after.lower) / (before.upper - before.lower))
    np.testing.assert_allclose(found.spread.correlation, sure.spread.correlation)
    assert found.parameters[::2] == sure.parameters[::2]


def test_an_open_side_counts_as_far_as_anyone_looked() -> None:
    """No end below: the interval reaches the end of the grid."""
    fitted, sure = _sure()
    after = widened_by(fitted, sure, [_profile(sure, math.nan, 1.0)]).parameters[1]
    assert after.lower == pytest.approx(sure.parameters[1].value - 4.0 * sure.parameters[1].sd)
    assert after.upper == sure.parameters[1].upper


def test_a_profile_inside_the_interval_changes_nothing() -> None:
    """A profile that is narrower than the covariance says takes nothing away."""
    fitted, sure = _sure()
    assert widened_by(fitted, sure, [_profile(sure, -1.0, 1.0)]) is sure


def test_what_is_held_says_what_at() -> None:
    """At its start, or as others of its kind are."""
    fitted, _ = _sure()
    name = fitted.problem.frees[1].name
    fitted.problem.held = (name,)
    for alike, words in (({}, "held at its start"), ({name: 5}, "held as the 5 others are")):
        one = sureness(replace(fitted, alike=alike), np.zeros((0, 3)), loss="none", seed=0).parameters[1]
        assert one.trust is Trust.NOT_IDENTIFIABLE and one.reason.endswith(words)
