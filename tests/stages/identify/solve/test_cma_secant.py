"""The two ways without derivatives: CMA-ES agrees with Levenberg-Marquardt, secants with Jacobians."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.solve.cma_es import cma_es
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.loss import StudentT
from r2s2r_cli.stages.identify.solve.secant import secant_jacobian
from tests.stages.identify.solve.problems import DECAY_START, decay, formula, linear


@pytest.mark.parametrize("limits", [{}, {"lower": 0.0, "upper": [1.8, 5.0, 5.0]}])
def test_cma_agrees_with_levenberg(limits) -> None:
    """From afar, CMA-ES comes within 0.05 sd of the solution of Levenberg-Marquardt, also on a bound."""
    problem = decay(**limits)
    newton = levenberg_marquardt(problem, DECAY_START, loss=StudentT())
    sampled = cma_es(problem, DECAY_START, sd0=0.5, budget=3000, seed=1, loss=StudentT())
    sd = np.sqrt(np.diag(np.linalg.inv(newton.normal)))
    assert np.max(np.abs(sampled.z - newton.z) / sd) < 0.05
    assert newton.cost - 1e-3 < sampled.cost < newton.cost + 1e-3
    assert sampled.on_bound == newton.on_bound
    assert np.all(np.diff(sampled.costs) <= 0)


def test_cma_is_silent_seeded_and_keeps_nuisances(tmp_path, monkeypatch, capfd) -> None:
    """No file, no output, global generator untouched; one seed, the same bits; nuisances stay; failures lose."""
    monkeypatch.chdir(tmp_path)
    full = decay()
    problem = formula(lambda z: full.f(z) if z[0] > 0.5 else np.full(40, np.nan), full.df, 3, names=("a", "b"))
    before = np.random.get_state()[1].copy()
    first, again, other = (cma_es(problem, [1.0, 2.0, 0.5], sd0=[0.5, 0.3], budget=120, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(before, np.random.get_state()[1])
    np.testing.assert_array_equal(first.z, again.z)
    assert first.costs == again.costs
    assert np.any(first.z != other.z)
    assert first.z[2] == 0.5
    assert first.reason == "budget"
    assert 120 <= first.counts.plain < 130
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_cma_goes_on_where_it_was_interrupted() -> None:
    """Interrupted in the seventh generation: it simulates the rest alone, failed samples among it, and ends bit by bit
    as the whole search, with the same progress."""
    full, spent = decay(), [0]

    def f(z):
        spent[0] += 1
        return full.f(z) if z[0] > 0.7 else np.full(40, np.nan)

    def search(**options):
        spent[0], told = 0, []
        problem = formula(f, full.df, 3, names=("a", "b"))
        found = cma_es(problem, [1.0, 2.0, 0.5], sd0=[0.5, 0.3], budget=90, seed=4, progress=told.append, **options)
        return found, told, spent[0]

    def stop(costs):
        kept[:] = [list(one) for one in costs]
        if len(costs) == 7:
            raise KeyboardInterrupt

    kept = []
    whole, told, evaluations = search()
    with pytest.raises(KeyboardInterrupt):
        search(checkpoint=stop)
    assert len(kept) == 7 and np.isinf(kept).any()
    again, told_again, rest = search(resume=kept)
    assert (again.costs, again.counts, again.reason) == (whole.costs, whole.counts, whole.reason)
    np.testing.assert_array_equal(again.z, whole.z)
    assert told_again == told
    assert rest == evaluations - sum(map(len, kept))


def test_cma_where_nothing_is_finite() -> None:
    """Without one finite sample there is no answer."""
    problem = formula(lambda z: np.array([np.nan]), lambda z: np.array([[1.0, 1.0]]), 2)
    with pytest.raises(NumericalError, match="no sample"):
        cma_es(problem, np.zeros(2), sd0=1.0, budget=30, seed=0)


def batch(f):
    """Many points at once, as the engine runs them."""
    return lambda zs: np.array([f(z) for z in zs])


def test_secants_are_the_jacobian_of_smooth_functions() -> None:
    """On a smooth function, quotients agree with the Jacobian, and the smaller width is taken."""
    problem, z = decay(), np.array([1.5, 0.9, 0.2])
    secant = secant_jacobian(batch(problem.f), z, (1e-4, 1e-3))
    np.testing.assert_allclose(secant.jacobian, problem.df(z), atol=1e-6, rtol=1e-6)
    np.testing.assert_array_equal(secant.residual, problem.f(z))
    assert secant.width[1] == 1e-4
    assert np.all(secant.rough < 1e-3)


def test_secants_look_over_jumps() -> None:
    """On stairs of height 0.01 along a slope of 1, the wide quotient is taken, and is the slope."""
    stairs = batch(lambda z: np.floor(z / 0.01 + 0.3) * 0.01)
    wide = secant_jacobian(stairs, np.array([0.5]), (0.004, 0.2))
    assert wide.width[0] == 0.2
    assert wide.jacobian[0, 0] == pytest.approx(1.0, abs=0.06)
    narrow = secant_jacobian(stairs, np.array([0.5]), (0.004, 0.0045))
    assert narrow.rough[0] == 1.0


def test_secants_at_bounds_and_beside_failures() -> None:
    """At a bound or beside a failure the quotient is one-sided, and says so; with neither side it is an error."""

    def f(z):
        return np.full(2, np.nan) if z[1] > 1.0 else np.array([2.0 * z[0] + z[1], 3.0 * z[1]])

    secant = secant_jacobian(batch(f), np.array([0.0, 1.0]), (1e-3, 1e-2), lower=np.array([0.0, -9.0]))
    np.testing.assert_allclose(secant.jacobian, [[2.0, 1.0], [0.0, 3.0]], atol=1e-9)
    assert np.all(np.isnan(secant.rough))
    with pytest.raises(NumericalError, match="both sides"):
        secant_jacobian(batch(f), np.zeros(2), (1e-3, 1e-2), lower=0.0, upper=0.0)
    with pytest.raises(NumericalError, match="not finite"):
        secant_jacobian(batch(f), np.array([0.0, 2.0]), (1e-3, 1e-2))


@pytest.mark.parametrize("place", [0, 2])
def test_what_is_held_stays_to_the_last_bit(place: int) -> None:
    """On its lower bound, as an effect that is off: both solvers find the best of the others with it there, which pulls
    it away with all its weight."""
    held, sd, lower = 1.0 / 3.0, np.full(4, 3.0), np.full(4, -np.inf)
    sd[place], lower[place] = 1e-9, held
    problem, a, b = linear(lower=lower, prior_mean=np.where(np.arange(4) == place, held, 0.0), prior_sd=sd)
    others = np.delete(np.arange(4), place)
    left, right = np.vstack([a[:, others], np.eye(3) / 3.0]), np.append(b - held * a[:, place], np.zeros(3))
    best = np.linalg.lstsq(left, right)[0]
    start = np.where(np.arange(4) == place, held, 0.5)
    for z in (
        levenberg_marquardt(problem, start, tolerance=1e-12).z,
        cma_es(problem, start, sd0=0.3, budget=3000, seed=3).z,
    ):
        assert z[place] == held
        assert z[others] == pytest.approx(best, abs=2e-3)


def test_where_all_is_held_nothing_is_sampled() -> None:
    """CMA-ES of no dimension is the cost where everything stays."""
    problem, _, b = linear(prior_sd=1e-9)
    found = cma_es(problem, np.zeros(4), sd0=0.3, budget=100, seed=0)
    assert found.counts.plain == 1 and found.cost == pytest.approx(0.5 * b @ b)
    np.testing.assert_array_equal(found.z, 0.0)
