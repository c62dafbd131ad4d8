"""Intervals cover what they say, pairs share their resamples, and what is missing is left out."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.measures.bootstrap import bootstrap, paired, upper_bound


def test_intervals_of_the_rmse_cover_the_truth() -> None:
    """Squared errors of 6 degrees of freedom, 12 segments, 300 sets: 95 % intervals cover 1 in 90 to 98.5 % of them."""
    rng = np.random.default_rng(21)
    found = [bootstrap(rng.chisquare(6, 12) / 6, draws=800, seed=k) for k in range(300)]
    covered = np.mean([one is not None and one.lower <= 1.0 <= one.upper for one in found])
    assert 0.90 <= covered <= 0.985


def test_the_interval_of_a_normal_mean_is_that_of_student() -> None:
    """40 normal values: ends within 15 % of the width of mean -+ t s / sqrt(n)."""
    x = np.random.default_rng(22).normal(10.0, 2.0, 40)
    found = bootstrap(x, summary="mean")
    assert found is not None
    half = 2.0227 * x.std(ddof=1) / 40**0.5
    assert [found.lower, found.upper] == pytest.approx([x.mean() - half, x.mean() + half], abs=0.15 * 2 * half)
    assert (found.value, found.n, found.few) == (pytest.approx(x.mean()), 40, False)


def test_the_value_is_root_mean_square_or_weighted_mean() -> None:
    """Of 9 and 16: 3.5 as a root mean square squared is 12.5; weights 3 and 1 make the mean 10.75."""
    x = np.array([9.0, 16.0])
    rms, mean = bootstrap(x), bootstrap(x, summary="mean", weights=np.array([3.0, 1.0]))
    assert rms is not None and mean is not None
    assert rms.value == pytest.approx(12.5**0.5)
    assert mean.value == pytest.approx(10.75)
    assert rms.few


def test_the_seed_decides_and_nothing_else() -> None:
    """Equal seeds, equal ends; another seed, other ends."""
    x = np.random.default_rng(23).chisquare(3, 9)
    assert bootstrap(x, seed=5) == bootstrap(x, seed=5)
    assert bootstrap(x, seed=5) != bootstrap(x, seed=6)


def test_a_constant_has_no_width_and_one_segment_no_interval() -> None:
    """Four equal segments; one segment beside one that was not predicted."""
    found = bootstrap(np.full(4, 4.0))
    assert found is not None
    assert (found.lower, found.value, found.upper) == (2.0, 2.0, 2.0)
    assert bootstrap(np.array([4.0, np.nan])) is None
    assert upper_bound(np.array([4.0])) is None


def test_a_pair_is_resampled_together() -> None:
    """1 mm better in every segment, which differ by far more: the difference is sure although the intervals overlap."""
    error = np.array([5.0, 9.0, 14.0, 22.0, 30.0])
    found = paired((error - 1.0), error, summary="mean")
    assert found is not None
    assert found.interval.value == pytest.approx(-1.0)
    assert (found.interval.lower, found.interval.upper) == (pytest.approx(-1.0), pytest.approx(-1.0))
    assert found.ours_better == 1.0


def test_equal_predictors_are_better_half_of_the_time() -> None:
    """Ties count half; only segments that both predict are compared."""
    x = np.array([1.0, 2.0, np.nan, 4.0])
    found = paired(x, x.copy())
    assert found is not None
    assert found.ours_better == 0.5
    assert found.interval.n == 3
    assert paired(x, np.array([1.0, np.nan, 3.0, np.nan])) is None


def test_the_upper_bound_lies_between_value_and_end_of_the_interval() -> None:
    """A one-sided 90 % bound is below the upper end of the two-sided 95 % interval."""
    x = np.random.default_rng(24).chisquare(6, 10)
    found, bound = bootstrap(x), upper_bound(x)
    assert found is not None and bound is not None
    assert found.value < bound < found.upper
