"""The analysis step against the Kalman filter in closed form, and what a point that is far off may do."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.identify.ensemble import analysis, centred, student_weights

MEMBERS, STATE, CAPS = 40, 7, 4
SENSOR = 3 * CAPS


def problem(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Deviations (E, n) with correlated parts, a linear sensor (m, n), an innovation (m,) and variances (m,)."""
    rng = np.random.default_rng(seed)
    deviation = centred(rng, MEMBERS, STATE) @ rng.normal(size=(STATE, STATE))
    return deviation, rng.normal(size=(SENSOR, STATE)), rng.normal(size=SENSOR), rng.uniform(0.5, 2.0, SENSOR)


@pytest.mark.parametrize("members", [STATE + 1, MEMBERS])
def test_the_analysis_is_the_kalman_update(members: int) -> None:
    """Mean and covariance of a linear Gaussian problem, as the gain gives them, to rounding."""
    _, sensor, innovation, variance = problem()
    deviation = centred(np.random.default_rng(1), members, STATE)
    before = deviation.T @ deviation / (members - 1)
    gain = before @ sensor.T @ np.linalg.inv(sensor @ before @ sensor.T + np.diag(variance))
    shift, after = analysis(deviation, deviation @ sensor.T, innovation, variance)
    assert shift == pytest.approx(gain @ innovation, abs=1e-12)
    assert after.T @ after / (members - 1) == pytest.approx((np.eye(STATE) - gain @ sensor) @ before, abs=1e-12)


def test_the_square_root_is_symmetric() -> None:
    """It keeps the members about their mean, and two analyses of half the precision are one of the whole."""
    deviation, sensor, innovation, variance = problem()
    shift, after = analysis(deviation, deviation @ sensor.T, innovation, variance)
    assert after.sum(axis=0) == pytest.approx(np.zeros(STATE), abs=1e-12)
    half, between = analysis(deviation, deviation @ sensor.T, innovation, 2 * variance)
    other, last = analysis(between, between @ sensor.T, innovation - sensor @ half, 2 * variance)
    assert half + other == pytest.approx(shift, abs=1e-12)
    assert last.T @ last == pytest.approx(after.T @ after, abs=1e-10)


def test_a_sensor_without_precision_changes_nothing() -> None:
    """Infinite variance, as of a point that is not seen."""
    deviation, sensor, innovation, _ = problem()
    shift, after = analysis(deviation, deviation @ sensor.T, innovation, np.full(SENSOR, np.inf))
    assert not shift.any() and (after == deviation).all()


def test_a_point_far_off_is_ignored() -> None:
    """As it goes away, the update tends to that of the other points; without the weights it follows."""
    deviation, sensor, innovation, variance = problem()
    seen = deviation @ sensor.T
    without = variance.copy()
    without[:3] = np.inf
    expected, _ = analysis(deviation, seen, innovation, without)

    def shift(off: float, dof: float) -> np.ndarray:
        moved = innovation + np.r_[np.full(3, off), np.zeros(SENSOR - 3)]
        weight = student_weights(
            moved.reshape(CAPS, 3), seen.reshape(MEMBERS, CAPS, 3), variance.reshape(CAPS, 3), dof
        )[:1]  # fmt: skip
        precision = np.r_[np.repeat(weight, 3), np.ones(SENSOR - 3)]
        return analysis(deviation, seen, moved, variance / precision)[0]

    errors = [float(np.abs(shift(off, 4.0) - expected).max()) for off in (1e2, 1e4, 1e6)]
    assert errors[0] > 10 * errors[1] > 100 * errors[2] and errors[2] < 1e-3
    assert np.abs(shift(1e6, 1e30) - expected).max() > 1e3


def test_a_point_within_its_spread_counts_in_full() -> None:
    """Weight 1 to d^2 = 3, (dof + 3) / (dof + d^2) beyond; what the members scatter is explained too."""
    narrow, wide = np.zeros((5, 1, 3)), np.zeros((5, 1, 3))
    wide[:, 0, 0] = [-4.0, -4.0, 0.0, 4.0, 4.0]  # variance 16
    off = np.array([[4.0, 0.0, 0.0]])
    assert student_weights(off, narrow, np.ones((1, 3)), 4.0) == pytest.approx(7 / 20)
    assert student_weights(off, wide, np.ones((1, 3)), 4.0) == pytest.approx(1.0)


def test_centred_draws() -> None:
    """Their mean is 0 to rounding, their sd 1."""
    draws = centred(np.random.default_rng(0), 2000, 3)
    assert draws.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-14)
    assert draws.std(axis=0) == pytest.approx(np.ones(3), abs=0.05)
