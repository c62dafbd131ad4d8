"""Doubts that values raise against themselves, in words."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.identify.default_method import loss_words
from r2s2r_cli.stages.identify.doubts import contradicted, doubtful, outdone, ranging, wider
from r2s2r_cli.stages.identify.found import OURS, ParameterFound, ProfileFound
from r2s2r_cli.stages.identify.free import catalogue
from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.free.extend import extended
from r2s2r_cli.stages.identify.free.select import select
from r2s2r_cli.stages.identify.report import report_of
from r2s2r_cli.stages.identify.request import Request
from r2s2r_cli.stages.identify.task import Task
from r2s2r_cli.stages.identify.trust.identifiability import Trust
from r2s2r_cli.stages.measures.baselines import NOTHING_MOVES
from r2s2r_cli.stages.measures.table import Predicted, judge
from schemas.config import IdentifySettings
from tests.stages.identify.planted import found, step
from tests.support.engine import threebar

KNOWN = catalogue(threebar())
NAN = (math.nan, math.nan)


def one(name: str, value: float, lower: float, trust: Trust = Trust.IDENTIFIED) -> ParameterFound:
    """A found number of the 3-bar robot."""
    return ParameterFound(KNOWN[name], value, 0.05, lower, value + 0.1, NAN, trust)


def test_winding_rates_beyond_the_no_load_speed_are_doubted() -> None:
    """Those above 1, by name, with those of which the interval reaches below; nothing else is."""
    rates = (one("motor_speed_out.0", 1.08, 0.98), one("motor_speed_out.1", 1.13, 1.05),
             one("motor_speed_in.0", 0.9, 0.8), one("friction", 1.3, 1.1))  # fmt: skip
    (text,) = doubtful(rates)
    assert text.startswith("faster than the motor turns without load: motor_speed_out.0 1.08, motor_speed_out.1 1.13 (")
    assert "interval of motor_speed_out.0 reaches below 1)" in text and "friction" not in text
    assert doubtful(rates[2:]) == ()
    assert doubtful([replace(rates[0], trust=Trust.NOT_IDENTIFIABLE), replace(rates[1], trust=None)]) == ()


def test_a_bound_that_was_hit_comes_with_the_option_that_widens_it() -> None:
    """The option is read, keeps the prior of the default set, and has room beyond the bound."""
    bound = KNOWN["rest_length.8"].lower
    (text,) = doubtful([one("rest_length.8", bound, bound, Trust.ON_BOUND)])
    assert text.startswith(f"rest_length.8 lies on its bound {bound:g} m: the runs ask for less")
    spec = text.split('"')[1]
    (free,) = select(extended((spec,), ("rest_length.8,~0.02",)), threebar())
    assert free.lower == pytest.approx(bound / 2, rel=1e-3) and free.prior_sd == 0.02


def test_a_bound_that_was_hit_for_nothing_is_told_too() -> None:
    """A number that the runs do not determine and that still went to its bound: give it, or hold it tighter."""
    bound = KNOWN["rest_length.8"].lower
    (text,) = doubtful([one("rest_length.8", bound, bound, Trust.NOT_IDENTIFIABLE)])
    assert f"--fix rest_length.8={KNOWN['rest_length.8'].start:g}," in text and "do not determine it" in text
    assert doubtful([one("rest_length.8", 1.01 * bound, bound, Trust.NOT_IDENTIFIABLE)]) == ()


def test_rivals_that_predict_as_well_are_named() -> None:
    """One better in every step, one better on the whole by chance, one worse; and a controller worse than standing."""
    steps = [step(interval) for interval in range(1, 9)]

    def off(*by: float) -> Predicted:
        """Errors of the steps in turn [m], along z."""
        size = np.resize(by, len(steps))
        key = np.array([one.key for one in steps])
        key[..., 2] += size[:, None]
        return Predicted(
            key, tuple(one.p_WE + np.array([0.0, 0.0, more]) for one, more in zip(steps, size, strict=True))
        )

    rivals = {"nominal": off(0.001), "last": off(0.0052, 0.001), NOTHING_MOVES: off(0.02)}
    rows = judge(steps, {OURS: off(0.004), **rivals})
    said = [
        "'nominal' predicts the held-out key frames better than the identified simulator",
        "'last' predicts the held-out key frames at least as well as the identified simulator",
    ]
    assert outdone(rows, 0.019) == (*said,)
    assert outdone(rows, 0.021)[:2] == (*said,) and "worse than 'nothing moves'" in outdone(rows, 0.021)[2]
    assert outdone({}, None) == ()
    # 0.01 mm less in every step is surely less, and nothing that a table shows.
    rows = judge(steps, {OURS: off(0.004), "nominal": off(0.00399), NOTHING_MOVES: off(0.02)})
    assert outdone(rows, None) == ()


def test_a_value_outside_its_own_profile_is_told() -> None:
    """Beyond an end; within, or where a side has no end, nothing is said."""
    free = (one("friction", 0.6, 0.5),)

    def said(low: float, high: float) -> tuple[str, ...]:
        return contradicted(free, [ProfileFound(0, np.array([0.5]), np.array([0.0]), (low, high))])

    assert said(0.5, 0.7) == said(math.nan, 0.7) == said(math.nan, math.nan) == ()
    assert said(0.42, 0.58)[0].startswith(
        "friction 0.6 lies outside the 95 % interval of its own profile likelihood, 0.42..0.58"
    )
    assert "0.7..:" in said(0.7, math.nan)[0]
    assert said(0.42, 0.58)[0].endswith("The interval reported holds both")
    free = (replace(free[0], trust=Trust.NOT_IDENTIFIABLE),)
    assert said(0.42, 0.58)[0].endswith("No interval is reported")


def test_a_range_beyond_its_interval_is_told() -> None:
    """By name, where it ends further out by a twentieth of the interval; not where nobody looked."""
    inside, outside = one("friction", 0.6, 0.5), one("mass.1", 0.4, 0.3)
    said = ranging((replace(inside, range=(0.495, 0.7)), replace(outside, range=(0.35, 0.52)), one("mass.2", 0.4, 0.3)))
    assert len(said) == 1
    assert "mass.1 (0.35..0.52)" in said[0] and "friction" not in said[0]


@pytest.mark.parametrize(
    ("free", "below", "expected"),
    [
        (Free("a", "1", 1.0, 0.5, 2.0), False, "0.5..2.75"),
        (Free("a", "m", 0.0, -1.0, 1.0, Coordinate.LINEAR), True, "-2..1"),
        (Free("a", "m", 0.5, 0.0, 1.0, Coordinate.LINEAR), True, None),
        (Free("a", "1", 0.5, 0.0, 0.9, Coordinate.LOGIT), False, "0..0.95"),
        (Free("a", "1", 0.5, 0.0, 1.0, Coordinate.LOGIT), False, None),
        (Free("a", "1", 0.5, 0.1, math.inf), True, "0.05.."),
    ],
)
def test_bounds_go_further_where_the_number_does(free: Free, below: bool, expected: str | None) -> None:
    """On the side that was hit, never beyond what the number can be."""
    assert wider(free, below=below) == expected


def test_they_reach_the_report() -> None:
    """Behind what the fit itself remarked."""
    fast = replace(found().parameters[0], value=1.2, lower=1.1, range=(1.15, 1.25), upper=1.3)
    warnings = report_of(found(parameters=(fast,), covariance=None, information=None, profiles=())).warnings
    assert warnings[0] == "a remark" and "motor_speed 1.2" in warnings[1] and len(warnings) == 2


def test_the_loss_names_windows_that_there_are() -> None:
    """Of at most as many intervals as follow each other in training, not of as many as the recipe allows."""

    def said(*intervals: int) -> str:
        return loss_words(Task(threebar(), [], Request((Selection("walk", intervals),)), IdentifySettings()))

    assert "up to 3 target intervals" in said(1, 2, 3, 5, 6) and "then of 2, 3 from" in said(1, 2, 3, 5, 6)
    assert "up to 1 target interval with" in said(4) and "then of 1 from" in said(4)
