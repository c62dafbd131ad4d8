"""A replayer that remembers: the same questions are answered from the checkpoint bit by bit, any other one is asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from r2s2r_cli.engine.flat import pack_state, unpack_state
from r2s2r_cli.stages.diagnose.which.looks import Seen
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.remembered import Remembered
from r2s2r_cli.stages.diagnose.which.replay import Replayer
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.model import rest_state
from tests.support.builders import robot
from tests.support.kept import Kept

FRAMES, SENSORS = 5, 2


@pytest.fixture(scope="module")
def model() -> Model:
    """The nominal simulator."""
    return Model(nominal(robot()), effects=())


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, model: Model) -> list[str]:
    """What was really simulated: a made-up simulator whose answers depend on all that it is asked, in an order of
    memory of their own."""
    done: list[str] = []

    def views(self: Replayer, many: Sequence[Stretch], total: np.ndarray) -> list[Seen]:
        self.rollouts += len(many) * len(total)
        rng = [np.random.default_rng([one.order, round(abs(1e6 * float(total.sum())))]) for one in many]
        k = len(total)
        return [Seen(r.standard_normal((6, 3, FRAMES, k)).T, r.standard_normal((k, FRAMES, SENSORS)),
                     r.standard_normal((k, 7)), r.standard_normal((k, 7))) for r in rng]  # fmt: skip

    def seen(
        self: Replayer, many: Sequence[Stretch], values: np.ndarray, by: Sequence[np.ndarray] | None = None
    ) -> list[Seen]:
        done.append("seen")
        return views(self, many, values + sum(float(one.sum()) for one in by or ()))

    def around(self: Replayer, many: Sequence[Stretch], values: np.ndarray, by: Sequence[np.ndarray]) -> list[Seen]:
        done.append("around")
        return views(self, many, values + sum(float(one.sum()) for one in by))

    def finals(self: Replayer, many: Sequence[Stretch], values: np.ndarray) -> Any:
        done.append("finals")
        self.rollouts += len(many)
        flat = torch.cat([pack_state(model.structure, one.window.state) for one in many])
        return unpack_state(model.structure, flat + float(values.sum()))

    for one in (seen, around, finals):
        monkeypatch.setattr(Replayer, one.__name__, one)
    return done


def stretch(order: int = 0, **changed: Any) -> Stretch:
    """One that begins at rest; what it observed no simulation asks for."""
    window: Any = SimpleNamespace(state=rest_state(robot()))
    none = np.zeros(0)
    return replace(Stretch("walk", "walk", 1 + order, order, window, none, none, None, None, ()), **changed)


def diagnosis(model: Model, kept: Kept) -> tuple[list[np.ndarray], int]:
    """Questions of all three kinds: every number that came back, and how many rollouts were counted."""
    replayer = Remembered(model, kept, threads=1)
    many = [stretch(0), stretch(1)]
    values = model.values0[None] + np.arange(3.0)[:, None] / 10
    found = [part for one in replayer.seen(many, values) for part in (one.caps, one.length, one.begin, one.end)]
    found += [one.caps for one in replayer.around(many, values[:1], [np.ones((1, 4)), np.full((1, 4), 0.5)])]
    found.append(pack_state(model.structure, replayer.finals(many, values[1])).numpy())
    found += [one.length for one in replayer.seen(many[1:], values[:1], [np.ones((1, 4))])]
    return found, replayer.rollouts


@pytest.mark.parametrize("count", range(5))
def test_what_was_done_is_not_done_again(model: Model, asked: list[str], count: int) -> None:
    """Begun anew after any number of answers: only the others are simulated, all numbers come out bit by bit, also
    their order in memory, and as many rollouts are counted as without the interruption."""
    kept = Kept()
    whole, rollouts = diagnosis(model, kept)
    assert asked == ["seen", "around", "finals", "seen"] and len(kept.answers) == 4
    asked.clear()
    again, counted = diagnosis(model, kept.after(count))
    assert asked == ["seen", "around", "finals", "seen"][count:]
    assert counted == rollouts > 0
    for one, other in zip(whole, again, strict=True):
        assert one.dtype == other.dtype and one.flags.c_contiguous and other.flags.c_contiguous
        assert np.array_equal(one, other)


OTHERS: dict[str, Any] = {
    "another run": {"run": "crawl"}, "another interval": {"interval": 2}, "a later piece": {"piece": 1},
    "another margin": {"margin": 1e-3}, "cables that are taut": {"taut": np.zeros(6)},
    "a later end": {"goes_on": 0.1},
}  # fmt: skip


@pytest.mark.parametrize("changed", OTHERS.values(), ids=OTHERS.keys())
def test_another_stretch_is_another_question(model: Model, asked: list[str], changed: dict[str, Any]) -> None:
    """Whatever of a stretch the simulation depends on makes it one that was not asked yet."""
    kept = Kept()
    Remembered(model, kept, threads=1).seen([stretch()], model.values0[None])
    for other, known in ((stretch(**changed), False), (stretch(), True)):
        asked.clear()
        Remembered(model, kept.after(1), threads=1).seen([other], model.values0[None])
        assert (asked == []) == known


def test_other_numbers_starts_and_questions_are_asked(model: Model, asked: list[str]) -> None:
    """The last bit of a value, of a start or of what is begun away from it, and another question at the same numbers:
    none is answered from memory."""
    kept = Kept()
    values, by = model.values0[None], np.ones((1, 4))
    Remembered(model, kept, threads=1).around([stretch()], values, [by])
    moved = stretch()
    state = moved.window.state
    moved.window.state = replace(state, p_WB=torch.nextafter(state.p_WB, state.p_WB + 1.0))
    near = np.nextafter(values, 1.0)

    def ask(one: Stretch, at: np.ndarray, away: np.ndarray) -> int:
        asked.clear()
        Remembered(model, kept.after(1), threads=1).around([one], at, [away])
        return len(asked)

    assert ask(stretch(), values, by) == 0
    assert ask(moved, values, by) == ask(stretch(), near, by) == ask(stretch(), values, np.nextafter(by, 2.0)) == 1
    for replay in (lambda r: r.seen([stretch()], values, [by]), lambda r: r.finals([stretch()], values[0])):
        asked.clear()
        replay(Remembered(model, kept.after(1), threads=1))
        assert len(asked) == 1


def test_after_another_question_nothing_old_is_believed(model: Model, asked: list[str]) -> None:
    """One answer that is missing in the middle: what comes after it is simulated and kept anew."""
    kept = Kept()
    diagnosis(model, kept)
    broken = Kept([kept.answers[0], (b"other", []), *kept.answers[2:]])
    asked.clear()
    again, _ = diagnosis(model, broken)
    assert asked == ["around", "finals", "seen"]
    assert [digest for digest, _ in broken.answers] == [digest for digest, _ in kept.answers]
    asked.clear()
    assert all(np.array_equal(a, b) for a, b in zip(again, diagnosis(model, broken.after(4))[0], strict=True))
    assert asked == []
