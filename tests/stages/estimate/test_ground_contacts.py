"""Ground offset and slope, contacts, and how far heights are trusted."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.estimate.contacts import HIGH, LOW, contact_probability, contacts, height_error
from r2s2r_cli.stages.estimate.ground import find_ground
from r2s2r_cli.stages.frames import ground_offset
from tests.stages.estimate.planted import JUDGING_SEEDS, RADIUS, planted

RADII = np.full(6, RADIUS)


def test_offset_is_found_within_its_standard_deviation() -> None:
    """On planted runs the offset is right to 3 of its standard deviations and 1 mm, and unbiased to 0.3 mm."""
    errors = []
    for seed in JUDGING_SEEDS:
        sample = planted(seed)
        ground = find_ground(sample.observed - np.array([0, 0, 0.004]), np.ones((len(sample.t), 6), dtype=bool), RADII)
        error = ground.shift - 0.004
        assert abs(error) < max(3 * ground.shift_sd, 1e-3)
        errors.append(error)
    assert abs(np.mean(errors)) < 3e-4


def test_offset_beats_the_plain_lowest_cap() -> None:
    """The mean height of the lowest cap is millimetres too low with noise; the offset of `estimate` is not."""
    plain, better = [], []
    for seed in JUDGING_SEEDS:
        sample = planted(seed)
        plain.append(abs(ground_offset(sample.observed, RADIUS)))
        better.append(abs(find_ground(sample.observed, np.ones((len(sample.t), 6), dtype=bool), RADII).shift))
    assert np.mean(better) < 0.3 * np.mean(plain)


def test_exact_heights_give_the_exact_offset() -> None:
    """Without noise the offset is exact, and its standard deviation 0."""
    sample = planted(3)
    ground = find_ground(sample.p_WE + np.array([0, 0, 0.0123]), np.ones((len(sample.t), 6), dtype=bool), RADII)
    assert ground.shift == pytest.approx(-0.0123, abs=1e-12)
    assert ground.shift_sd == pytest.approx(0.0, abs=1e-12)


def test_slope_of_a_tilted_floor_is_found() -> None:
    """Caps that stand on a floor of known slope show it within 4 standard deviations; the shift is not spoilt."""
    rng = np.random.default_rng(2)
    n = 200
    p = rng.uniform(-0.2, 0.2, (n, 6, 3))
    p[:, :, 2] = 0.1
    p[:, 0, 2] = RADIUS + 0.03 * p[:, 0, 0] - 0.02 * p[:, 0, 1] + 0.001 * rng.normal(size=n)
    ground = find_ground(p, np.ones((n, 6), dtype=bool), RADII)
    assert ground.slope is not None and ground.slope_sd is not None
    assert np.all(np.abs(ground.slope - [0.03, -0.02]) < 4 * ground.slope_sd)
    assert np.all(ground.slope_sd < 0.002)


def test_slope_is_not_claimed_from_one_spot() -> None:
    """A robot that stands still on one cap cannot tell the slope, and says so."""
    rng = np.random.default_rng(4)
    p = np.tile(np.array([0.0, 0.0, 0.1]), (100, 6, 1))
    p[:, 0, 2] = RADIUS
    p += 0.001 * rng.normal(size=p.shape)
    assert find_ground(p, np.ones((100, 6), dtype=bool), RADII).slope is None


def test_unused_observations_do_not_count() -> None:
    """A cap that the tracker throws far below the floor is left out where it is marked as an outlier."""
    sample = planted(5)
    p, used = sample.p_WE.copy(), np.ones((len(sample.t), 6), dtype=bool)
    p[::2, 1, 2] -= 0.2
    used[::2, 1] = False
    assert find_ground(p, used, RADII).shift == pytest.approx(0.0, abs=1e-12)


def test_probability_is_one_half_at_the_clearance() -> None:
    """Closed form: at the clearance 1/2, one standard deviation below 0.841; times 0.683 for a speed of one sd."""
    args = {"clearance": 0.003, "lift": 0.03}
    half = contact_probability(np.array(0.003), np.array(1e-3), np.array(0.0), np.array(1e-6), **args)
    low = contact_probability(np.array(0.002), np.array(1e-3), np.array(0.0), np.array(1e-6), **args)
    slow = contact_probability(np.array(-1.0), np.array(1e-3), np.array(0.0), np.array(0.03), **args)
    assert (float(half), float(low), float(slow)) == pytest.approx((0.5, 0.841345, 0.682689), abs=1e-6)


def test_a_rising_cap_is_not_in_contact() -> None:
    """At the same height, a cap that rises or falls fast is far less likely to touch, alike in both directions."""
    speed = np.array([0.0, 0.1, -0.1])
    p = contact_probability(np.zeros(3), np.full(3, 1e-3), speed, np.full(3, 0.01), clearance=0.003, lift=0.03)
    assert p[0] > 0.95
    assert np.all(p[1:] < 0.01)
    assert p[1] == pytest.approx(p[2])


def test_hysteresis_holds_on_to_a_contact_in_both_directions_of_time() -> None:
    """A contact lasts while the probability stays above LOW; a stretch that never gets above HIGH is none."""
    middle = 0.5 * (LOW + HIGH)
    p = np.array([0.0, middle, 0.9, middle, 0.0, middle, middle, 0.0, 0.9])[:, None]
    expected = [False, True, True, True, False, False, False, False, True]
    assert contacts(p)[:, 0].tolist() == expected
    assert contacts(p[::-1])[::-1, 0].tolist() == expected


def test_height_error_is_the_third_lowest_cap() -> None:
    """Bias of the tracker at the third cap that must carry the robot is found; a robot on one cap tells nothing."""
    height = np.tile(np.array([0.0, 0.001, 0.004, 0.08, 0.09, 0.1]), (50, 1))
    assert height_error(height) == pytest.approx(0.004)
    height[:, 1:] += 0.05
    assert height_error(height) is None
    assert height_error(-height[:, :3] - 0.1) == 0.0


def test_the_deviation_of_the_slope_is_that_of_its_scatter() -> None:
    """A robot walks while its heights drift (correlated by 0.8): scatter of the slope as predicted to 35 %.

    Residuals that count as independent would give a third: sqrt((1 - 0.8) / (1 + 0.8)).
    """
    rng = np.random.default_rng(8)
    n, slopes, predicted = 300, [], []
    s = np.linspace(0.0, 2 * np.pi, n)
    for _ in range(60):
        p = np.full((n, 6, 3), 0.3)
        p[:, 0, :2] = 0.5 * np.column_stack([np.cos(s), np.sin(s)])
        drift = 0.001 * rng.normal(size=n)
        for k in range(1, n):
            drift[k] = 0.8 * drift[k - 1] + 0.6 * drift[k]
        p[:, 0, 2] = RADIUS + drift
        ground = find_ground(p, np.ones((n, 6), dtype=bool), RADII)
        assert ground.slope is not None and ground.slope_sd is not None
        slopes.append(ground.slope)
        predicted.append(ground.slope_sd)
    assert np.mean(predicted, axis=0) == pytest.approx(np.sqrt(np.mean(np.square(slopes), axis=0)), rel=0.35)
