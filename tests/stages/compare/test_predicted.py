"""What a simulator says of a run, whatever `simulate` is set to."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.stages.compare.opening import Opening
from r2s2r_cli.stages.compare.predicted import Model, predicted
from r2s2r_cli.stages.compare.runs import RealRun, cap_shares
from r2s2r_cli.stages.compare.walk import Walk
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.segments import target_intervals
from r2s2r_cli.stages.simulate.drive import Driver
from r2s2r_cli.stages.simulate.policies import Sequence
from schemas.config import SimulateSettings
from tests.support import builders
from tests.support.kept import Kept


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of machine code."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def run(cache: Path) -> RealRun:
    """What the engine itself makes of a policy of two targets."""
    robot = builders.robot()
    targets = Sequence(np.array([[1.0, 0.5, 1, 1, 1, 1], [1.0] * 6]), np.zeros(2), np.full(2, 3.0))
    driver = Driver(robot, SimulateSettings(), cache)
    made = driver.closed_loop("walk", targets, driver.rest(), lambda _: None)
    t, caps = made.frames["t"], made.frames["p_WE"]
    intervals = target_intervals(t, made.target_at, control=made.control_at, tolerance=robot.pid.tolerance)
    walk = Walk(t, caps, cap_shares(robot), intervals)
    return RealRun("walk", "walk", 1, len(intervals), walk, targets, None, Opening())


def test_what_is_simulated_after_the_last_target_is_not_compared(run: RealRun, cache: Path) -> None:
    """A tail with the motors off lengthens no interval: the run is the one without it, to its end."""
    settings = SimulateSettings(tail_s=2.0)
    (found,) = predicted(Model("initial", nominal(builders.robot())), [run], settings, cache_dir=cache)
    assert found.walk is not None and len(found.walk.intervals) == 2
    assert abs(found.walk.t[-1] - run.walk.t[-1]) < 0.1


def test_what_is_kept_is_not_simulated_again(run: RealRun, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It comes back bit by bit, and the engine is not even made ready; of another run it is not taken."""
    model, settings = Model("initial", nominal(builders.robot())), SimulateSettings()
    kept = Kept()
    (first,) = predicted(model, [run], settings, cache_dir=cache, checkpoint=kept)
    monkeypatch.setattr(sys.modules[predicted.__module__], "Driver", None)
    (again,) = predicted(model, [run], settings, cache_dir=cache, checkpoint=kept.again())
    assert again.walk is not None and first.walk is not None and again.real is not None and first.real is not None
    for one, other in ((first.walk, again.walk), (first.real, again.real)):
        for name in ("t", "p_WE", "share"):
            same(getattr(one, name), getattr(other, name))
        for mine, its in zip(vars(one.intervals).values(), vars(other.intervals).values(), strict=True):
            same(mine, its)
    with pytest.raises(TypeError, match="not callable"):
        predicted(model, [replace(run, name="crawl")], settings, cache_dir=cache, checkpoint=kept.again())


def same(one: np.ndarray, other: np.ndarray) -> None:
    """Bit by bit, and alike in memory: sums depend on it."""
    assert one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
    assert one.flags.c_contiguous and other.flags.c_contiguous
