"""What a simulator says of a run, whatever `simulate` is set to."""

from __future__ import annotations

from pathlib import Path

import numpy as np

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


def test_what_is_simulated_after_the_last_target_is_not_compared(tmp_path: Path) -> None:
    """A tail with the motors off lengthens no interval: the run is the one without it, to its end."""
    robot = builders.robot()
    targets = Sequence(np.array([[1.0, 0.5, 1, 1, 1, 1], [1.0] * 6]), np.zeros(2), np.full(2, 3.0))
    driver = Driver(robot, SimulateSettings(), tmp_path)
    made = driver.closed_loop("walk", targets, driver.rest(), lambda _: None)
    t, caps = made.frames["t"], made.frames["p_WE"]
    intervals = target_intervals(t, made.target_at, control=made.control_at, tolerance=robot.pid.tolerance)
    walk = Walk(t, caps, cap_shares(robot), intervals)
    run = RealRun("walk", "walk", 1, len(intervals), walk, targets, None, Opening())
    settings = SimulateSettings(tail_s=2.0)
    (found,) = predicted(Model("initial", nominal(robot)), [run], settings, cache_dir=tmp_path)
    assert found.walk is not None and len(found.walk.intervals) == 2
    assert abs(found.walk.t[-1] - walk.t[-1]) < 0.1
