"""The floor recovers planted repeatability and sensor noise, in any pose, and says what it rests on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.measures.baselines import Carry
from r2s2r_cli.stages.measures.floor import contrast_squares, floor_of
from r2s2r_cli.stages.measures.steps import steps_of
from tests.stages.measures.gait import FRAMES, path, run

N = 121
KEYS = np.arange(1, N + 1) * FRAMES - 1


@pytest.mark.parametrize("by", ["pose", "displacement"])
def test_planted_repeatability_is_recovered(by: Carry) -> None:
    """5 mm per axis at the key frames of 40 cycles: a floor of 5 sqrt(3) mm within 4 sd of its sampling error."""
    observed = path(N)
    observed[KEYS] += np.random.default_rng(11).normal(0.0, 0.005, (N, 6, 3))
    found = floor_of(steps_of(run(N, observed=observed, noise=0.0), range(1, N + 1)), by=by)
    assert found is not None
    assert found.contrasts == 117
    relative = (0.5 / (found.contrasts * 18)) ** 0.5
    assert found.floor_m == pytest.approx(0.005 * 3**0.5, rel=4 * relative)
    assert found.interval is not None
    assert found.interval.lower < 0.005 * 3**0.5 < found.interval.upper
    assert found.sensor_m == 0.0
    assert found.repeatability_m == found.floor_m


@pytest.mark.parametrize("by", ["pose", "displacement"])
def test_sensor_noise_is_told_from_repeatability(by: Carry) -> None:
    """4 mm noise at starts and key frames and nothing else: all of the floor is the sensor, by its own formula."""
    observed = path(N) + np.random.default_rng(12).normal(0.0, 0.004, (N * FRAMES, 6, 3))
    observed[..., 3:, 2] += 0.1  # far above the others, so that noise does not change what the robot stands on
    found = floor_of(steps_of(run(N, observed=observed, noise=0.004), range(1, N + 1)), by=by)
    assert found is not None
    expected = {"pose": 3.0 + 3.0 / 6.0, "displacement": 6.0}[by]
    assert found.sensor_m == pytest.approx(0.004 * expected**0.5)
    relative = (0.5 / (found.contrasts * 18)) ** 0.5
    assert found.floor_m == pytest.approx(found.sensor_m, rel=5 * relative)
    assert found.repeatability_m < 0.35 * found.floor_m


def test_an_exact_gait_has_no_floor_but_rounding() -> None:
    """Every cycle elsewhere and turned: planar moves take it all out."""
    found = floor_of(steps_of(run(12, noise=0.0), range(1, 13)))
    assert found is not None
    assert found.floor_m < 1e-12


def test_contrasts_add_up_to_the_sum_of_squares_about_the_mean() -> None:
    """Helmert contrasts are an orthogonal change of coordinates; of two repeats, half the squared difference."""
    x = np.random.default_rng(13).normal(size=(5, 6, 3))
    about_mean = np.sum((x - x.mean(axis=0)) ** 2, axis=-1).mean(axis=-1)
    assert contrast_squares(x).sum() == pytest.approx(about_mean.sum())
    assert contrast_squares(x[:2])[0] == pytest.approx(0.5 * np.sum((x[1] - x[0]) ** 2, axis=-1).mean())


def test_leaving_one_out_gives_the_same_floor() -> None:
    """Squared errors of the mean of the others, times (n - 1) / n, average to the mean of the contrasts."""
    x = np.random.default_rng(14).normal(size=(4, 6, 3))
    squares = [np.sum((x[i] - np.delete(x, i, 0).mean(axis=0)) ** 2, axis=-1).mean() for i in range(4)]
    assert 0.75 * np.mean(squares) == pytest.approx(contrast_squares(x).mean())


def test_only_repeats_count_and_they_are_named() -> None:
    """Intervals 2, 3, 5, 8 of which 5 is faulty: the floor rests on 2 and 8, one contrast, no interval."""
    walk = run(12)
    two, three, five, eight = steps_of(walk, [2, 3, 5, 8])
    found = floor_of([two, three, replace(five, faulty=True), eight])
    assert found is not None
    assert found.phases == ((("walk", 2), ("walk", 8)),)
    assert found.contrasts == 1
    assert found.interval is None


def test_without_repeats_there_is_no_floor() -> None:
    """Three phases, each seen once; and no steps at all."""
    assert floor_of(steps_of(run(6), [2, 3, 4])) is None
    assert floor_of([]) is None
