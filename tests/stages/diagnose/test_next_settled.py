"""What a gait is worth: expected probability of the right candidate after it, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.next_gait import WORTH_IT, chosen
from r2s2r_cli.stages.diagnose.next_settled import settled, unsettled, worth

T = 4.0
NOTHING_WRONG = np.array([0.55, 0.25, 0.2])
"""Of the refit nominal model, first in the ranking, and two effects."""


def _apart(count: int, pairs: dict[tuple[int, int], float]) -> np.ndarray:
    """Nats of pairs, both ways."""
    found = np.zeros((count, count))
    for (i, j), nats in pairs.items():
        found[i, j] = found[j, i] = nats
    return found


@pytest.mark.parametrize("nats", [0.0, 3.0, 12.0])
def test_two_candidates_alike_are_settled_as_the_logistic_function_says(nats: float) -> None:
    """Equally probable and n nats apart: 1 / (1 + exp(-n / T)), whichever is the truth. It is worth n."""
    p = np.array([0.5, 0.5])
    after = settled(p, _apart(2, {(0, 1): nats}), T, none=1)
    assert after == pytest.approx(1.0 / (1.0 + np.exp(-nats / T)))
    assert worth(unsettled(p), after, T) == pytest.approx(nats)


def test_more_candidates_alike_are_worth_what_they_stand_apart() -> None:
    """Three of them, 5 nats from each other, with probabilities that do not add up to 1: the rest are no candidates."""
    p = np.full(3, 0.2)
    after = settled(p, 5.0 * (1.0 - np.eye(3)), T, none=0)
    assert after == pytest.approx(1.0 / (1.0 + 2.0 * np.exp(-5.0 / T)))
    assert worth(unsettled(p), after, T) == pytest.approx(5.0)


def test_a_gait_that_tells_nothing_leaves_what_was_there() -> None:
    """0 nats between all: each is as probable as before."""
    after = settled(NOTHING_WRONG, np.zeros((3, 3)), T, none=0)
    assert after == pytest.approx(unsettled(NOTHING_WRONG))
    assert worth(unsettled(NOTHING_WRONG), after, T) == pytest.approx(0.0)


def test_telling_two_weak_effects_apart_is_worth_less_than_telling_nothing_wrong_from_both() -> None:
    """40 nats between the two effects and none to the refit model, against 8 between that and each: the second gait is
    chosen. By the smallest distance between effects alone, as up to version 19, it was the first."""
    weak = settled(NOTHING_WRONG, _apart(3, {(1, 2): 40.0}), T, none=0)
    right = settled(NOTHING_WRONG, _apart(3, {(0, 1): 8.0, (0, 2): 8.0}), T, none=0)
    assert chosen(unsettled(NOTHING_WRONG), {"weak": weak, "right": right}) == "right"


def test_no_gait_is_chosen_where_none_is_expected_to_settle_more() -> None:
    """A gain below WORTH_IT is no reason to run anything; neither is an empty library."""
    assert chosen(0.5, {"a": 0.5, "b": 0.5 + 0.9 * WORTH_IT}) is None
    assert chosen(0.5, {"a": 0.5, "b": 0.5 + 1.1 * WORTH_IT}) == "b"
    assert chosen(0.5, {}) is None


def test_an_effect_that_gains_nothing_already_cannot_become_less_probable() -> None:
    """Where nothing is wrong 100 nats against such an effect change nothing, as in the ranking; where the effect is
    there they settle the set. One that gains something falls to where the other is."""
    p = np.array([0.8, 0.2])
    nats = _apart(2, {(0, 1): 100.0})
    assert settled(p, nats, T, none=0, nothing=np.log(0.25)) == pytest.approx(0.8 * 0.8 + 0.2)
    assert settled(p, nats, T, none=0, nothing=np.log(0.1)) == pytest.approx(0.8 / 1.1 + 0.2)


def test_what_the_truth_cannot_predict_itself_speaks_against_it() -> None:
    """Both signs: a candidate that stands nearer to what is seen than the truth does makes the truth less probable."""
    p = np.array([0.5, 0.5])
    after = settled(p, np.array([[0.0, -4.0], [4.0, 0.0]]), T, none=1)
    assert after == pytest.approx(0.5 / (1.0 + np.e) + 0.5 / (1.0 + np.exp(-1.0)))
