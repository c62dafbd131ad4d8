"""The straight line of one sensor: closed forms against brute force and planted truths."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.calibrate.lines import DEAD, FALLING, GOOD, fit_line

LENGTHS = np.array([0.10, 0.12, 0.14, 0.16, 0.186])


def noisy(seed: int, slope: float = 3e-11, noise: float = 5e-14) -> tuple[np.ndarray, np.ndarray]:
    """Points about a line, capacitance noise in F."""
    rng = np.random.default_rng(seed)
    length = np.sort(rng.uniform(0.1, 0.3, rng.integers(5, 9)))
    return length, slope * length + 1.7e-11 + noise * rng.standard_normal(len(length))


def test_a_planted_line_is_recovered_exactly() -> None:
    """Points on a line give its slope and offset, and no residual."""
    fit = fit_line(LENGTHS, 3.21e-11 * LENGTHS + 1.654e-11)
    assert fit.slope == pytest.approx(3.21e-11, rel=1e-12)
    assert fit.offset == pytest.approx(1.654e-11, rel=1e-12)
    assert max(fit.rms, fit.worst, fit.loo_rms, fit.quadratic_rms) < 1e-12
    assert fit.state == GOOD


@pytest.mark.parametrize("seed", range(5))
def test_residuals_are_lengths_that_the_line_reads_back(seed: int) -> None:
    """Slope and offset are those of polyfit; a residual is the inverted line minus the measured length."""
    length, capacitance = noisy(seed)
    fit = fit_line(length, capacitance)
    slope, offset = np.polyfit(length, capacitance, 1)
    assert fit.slope == pytest.approx(slope, rel=1e-9)
    np.testing.assert_allclose(fit.residual, (capacitance - offset) / slope - length, atol=1e-12)
    assert fit.rms == pytest.approx(np.sqrt(np.mean(fit.residual**2)))
    assert fit.worst == pytest.approx(np.abs(fit.residual).max())


@pytest.mark.parametrize("seed", range(5))
def test_leave_one_out_equals_fitting_without_the_point(seed: int) -> None:
    """The closed form of the left-out residuals agrees with n separate fits."""
    length, capacitance = noisy(seed)
    fit = fit_line(length, capacitance)
    for i in range(len(length)):
        slope, offset = np.polyfit(np.delete(length, i), np.delete(capacitance, i), 1)
        assert fit.loo_residual[i] == pytest.approx((capacitance[i] - offset) / slope - length[i], rel=1e-7, abs=1e-12)
    assert fit.loo_rms > fit.rms


@pytest.mark.parametrize("seed", range(5))
def test_quadratic_residual_equals_a_parabola_fit(seed: int) -> None:
    """The rms of the parabola is that of polyfit of degree 2, over the line's slope."""
    length, capacitance = noisy(seed)
    left = capacitance - np.polyval(np.polyfit(length, capacitance, 2), length)
    fit = fit_line(length, capacitance)
    assert fit.quadratic_rms == pytest.approx(np.sqrt(np.mean(left**2)) / abs(fit.slope), rel=1e-6)
    assert fit.quadratic_rms <= fit.rms


def test_a_curved_sensor_shows_in_the_quadratic_residual() -> None:
    """Points on a parabola leave a residual to the line and none to the parabola."""
    fit = fit_line(LENGTHS, 1.7e-11 + 2e-11 * LENGTHS + 5e-11 * LENGTHS**2)
    assert fit.rms > 1e-4
    assert fit.quadratic_rms < 1e-9


def test_four_lengths_are_too_few_for_a_parabola() -> None:
    """With fewer than five lengths the quadratic residual is not a number, the line's still is."""
    length, capacitance = LENGTHS[:4], 3e-11 * LENGTHS[:4] + np.array([0, 1, -1, 0]) * 1e-14
    fit = fit_line(length, capacitance)
    assert np.isnan(fit.quadratic_rms) and np.isfinite(fit.loo_rms)


def test_the_standard_error_is_that_of_scipy() -> None:
    """Slope and standard error agree with scipy.stats.linregress."""
    from scipy.stats import linregress

    length, capacitance = noisy(11)
    fit, other = fit_line(length, capacitance), linregress(length, capacitance)
    assert fit.slope_se == pytest.approx(other.stderr, rel=1e-9)


@pytest.mark.parametrize("value", [2e-13, 2.33e-11])
def test_a_constant_capacitance_is_dead(value: float) -> None:
    """A sensor that always says the same is dead, and has no residuals in length."""
    fit = fit_line(LENGTHS, np.full(5, value))
    assert fit.state == DEAD
    assert np.isnan([fit.rms, fit.worst, fit.loo_rms, fit.quadratic_rms]).all() and np.isnan(fit.residual).all()


def test_the_dead_flag_follows_the_standard_error() -> None:
    """Noise without slope is dead; the same noise on a real slope is not, at the p-value of linregress."""
    from scipy.stats import linregress

    states = {True: 0, False: 0}
    for seed in range(200):
        rng = np.random.default_rng(seed)
        capacitance = 2e-11 + 2e-12 * LENGTHS + 1e-13 * rng.standard_normal(5)
        fit = fit_line(LENGTHS, capacitance)
        dead = linregress(LENGTHS, capacitance).pvalue >= 0.05
        assert (fit.state == DEAD) == dead
        states[dead] += 1
    assert min(states.values()) > 20


def test_a_falling_line_is_flagged_and_not_dead() -> None:
    """Exchanged columns or a wrong sensor: capacitance that falls with the length."""
    assert fit_line(LENGTHS, 2e-11 - 3e-11 * LENGTHS).state == FALLING


def test_the_line_does_not_depend_on_the_order_of_the_points() -> None:
    """Permuted points give the same fit, with permuted residuals."""
    length, capacitance = noisy(3)
    order = np.random.default_rng(0).permutation(len(length))
    fit, other = fit_line(length, capacitance), fit_line(length[order], capacitance[order])
    assert other.rms == pytest.approx(fit.rms) and other.loo_rms == pytest.approx(fit.loo_rms)
    np.testing.assert_allclose(other.residual, fit.residual[order], atol=1e-12)
