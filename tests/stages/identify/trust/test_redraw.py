"""Re-drawn noise against the covariance, and ranges."""

import numpy as np
import pytest

from r2s2r_cli.stages.identify.free.base import Free
from r2s2r_cli.stages.identify.trust.covariance import covariance
from r2s2r_cli.stages.identify.trust.redraw import Redrawn, redraw_linear, spans
from tests.stages.identify.trust.planted import linear_frees, planted, solved


def test_linearised_draws_have_the_covariance():
    """Independent noise as given: their covariance is the naive one."""
    case = planted(0)
    solution = solved(case.problem)
    naive = covariance(case.problem, solution, case.frees).naive
    drawn = redraw_linear(case.problem, solution, draws=4000).z
    size = np.sqrt(np.diag(naive))
    np.testing.assert_allclose((np.cov(drawn.T) - naive) / np.outer(size, size), 0, atol=0.08)


def test_windows_that_share_a_misfit_are_drawn_as_wholes():
    """Drawn by window, parameters vary as the windows disagree; by noise far less."""
    case = planted(2, windows=24, rows=20, shared=0.5)
    solution = solved(case.problem)
    sd = covariance(case.problem, solution, case.frees, cluster=case.cluster).sd_z
    linear = redraw_linear(case.problem, solution, case.cluster).sd_z
    np.testing.assert_allclose(linear / sd, 1.0, atol=0.25)
    assert np.all(redraw_linear(case.problem, solution).sd_z < 0.6 * sd)


def test_spans_take_all_starts_and_most_draws():
    """Units, not coordinates; few draws count whole, many by their middle 95 %."""
    frees = (Free("a", "1", 1.0, 0.01, 100.0),)
    assert spans(frees, np.log([[2.0], [3.0]]), np.log([[1.0], [2.5]])) == pytest.approx(np.array([[1.0, 3.0]]))
    many = Redrawn(np.linspace(-1, 1, 401)[:, None])
    assert spans(linear_frees(("a",)), many.z) == pytest.approx(np.array([[-0.95, 0.95]]))
