"""What an effect will do on the judged intervals, imagined from their targets alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.much.ahead import ahead
from r2s2r_cli.stages.diagnose.sample import NOISE_M, _at_rest, planted
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.replay import Replayer
from r2s2r_cli.stages.diagnose.which.stretches import stretch_of
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.identify.windows import window
from tests.support.builders import robot


@pytest.mark.slow
def test_what_is_imagined_is_what_two_robots_do(tmp_path: Path) -> None:
    """A robot whose motors do 70 % and one that is right, both run with the same targets: where their caps are at the
    end of the first interval differs by what was imagined, to the noise. The second interval begins where
    the truth is, so that two models that are the same never part; nor do any two where no motor runs."""
    body = robot()
    model = Model(nominal(body))
    replayer = Replayer(model, step=2e-3, cache_dir=tmp_path, threads=1)
    slow = {f"motor_speed_mismatch.factor.{k}": 0.7 for k in range(len(body.actuated))}
    how = {"gaits": 2, "targets": 2, "cache_dir": tmp_path}
    wrong, right = (planted(body, effect, **how).runs for effect in (slow, {}))  # type: ignore[arg-type]
    run = wrong[0]
    like = stretch_of(run, 1, window(run.caps, (1,), _at_rest(replayer)), 0)
    arena = Arena(replayer, [like], floor_m=2e-3)
    off = model.values0
    on = off.copy()
    on[[model.place[name] for name in slow]] = list(slow.values())
    targets = wrong[1].caps.intervals.target
    made = ahead(arena, targets, (1, 2), on, off)[0]
    end = int(wrong[1].caps.intervals.last[0])
    seen = right[1].caps.observed[end] - wrong[1].caps.observed[end]
    assert np.sqrt(np.mean(made[0] ** 2)) > 3 * NOISE_M
    assert np.sqrt(np.mean((made[0] - seen) ** 2)) < 2 * NOISE_M
    assert made[1] == pytest.approx(ahead(arena, targets, (2,), on, off)[0, 0])
    assert ahead(arena, targets, (1, 2), on, on) == pytest.approx(np.zeros((1, 2, body.n_caps, 3)))
    still = np.ones_like(targets)
    assert np.abs(ahead(arena, still, (1, 2), on, off)).max() < 1e-4
