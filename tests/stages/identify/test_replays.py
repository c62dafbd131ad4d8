"""Replayed intervals, written down: which residuals are noise, and which are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.identify.judged import Replayed
from r2s2r_cli.stages.identify.replays import free_runs_found, segments_found
from r2s2r_cli.stages.measures.steps import Step
from tests.stages.identify.planted import CAPS, step

FRAMES = 40


def long(interval: int) -> Step:
    """A step of 40 frames at rest, each starting where the one before it ended."""
    t = 2.0 * interval + np.linspace(0.0, 1.9, FRAMES)
    return replace(step(interval), t=t, t_next=2.0 * interval + 2.0, p_WE=np.zeros((FRAMES, CAPS, 3)))


def test_drift_is_not_white_and_noise_is() -> None:
    """A cap that drifts by 5 mm along the first interval is named there and nowhere else."""
    noise = 1e-3 * np.random.default_rng(4).normal(size=(2, FRAMES, CAPS, 3))
    noise[0, :, 3] += 5e-3 * np.linspace(-1, 1, FRAMES)[:, None]
    steps = (long(1), long(2))
    first, second = segments_found(Replayed(steps, tuple(noise), ()))
    assert first.white.tolist() == [True, True, True, False, True, True]
    assert second.white.all()
    assert first.lag1[3] > 0.7 and abs(second.lag1).max() < 0.4
    assert first.step is steps[0] and first.simulated is not None


def test_chains_become_free_runs() -> None:
    """Two intervals that follow each other are one free run, a third apart from them another."""
    steps = (long(1), long(2), long(5))
    paths = tuple(np.full((n * FRAMES, CAPS, 3), 0.01) for n in (2, 1))
    one, two = free_runs_found(Replayed(steps, tuple(s.p_WE for s in steps), paths))
    assert (len(one.t), len(two.t)) == (2 * FRAMES, FRAMES)
    assert one.t[0] == 2.0 and two.t[0] == 10.0
    assert np.linalg.norm(one.simulated - one.observed, axis=-1).max() == pytest.approx(0.01 * np.sqrt(3))


def test_nothing_replayed_is_nothing() -> None:
    """Without test intervals there is nothing to write down."""
    assert segments_found(Replayed((), (), ())) == () == free_runs_found(Replayed((), (), ()))


def test_the_frame_of_the_start_says_nothing_of_noise() -> None:
    """An outlier there, which the filter saw, hides neither drift behind it nor makes noise look like drift."""
    residual = 1e-3 * np.random.default_rng(5).normal(size=(FRAMES, CAPS, 3))
    wrong = residual.copy()
    wrong[0] = 1.0
    one, other = (segments_found(Replayed((long(1),), (path,), ()))[0] for path in (residual, wrong))
    np.testing.assert_array_equal(one.lag1, other.lag1)
    assert one.white.all() and other.white.all()


def test_a_step_of_one_frame_is_not_judged() -> None:
    """Between two others: its caps count as white, without a number, and theirs stay their own."""
    path = 1e-3 * np.random.default_rng(6).normal(size=(FRAMES, CAPS, 3))
    path[:, 2] += 5e-3 * np.linspace(-1, 1, FRAMES)[:, None]
    lone = replace(long(2), t=np.array([4.0]), p_WE=np.zeros((1, CAPS, 3)))
    first, middle, last = segments_found(Replayed((long(1), lone, long(3)), (path, path[:1], path), ()))
    assert np.isnan(middle.lag1).all() and middle.white.all()
    for one in (first, last):
        assert one.lag1[2] > 0.7 and not one.white[2] and one.white.sum() == CAPS - 1
