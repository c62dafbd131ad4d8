"""Growing horizons and several starts: far starts find the minimum, misleading horizons are dropped."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.solve.horizon import solve_growing
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.record import Counts
from r2s2r_cli.stages.identify.solve.starts import multi_start, starts
from tests.stages.identify.solve.problems import DECAY_START, Formula, decay, formula


def oscillation(until: float) -> Formula:
    """sin(w t) seen up to `until`, w = 2; from far away, a long view has many minima and a short one has one."""
    t = np.linspace(0.05, until, 200)
    return formula(
        lambda z: (np.sin(z[0] * t) - np.sin(2.0 * t)) / 0.1, lambda z: (t * np.cos(z[0] * t) / 0.1)[:, None], 1
    )


def two_wells(**options) -> Formula:
    """(z^2 - 1)^2 tilted: minima near -1 and 1, the one at -1 deeper."""
    return formula(
        lambda z: np.array([5.0 * (z[0] ** 2 - 1.0), z[0] + 1.0]),
        lambda z: np.array([[10.0 * z[0]], [1.0]]),
        1,
        lower=-2.0,
        upper=2.0,
        **options,
    )


def failing(seen: list[np.ndarray] | None = None) -> Formula:
    """A problem that can be evaluated nowhere."""
    return formula(lambda z: np.array([np.nan]), lambda z: np.array([[1.0]]), 1, lower=-2.0, upper=2.0)


def test_growing_horizon_finds_what_the_long_one_misses() -> None:
    """From w = 1, 20 s of an oscillation of w = 2 end in a wrong minimum; 1 s, 4 s, 20 s in turn find it."""
    start = np.array([1.0])
    direct = levenberg_marquardt(oscillation(20.0), start)
    assert abs(direct.z[0] - 2.0) > 0.1
    problems = [(f"{until:g} s", oscillation(until)) for until in (1.0, 4.0, 20.0)]
    names = []
    grown = solve_growing(problems, start, progress=lambda step: names.append(step.stage_name))
    assert grown.z[0] == pytest.approx(2.0, abs=1e-4)
    assert grown.dropped == ()
    assert list(dict.fromkeys(names)) == ["1 s", "20 s"]  # 4 s asked for no step
    calls = [call for _, problem in problems for call in problem.calls]
    assert grown.counts == Counts(calls.count(False), calls.count(True))


def test_misleading_horizon_is_dropped() -> None:
    """A first stage whose answer fits the next one worse than the start did is not used, nor one that fails."""
    away = formula(lambda z: z - [9.0, 9.0, 9.0], lambda z: np.eye(3), 3)
    broken = formula(lambda z: np.array([np.nan]), lambda z: np.ones((1, 3)), 3)
    plain = levenberg_marquardt(decay(), DECAY_START)
    grown = solve_growing([("away", away), ("broken", broken), ("all", decay())], DECAY_START)
    assert grown.dropped == ("away", "broken")
    np.testing.assert_array_equal(grown.z, plain.z)


def test_last_horizon_must_work() -> None:
    """Only early horizons may fail."""
    with pytest.raises(NumericalError, match="not finite"):
        solve_growing([("short", two_wells()), ("long", failing())], np.array([0.5]))


def test_starts_are_a_latin_hypercube() -> None:
    """The first is z0; of the others, each unknown has one value in each of n - 1 equal parts of its range."""
    lower, upper, z0 = np.array([0.0, -np.inf, -1.0]), np.array([1.0, np.inf, 1.0]), np.array([0.5, 3.0, 0.9])
    drawn = starts(lower, upper, z0, n=9, seed=3, spread=np.array([np.inf, 2.0, 0.4]))
    np.testing.assert_array_equal(drawn[0], z0)
    low, high = np.array([0.0, 1.0, 0.5]), np.array([1.0, 5.0, 1.0])
    cell = np.floor((drawn[1:] - low) / (high - low) * 8).astype(int)
    np.testing.assert_array_equal(np.sort(cell, axis=0), np.tile(np.arange(8)[:, None], 3))
    np.testing.assert_array_equal(drawn, starts(lower, upper, z0, n=9, seed=3, spread=np.array([np.inf, 2.0, 0.4])))
    assert np.any(drawn != starts(lower, upper, z0, n=9, seed=4, spread=np.array([np.inf, 2.0, 0.4])))
    assert starts(lower, upper, z0, n=1, seed=3, spread=1.0).shape == (1, 3)


def test_starts_leave_nuisances_and_refuse_endless_ranges() -> None:
    """A spread of 0 leaves an unknown where it is; without any finite range there is nothing to draw from."""
    unbounded = np.full(2, np.inf)
    drawn = starts(-unbounded, unbounded, np.array([1.0, 2.0]), n=5, seed=0, spread=np.array([1.0, 0.0]))
    assert np.all(drawn[:, 1] == 2.0)
    assert len(set(drawn[:, 0])) == 5
    with pytest.raises(ValueError, match="finite"):
        starts(-unbounded, unbounded, np.zeros(2), n=5, seed=0)


def test_several_starts_find_the_deeper_well() -> None:
    """From the shallow well's side, more starts find the deeper one; the summary says how many and how far apart."""
    problem = two_wells()
    z0s = starts(problem.lower, problem.upper, np.array([1.5]), n=9, seed=0)
    alone = levenberg_marquardt(problem, z0s[0])
    found = multi_start([("", problem)], z0s)
    assert alone.z[0] > 0.5
    assert found.best.z[0] == pytest.approx(-1.0, abs=1e-4)
    costs = [one.cost for one in found.solutions]
    assert costs == sorted(costs)
    assert found.close == sum(one.z[0] < 0 for one in found.solutions)
    assert found.share == found.close / 9
    assert 0.2 < found.share < 0.8
    assert -1.01 < found.low[0] <= found.high[0] < -0.99
    assert found.order[0] != 0
    np.testing.assert_array_equal(found.solutions[found.order.index(0)].z, alone.z)


def test_starts_that_fail_are_counted() -> None:
    """A start whose simulation is not finite is named and counted against the share; if all fail, it is an error."""
    inside = two_wells()
    outer = formula(lambda z: inside.f(z) if z[0] < 0 else np.full(2, np.nan), inside.df, 1, lower=-2.0, upper=2.0)
    found = multi_start([("", outer)], np.array([[1.5], [-1.5], [-0.5]]))
    assert found.failed == (0,)
    assert found.share == pytest.approx(2 / 3)
    with pytest.raises(NumericalError):
        multi_start([("", failing())], np.array([[1.5], [-1.5]]))
