"""The smoother against closed forms: it is a least-squares problem that small matrices solve directly."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.estimate import kalman
from r2s2r_cli.stages.estimate.kalman import Disturbances, backward, forward, process, transition
from r2s2r_cli.stages.estimate.likelihood import log_likelihood
from r2s2r_cli.stages.estimate.noise import MIN_NOISE
from tests.stages.estimate import dense
from tests.stages.estimate.dense import covariance

N = 9
NARROW = (0.1, 1.0)
"""A prior with which one big matrix can still be inverted exactly."""


def problem(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, Disturbances]:
    """A short random track of two series with a gap, a kick and a jump."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.03, 0.2, N))
    y = np.cumsum(rng.normal(0, 0.02, (N, 2)), axis=0)
    y[4, 1] = np.nan
    var = rng.uniform(1e-6, 1e-5, (N, 2))
    kick, jump = np.zeros(N - 1), np.zeros((N - 1, 2))
    kick[2], jump[5, 0] = 0.04, 0.01
    return t, y, var, np.array([[1e-3, 1e-2]]), Disturbances(kick, jump)


def solved(
    t: np.ndarray, y: np.ndarray, var: np.ndarray, density: float, kick: np.ndarray, jump: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean and covariance of all states of one series, and the log density of its observations, by one big matrix."""
    n = len(t)
    cov = covariance(t, density, kick, jump, 2, NARROW)
    seen = np.flatnonzero(np.isfinite(y))
    mean0 = np.zeros(n * 2)
    mean0[::2] = y[seen[0]]
    select = np.eye(n * 2)[seen * 2]
    spread = select @ cov @ select.T + np.diag(var[seen])
    gain = cov @ select.T @ np.linalg.inv(spread)
    rest = y[seen] - select @ mean0
    loglik = -0.5 * (rest @ np.linalg.solve(spread, rest) + np.linalg.slogdet(2 * np.pi * spread)[1])
    left = np.eye(n * 2) - gain @ select
    posterior = left @ cov @ left.T + gain @ np.diag(var[seen]) @ gain.T
    return (mean0 + gain @ rest).reshape(n, 2), posterior, float(loglik)


@pytest.mark.parametrize("seed", range(3))
def test_the_likelihood_alone_is_that_of_the_filter(seed: int) -> None:
    """Of every process noise of a grid and every series, with what is missing, kicks and jumps."""
    t, y, var, _, free = problem(seed)
    density = 10.0 ** np.linspace(-8, 2, 11)[:, None]
    expected = forward(t, y, var, density, free).loglik
    assert log_likelihood(t, y, var, density, free) == pytest.approx(expected, rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_states_and_covariance_are_those_of_least_squares(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Filter and smoother give the conditional mean, covariance and likelihood that one big Gaussian gives."""
    monkeypatch.setattr(kalman, "PRIOR_SD", NARROW)
    t, y, var, density, free = problem(seed)
    run = forward(t, y, var, density, free)
    state = backward(t, y, var, free, run)
    for s in range(2):
        mean, cov, loglik = solved(t, y[:, s], var[:, s], density[0, s], free.kick, free.jump[:, s])
        assert state.mean[:, s] == pytest.approx(mean, rel=1e-6, abs=1e-8)
        for k in range(N):
            block = slice(2 * k, 2 * k + 2)
            assert state.cov[k, s] == pytest.approx(cov[block, block], rel=1e-3, abs=1e-9)
        assert run.loglik[0, s] == pytest.approx(loglik, rel=1e-6)


def test_outlier_score_is_the_left_out_residual() -> None:
    """The score of a frame equals its distance from the track smoothed without it, over the standard deviation."""
    t, y, var, density, free = problem(1)
    state = backward(t, y, var, free, forward(t, y, var, density, free))
    for k in (1, 4, 7):
        rest = y.copy()
        rest[k] = np.nan
        left = backward(t, rest, var, free, forward(t, rest, var, density, free))
        expected = (y[k] - left.mean[k, :, 0]) / np.sqrt(left.cov[k, :, 0, 0] + var[k])
        assert state.outlier[k] == pytest.approx(np.nan_to_num(expected), abs=1e-6)


def test_jump_score_is_the_likelihood_ratio_of_a_free_jump() -> None:
    """Half the squared score is what a jump of free size in that gap adds to the log likelihood."""
    t, y, var, density, free = problem(2)

    def loglik(size: float) -> float:
        moved = y.copy()
        moved[6:, 0] -= size
        return float(forward(t, moved, var, density, still).loglik[0, 0])

    still = Disturbances(free.kick, np.zeros_like(free.jump))
    state = backward(t, y, var, still, forward(t, y, var, density, still))
    sizes = np.array([-0.01, 0.0, 0.01])
    parabola = np.polyfit(sizes, [loglik(size) for size in sizes], 2)
    gain = parabola[2] - parabola[1] ** 2 / (4 * parabola[0]) - loglik(0.0)
    assert 0.5 * state.jump[6, 0] ** 2 == pytest.approx(gain, rel=1e-4)


def test_a_straight_line_without_noise_is_recovered() -> None:
    """Constant velocity, no noise, irregular stamps: position and velocity come out to a millionth."""
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.02, 0.3, 40))
    y = (0.3 + 0.07 * t)[:, None]
    var = np.full(y.shape, MIN_NOISE**2)
    free = Disturbances(np.zeros(39), np.zeros((39, 1)))
    state = backward(t, y, var, free, forward(t, y, var, np.array([[1e-8]]), free))
    assert state.mean[:, 0, 0] == pytest.approx(y[:, 0], abs=1e-9)
    assert state.mean[:, 0, 1] == pytest.approx(0.07, abs=1e-6)


def test_process_noise_adds_up_over_time() -> None:
    """Two gaps one after the other give the covariance of the whole gap: the model does not depend on the stamps."""
    a, b = 0.07, 0.11
    assert transition(b) @ process(a) @ transition(b).T + process(b) == pytest.approx(process(a + b), rel=1e-12)


def test_the_model_is_noise_that_is_integrated_twice() -> None:
    """Transition and process noise are those of the general formulas for integrated white noise."""
    assert transition(0.13) == pytest.approx(dense.transition(0.13, 2), rel=1e-12)
    assert process(0.13) == pytest.approx(dense.process(0.13, 2), rel=1e-12)
