"""Which gait narrows the bound of `no_gap`: that of most target intervals whose end is sure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose import next_narrow
from r2s2r_cli.stages.diagnose.next_narrow import ends_off, narrowest
from r2s2r_cli.stages.diagnose.sample import _at_rest, planted
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.replay import Replayer
from r2s2r_cli.stages.diagnose.which.stretches import stretch_of
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.identify.windows import window
from tests.support.builders import robot

NOBODY: Any = None
"""Arena and fit where how far ends are off is given."""


@pytest.mark.parametrize(
    ("off", "best"),
    [
        ({"a": [1.0, 9.0, 1.0], "b": [1.0, 1.0, 9.0, 1.0], "c": [9.0]}, ("b", 3)),
        ({"a": [1.0, 4.0], "b": [1.0, 2.0], "c": [1.0, np.inf]}, ("b", 2)),
        ({"a": [5.1], "b": [np.inf, 9.0]}, None),
        ({}, None),
    ],
)
def test_sure_intervals_count_and_among_equals_the_surest(
    off: dict[str, list[float]], best: tuple[str, int] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ends within a floor of 5 are sure; a gait without one is not suggested."""
    monkeypatch.setattr(next_narrow, "ends_off", lambda arena, base, targets, *, name: np.array(off[name]))
    assert narrowest(NOBODY, NOBODY, dict.fromkeys(off, ((0.0,),)), 5.0) == best


@pytest.mark.slow
def test_a_robot_that_stands_still_ends_where_it_is(tmp_path: Path) -> None:
    """One number an interval, eight at most; less than a millimetre is off where no motor runs (cables may be stiffer
    than they are known to be), and where six do, more, since their speed is not known."""
    body = robot()
    model = Model(nominal(body))
    replayer = Replayer(model, step=2e-3, cache_dir=tmp_path, threads=1)
    run = planted(body, {}, gaits=2, targets=2, cache_dir=tmp_path).runs[0]
    arena = Arena(replayer, [stretch_of(run, 1, window(run.caps, (1,), _at_rest(replayer)), 0)], floor_m=2e-3)
    base = Fit(
        Hypothesis(), arena.mean.copy(), np.zeros(0), np.zeros(0), np.zeros((0, 0)), 0.0, np.zeros(0), np.zeros(0), []
    )
    six = tuple(tuple(float((k + i) % 2) for i in range(6)) for k in range(10))
    moving = ends_off(arena, base, six, name="six")
    still = ends_off(arena, base, ((1.0,) * 6,) * 3, name="still")
    assert len(moving) == 8 and len(still) == 3
    assert still.max() < 1e-3 < moving.min()
    assert narrowest(arena, base, {"six": six, "still": ((1.0,) * 6,) * 9}, 1e-3) == ("still", 8)
