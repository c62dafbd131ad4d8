"""The runs of `bench estimate`: what the truth says fits what was recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.commands.bench_estimate_case import REPORT_SEEDS, TUNING_SEEDS, make_case
from r2s2r_cli.commands.bench_estimate_motion import moved, robot_of
from r2s2r_cli.rig.world import World


def test_seeds_of_the_figures_are_not_those_of_tuning() -> None:
    """Nothing that was looked at while tuning is reported."""
    assert not set(REPORT_SEEDS) & set(TUNING_SEEDS)


def test_motion_is_the_same_every_time_and_sensors_follow_it() -> None:
    """Equal seeds, equal runs; exact sensors without lag show the true lengths of their instant."""
    robot = robot_of()
    exact = {"day_sd_m": 0.0, "drift_sd_m": 0.0, "bow_sd_m": 0.0, "noise_sd_m": 0.0, "lag_s": 0.0,
             "converter": "exact", "dropout_share": 0.0}  # fmt: skip
    world = World.model_validate({"seed": 100, "sensors": exact, "start": {"settle_s": 1.0}})
    one, two = (moved(robot, world, 100, 2.0) for _ in range(2))
    assert np.array_equal(one.p_WE, two.p_WE)
    sensors = one.streams["sensors"]
    true = np.stack([np.interp(sensors["t"], one.t, column) for column in one.length.T], axis=1)
    off = sensors["length"] - true[:, sensors["cable"]]
    assert np.isfinite(off).any(axis=0).all()
    assert np.nanmax(np.abs(off)) < 5e-4  # the plant goes in steps of 1 ms, at up to 0.3 m/s


@pytest.mark.slow
def test_pictures_sensors_and_truth_have_one_clock_but_for_the_stated_delay(tmp_path: Path) -> None:
    """Lengths that the sensors give at t + delay are the true ones at the frame, to their noise; half of the time the
    hidden cap is hidden, and a case that is drawn already is taken as it is."""
    case = make_case(100, tmp_path, run_s=4.0, hide_cap=True, bias_m=0.0)
    truth, sensors = case.truth, case.streams["sensors"]
    cable = sensors["cable"]
    right = reversed_ = 0.0
    for column, k in enumerate(cable.tolist()):
        good = np.isfinite(sensors["length"][:, column])
        shown = np.interp(truth.t + truth.delay_s, sensors["t"][good], sensors["length"][good, column])
        wrong = np.interp(truth.t - truth.delay_s, sensors["t"][good], sensors["length"][good, column])
        off, off_wrong = shown - truth.length[:, k], wrong - truth.length[:, k]
        assert np.sqrt(np.mean(off**2)) < 0.004
        right, reversed_ = right + np.sum(off**2), reversed_ + np.sum(off_wrong**2)
    assert right < reversed_
    hidden = truth.hidden[:, 100 % 6]
    assert 0.4 < hidden.mean() < 0.6
    before = {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    again = make_case(100, tmp_path, run_s=4.0, hide_cap=True, bias_m=0.0)
    assert {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == before
    assert np.array_equal(again.truth.p_WE, truth.p_WE)
    assert again.frames.color[5] == case.frames.color[5]
