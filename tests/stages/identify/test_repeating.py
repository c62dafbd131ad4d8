"""What the simulator leaves behind and the robot repeats: learned where it is there, shrunk away where it is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.identify.judged import Replayed
from r2s2r_cli.stages.identify.repeating import Repeating, independent, learned, left_out, repeats_from, with_repeats
from r2s2r_cli.stages.measures.floor import Floor
from r2s2r_cli.stages.measures.steps import Step, chains, steps_of
from r2s2r_cli.stages.measures.table import Predicted, judge
from tests.stages.measures.gait import FRAMES, path, run

CYCLES = 10
OFF = 0.010
"""Planted: how far the simulator ends from where the robot does, in a direction of each cap and phase [m]."""
SCATTER = 0.006
"""Of the robot's key frames, rms of the distance [m]."""
PACE = np.linspace(0.0, 1.0, FRAMES)[:, None, None]


def planted(off: float, *, first: int = 0, count: int = 3 * CYCLES + 1, seed: int = 0) -> Replayed:
    """Intervals that the robot repeats but for SCATTER, and a simulator that knows all of it but for `off`: the same in
    every interval of a phase, in the frame of the robot, which turns and moves from cycle to cycle."""
    rng, whole = np.random.default_rng(seed), path(first + count)
    bias = np.random.default_rng(3).normal(size=(3, 6, 3))
    bias *= off / np.sqrt(np.mean(np.sum(bias**2, axis=-1), axis=-1))[:, None, None]
    truth = [whole[FRAMES * i : FRAMES * (i + 1)] for i in range(first + count)]
    scatter = SCATTER / np.sqrt(3) * rng.normal(size=(first + count, 6, 3))
    seen = np.concatenate([one + PACE**8 * scatter[i] for i, one in enumerate(truth)])
    steps = steps_of(run(first + count, observed=seen), range(first + 1, first + count + 1))
    turned = [bias[i % 3] @ _turn(i // 3) for i in range(first + count)]
    paths = tuple(truth[i] + PACE**2 * turned[i] for i in range(first, first + count))
    free = tuple(np.concatenate([paths[step.interval - first - 1] for step in chain]) for chain in chains(steps))
    return Replayed(steps, paths, free)


def _turn(cycles: int) -> np.ndarray:
    c, s = np.cos(0.7 * cycles), np.sin(0.7 * cycles)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def errors(test: Replayed, predicted: Predicted) -> tuple[float, float]:
    """Key frames and free run [m]."""
    row = judge(test.steps, {"ours": predicted})["ours"]
    return row.key.rmse_m or 0.0, row.free_m or 0.0


def test_what_repeats_is_predicted() -> None:
    """The error falls from sqrt(off^2 + scatter^2) to the scatter and what ten noisy repeats leave, off^2 s^2 / (n
    off^2 + s^2): in any place and heading, at key frames and in free run. The training intervals say so beforehand."""
    train, test = planted(OFF), planted(OFF, first=31, count=30, seed=1)
    found = repeats_from(train, train.steps, test)
    assert found is not None and found.used and found.evidence is not None and found.made is not None
    before, after = errors(test, test.predicted), errors(test, found.made.predicted)
    left = OFF**2 * SCATTER**2 / (CYCLES * OFF**2 + SCATTER**2)
    assert before[0] == pytest.approx(np.hypot(OFF, SCATTER), rel=0.05)
    assert after[0] == pytest.approx(np.sqrt(SCATTER**2 + left), rel=0.06)
    assert after[1] < 0.7 * before[1]
    assert found.evidence.with_m < 0.7 * found.evidence.alone_m
    assert found.model.gap_m == pytest.approx(OFF, rel=0.1)
    assert found.made.weights == pytest.approx(CYCLES * OFF**2 / (CYCLES * OFF**2 + SCATTER**2), abs=0.02)
    assert set(found.made.repeats) == {CYCLES}


def test_where_nothing_repeats_nothing_is_added() -> None:
    """A simulator that is right but for the robot's own scatter: hardly any weight, hardly any change."""
    train, test = planted(0.0), planted(0.0, first=31, count=9, seed=1)
    model = learned(train, train.steps)
    assert model is not None and model.gap_m < 0.4 * SCATTER
    made = with_repeats(model, test)
    assert made.weights.max() < 0.5  # of ten repeats, which are nearly as good as this simulator
    moved = made.predicted.key - test.predicted.key
    assert np.sqrt(np.mean(np.sum(moved**2, axis=-1))) < 0.2 * SCATTER


def test_a_transition_that_was_never_seen_is_the_simulator_alone() -> None:
    """No repeat, no weight, the same bits; other transitions of the same run have theirs."""
    train, test = planted(OFF), planted(OFF, first=31, count=6, seed=1)
    phases = [step.phase for step in test.steps]
    other = [step for step in train.steps if step.phase != phases[0]]
    model = learned(train, other)
    assert model is not None
    made = with_repeats(model, test)
    unseen = np.array([phase == phases[0] for phase in phases])
    assert (made.repeats[unseen] == 0).all() and (made.weights[unseen] == 0).all() and (made.weights[~unseen] > 0).all()
    assert np.array_equal(made.predicted.key[unseen], test.predicted.key[unseen])


def test_nothing_of_a_test_interval_is_used_but_its_start() -> None:
    """Later frames thrown about: the same prediction, bit by bit."""
    train, test = planted(OFF), planted(OFF, first=31, count=3, seed=1)
    model = learned(train, train.steps)
    assert model is not None

    def thrown(step: Step) -> Step:
        p_WE = step.p_WE.copy()
        p_WE[1:] += np.random.default_rng(5).normal(size=p_WE[1:].shape)
        return replace(step, p_WE=p_WE)

    one, other = with_repeats(model, test), with_repeats(model, replace(test, steps=tuple(map(thrown, test.steps))))
    assert np.array_equal(one.predicted.key, other.predicted.key)
    for a, b in zip(one.predicted.free, other.predicted.free, strict=True):
        assert a is not None and b is not None and np.array_equal(a, b)


def model_of(gap: float, floor: float, *, contrasts: int, intervals: int) -> Repeating:
    """A model without steps, its variances known from so many squares."""
    found = Floor(floor, None, contrasts, 0.0, ())
    return Repeating((), gap**2 + floor**2, intervals, found, dof=5.0, unlike=1e-4)


def test_the_weight_is_that_of_a_random_effect() -> None:
    """Known variances: n G^2 / (n G^2 + f^2). A repeat from a start unlike by u counts with f^2 + u^2. Few data pull
    towards what is not certain: between the extremes."""
    sure = model_of(0.01, 0.008, contrasts=4000, intervals=4000)
    for n in (1, 3):
        assert sure.weight((0.0,) * n)[0] == pytest.approx(n * 1e-4 / (n * 1e-4 + 6.4e-5), rel=0.01)
    weight, share = sure.weight((1e-4, 1e-4 + 6.4e-5))
    precision = 1 / 6.4e-5 + 1 / 1.28e-4
    assert weight == pytest.approx(1e-4 * precision / (1 + 1e-4 * precision), rel=0.01)
    assert share == pytest.approx([2 / 3, 1 / 3])
    assert model_of(0.0, 0.008, contrasts=4000, intervals=4000).weight()[0] < 0.03
    few = model_of(0.01, 0.008, contrasts=1, intervals=5).weight()[0]
    assert 0.2 < few < sure.weight()[0]


def test_without_repeats_there_is_no_model() -> None:
    """One cycle: nothing tells what repeats from what happens once."""
    train = planted(OFF, count=4)
    assert learned(train, train.steps) is None
    assert repeats_from(train, train.steps, train) is None


def test_evidence_needs_an_interval_with_a_repeat() -> None:
    """Left out, an interval is nobody's repeat: with one of each phase nothing is predicted, and nothing is said."""
    train = planted(OFF)
    model = learned(train, train.steps)
    assert model is not None
    one = slice(3, 6)
    cycle = Replayed(train.steps[one], train.simulated[one], ())
    assert left_out(replace(model, steps=cycle.steps), cycle) is None


def test_squares_that_move_together_count_once() -> None:
    """18 numbers that depend on 3 independent ones in equal parts: about 3; independent ones: about 18."""
    rng = np.random.default_rng(2)
    base = np.linalg.qr(rng.normal(size=(18, 3)))[0]
    assert independent(rng.normal(size=(400, 3)) @ base.T) == pytest.approx(3, rel=0.1)
    assert independent(rng.normal(size=(400, 18))) == pytest.approx(18, rel=0.1)
    assert independent(np.ones((3, 18))) == 1.0
