"""Profile likelihood: parabolas, closed forms where it is none, open ends."""

import numpy as np
import pytest

from r2s2r_cli.stages.identify.solve.loss import LOSSES
from r2s2r_cli.stages.identify.trust.covariance import covariance
from r2s2r_cli.stages.identify.trust.profile import by_population, interval, profile
from tests.stages.identify.solve.problems import formula
from tests.stages.identify.trust.planted import linear_frees, planted, solved


def _exponential(y: float, s: float, **box):
    """y = exp(a) with noise s, at its solution; the prior is flat."""
    problem = formula(lambda z: (np.exp(z) - y) / s, lambda z: np.exp(z)[:, None] / s, 1, names=("a",), **box)
    solution = solved(problem, np.log([y]))
    frees = linear_frees(("a",))
    return problem, solution, frees, 0, covariance(problem, solution, frees)


def test_linear_problem_has_a_parabola():
    """Profile and covariance give the same interval, also with nuisances and with an inflation by the windows."""
    case = planted(4, shared=0.5)
    solution = solved(case.problem)
    spread = covariance(case.problem, solution, case.frees, cluster=case.cluster)
    assert spread.inflation > 2
    for index in (0, 2):
        found = profile(case.problem, solution, case.frees, index, spread)
        np.testing.assert_allclose((found.lower, found.upper), found.quadratic, rtol=2e-3)
        assert found.words == "agrees with the covariance"
        assert found.better is None
        assert len(found.value) == 9


def test_exponential_has_its_likelihood_interval():
    """The interval is that of exp(a) in y -+ 1.96 s, which the covariance misses."""
    found = profile(*_exponential(1.0, 0.4), points=17)
    np.testing.assert_allclose((found.lower, found.upper), np.log([1 - 1.959964 * 0.4, 1 + 1.959964 * 0.4]), atol=0.03)
    assert found.quadratic == pytest.approx((-1.959964 * 0.4, 1.959964 * 0.4), rel=1e-4)
    assert "times further below" in found.words


def test_flat_side_is_open():
    """Where even a = -inf is not refused, the interval is open below and its words say so."""
    found = profile(*_exponential(1.0, 0.6))
    assert np.isnan(found.lower)
    assert found.upper == pytest.approx(np.log(1 + 1.959964 * 0.6), abs=0.03)
    assert found.words.startswith("open below")
    assert "bound" not in found.words


def test_bound_ends_the_grid():
    """The grid ends on a bound, which the words name."""
    found = profile(*_exponential(1.0, 0.3, upper=0.2))
    assert found.value[-1] == 0.2
    assert np.isnan(found.upper)
    assert "0.2, its bound" in found.words


def test_better_minimum_is_reported():
    """A profile that falls below the cost of the solution says where."""
    problem, _, frees, _, spread = _exponential(1.0, 0.3)
    found = profile(problem, solved(problem, np.array([0.25])), frees, 0, spread)
    assert found.better is not None
    assert abs(found.better[0]) < 0.1
    assert found.words.startswith("a better fit was found")


def test_a_population_sees_the_same_parabola():
    """Found by candidates, the profile of a linear problem with nuisances is that of the covariance, also about a
    solution that is a standard deviation off along another unknown: rises count from the minimum."""
    case = planted(4, windows=3, offsets=2)
    best = solved(case.problem)
    off = best.z.copy()
    off[1] += np.sqrt(np.linalg.inv(best.normal)[1, 1])
    solution = solved(case.problem, off)
    spread = covariance(case.problem, solution, case.frees)
    search = by_population(case.problem, solution, 0, LOSSES["none"], members=40, inflation=1.0, seed=3)
    found = profile(case.problem, solution, case.frees, 0, spread, search=search)
    half = 0.5 * (found.quadratic[1] - found.quadratic[0])
    np.testing.assert_allclose((found.lower, found.upper), best.z[0] + np.array([-half, half]), atol=0.05 * half)


def test_interval_of_a_parabola_is_exact():
    """Signed roots make the ends exact on any grid; without a rise there is no end."""
    grid = np.array([-3.0, -1.7, 0.0, 0.4, 2.9])
    assert interval(grid, 0.5 * grid**2, 1.5) == pytest.approx((-1.5, 1.5))
    assert np.isnan(interval(grid, np.zeros(5), 1.5)).all()
