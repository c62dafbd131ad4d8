"""Which gait narrows the bound of `no_gap`: that of most target intervals whose end is sure."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose import next_narrow
from r2s2r_cli.stages.diagnose.next_narrow import ends_off, narrowest, ways
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
    monkeypatch.setattr(next_narrow, "ways", lambda arena, base, many: np.array([1.0, 2.0, 3.0, 4.0, 5.0]))

    def ends_off(arena: Any, base: Any, targets: Any, *, name: str, least_m: float) -> np.ndarray:
        assert least_m == 2.0
        return np.array(off[name])

    monkeypatch.setattr(next_narrow, "ends_off", ends_off)
    nobody = SimpleNamespace(whole=())
    assert narrowest(nobody, NOBODY, dict.fromkeys(off, ((0.0,),)), 5.0) == best  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_robot_that_stands_still_shows_nothing(tmp_path: Path) -> None:
    """One number an interval, eight at most; less than a millimetre is off where no motor runs (cables may be stiffer
    than they are known to be), and where six do, more, since their speed is not known. An interval without motion does
    not count, however sure it is: the running motors are suggested."""
    body = robot()
    model = Model(nominal(body))
    replayer = Replayer(model, step=2e-3, cache_dir=tmp_path, threads=1)
    run = planted(body, {}, gaits=2, targets=2, cache_dir=tmp_path).runs[0]
    arena = Arena(replayer, [stretch_of(run, 1, window(run.caps, (1,), _at_rest(replayer)), 0)], floor_m=2e-3)
    base = Fit(
        Hypothesis(), arena.mean.copy(), np.zeros(0), np.zeros(0), np.zeros((0, 0)), 0.0, np.zeros(0), np.zeros(0), []
    )
    six = tuple(tuple(float((k + i) % 2) for i in range(6)) for k in range(10))
    still = ((1.0,) * 6,) * 9
    moving = ends_off(arena, base, six, name="six", least_m=0.0)
    standing = ends_off(arena, base, still, name="still", least_m=0.0)
    assert len(moving) == len(standing) == 8
    assert standing.max() < 1e-3 < moving.min()
    assert np.isinf(ends_off(arena, base, still, name="still", least_m=5e-3))[1:].all()  # the first one settles
    assert ways(arena, base, arena.whole).min() > 5e-3
    best = narrowest(arena, base, {"six": six, "still": still}, float(moving.max()) + 1e-6)
    assert best is not None and best[0] == "six"
