"""Levenberg-Marquardt: known minima, the minima of scipy, priors, bounds, outliers, and refused steps."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.free import Coordinate, Free, slopes_of, values_of
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.loss import LOSSES, Huber, StudentT
from r2s2r_cli.stages.identify.solve.record import Reason
from tests.stages.identify.solve.problems import (
    DECAY_START,
    INF,
    decay,
    formula,
    line_with_outliers,
    linear,
    rosenbrock,
)

TIGHT = {"tolerance": 0.0, "step_sd": 0.0, "gradient_sd": 1e-10, "max_iterations": 200}


def scipy_minimum(problem, z0, **options):
    """The same problem given to scipy, as tight as it goes."""
    return least_squares(problem.f, z0, problem.df, bounds=(problem.lower, problem.upper),
                         xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac", max_nfev=2000, **options)  # fmt: skip


def test_rosenbrock() -> None:
    """The curved valley is followed to its known minimum."""
    solution = levenberg_marquardt(rosenbrock(), np.array([-1.2, 1.0]), **TIGHT)
    np.testing.assert_allclose(solution.z, 1.0, atol=1e-9)
    assert solution.reason is Reason.GRADIENT
    assert solution.reason.converged
    assert np.all(np.diff(solution.costs) < 0)
    assert len(solution.costs) == solution.iterations + 1


def test_linear_in_one_step() -> None:
    """Without damping, one step solves a linear problem."""
    problem, a, b = linear()
    solution = levenberg_marquardt(problem, np.full(4, 3.0), damping0=0.0)
    np.testing.assert_allclose(solution.z, np.linalg.lstsq(a, b, rcond=None)[0], atol=1e-7)
    assert solution.iterations == 1
    assert solution.counts.plain == 1
    assert solution.counts.jacobian == 2
    np.testing.assert_allclose(solution.normal, a.T @ a, rtol=1e-12)


def test_priors_are_ridge() -> None:
    """Normal priors give the closed form of ridge regression, and the matrix whose inverse is the posterior."""
    mean, sd = np.array([1.0, -1.0, 0.5, 0.0]), np.array([0.1, 0.2, INF, 0.05])
    problem, a, b = linear(prior_mean=mean, prior_sd=sd)
    solution = levenberg_marquardt(problem, np.zeros(4), **TIGHT)
    precision = np.diag(sd**-2.0)
    np.testing.assert_allclose(solution.z, np.linalg.solve(a.T @ a + precision, a.T @ b + precision @ mean), atol=1e-7)
    np.testing.assert_allclose(solution.normal - solution.normal_data, precision, atol=1e-12)
    expected = 0.5 * (np.sum((a @ solution.z - b) ** 2) + np.sum(((solution.z - mean) / sd) ** 2))
    assert solution.cost == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("seed", range(5))
def test_bounded_linear_is_the_minimum_in_the_box(seed: int) -> None:
    """With several bounds active, the exact minimum of the box is found, and the unknowns lie on them exactly."""
    problem, a, b = linear(seed, n=6, lower=-0.1, upper=0.05)
    solution = levenberg_marquardt(problem, np.zeros(6), **TIGHT)
    oracle = lsq_linear(a, b, (-0.1, 0.05), method="bvls", tol=1e-15)
    np.testing.assert_allclose(solution.z, oracle.x, atol=1e-7)
    active = tuple(name for name, on in zip(problem.names, oracle.active_mask, strict=True) if on)
    assert 2 <= len(active) <= 6
    assert set(active) <= set(solution.on_bound)


@pytest.mark.parametrize(
    ("limits", "loss", "scipy_loss"),
    [
        ({}, LOSSES["none"], {}),
        ({"lower": 0.0, "upper": [1.8, 5.0, 5.0]}, LOSSES["none"], {}),
        ({"upper": [5.0, 5.0, 0.45]}, LOSSES["none"], {}),
        ({}, Huber(0.5), {"loss": "huber", "f_scale": 0.5}),
        ({"lower": [-9.0, 0.75, -9.0]}, Huber(0.5), {"loss": "huber", "f_scale": 0.5}),
    ],
)
def test_decay_like_scipy(limits, loss, scipy_loss) -> None:
    """A decay is fitted to the minimum that scipy finds: free, with bounds active, with Huber's loss, with both."""
    problem = decay(**limits)
    start = np.clip(DECAY_START, problem.lower + 1e-3, problem.upper - 1e-3)
    oracle = scipy_minimum(problem, start, **scipy_loss)
    solution = levenberg_marquardt(problem, start, loss=loss, **TIGHT)
    assert solution.cost <= oracle.cost * (1 + 1e-12)
    np.testing.assert_allclose(solution.z, oracle.x, rtol=1e-8, atol=1e-8)
    assert bool(solution.on_bound) is bool(limits)


def test_gradient_is_the_slope_of_the_cost() -> None:
    """With a loss and priors, the gradient agrees with central differences of the robust cost."""
    problem = decay(prior_mean=1.0, prior_sd=[0.3, INF, 0.1])

    def at(z):
        return levenberg_marquardt(problem, z, loss=StudentT(), max_iterations=0)

    z, h = np.array([1.5, 1.0, 0.3]), 1e-6
    slope = [(at(z + h * e).cost - at(z - h * e).cost) / (2 * h) for e in np.eye(3)]
    np.testing.assert_allclose(at(z).gradient, slope, rtol=1e-6)
    assert at(z).reason is Reason.ITERATIONS


@pytest.mark.parametrize("seed", range(4))
def test_robust_losses_see_through_outliers(seed: int) -> None:
    """A line with 20 % outliers is recovered by Student's t within its noise; least squares is off by many sd."""
    problem = line_with_outliers(seed)
    fit = {name: levenberg_marquardt(problem, np.zeros(2), loss=loss) for name, loss in LOSSES.items()}
    sd = np.sqrt(np.diag(np.linalg.inv(fit["student_t"].normal)))
    off = {name: np.max(np.abs(one.z - [1.0, 2.0]) / sd) for name, one in fit.items()}
    assert off["student_t"] < 3.5
    assert off["huber"] < 0.5 * off["none"]
    assert off["none"] > 10.0
    outlier = fit["student_t"].weight.reshape(-1, 3)
    assert np.all(outlier == outlier[:, :1])
    assert np.sum(outlier[:, 0] < 0.1) == 8


def test_steps_into_nan_are_refused() -> None:
    """A fit whose first full step leads where the simulation fails shortens it and ends at the minimum."""
    problem = formula(
        lambda z: np.array([np.nan]) if z[0] > 3.0 else np.array([np.arctan(z[0] - 2.0)]),
        lambda z: np.array([[1.0 / (1.0 + (z[0] - 2.0) ** 2)]]),
        1,
    )
    solution = levenberg_marquardt(problem, np.array([0.0]), **TIGHT)
    assert solution.z[0] == pytest.approx(2.0, abs=1e-9)
    asked = (problem.calls.count(False), problem.calls.count(True))
    assert asked == (solution.counts.plain, solution.counts.jacobian)
    assert solution.counts.plain + solution.counts.jacobian > solution.iterations + 1


def test_infinite_residuals_and_derivatives_are_refused() -> None:
    """Residuals and derivatives that are returned but not finite are refused like an error."""
    problem = formula(lambda z: np.array([np.inf if z[0] > 3.0 else np.arctan(z[0] - 2.0)]),
                      lambda z: np.array([[np.nan if z[0] > 2.5 else 1.0 / (1.0 + (z[0] - 2.0) ** 2)]]), 1)  # fmt: skip
    assert levenberg_marquardt(problem, np.array([0.0]), **TIGHT).z[0] == pytest.approx(2.0, abs=1e-9)


def test_huge_residuals_are_refused_without_a_warning() -> None:
    """Residuals whose squares overflow, as of a simulation that explodes, are refused; warnings are errors here."""
    problem = formula(lambda z: np.array([1e200 if z[0] > 3.0 else np.arctan(z[0] - 2.0)]),
                      lambda z: np.array([[1.0 / (1.0 + (z[0] - 2.0) ** 2)]]), 1)  # fmt: skip
    for loss in LOSSES.values():
        assert levenberg_marquardt(problem, np.array([0.0]), loss=loss, **TIGHT).z[0] == pytest.approx(2.0, abs=1e-9)


def test_start_that_cannot_be_evaluated() -> None:
    """A start without a finite simulation is an error with a hint, not a refused step."""
    problem = formula(lambda z: np.array([np.inf]), lambda z: np.array([[1.0]]), 1)
    with pytest.raises(NumericalError, match="not finite") as caught:
        levenberg_marquardt(problem, np.array([0.0]))
    assert "hint:" in str(caught.value)


def test_start_outside_and_bound_hit_are_reported() -> None:
    """The start is moved into the box; a parameter that ends on a bound, or within 1 % of it, is named."""
    names = ("mass", "friction", "damping")
    problem = formula(lambda z: z - [2.0, 0.995, 0.5, 9.0], lambda z: np.eye(4), 4, lower=0.0, upper=1.0, names=names)
    solution = levenberg_marquardt(problem, np.full(4, 7.0), **TIGHT)
    np.testing.assert_allclose(solution.z, [1.0, 0.995, 0.5, 1.0], atol=1e-9)
    assert solution.on_bound == ("mass", "friction")


def test_leaves_a_bound_that_it_starts_on() -> None:
    """An unknown that starts on a bound moves off it where the cost falls inwards."""
    problem = decay(lower=[0.0, 0.0, 0.0])
    solution = levenberg_marquardt(problem, np.array([0.1, 0.0, 0.0]), **TIGHT)
    np.testing.assert_allclose(solution.z, scipy_minimum(problem, [1, 1, 1]).x, atol=1e-8)


def test_unknown_without_any_effect_stays() -> None:
    """A column of zeros and no prior: that unknown stays where it is, the others are solved."""
    _, a, b = linear()
    problem = formula(lambda z: a @ z[:4] - b, lambda z: np.hstack([a, np.zeros((30, 1))]), 5)
    solution = levenberg_marquardt(problem, np.array([0.0, 0.0, 0.0, 0.0, 0.7]), **TIGHT)
    np.testing.assert_allclose(solution.z, [*np.linalg.lstsq(a, b, rcond=None)[0], 0.7], atol=1e-7)


def test_kink_ends_the_fit() -> None:
    """Where the derivative lies on one side of a kink, the fit stops and says it is stuck, not converged."""
    problem = formula(lambda z: np.array([1.0 + abs(z[0])]), lambda z: np.array([[1.0 if z[0] >= 0 else -1.0]]), 1)
    solution = levenberg_marquardt(problem, np.array([0.0]))
    assert solution.reason is Reason.STUCK
    assert not solution.reason.converged
    assert solution.z[0] == 0.0


def test_default_limits_end_within_a_share_of_a_standard_deviation() -> None:
    """With the default limits, the answer lies within 0.02 sd of the minimum, after few Jacobians."""
    for seed in range(5):
        problem = decay(seed)
        solution = levenberg_marquardt(problem, DECAY_START)
        sd = np.sqrt(np.diag(np.linalg.inv(solution.normal)))
        assert np.max(np.abs(solution.z - scipy_minimum(problem, DECAY_START).x) / sd) < 0.02
        assert solution.reason.converged
        assert solution.message.startswith("Converged")
        assert solution.counts.jacobian <= 12


def test_two_short_steps_in_a_row_end_the_fit() -> None:
    """Asked to stop on steps alone, it stops at the second step in a row that is shorter than the share of an sd."""
    lengths = []
    solution = levenberg_marquardt(decay(), DECAY_START, loss=Huber(0.5), tolerance=0.0, gradient_sd=0.0, step_sd=0.05,
                                   progress=lambda step: lengths.append(step.step_sd))  # fmt: skip
    assert solution.reason is Reason.STEP
    assert max(lengths[-2:]) <= 0.05 < min(lengths[:-2])


def test_two_solves_give_the_same_bits() -> None:
    """The same call twice gives the same bits everywhere."""
    first, second = (levenberg_marquardt(decay(), DECAY_START, loss=StudentT()) for _ in range(2))
    for one in dataclasses.fields(first):
        np.testing.assert_array_equal(getattr(first, one.name), getattr(second, one.name))


def test_data_that_ask_for_more_than_a_share_can_be() -> None:
    """A logit has no end, and each step is further than the one before: the fit ends at the bound that data pull to."""
    frees = (Free("x", "1", 0.3, 0.0, 1.0, Coordinate.LOGIT),)
    for wanted, bound in ((-0.5, 0.0), (1.5, 1.0)):
        problem = formula(
            lambda z, wanted=wanted: 100.0 * (values_of(frees, z) - wanted) * np.arange(1.0, 4.0),
            lambda z: 100.0 * slopes_of(frees, z) * np.arange(1.0, 4.0)[:, None],
            1,
        )
        solution = levenberg_marquardt(problem, np.array([frees[0].to_z(0.3)]))
        assert values_of(frees, solution.z)[0] == pytest.approx(bound, abs=1e-6)
