"""Cubic tendon curves: exact recovery, the origin, the average, the monotone check, damaged tables."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.source import Source
from r2s2r_cli.stages.calibrate.tendons import (
    Curve,
    average,
    falls_from,
    fit_curve,
    force_of,
    read_curves,
    stiffness_min,
)
from schemas.robot import Robot
from tests.stages.calibrate.conftest import cubic_text, source

K = np.array([80.0, -300.0, 4000.0])
X = np.linspace(0, 0.1, 21)


def test_a_planted_cubic_is_recovered_exactly() -> None:
    """Points on a cubic through the origin give its coefficients and no residual."""
    fit = fit_curve(Curve("a", X, force_of(K, X)))
    np.testing.assert_allclose(fit.k, K, rtol=1e-9)
    assert fit.rms < 1e-12 and fit.x_max == 0.1


@pytest.mark.parametrize("seed", range(4))
def test_noisy_curves_pass_through_the_origin_and_are_least_squares(seed: int) -> None:
    """The fit is the least-squares solution without a constant, found from the normal equations."""
    force = force_of(K, X) + 0.1 * np.random.default_rng(seed).standard_normal(len(X)) + 0.3
    fit = fit_curve(Curve("a", X, force))
    design = np.stack([X, X**2, X**3], axis=1)
    np.testing.assert_allclose(fit.k, np.linalg.lstsq(design, force, rcond=None)[0], rtol=1e-6)
    assert force_of(fit.k, np.zeros(1))[0] == 0.0
    assert fit.rms == pytest.approx(np.sqrt(np.mean((force - design @ fit.k) ** 2)))


def test_a_straight_curve_has_no_higher_terms() -> None:
    """A linear spring gives k1 alone."""
    fit = fit_curve(Curve("a", X, 90.0 * X))
    np.testing.assert_allclose(fit.k * [1, 0.1, 0.01], [90.0, 0, 0], atol=1e-9)
    assert fit.stiffness_min == pytest.approx(90.0)


def test_the_average_of_eleven_curves() -> None:
    """The mean coefficients give the mean of the curves; the spread is the pointwise standard deviation."""
    ks = K * (1 + 0.1 * np.random.default_rng(1).standard_normal((11, 3)))
    ends = np.linspace(0.09, 0.1, 11)
    fits = [
        fit_curve(Curve(str(i), X / 0.1 * end, force_of(k, X / 0.1 * end)))
        for i, (k, end) in enumerate(zip(ks, ends, strict=True))
    ]
    mean = average(fits)
    assert mean.x_common == pytest.approx(0.09) and mean.x[-1] == mean.x_common
    curves = np.stack([force_of(k, mean.x) for k in ks])
    np.testing.assert_allclose(mean.mean, curves.mean(axis=0), atol=1e-10)
    np.testing.assert_allclose(mean.sd, curves.std(axis=0, ddof=1), atol=1e-10)
    np.testing.assert_allclose(mean.k_sd, ks.std(axis=0, ddof=1), rtol=1e-6)


def test_one_curve_has_no_spread() -> None:
    """The spread between curves is not a number where there is one curve only."""
    mean = average([fit_curve(Curve("a", X, force_of(K, X)))])
    assert np.isnan(mean.sd).all() and np.isnan(mean.k_sd).all()
    np.testing.assert_allclose(mean.mean, force_of(K, mean.x), rtol=1e-9)


@given(st.floats(-100, 100), st.floats(-3000, 3000), st.floats(-30000, 30000), st.floats(0.01, 0.2))
def test_smallest_stiffness_equals_a_dense_scan(k1: float, k2: float, k3: float, x_max: float) -> None:
    """The analytic minimum of the slope is never above, and hardly below, that of a dense scan."""
    x = np.linspace(0, x_max, 2001)
    scan = (k1 + 2 * k2 * x + 3 * k3 * x**2).min()
    exact = stiffness_min(np.array([k1, k2, k3]), x_max)
    margin = 3 * abs(k3) * (x[1] - x[0]) ** 2 + 1e-9
    assert scan - margin <= exact <= scan + 1e-9


@pytest.mark.parametrize(
    ("k", "monotone"),
    [
        ((80.0, 0.0, 0.0), True),
        ((80.0, -300.0, 4000.0), True),
        ((80.0, -1000.0, 4000.0), False),  # falls in the middle, rises at both ends
        ((80.0, 0.0, -3000.0), False),  # falls at the end
        ((-1.0, 500.0, 0.0), False),  # falls at the start
        ((80.0, -399.0, 0.0), True),  # would fall from 100.25 mm
        ((80.0, -401.0, 0.0), False),  # falls from 99.75 mm
    ],
)
def test_the_monotone_check_both_ways(k: tuple[float, float, float], monotone: bool) -> None:
    """Cubics that rise on the whole range pass, those that fall anywhere on it do not."""
    fit = fit_curve(Curve("a", X, force_of(np.array(k), X)))
    assert fit.monotone == monotone


def test_where_a_cubic_falls() -> None:
    """The first fall, in closed form: for k1 x + k2 x^2 it is -k1 / (2 k2)."""
    assert falls_from(np.array([80.0, -400.0, 0.0])) == pytest.approx(0.1)
    assert falls_from(np.array([80.0, 0.0, -3000.0])) == pytest.approx(np.sqrt(80 / 9000))
    assert falls_from(np.array([80.0, -400.0, 1e-13])) == pytest.approx(0.1, rel=1e-12)
    assert falls_from(np.array([80.0, -1000.0, 4000.0])) == pytest.approx((1000 - np.sqrt(40000)) / 12000)
    assert falls_from(np.array([80.0, -300.0, 4000.0])) == np.inf
    assert falls_from(np.array([80.0, 0.0, 0.0])) == np.inf
    assert falls_from(np.array([-1.0, 100.0, 0.0])) == 0.0


def test_tables_with_and_without_a_curve_column(robot: Robot) -> None:
    """One file with many curves, and one file a curve named by its stem; millimetres and metres alike."""
    ks = np.stack([K, K * 1.1])
    both = read_curves([source(cubic_text(ks), "all.csv")], robot)
    assert [curve.name for curve in both] == ["t0", "t1"]
    rows = "\n".join(
        ["displacement_m,force_N", *(f"{x},{f}" for x, f in zip(X.tolist(), force_of(K, X).tolist(), strict=True))]
    )
    (single,) = read_curves([source(rows, "runs/tendon 3.csv")], robot)
    assert single.name == "tendon 3"
    np.testing.assert_allclose(single.displacement, both[0].displacement, rtol=1e-12)
    np.testing.assert_allclose(fit_curve(both[1]).k, K * 1.1, rtol=1e-9)


def table(x: list[object], force: list[object], header: str = "displacement_mm,force_N") -> bytes:
    """A table of one curve."""
    return "\n".join([header, *(f"{a},{b}" for a, b in zip(x, force, strict=True))]).encode()


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (table([0, 10, 20, 30], [0, 1, 2, 3]), "too few points"),
        (table([10, 20, 30], [1, 2, 3]), "too few points"),
        (table([10, 10, 10, 20, 20], [1, 1, 1, 2, 2]), "too few points"),
        (table([0, 10, 20, 15, 30, 40], [0, 1, 2, 1.5, 3, 4]), "displacement decreases"),
        (table([-5, 10, 20, 30, 40], [0, 1, 2, 3, 4]), "below zero"),
        (table([0, 10, 20, 30, 40], [0, -1, -2, -3, -4]), "pushes"),
        (table([0, 10, 20, 30, 40], [0, 1, 2, -1, 4]), "pushes"),
        (table([0, 10, 20, 30, 40], [0, 0, 0, 0, 0]), "pushes"),
        (table([0, 10, 20, 30, 40], [0, 1, 2, 3, "4e300"]), "no tendon bears"),
        (table([0, 10, "nan", 30, 40], [0, 1, 2, 3, 4]), "not a number"),
        (table([0, 10, 20, 30, 40], [0, 1, 2, "inf", 4]), "not a number"),
        (table([0, 10, 20, 30, 40], [0, 1, 2, 3, 4], "displacement_m,force_N"), "a stretch that no cable"),
        (table([0, 0.01, 0.02, 0.03, 0.04], [0, 1, 2, 3, 4]), "a stretch that no cable"),
        (table([0, 10], [0, 1], "displacement_mm,force_kN"), "did you mean force_N"),
        (table([0, 10], [0, 1], "displacement_mm,displacement_m"), "two columns hold the displacement"),
    ],
)
def test_a_wrong_curve_is_refused(robot: Robot, data: bytes, what: str) -> None:
    """Every kind of damage raises InputError with place, expectation and hint."""
    with pytest.raises(InputError) as caught:
        read_curves([Source("tendon.csv", data)], robot)
    error = caught.value
    assert what in error.what
    assert error.where.startswith("tendon.csv") and error.expected and error.received and error.hint


def test_two_curves_of_one_name_are_refused(robot: Robot) -> None:
    """The same file twice would count a tendon twice."""
    text = source(cubic_text(K[None]), "a.csv")
    with pytest.raises(InputError, match="same name"):
        read_curves([text, text], robot)


def test_the_noise_of_an_unloaded_cell_passes(robot: Robot) -> None:
    """Forces slightly below zero at the start of a pull are noise, not a pushing tendon."""
    (curve,) = read_curves([Source("a.csv", table([0, 1, 10, 20, 30, 40], [-0.01, 0.01, 1, 2, 3, 4]))], robot)
    assert fit_curve(curve).k[0] == pytest.approx(100, rel=0.05)
