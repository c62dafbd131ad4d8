"""Fits of perturbed observations: the posterior of linear problems with many unknowns, and plains beside a valley."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.identify.solve.loss import LOSSES
from r2s2r_cli.stages.identify.trust.perturbed import MEMBERS, perturbed
from tests.stages.identify.solve.problems import formula, linear

SQUARES = LOSSES["none"]


@pytest.mark.parametrize("temperature", [1.0, 4.0])
def test_of_a_linear_problem_with_many_unknowns(temperature: float) -> None:
    """Mean and covariance of 20 unknowns, (A^T A / T + P)^-1, up to the chance of so many draws: five standard errors
    for the means, standard deviations within 8 % on average and each within five of its own."""
    n = 20
    problem, a, b = linear(m=60, n=n, prior_sd=1.0, names=tuple(f"x{k}" for k in range(n)))
    covariance = np.linalg.inv(a.T @ a / temperature + np.eye(n))
    mean = covariance @ (a.T @ b) / temperature
    sd = np.sqrt(np.diag(covariance))
    by_curvature = np.linalg.inv(a.T @ a + np.eye(n))
    found = perturbed(problem, mean, by_curvature, loss=SQUARES, temperature=temperature, seed=2)
    share = np.sqrt(np.diag(found.covariance)) / sd
    np.testing.assert_array_less(np.abs(found.mean - mean) / sd, 5.0 / np.sqrt(MEMBERS))
    np.testing.assert_array_less(np.abs(share - 1.0), 5.0 / np.sqrt(2.0 * MEMBERS))
    assert share.mean() == pytest.approx(1.0, abs=0.08)


def test_a_narrow_valley_does_not_hide_the_plain_beside_it() -> None:
    """At the best the curvature says 0.04; beyond 0.02 the slope is a 26th, and the posterior nearly as wide as 1."""

    def f(z: np.ndarray) -> np.ndarray:
        return np.array([z[0] + 0.5 * np.clip(z[0] / 0.02, -1.0, 1.0)])

    problem = formula(f, lambda z: np.ones((1, 1)), 1, prior_sd=50.0)
    grid = np.linspace(-6.0, 6.0, 4001)
    weight = np.exp(-0.5 * problem.residuals(grid[:, None])[:, 0] ** 2)
    exact = np.sqrt(np.sum(weight * grid**2) / np.sum(weight))
    found = [perturbed(problem, np.zeros(1), np.array([[26.0**-2]]), loss=SQUARES, seed=k) for k in range(4)]
    assert np.median([np.sqrt(one.covariance[0, 0]) for one in found]) == pytest.approx(exact, rel=0.3)


def test_held_unknowns_stay_and_a_lower_cost_is_told() -> None:
    """Held: 0 in rows and columns. Begun beside the minimum, it tells the better point that it met."""
    problem, a, _ = linear(n=3, prior_sd=np.array([2.0, 1e-9, 2.0]))
    start = np.array([1.0, 0.0, 1.0])
    found = perturbed(problem, start, np.linalg.inv(a.T @ a), loss=SQUARES)
    assert (found.covariance[1] == 0).all()
    assert found.mean[1] == 0
    here = problem.residuals(found.best[None])[0]
    assert found.cost == pytest.approx(0.5 * (here @ here + found.best[[0, 2]] @ found.best[[0, 2]] / 4.0))
    assert found.cost < 0.5 * np.sum(problem.residuals(start[None]) ** 2)
