"""What a fitted number is worth: label, reason and interval say the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.trust.covariance import Covariance, covariance
from r2s2r_cli.stages.identify.trust.identifiability import Identifiability, Trust, identifiability
from r2s2r_cli.stages.identify.trust.worth import worth
from tests.stages.identify.solve.problems import formula
from tests.stages.identify.trust.planted import solved

WIDTH = 0.02
FREE = Free("rest_length.6", "m", 0.165, 0.0, 1.0, Coordinate.LINEAR, prior_sd=WIDTH)


def told(sd: float) -> tuple[Identifiability, Covariance]:
    """Data that know the parameter to sd [m], in 40 equal residuals of 8 windows: before and after."""
    column = np.full((40, 1), 1.0 / (sd * np.sqrt(40.0)))
    problem = formula(lambda z: column @ (z - 0.16), lambda z: column, 1, prior_sd=WIDTH, prior_mean=np.array([0.165]),
                      lower=np.array([0.0]), upper=np.array([1.0]), names=(FREE.name,))  # fmt: skip
    solution = solved(problem)
    after = identifiability(problem, solution.z, (FREE,), refuse=False)
    return after, covariance(problem, solution, (FREE,), cluster=np.repeat(np.arange(8), 5))


@pytest.mark.parametrize(
    ("sd", "label"), [(0.004, Trust.IDENTIFIED), (0.02, Trust.WEAK), (0.2, Trust.NOT_IDENTIFIABLE)]
)
def test_where_the_interval_agrees_the_label_is_that_of_the_information(sd: float, label: Trust) -> None:
    """Residuals as small as the noise: the share that is left is sd / hypot(sd, width), and the reason says it."""
    after, spread = told(sd)
    ((found, reason),) = worth(after, spread, (FREE,))
    assert found is label is after.trust[0]
    assert reason == f"prior and bounds allow 0.02 m, the runs leave {sd / np.hypot(sd, WIDTH):.2g} of it".replace(
        "leave 1 of", "leave all of"
    )


def test_a_wider_interval_lowers_the_label() -> None:
    """Information leaves 0.2 of the width, windows that disagree 0.6: what is printed as sd decides."""
    after, spread = told(0.004)
    wider = replace(spread, covariance=np.array([[(0.6 * WIDTH) ** 2]]), quantile=np.array([1.959964]))
    ((found, reason),) = worth(after, wider, (FREE,))
    assert found is Trust.WEAK and reason.endswith("the runs leave 0.6 of it")


def test_an_interval_to_both_bounds_is_no_identification() -> None:
    """A small sd of one degree of freedom: 12.7 of them reach both bounds, nothing was excluded."""
    free = Free("friction", "1", 0.76, 0.04, 5.0, prior_sd=0.35)
    column = np.full((4, 1), 50.0)
    problem = formula(lambda z: column @ z, lambda z: column, 1, prior_sd=0.35, lower=np.log([0.04]),
                      upper=np.log([5.0]), names=("friction",))  # fmt: skip
    after = identifiability(problem, np.zeros(1), (free,), refuse=False)
    spread = covariance(problem, solved(problem), (free,))
    few = replace(spread, covariance=np.array([[0.36]]), quantile=np.array([12.7]), clusters=2)
    assert after.trust == (Trust.IDENTIFIED,)
    ((found, reason),) = worth(after, few, (free,))
    assert found is Trust.NOT_IDENTIFIABLE
    assert reason == "prior and bounds allow 42 %, the runs leave all of it: 2 windows are too few to say more"


def test_one_window_alone_identifies_nothing() -> None:
    """However much information: without a second window no disagreement can show."""
    after, spread = told(0.004)
    ((found, reason),) = worth(after, replace(spread, clusters=1), (FREE,))
    assert found is Trust.WEAK and "by one interval alone" in reason
    after, spread = told(0.2)
    ((found, reason),) = worth(after, replace(spread, clusters=1), (FREE,))
    assert found is Trust.NOT_IDENTIFIABLE and "alone" not in reason


def test_what_nothing_depends_on_says_so() -> None:
    """A column of zeros."""
    after, spread = told(1e9)
    ((found, reason),) = worth(after, spread, (FREE,))
    assert (found, reason) == (Trust.NOT_IDENTIFIABLE, "no compared frame depends on it")
