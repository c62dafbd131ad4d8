"""Covariances against closed forms, and intervals against the truths they should hold."""

import numpy as np
import pytest

from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.loss import LOSSES
from r2s2r_cli.stages.identify.trust.covariance import covariance
from r2s2r_cli.stages.identify.trust.parts import parts_of, scores_of
from tests.stages.identify.solve.problems import formula, linear
from tests.stages.identify.trust.coverage import bias, clopper_pearson, coverage
from tests.stages.identify.trust.planted import linear_frees, planted, solved


def test_linear_problem_has_inverse_normal_matrix():
    """Without nuisances, and with noise no larger than given, the covariance is (J^T J)^-1."""
    _, a, b = linear(3)
    quiet = formula(lambda z: 0.1 * (a @ z - b) + 0.9 * a @ z, lambda z: a, 4)
    found = covariance(quiet, solved(quiet), linear_frees(quiet.names))
    assert found.how == "noise as given"
    np.testing.assert_allclose(found.covariance, np.linalg.inv(a.T @ a), rtol=1e-10, atol=1e-14)
    np.testing.assert_allclose(found.upper - found.value, 1.959964 * found.sd, rtol=1e-6)


def test_nuisances_are_marginalised():
    """With priors on nuisances the covariance is the parameters' block of the inverse of everything."""
    case = planted(0, noise=0.3)
    found = covariance(case.problem, solved(case.problem), case.frees)
    whole = np.linalg.inv(case.matrix.T @ case.matrix + np.diag(case.problem.prior_sd**-2.0))
    np.testing.assert_allclose(found.covariance, whole[:4, :4], rtol=1e-9)


def test_misfit_widens_by_chi_squared():
    """Residuals three times the noise widen by chi^2 / dof, the degrees of freedom of the fit taken off."""
    case = planted(1, offsets=0, noise=3.0)
    solution = solved(case.problem)
    found = covariance(case.problem, solution, case.frees)
    factor = solution.residual @ solution.residual / (len(solution.residual) - 4)
    np.testing.assert_allclose(found.covariance, factor * found.naive, rtol=1e-9)
    assert found.inflation == pytest.approx(factor)


def test_expected_scores_are_those_of_independent_noise():
    """The expected outer products of scores, leverage included, are the mean over many drawn noises."""
    case = planted(2, windows=3, rows=12, p=2, offsets=2)
    p, (m, n) = 2, case.matrix.shape
    draw = np.random.default_rng(0)
    total = np.zeros((3, p, p))
    for _ in range(800):
        offsets = np.concatenate([np.zeros(p), 0.5 * draw.normal(size=n - p)])
        y = case.matrix @ offsets + draw.normal(size=m)
        problem = formula(lambda z, y=y: case.matrix @ z - y, lambda z: case.matrix, n,
                          prior_sd=case.problem.prior_sd, names=("a", "b"))  # fmt: skip
        solution = solved(problem)
        scores = scores_of(problem, solution, parts_of(problem, solution, LOSSES["none"], None), case.cluster)
        total += np.einsum("si,sj->sij", scores.score, scores.score) / 800
    size = np.sqrt(np.einsum("sii->si", scores.expected))
    np.testing.assert_allclose((total - scores.expected) / np.einsum("si,sj->sij", size, size), 0, atol=0.17)


def test_prior_stands_where_data_are_silent():
    """A parameter without effect keeps its prior's sd; without a prior its interval is the range."""
    a = np.random.default_rng(0).normal(size=(20, 3)) * [1.0, 0.0, 0.0]
    problem = formula(lambda z: a @ z, lambda z: a, 3, prior_sd=np.array([np.inf, 0.2, np.inf]))
    found = covariance(problem, solved(problem, np.zeros(3)), linear_frees(("a", "b", "c"), half=5.0))
    assert found.sd_z[1] == pytest.approx(0.2)
    assert np.isinf(found.sd_z[2])
    assert (found.lower[2], found.upper[2]) == (-5.0, 5.0)
    assert np.isnan(found.correlation[0, 2])


def test_intervals_are_mapped_and_cut():
    """In a log coordinate the interval is a factor either way; a bound cuts it."""
    problem = formula(lambda z: z / 0.5, lambda z: np.eye(2) / 0.5, 2)
    frees = (Free("a", "1", 1.0, 0.01, 100.0), Free("b", "1", 1.0, 0.5, 100.0, Coordinate.LOG))
    found = covariance(problem, solved(problem, np.zeros(2)), frees)
    reach = np.exp(1.959964 * 0.5)
    np.testing.assert_allclose([found.lower[0], found.upper[0]], [1 / reach, reach], rtol=1e-5)
    assert found.lower[1] == 0.5


def test_pairs_that_data_cannot_tell_apart_are_named():
    """Two nearly equal columns give a correlation near -1."""
    a = np.random.default_rng(0).normal(size=(50, 2))
    a = np.column_stack([a[:, 0], a[:, 0] + 0.1 * a[:, 1], a[:, 1]])[:, [0, 1]]
    problem = formula(lambda z: 0.1 * a @ z, lambda z: a, 2)
    (pair,) = covariance(problem, solved(problem, np.zeros(2)), linear_frees(("a", "b"))).alike()
    assert pair[:2] == ("a", "b")
    assert pair[2] < -0.98


def _coverages(cases: int, *, windows: int, shared: float):
    """Coverage with windows given and of the naive covariance, over drawn cases."""
    rows = []
    for seed in range(cases):
        case = planted(seed, windows=windows, rows=24, shared=shared)
        found = covariance(case.problem, solved(case.problem), case.frees, cluster=case.cluster)
        away = 1.96 * np.sqrt(np.diag(found.naive))
        rows.append((case.truth, found.lower, found.upper, found.value - away, found.value + away))
    truth, low, high, naive_low, naive_high = np.stack(rows, axis=1)
    return coverage(truth, low, high), coverage(truth, naive_low, naive_high)


def test_intervals_cover_under_independent_noise():
    """95 % intervals hold the truths of 400 problems: the naive ones as often as promised, ours no less often."""
    ours, naive = _coverages(400, windows=7, shared=0.0)
    assert naive.share == pytest.approx(0.95, abs=0.018)
    assert 0.94 < ours.share < 0.98


@pytest.mark.parametrize("windows", [5, 24])
def test_intervals_cover_where_windows_share_a_misfit(windows):
    """With few windows (one pooled inflation) and with many (their own scores), where naive ones hold few truths."""
    ours, naive = _coverages(100, windows=windows, shared=0.5)
    assert naive.share < 0.7
    assert 0.89 < ours.share < 0.99


@pytest.mark.parametrize("loss", ["huber", "student_t"])
def test_robust_losses_keep_their_coverage(loss):
    """Weights lower the curvature and cut the scores: intervals that count both hold 95 % among 10 % outliers."""
    draw, rows = np.random.default_rng(5), []
    for _ in range(150):
        a, truth = draw.normal(size=(120, 3)), draw.normal(size=3)
        noise = draw.normal(size=120) * np.where(draw.random(120) < 0.1, 8.0, 1.0)
        y = a @ truth + noise
        problem = formula(lambda z, a=a, y=y: a @ z - y, lambda z, a=a: a, 3, block_size=3)
        solution = levenberg_marquardt(problem, np.zeros(3), loss=LOSSES[loss])
        found = covariance(problem, solution, linear_frees(problem.names), loss=LOSSES[loss], block=np.arange(120) // 3)
        rows.append((truth, found.lower, found.upper))
    assert 0.925 < coverage(*np.stack(rows, axis=1)).share < 0.985


def test_clopper_pearson_and_bias():
    """Interval of 10 of 10 and 0 of 10 by its closed form; a planted bias and honest sds are seen."""
    assert clopper_pearson(10, 10)[0] == pytest.approx(0.025**0.1)
    assert clopper_pearson(0, 10)[1] == pytest.approx(1 - 0.025**0.1)
    draw = np.random.default_rng(0)
    found = bias(0.5 + 2.0 * draw.normal(size=400), np.zeros(400), np.full(400, 2.0))
    assert found.mean == pytest.approx(0.5, abs=0.3)
    assert found.standard_error == pytest.approx(0.1, rel=0.1)
    assert found.size > 3
    assert found.pull_sd == pytest.approx(1.0, abs=0.1)
    with pytest.raises(ValueError, match="two cases"):
        bias(np.array([1.0, np.nan]), np.zeros(2))
    assert coverage(np.zeros(3), np.array([-1.0, 1.0, np.nan]), np.full(3, 2.0)).cases == 2
