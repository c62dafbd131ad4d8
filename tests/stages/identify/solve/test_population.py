"""Populations: exact where the residuals are linear, and right about slopes where derivatives mislead."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.solve.found_twice import AGREE, Begin, cool_growing
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.loss import LOSSES
from r2s2r_cli.stages.identify.solve.population import (
    NARROWEST,
    Cooling,
    Costs,
    cool,
    costs_of,
    covariance_at,
    regressed,
    temperature_of,
    weights_at,
)
from tests.stages.identify.solve.problems import Formula, formula, linear

SQUARES = LOSSES["none"]
JUMP = 0.02
"""Width of a stair, a tenth of a standard deviation."""


def stairs(slope: float = -1.0, hidden: float = 6.0, m: int = 60) -> Formula:
    """Residuals whose derivative is `slope` almost everywhere, and which rise by slope + hidden over many stairs."""
    a = np.random.default_rng(3).normal(size=(m, 2))
    b = np.random.default_rng(4).normal(size=m)

    def f(z: np.ndarray) -> np.ndarray:
        return a @ (slope * z + hidden * JUMP * np.round(z / JUMP)) - b

    return formula(f, lambda z: slope * a, 2, prior_sd=3.0)


def minimum_of(a: np.ndarray, b: np.ndarray, sd: float) -> tuple[np.ndarray, np.ndarray]:
    """Minimum and normal matrix of |a z - b|^2 with a prior about 0."""
    normal = a.T @ a + np.eye(a.shape[1]) / sd**2
    return np.linalg.solve(normal, a.T @ b), normal


def test_linear_residuals_are_solved_and_their_slopes_found() -> None:
    """The regression of linear residuals is exact: the minimum, the Jacobian and the normal matrix come out."""
    problem, a, b = linear(prior_sd=2.0)
    z, normal = minimum_of(a, b, 2.0)
    found = cool(problem, np.ones(4), np.eye(4), loss=SQUARES, seed=1)
    np.testing.assert_allclose(found.z, z, atol=1e-2 / np.sqrt(np.diag(normal)).max())
    np.testing.assert_allclose(found.jacobian, a, atol=0.02 * np.abs(a).max())
    np.testing.assert_allclose(found.normal, normal, rtol=0.05, atol=0.05 * np.diag(normal).max())
    np.testing.assert_allclose(found.residual, a @ found.z - b)
    assert found.rough == 1.0
    assert (np.diff(found.costs) <= 0).all()


def test_slopes_over_stairs_are_those_of_the_whole_way() -> None:
    """Where each stair slopes the other way, a fifth as steeply, the population sees the whole and ends at its
    minimum; Levenberg-Marquardt believes the stair, is stuck at its edge, and takes itself for five times less sure."""
    problem = stairs()
    slopes = -5.0 * problem.df(np.zeros(2))
    z, normal = minimum_of(slopes, -problem.f(np.zeros(2)), 3.0)
    found = cool(problem, np.array([3.0, -2.0]), np.eye(2), loss=SQUARES, seed=0)
    off = found.z - z
    assert off @ normal @ off < 1.0
    np.testing.assert_allclose(found.jacobian, slopes, atol=0.25 * np.abs(slopes).max())
    climbed = levenberg_marquardt(problem, np.array([3.0, -2.0]))
    assert climbed.cost > 10 * found.cost
    believed = np.linalg.inv(climbed.normal)[0, 0]
    assert believed > 10 * np.linalg.inv(found.normal)[0, 0]


def test_what_is_held_stays_and_the_box_is_kept() -> None:
    """An unknown with a narrow prior keeps its value to the bit; the others end on a bound that the minimum is beyond
    (the problem itself refuses points outside)."""
    problem, a, b = linear(prior_sd=np.array([2.0, 1e-9, 2.0, 2.0]), lower=np.array([-9.0, -9.0, -9.0, 0.5]))
    start = np.array([0.3, 0.0, 0.2, 0.6])
    found = cool(problem, start, np.diag(problem.prior_sd**-2.0) + np.eye(4), loss=SQUARES, seed=2)
    assert found.z[1] == 0.0
    assert (found.jacobian[:, 1] == 0).all()
    free, _ = minimum_of(a[:, [0, 2, 3]], b, 2.0)
    assert free[2] < 0.5
    assert found.z[3] == pytest.approx(0.5, abs=0.02)


def test_points_that_fail_do_not_count() -> None:
    """Half of the plane cannot be simulated: the minimum beside it is found; where nothing can be, it is said."""
    _, a, b = linear(n=2, prior_sd=2.0)
    z, normal = minimum_of(a, b, 2.0)
    edge = z[0] + 0.5 / np.sqrt(normal[0, 0])
    half = formula(
        lambda x: np.where(x[0] > edge, np.nan, 1.0) * (a @ x - b), lambda x: a, 2, prior_sd=2.0
    )  # fmt: skip
    found = cool(half, z - 0.3, np.eye(2), loss=SQUARES, seed=0)
    assert (found.z - z) @ normal @ (found.z - z) < 0.2
    nothing = formula(lambda x: np.full(3, np.nan), lambda x: np.zeros((3, 2)), 2, prior_sd=1.0)
    with pytest.raises(NumericalError, match="hardly any candidate"):
        cool(nothing, np.zeros(2), np.eye(2), loss=SQUARES, seed=0)


def test_draws_are_those_of_the_seed() -> None:
    """The same seed gives the same bits, another one other candidates."""
    one, again, other = (cool(stairs(), np.ones(2), np.eye(2), loss=SQUARES, seed=seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(one.z, again.z)
    assert one.costs == again.costs
    assert one.costs != other.costs


def test_temperature_leaves_priors_as_they_are() -> None:
    """Covariance of a tempered likelihood times a prior in one dimension, 1 / (d / T + p)."""
    for temperature in (1.0, 7.0, 1e6):
        found = covariance_at(np.array([[4.0]]), np.array([[0.25]]), temperature)
        assert found[0, 0] == pytest.approx(1.0 / (4.0 / temperature + 0.25))
    cost = Costs(np.array([0.0, 8.0]), np.array([0.0, 1.0]))
    assert np.log(np.divide(*weights_at(cost, 4.0))) == pytest.approx(8.0 / 4.0 + 1.0)


def test_the_temperature_makes_as_many_candidates_count_as_were_asked() -> None:
    """Effective sample size at the found temperature, and the coldest one where that is enough already."""
    cost = Costs(np.random.default_rng(0).exponential(50.0, 30), np.zeros(30))
    found = temperature_of(cost, 10.0, 1.0)
    assert 1.0 / np.sum(weights_at(cost, found) ** 2) == pytest.approx(10.0, rel=0.02)
    assert temperature_of(Costs(np.zeros(30), np.zeros(30)), 10.0, 3.0) == 3.0


def test_costs_are_those_of_the_solvers() -> None:
    """Robust costs of many points, blocks of three, are the cost that Levenberg-Marquardt has at each."""
    problem, _, _ = linear(block_size=3, prior_sd=1.5)
    z = np.random.default_rng(1).normal(size=(5, 4))
    found = costs_of(problem, z, problem.residuals(z), LOSSES["student_t"])
    for point, cost in zip(z, found.total, strict=True):
        assert levenberg_marquardt(problem, point, loss=LOSSES["student_t"], max_iterations=0).cost == pytest.approx(
            cost
        )


def test_regression_weighs_its_points() -> None:
    """Points without weight do not move the plane through the others."""
    rng = np.random.default_rng(2)
    z, a = rng.normal(size=(20, 2)), rng.normal(size=(6, 2))
    r = z @ a.T + 1.0
    r[10:] += 100.0
    weight = np.where(np.arange(20) < 10, 1.0, 0.0)
    middle, at, slopes = regressed(z, r, weight / weight.sum(), np.eye(2))
    np.testing.assert_allclose(middle, z[:10].mean(axis=0))
    np.testing.assert_allclose(at, a @ middle + 1.0, rtol=1e-2)
    np.testing.assert_allclose(slopes, a, atol=1e-2)


def wells(depth: float = 30.0) -> Formula:
    """One residual of |z| that is 0 in a wide well at 6, and about sqrt(2 depth) at the bottom of a narrow one at 0."""

    def f(z: np.ndarray) -> np.ndarray:
        cost = np.minimum(depth + 8.0 * z[0] ** 2, 0.02 * depth * (z[0] - 6.0) ** 2 * 2.5)
        return np.array([np.sqrt(2.0 * cost), 0.0])

    return formula(f, lambda z: np.ones((2, 1)), 1, prior_sd=20.0)


def test_ways_are_begun_anew_until_the_best_is_found_twice() -> None:
    """A smooth problem needs one way; what it ends in, and the list of costs, belong to the best of all ways."""
    problem, _, _ = linear(prior_sd=2.0)
    ways = cool_growing([problem, problem], [Begin(np.ones(4), np.eye(4))], loss=SQUARES, seed=0)
    assert len(ways.costs) == 1
    assert not ways.twice
    rough = cool_growing(
        [wells()], [Begin(np.zeros(1), np.array([[100.0]]))], loss=SQUARES, seed=0, cooling=Cooling(hottest=300.0)
    )
    assert rough.best.cost == min(rough.costs)
    assert rough.best.z[0] == pytest.approx(6.0, abs=1.5)
    many = [
        cool_growing([stairs()], [Begin(np.array([3.0, -2.0]), np.eye(2))], loss=SQUARES, seed=seed, chances=4)
        for seed in range(3)
    ]
    for one in many:
        assert one.twice or len(one.costs) in (1, 4)
        assert one.twice == (len(one.costs) > 1 and sorted(one.costs)[1] < sorted(one.costs)[0] + AGREE)
        assert len(one.others) >= (len(one.costs) > 1)  # where none agrees, the next best says how far off it may be


def test_a_draw_never_becomes_too_narrow() -> None:
    """Curvature of a jump: along it the draw keeps NARROWEST of the prior's width; across it is as the data say."""
    prior, jump = np.diag([4.0, 25.0]), np.array([3.0, 1.0])
    found = covariance_at(1e12 * np.outer(jump, jump), prior, 1.0)
    whitened = found * np.sqrt(np.outer(np.diag(prior), np.diag(prior)))
    assert np.sqrt(np.linalg.eigvalsh(whitened)) == pytest.approx([NARROWEST, 1.0], rel=1e-3)
