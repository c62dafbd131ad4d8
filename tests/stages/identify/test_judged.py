"""Intervals predicted with given numbers: from frames before them only, and from the states they start with."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import torch

from r2s2r_cli.engine import end_caps
from r2s2r_cli.engine.flat import unpack_state
from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.belief import Filter
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.judged import Replayed, mean_path, replayed, simulated_paths, starts_of, steps_from
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.start import starts_at
from r2s2r_cli.stages.identify.ways import Start
from r2s2r_cli.stages.identify.windows import window
from tests.stages.identify.replayed import predictor_of, start, values_at, walk

RECIPE = Recipe(belief=Filter(members=8))
TEST = (Selection("walk", (2, 3)),)
NOISE = 1e-3
UP = np.array([0.0, 0.0, 0.005])


@lru_cache
def predictor() -> Predictor:
    """A height of the ground that is not 0: what is said of caps is in the camera's frame."""
    return predictor_of("motor_speed", "ground_height")


def values() -> np.ndarray:
    """Motors a tenth too slow, the ground 5 mm up."""
    return values_at(predictor(), motor_speed=0.72, ground_height=0.005)


def raised(run: RunData) -> RunData:
    """As a camera sees it that has the ground 5 mm too high."""
    return replace(run, observed=run.observed + UP, p_WE=run.p_WE + UP)


def seen(run: RunData) -> Replayed:
    """Intervals 2 and 3, and the free run from 2 on."""
    return replayed([run], TEST, predictor(), values(), RECIPE)


@lru_cache
def noisy() -> RunData:
    """A walk with noise."""
    return raised(walk(noise=NOISE, seed=7))


@lru_cache
def played() -> Replayed:
    """The noisy walk, replayed."""
    return seen(noisy())


def without_future(run: RunData, frame: int) -> RunData:
    """Everything that was observed after `frame`, and all that is smoothed, is something else."""
    wrong = run.observed.copy()
    wrong[frame + 1 :] += np.random.default_rng(8).normal(size=wrong[frame + 1 :].shape)
    return replace(run, observed=wrong, p_WE=run.p_WE + 1.0, v_WE=run.v_WE + 1.0, sd_p=2 * run.sd_p, sd_v=2 * run.sd_v)


def test_nothing_later_is_known_to_a_prediction() -> None:
    """Frames after the start of interval 3, wherever they lie, change neither what is predicted of 2 and 3 nor of their
    free run; those after the start of 2 change 3, whose start has seen them, and nothing else."""
    second, third = (int(frame) for frame in noisy().intervals.first[1:])
    other = seen(without_future(noisy(), third))
    for one, two in zip(played().simulated, other.simulated, strict=True):
        np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(played().free[0], other.free[0])
    earlier = seen(without_future(noisy(), second))
    np.testing.assert_array_equal(played().simulated[0], earlier.simulated[0])
    np.testing.assert_array_equal(played().free[0], earlier.free[0])
    assert not np.array_equal(played().simulated[1], earlier.simulated[1])


def test_one_pass_of_the_filter_serves_both_sides() -> None:
    """Starts of all intervals at once are those that the test intervals alone have, bit by bit."""
    run = [noisy()]
    both = (Selection("walk", (3,)), Selection("walk", (1,)))
    starts = starts_of(run, both, predictor(), values(), RECIPE)
    assert sorted(starts) == [("walk", 1), ("walk", 2), ("walk", 3)]
    other = replayed(run, TEST, predictor(), values(), RECIPE, starts=starts)
    for one, two in zip((*played().simulated, *played().free), (*other.simulated, *other.free), strict=True):
        np.testing.assert_array_equal(one, two)
    (early,) = replayed(run, both[1:], predictor(), values(), RECIPE, free_run=False).simulated
    (late,) = replayed(run, both[1:], predictor(), values(), RECIPE, free_run=False, starts=starts).simulated
    np.testing.assert_array_equal(early, late)


def test_later_commands_change_nothing_before_them() -> None:
    """Other commands in interval 3 leave the prediction of 2 and the first half of the free run."""
    run = noisy()
    control = run.control.copy()
    control[int(run.intervals.first[2]) :] = 0.0
    other = seen(replace(run, control=control))
    np.testing.assert_allclose(played().simulated[0], other.simulated[0], atol=1e-12)
    half = len(played().simulated[0])
    np.testing.assert_allclose(played().free[0][:half], other.free[0][:half], atol=1e-12)
    assert np.abs(played().free[0][half:] - other.free[0][half:]).max() > 1e-3


def test_paths_begin_with_the_caps_of_their_start() -> None:
    """One row a frame of the interval; the first is the mean of the caps of the start's members over the camera's
    ground; key frames are the last; steps that follow each other are one free run that begins like the first."""
    starts = starts_at([noisy()], predictor(), values(), {"walk": 3}, belief=RECIPE.belief)
    theta = predictor().mapping.theta(torch.as_tensor(values()))
    for step, path in zip(played().steps, played().simulated, strict=True):
        assert path.shape == step.p_WE.shape
        members = starts["walk", step.interval].members
        assert members is not None
        caps = end_caps(theta, unpack_state(predictor().structure, members)).numpy().mean(axis=0) + UP
        np.testing.assert_allclose(path[0], caps, atol=1e-12)
        assert np.abs(caps - step.start).max() < 0.02
    assert len(played().free) == 1
    assert len(played().free[0]) == sum(len(step.t) for step in played().steps)
    np.testing.assert_allclose(played().free[0][: len(played().steps[0].t)], played().simulated[0], atol=1e-12)
    predicted = played().predicted
    np.testing.assert_array_equal(predicted.key, np.array([path[-1] for path in played().simulated]))


def test_a_prediction_is_the_mean_over_what_is_not_known_of_its_start() -> None:
    """Each member simulated by itself, averaged frame by frame; one that cannot be simulated is left out, and without
    any there is no prediction."""
    run = noisy()
    start = starts_at([run], predictor(), values(), {"walk": 2}, belief=RECIPE.belief)["walk", 2]
    assert start.members is not None
    whole = mean_path(predictor(), values(), run, (2,), start)
    own = window(run, (2,), start.state, whole=True)
    each = [replace(own, state=unpack_state(predictor().structure, one[None])) for one in start.members]
    paths = [simulated_paths(predictor(), values(), [one])[0] for one in each]
    np.testing.assert_allclose(whole, np.mean(paths, axis=0), atol=1e-12)
    assert np.std(paths, axis=0).max() > 1e-4

    bad = start.members.clone()
    bad[:3] = float("nan")
    others = mean_path(predictor(), values(), run, (2,), Start(start.state, bad))
    np.testing.assert_allclose(others, np.mean(paths[3:], axis=0), atol=1e-12)
    bad[:] = float("nan")
    with pytest.raises(NumericalError):
        mean_path(predictor(), values(), run, (2,), Start(start.state, bad))


def test_known_start_and_true_values_reproduce_the_run() -> None:
    """From the true start of interval 1 with the true numbers, without noise: every frame, also of the free run; and to
    the end, where a window of training would stop because the robot seems to tip over."""
    run, x = raised(walk()), values_at(predictor(), ground_height=0.005)
    fallen = run.observed.copy()
    fallen[5:] += np.array([0.1, 0.0, 0.0])
    tipped = replace(run, observed=fallen)
    assert len(window(tipped, (1,), start()).frames) == 4
    known = {"walk": start()}
    found = replayed([tipped], [Selection("walk", (1,))], predictor(), x, RECIPE, known=known, free_run=False)
    np.testing.assert_allclose(found.simulated[0], run.observed[: len(found.steps[0].t)], atol=1e-9)
    assert found.free == ()
    path = simulated_paths(predictor(), x, [window(run, (1, 2, 3), start(), whole=True)])[0]
    np.testing.assert_allclose(path, run.observed, atol=1e-9)


def test_steps_are_of_their_run_and_smoothed_on_request() -> None:
    """In the order of the selections; observed caps unless smoothed ones are asked for."""
    run = noisy()
    other = replace(run, name="other")
    both = steps_from([run, other], [Selection("other", (3,)), Selection("walk", (1, 2))])
    assert [(step.run, step.interval) for step in both] == [("other", 3), ("walk", 1), ("walk", 2)]
    first, last = run.intervals.first[0], run.intervals.last[0]
    np.testing.assert_array_equal(both[1].p_WE, run.observed[first : last + 1])
    smoothed = steps_from([run], [Selection("walk", (1,))], smoothed=True)
    np.testing.assert_array_equal(smoothed[0].p_WE, run.p_WE[first : last + 1])
    with pytest.raises(IndexError, match="walk"):
        steps_from([run], [Selection("walk", (4,))])


def test_without_test_intervals_there_is_nothing() -> None:
    """No step, no path, no simulation."""
    before = predictor().rollouts
    found = replayed([noisy()], (), predictor(), values(), RECIPE)
    assert (found.steps, found.simulated, found.free) == ((), (), ())
    assert len(found.predicted.key) == 0
    assert predictor().rollouts == before
