"""Whiteness: white noise passes as often as promised, correlated noise does not, irregular stamps are minded."""

import numpy as np
import pytest

from r2s2r_cli.stages.identify.trust.whiteness import holm, whiteness


def _series(seed: int, count: int, frames: int, share: float):
    """AR(1) noise of three axes with the correlation `share`, at stamps that jitter."""
    draw = np.random.default_rng(seed)
    e = draw.normal(size=(count, frames, 3))
    for k in range(1, frames):
        e[:, k] = share * e[:, k - 1] + np.sqrt(1 - share**2) * e[:, k]
    t = np.cumsum(0.05 * (1 + 0.2 * draw.random((count, frames))), axis=1)
    return e.reshape(-1, 3), np.repeat(np.arange(count), frames), t.ravel()


def test_white_noise_passes_at_the_nominal_rate():
    """One series in twenty has p < 0.05, and none of all is refused in 95 % of the runs; lag 1 has no bias."""
    found = [whiteness(*_series(seed, 10, 20, 0.0)) for seed in range(40)]
    p = np.concatenate([one.p for one in found])
    assert 0.02 < np.mean(p < 0.05) < 0.08
    assert np.mean([one.white.all() for one in found]) > 0.85
    assert np.mean([one.centred.all() for one in found]) > 0.85
    lag1 = np.concatenate([one.lag1 for one in found])
    assert 0.0 < np.mean([one.p_all < 0.25 for one in found]) < 0.5
    assert abs(lag1.mean()) < 0.02
    assert lag1.std() == pytest.approx(found[0].lag1_sd[0], rel=0.2)


def test_correlated_noise_is_refused():
    """AR(1) with 0.5 is seen in nearly all series of 60 frames, and measured; 12 frames show it together."""
    short = whiteness(*_series(0, 12, 12, 0.5))
    assert short.white.sum() > 6
    assert short.p_all < 1e-3
    found = whiteness(*_series(0, 12, 60, 0.5))
    assert found.white.sum() <= 1
    assert found.lag1.mean() == pytest.approx(0.5, abs=0.08)


def test_offset_is_told_from_correlation():
    """A constant offset of one series leaves it white, and not centred."""
    e, series, t = _series(1, 6, 30, 0.0)
    e[series == 2, 1] += 1.5
    found = whiteness(e, series, t)
    assert found.white.all()
    np.testing.assert_array_equal(found.centred, np.arange(6) != 2)
    assert found.offset[2, 1] == pytest.approx(1.5, abs=0.5)


def test_frames_across_a_gap_are_no_neighbours():
    """Two values in turn are anticorrelated; with every second gap long, neighbours are only those within pairs."""
    e = np.repeat(np.random.default_rng(0).normal(size=30), 2)
    near = np.cumsum(np.tile([0.5, 0.05], 30))
    together = whiteness(e, np.zeros(60), near)
    apart = whiteness(e, np.zeros(60), np.arange(60) * 0.05)
    assert together.lag1[0] > 0.9
    assert apart.lag1[0] < 0.7


def test_short_and_constant_series_say_nothing():
    """Too few frames or no noise: nan, and not refused."""
    found = whiteness(np.zeros(14), np.repeat([3, 7], [4, 10]), np.arange(14.0))
    assert list(found.series) == [3, 7]
    assert np.isnan(found.lag1).all()
    assert np.isnan(found.p_all)
    assert found.white.all()


def test_holm_by_hand():
    """Each in turn against level over those left, until one stands; nan is no hypothesis."""
    p = np.array([0.04, 0.001, np.nan, 0.02, 0.016])
    np.testing.assert_array_equal(holm(p), [True, True, False, True, True])
    np.testing.assert_array_equal(holm(np.array([0.03, 0.03])), [False, False])
