"""Robust losses against their closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from r2s2r_cli.stages.identify.solve.loss import LOSSES, Huber, StudentT, robust_sum
from r2s2r_cli.stages.identify.solve.problem import Evaluation


@pytest.mark.parametrize("name", LOSSES)
def test_weight_is_the_slope_of_rho(name: str) -> None:
    """The weight is d rho / d s, rho is 0 at 0, and rho is concave, as re-weighting needs."""
    loss, size = LOSSES[name], np.repeat([1, 2, 3], 40)
    s = np.tile(np.geomspace(1e-3, 1e3, 40), 3)
    slope = (loss.rho(s * (1 + 1e-6), size) - loss.rho(s * (1 - 1e-6), size)) / (2e-6 * s)
    np.testing.assert_allclose(loss.weight(s, size), slope, rtol=1e-6)
    assert np.all(loss.rho(np.zeros(3), np.array([1, 2, 3])) == 0.0)
    assert np.all(np.diff(loss.weight(s, size).reshape(3, 40), axis=1) <= 0.0)


def test_student_t_is_the_density_of_scipy() -> None:
    """Differences of rho are differences of -2 ln p of the multivariate t with 4 degrees of freedom."""
    loss, size = StudentT(), np.array([3])
    for r in np.random.default_rng(0).normal(0, 3, (5, 3)):
        density = stats.multivariate_t(np.zeros(3), np.eye(3), df=4)
        expected = -2.0 * (density.logpdf(r) - density.logpdf(np.zeros(3)))
        assert loss.rho(np.array([r @ r]), size)[0] == pytest.approx(expected, rel=1e-12)
    assert loss.weight(np.array([3.0]), size)[0] == 1.0


def test_huber_is_linear_outside() -> None:
    """Squares inside, linear in the norm outside, continuous with its slope at threshold sqrt(size)."""
    loss, size = Huber(1.5), np.array([4])
    norm = np.array([2.9, 3.0, 4.0, 5.0])
    rho = loss.rho(norm**2, size)
    np.testing.assert_allclose(rho, [2.9**2, 9.0, 15.0, 21.0])
    np.testing.assert_allclose(loss.weight(norm**2, size), [1.0, 1.0, 0.75, 0.6])


def test_blocks_share_a_weight() -> None:
    """Residuals of one block, in any order and with any numbers, get the weight of its norm; sizes may differ."""
    residual = np.array([3.0, 1.0, 4.0, 0.0, 12.0])
    block = np.array([7, 2, 7, 2, 7])  # norms 13 of three, 1 of two
    total, weight = robust_sum(Huber(1.0), Evaluation(residual, None, block))
    edge = math.sqrt(3.0)
    assert total == pytest.approx(2.0 * edge * 13.0 - 3.0 + 1.0)
    np.testing.assert_allclose(weight, [edge / 13, 1.0, edge / 13, 1.0, edge / 13])
