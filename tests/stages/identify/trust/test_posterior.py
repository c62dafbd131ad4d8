"""The posterior from candidates: that of linear problems, tempered, and wider where a curvature is too narrow."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.identify.solve.loss import LOSSES
from r2s2r_cli.stages.identify.trust.posterior import posterior
from tests.stages.identify.solve.problems import formula, linear

SQUARES = LOSSES["none"]


@pytest.mark.parametrize("temperature", [1.0, 9.0])
def test_of_a_linear_problem(temperature: float) -> None:
    """Mean and covariance of normal distributions: (A^T A / T + P)^-1, found from a first guess twice too narrow; means
    over seeds within a tenth of a standard deviation, standard deviations within 10 %."""
    problem, a, b = linear(n=3, prior_sd=2.0)
    precision = a.T @ a / temperature + np.eye(3) / 4.0
    covariance = np.linalg.inv(precision)
    mean = covariance @ (a.T @ b) / temperature
    sd = np.sqrt(np.diag(covariance))
    found = [
        posterior(
            problem, mean + 0.5 * sd, covariance / temperature / 4.0, loss=SQUARES, temperature=temperature, seed=k
        )
        for k in range(12)
    ]
    assert all(one.count > 15 for one in found)
    means = np.array([one.mean for one in found])
    sds = np.array([np.sqrt(np.diag(one.covariance)) for one in found])
    np.testing.assert_allclose(means.mean(axis=0), mean, atol=0.1 * sd.min())
    np.testing.assert_allclose(np.median(sds, axis=0), sd, rtol=0.1)


def test_it_sees_both_of_two_minima() -> None:
    """Two minima as good, 2 apart, each of sd 0.3: the curvature says 0.3, the candidates about 1.05."""

    def f(z: np.ndarray) -> np.ndarray:
        return np.array([np.minimum(np.abs(z[0] - 1.0), np.abs(z[0] + 1.0)) / 0.3])

    problem = formula(f, lambda z: np.ones((1, 1)), 1, prior_sd=50.0)
    found = [posterior(problem, np.ones(1), np.array([[0.3**2]]), loss=SQUARES, seed=k) for k in range(8)]
    sds = [np.sqrt(one.covariance[0, 0]) for one in found]
    assert np.median(sds) == pytest.approx(np.sqrt(1.0 + 0.3**2), rel=0.2)


def test_a_lower_cost_is_told() -> None:
    """Started beside the minimum, it tells the better point that it met."""
    problem, a, b = linear(n=3, prior_sd=2.0)
    covariance = np.linalg.inv(a.T @ a)
    start = np.linalg.lstsq(a, b, rcond=None)[0] + 2.0 * np.sqrt(np.diag(covariance))
    found = posterior(problem, start, covariance, loss=SQUARES)
    here = problem.residuals(found.best[None])[0]
    assert found.cost == pytest.approx(0.5 * (here @ here + found.best @ found.best / 4.0))
    assert found.cost < 0.5 * np.sum(problem.residuals(start[None]) ** 2)


def test_held_unknowns_have_no_spread() -> None:
    """Held: 0 in rows and columns."""
    problem, a, _ = linear(n=3, prior_sd=np.array([2.0, 1e-9, 2.0]))
    found = posterior(problem, np.zeros(3), np.linalg.inv(a.T @ a), loss=SQUARES)
    assert (found.covariance[1] == 0).all()
    assert found.mean[1] == 0
