"""Answers that are kept are given again, whoever asks in whatever order, and the oldest are forgotten."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.diagnose.which.looks import Seen
from r2s2r_cli.stages.diagnose.which.recent import Recent, digests


def answers(questions: np.ndarray) -> list[Seen]:
    """Of two stretches, made of the questions (k, 2)."""
    by = questions.sum(axis=1)
    return [Seen(*(np.multiply.outer(by + k, np.ones(shape)) for shape in ((4, 6, 3), (4, 2), 7, 7))) for k in range(2)]


def same(found: list[Seen], questions: np.ndarray) -> bool:
    """Whether these are their answers."""
    return all(
        np.array_equal(getattr(a, name), getattr(b, name))
        for a, b in zip(found, answers(questions), strict=True) for name in vars(a)
    )  # fmt: skip


def test_known_answers_of_several_batches_come_in_the_order_asked() -> None:
    """Two batches are kept; a third one mixes both, twice the same question among them."""
    rng = np.random.default_rng(0)
    first, second = rng.standard_normal((2, 5, 2))
    recent = Recent()
    for batch in (first, second):
        assert not recent.known(digests((1,), batch)).any()
        recent.keep(digests((1,), batch), answers(batch))
        assert same(recent.of(digests((1,), batch)), batch)
    mixed = np.concatenate([second[[3]], first[[4, 0]], second[[3, 1]]])
    names = digests((1,), mixed)
    assert recent.known(names).all()
    assert same(recent.of(names), mixed)


def test_another_question_has_another_name() -> None:
    """A number that differs in its last bit, other stretches, or another order of the same numbers."""
    one = np.array([[1.0, 2.0]])
    names = [digests((n,), x)[0] for n, x in ((1, one), (2, one), (1, np.nextafter(one, 9.0)), (1, one[:, ::-1]))]
    assert len(set(names)) == 4
    assert digests((1,), one, one) != digests((1,), one)


def test_the_oldest_are_forgotten_but_not_while_they_are_asked_for() -> None:
    """With room for one batch alone the second one drives out the first, when it is asked the next time."""
    first, second = np.random.default_rng(1).standard_normal((2, 3, 2))
    recent = Recent(sum(part.nbytes for one in answers(first) for part in vars(one).values()))
    recent.keep(digests((), first), answers(first))
    recent.keep(digests((), second), answers(second))
    assert same(recent.of(digests((), first)), first)
    assert not recent.known(digests((), first)).any()
    assert recent.known(digests((), second)).all()
