"""What a checkpoint of the default fit holds belongs together: taken up anywhere, nothing is told or counted twice."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from r2s2r_cli.stages.identify import default_method
from r2s2r_cli.stages.identify.default_method import first_fit
from r2s2r_cli.stages.identify.kept import Kept
from r2s2r_cli.stages.identify.solve.record import Checkpoint, Counts, Progress, State

ROUNDS, STEPS, EACH = 3, 4, 10


class Interrupted(Exception):
    """Control and C."""


class Saved:
    """A checkpoint file in memory."""

    def __init__(self) -> None:
        self.text = ""

    def load(self) -> dict[str, Any] | None:
        """As it comes back from JSON."""
        return cast("dict[str, Any]", json.loads(self.text)) if self.text else None

    def save(self, values: Any) -> None:
        """Replace it."""
        self.text = json.dumps(values)


def pretended(*given: Any, progress: Any, checkpoint: Any, resume: Any, **rest: Any) -> str:
    """Rounds as `fit` has them: the first can be taken up after every step, the others begin anew."""
    predictor = given[2]
    at, values, inner = resume or (0, np.array([0.5]), None)
    for number in range(at, ROUNDS):
        if inner is None:
            checkpoint(number, values, None)
        for step in range(inner.state.iteration if inner else 0, STEPS):
            predictor.rollouts += EACH
            if number == 0:
                checkpoint(number, values, Checkpoint(State((0.0,), 1.0, iteration=step + 1)))
            cost = float(values[0] * 100 - step)
            progress(number, ROUNDS, Progress(step + 1, STEPS, cost, 0.0, 0.0, Counts(), stage_name="all"))
        inner, values = None, values / 3.0
    return "fitted"


def run(saved: Saved, stop: int | None) -> tuple[list[tuple[str, int, float]], int]:
    """The trace and the simulations of a fit that is interrupted after so many steps; None: that goes through."""
    told = 0

    def progress(one: object) -> None:
        nonlocal told
        told += 1
        if told == stop:
            raise Interrupted

    task = SimpleNamespace(
        runs=(), request=SimpleNamespace(train=(), seed=0), recipe=None, progress=progress, held=(), near=None
    )
    kept, predictor = Kept(saved), SimpleNamespace(rollouts=3)
    first_fit(cast(Any, task), cast(Any, predictor), kept)
    return [(one.stage, one.iteration, one.cost) for one in kept.steps], predictor.rollouts


@pytest.mark.parametrize("stop", range(1, ROUNDS * STEPS + 1))
def test_an_interruption_leaves_no_trace(monkeypatch: pytest.MonkeyPatch, stop: int) -> None:
    """Interrupted after any step of any round, and once more after the next one: trace and count are the whole fit's,
    each step once."""
    monkeypatch.setattr(default_method, "fit", pretended)
    monkeypatch.setattr(default_method, "as_the_others", lambda found: found)
    whole = run(Saved(), None)
    assert len(whole[0]) == len(set(whole[0])) == ROUNDS * STEPS and whole[1] == 3 + ROUNDS * STEPS * EACH
    saved = Saved()
    for after in (stop, 1):
        with pytest.raises(Interrupted):
            run(saved, after)
    assert run(saved, None) == whole
