"""Interrupted after any iteration and resumed through JSON: the same bits as without the interruption."""

from __future__ import annotations

import dataclasses
import json
from functools import partial

import numpy as np
import pytest

from r2s2r_cli.stages.identify.solve.horizon import solve_growing
from r2s2r_cli.stages.identify.solve.levenberg import levenberg_marquardt
from r2s2r_cli.stages.identify.solve.loss import StudentT
from r2s2r_cli.stages.identify.solve.record import Checkpoint
from r2s2r_cli.stages.identify.solve.starts import multi_start, starts
from tests.stages.identify.solve.problems import DECAY_START, decay, rosenbrock

HORIZONS = [("1 s", decay(until=1.0)), ("3 s", decay(until=3.0)), ("all", decay())]
STARTS = starts(np.full(3, -1.0), np.full(3, 3.0), DECAY_START, n=3, seed=1)
SOLVES = {
    "levenberg": partial(levenberg_marquardt, rosenbrock(upper=0.9), np.array([-1.2, 0.8])),
    "growing": partial(solve_growing, HORIZONS, DECAY_START, loss=StudentT()),
    "several": partial(multi_start, HORIZONS, STARTS, loss=StudentT(), seed=1),
}


class Interrupted(Exception):
    """What a key press does to a fit."""


def same(first, second) -> None:
    """All fields equal, bit by bit."""
    for one in dataclasses.fields(first):
        a, b = getattr(first, one.name), getattr(second, one.name)
        if one.name == "solutions":
            assert len(a) == len(b)
            for x, y in zip(a, b, strict=True):
                same(x, y)
        else:
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("name", SOLVES)
def test_resume_after_any_iteration(name: str) -> None:
    """For every iteration: interrupt there, store the last checkpoint as JSON, resume, compare all fields."""
    solve, steps = SOLVES[name], []
    whole = solve(progress=steps.append)
    assert len(steps) > 6

    for stop in range(1, len(steps) + 1):
        kept, seen = [], []

        def interrupt(step, seen=seen, stop=stop) -> None:
            seen.append(step)
            if len(seen) == stop:
                raise Interrupted

        with pytest.raises(Interrupted):
            solve(progress=interrupt, checkpoint=lambda one, kept=kept: kept.append(json.dumps(one.to_dict())))
        rest = []
        same(whole, solve(resume=Checkpoint.from_dict(json.loads(kept[-1])), progress=rest.append))
        assert seen + rest == steps


@pytest.mark.parametrize("name", SOLVES)
def test_progress_rises(name: str) -> None:
    """The share done that progress reports rises from 0 towards 1, for a forecast of the time left."""
    steps = []
    SOLVES[name](progress=steps.append)
    shares = [step.fraction for step in steps]
    assert np.all(np.diff(shares) > 0)
    assert 0.0 < shares[0] < shares[-1] <= 1.0
