"""Baselines on a gait that repeats itself: exact, silent where nothing was trained, blind to the future."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.measures.baselines import Carry, nothing_moves, same_phase
from r2s2r_cli.stages.measures.replay import free_nothing_moves, free_same_phase, observed_run
from r2s2r_cli.stages.measures.steps import chains, repeats_of, steps_of
from tests.stages.measures.gait import FRAMES, SHAPES, path, run

WALK = run(12)
BOTH: list[Carry] = ["pose", "displacement"]


def test_nothing_moves_keeps_the_start() -> None:
    """The error at the key frame of the first interval is what the gait moved."""
    first = steps_of(WALK, [1])
    assert nothing_moves(first).key[0] == pytest.approx(SHAPES[0])
    assert first[0].key == pytest.approx(SHAPES[1])


@pytest.mark.parametrize("by", BOTH)
@pytest.mark.parametrize("last_only", [False, True])
def test_an_exactly_periodic_gait_is_predicted_in_any_pose(by: Carry, last_only: bool) -> None:
    """Every cycle is elsewhere and turned by 0.7 rad: still exact, from all training cycles and from the last."""
    test = steps_of(WALK, range(8, 13))
    found = same_phase(test, steps_of(WALK, range(1, 8)), by=by, last_only=last_only)
    assert found.key == pytest.approx(np.array([step.key for step in test]), abs=1e-12)
    assert [[one.interval for one in of] for of in found.repeats] == (
        [[5], [6], [7], [5], [6]] if last_only else [[2, 5], [3, 6], [4, 7], [2, 5], [3, 6]]
    )
    assert max(one.start_rmse_m for of in found.repeats for one in of) < 1e-12


@pytest.mark.parametrize("by", BOTH)
def test_a_free_run_of_a_periodic_gait_is_exact(by: Carry) -> None:
    """Five intervals chained from one start, at every frame."""
    (chain,) = chains(steps_of(WALK, range(8, 13)))
    found = free_same_phase(chain, steps_of(WALK, range(1, 8)), by=by)
    assert found == pytest.approx(observed_run(chain)[1], abs=1e-12)
    assert free_nothing_moves(chain) == pytest.approx(np.repeat(chain[0].p_WE[:1], 5 * FRAMES, axis=0))


def test_time_is_scaled_to_the_step() -> None:
    """A test interval that lasts three times as long shows the training frames at three times their age."""
    (step,) = steps_of(WALK, [8])
    slow = replace(step, t=step.t[0] + 3.0 * (step.t - step.t[0]))
    assert free_same_phase([slow], steps_of(WALK, [5])) == pytest.approx(step.p_WE, abs=1e-12)


def test_carrying_by_pose_forgets_the_shape_of_the_start_and_by_displacement_keeps_it() -> None:
    """A cap 10 mm too high at the test start is 0 or 10 mm too high at the predicted key frame."""
    test, train = steps_of(WALK, [8]), steps_of(WALK, [5])
    start = np.array([test[0].start])
    start[0, 4, 2] += 0.010
    pose, moved = (same_phase(test, train, by=by, starts=start).key[0] - test[0].key for by in BOTH)
    assert pose == pytest.approx(np.zeros((6, 3)), abs=1e-12)
    assert moved[4, 2] == pytest.approx(0.010)
    assert np.delete(moved.ravel(), 14) == pytest.approx(np.zeros(17), abs=1e-12)


def test_several_repeats_are_averaged_and_each_is_told() -> None:
    """Key frames of two cycles 4 mm and 8 mm too high: the mean is 6 mm too high."""
    observed = path(12)
    observed[2 * FRAMES - 1, :, 2] += 0.004
    observed[5 * FRAMES - 1, :, 2] += 0.008
    walk = run(12, observed=observed)
    test = steps_of(walk, [8])
    found = same_phase(test, steps_of(walk, range(1, 8)))
    assert (found.key[0] - test[0].key)[:, 2] == pytest.approx([0.006] * 6)
    assert [(one.key - test[0].key)[0, 2] for one in found.repeats[0]] == pytest.approx([0.004, 0.008])


def test_a_phase_that_was_not_trained_is_not_predicted() -> None:
    """Trained on interval 2 alone, only intervals of its phase are predicted, and no free run beyond them."""
    test, train = steps_of(WALK, range(5, 8)), steps_of(WALK, [2])
    found = same_phase(test, train)
    assert found.silent == (1, 2)
    assert found.repeats[1] == ()
    assert free_same_phase(test, train) is None
    assert free_same_phase(test[:1], train) is not None


def test_the_first_interval_of_a_run_has_no_phase() -> None:
    """Nobody knows its previous target: neither predicted nor a repeat of interval 4, which has the same target."""
    one, four = steps_of(WALK, [1, 4])
    assert (one.target == four.target).all()
    assert repeats_of(one, [four]) == []
    assert repeats_of(four, [one]) == []


def test_a_robot_on_other_caps_is_another_phase() -> None:
    """Cap 3 as low as a standing one, at the start of interval 5: no longer a repeat of intervals 2 and 8."""
    observed = path(12)
    observed[4 * FRAMES, 3, 2] = 0.017
    tipped = run(12, observed=observed)
    two, five, eight = steps_of(tipped, [2, 5, 8])
    assert repeats_of(two, [five, eight]) == [eight]
    assert five.support == {0, 1, 3}


def test_steps_with_a_wrong_tracker_are_no_repeats() -> None:
    """Four of six caps marked at the start: out of the training; two of six: still in."""
    quality = np.zeros((12 * FRAMES, 6), np.uint8)
    quality[4 * FRAMES, :4] = [2, 3, 3, 3]
    quality[7 * FRAMES, :2] = 2
    two, five, eight = steps_of(replace(WALK, quality=quality), [2, 5, 8])
    assert (five.faulty, eight.faulty) == (True, False)
    assert repeats_of(two, [five, eight]) == [eight]


def test_nothing_but_the_start_of_a_test_step_is_used() -> None:
    """All later frames of the test are garbage, and no prediction changes: of key frames, of a free run."""
    test, train = steps_of(WALK, range(8, 11)), steps_of(WALK, range(1, 8))
    blind = [replace(step, p_WE=np.concatenate([step.p_WE[:1], np.full_like(step.p_WE[1:], 9.0)])) for step in test]
    assert (same_phase(blind, train).key == same_phase(test, train).key).all()
    later = [blind[0], *(replace(step, p_WE=np.full_like(step.p_WE, 9.0)) for step in blind[1:])]
    assert (np.asarray(free_same_phase(later, train)) == np.asarray(free_same_phase(test, train))).all()


def test_a_test_step_is_never_its_own_repeat() -> None:
    """Trained on all intervals, interval 8 rests on 2, 5 and 11."""
    (found,) = same_phase(steps_of(WALK, [8]), steps_of(WALK, range(1, 13))).repeats
    assert [one.interval for one in found] == [2, 5, 11]


def test_chains_break_where_intervals_are_left_out() -> None:
    """Intervals 2, 3, 7 and another run: three starts of a free run."""
    steps = [*steps_of(WALK, [2, 3, 7]), *steps_of(run(6, name="other"), [4])]
    assert [[(one.run, one.interval) for one in chain] for chain in chains(steps)] == [
        [("other", 4)], [("walk", 2), ("walk", 3)], [("walk", 7)],
    ]  # fmt: skip


def test_an_interval_that_does_not_exist_is_refused() -> None:
    """0 and 13 of 12."""
    for number in (0, 13):
        with pytest.raises(IndexError, match="1 to 12"):
            steps_of(WALK, [number])
