"""The stretch sensors of the boards: lag, errors, calibration and faults against the true lengths."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from r2s2r_cli.rig.firmware import nominal_calibration, points_csv
from r2s2r_cli.rig.firmware.sensors import ADC_MAX, ADC_PF, StretchSensors, converted
from r2s2r_cli.rig.world import World
from tests.support.rig_boards import ALL, EXACT, ROBOT, lengths_of


def sensors(**table: Any) -> StretchSensors:
    """The sensors alone."""
    return StretchSensors(ROBOT, World.model_validate({"sensors": EXACT | table}), np.random.default_rng(3))


def test_exact_sensors_tell_the_length_through_the_calibration() -> None:
    """Without errors the nominal calibration gives back the lengths of every sensor."""
    length = np.linspace(0.08, 0.3, 9)
    s = sensors()
    s.follow(0.0, length)
    np.testing.assert_allclose(lengths_of(s.read(0.0, ALL)), length, atol=1e-12)


def test_the_calibration_of_robot_toml_comes_first() -> None:
    """A calibrated sensor has the slope and offset of robot.toml, unless the world file says otherwise; the others have
    those of the world file."""
    sensor = ROBOT.sensors[0].model_copy(update={"slope_f_per_m": 2e-11, "offset_f": 1e-11})
    robot = ROBOT.model_copy(update={"sensors": (sensor, *ROBOT.sensors[1:])})
    slope, offset = nominal_calibration(robot, World().sensors)
    assert (slope[0], offset[0]) == (2e-11, 1e-11)
    assert (slope[1], offset[1]) == (3e-11, 1.4e-11)
    slope, offset = nominal_calibration(robot, World().sensors.model_copy(update={"line": "own"}))
    assert (slope == 3e-11).all()
    assert (offset == 1.4e-11).all()


def test_the_converter_is_that_of_the_robot() -> None:
    """Capacitances are 42 1024 / 3.3 / n pF with whole n: 0.031 pF at 20 pF, and a floor where n ends."""
    pF = converted(np.linspace(13.0, 25.0, 500))
    n = ADC_PF / pF
    np.testing.assert_allclose(n, np.round(n), atol=1e-9)
    assert np.diff(np.unique(converted(np.linspace(19.9, 20.1, 999)))).mean() == pytest.approx(0.0307, abs=5e-4)
    assert converted(np.array([3.0]))[0] == pytest.approx(ADC_PF / ADC_MAX)


def test_the_lag_is_first_order() -> None:
    """Behind a ramp it is late by its time constant, and a step comes to 1 - 1/e after it."""
    s = sensors(lag_s=0.05)
    for k in range(200):
        s.follow(k * 0.005, np.full(9, 0.1 + 0.04 * k * 0.005))
    np.testing.assert_allclose(lengths_of(s.read(0.0, ALL)), 0.1 + 0.04 * (199 * 0.005 - 0.05), atol=1e-9)
    s = sensors(lag_s=0.05)
    s.follow(0.0, np.full(9, 0.1))
    s.follow(1e-9, np.full(9, 0.2))
    s.follow(0.05, np.full(9, 0.2))
    np.testing.assert_allclose(lengths_of(s.read(0.0, ALL)), 0.2 - 0.1 * np.exp(-1), atol=1e-6)


def test_errors_have_their_statistics() -> None:
    """Offset of the day, noise and drift over many seeds have the standard deviations of the world file."""
    day, noise, drift = [], [], []
    for seed in range(120):
        rng = np.random.default_rng(seed)
        s = StretchSensors(ROBOT, World.model_validate({"sensors": EXACT | {"day_sd_m": 0.005}}), rng)
        s.follow(0.0, np.full(9, 0.15))
        day.append(lengths_of(s.read(0.0, ALL)) - 0.15)
        s = StretchSensors(ROBOT, World.model_validate({"sensors": EXACT | {"noise_sd_m": 0.0005}}), rng)
        s.follow(0.0, np.full(9, 0.15))
        noise.append(lengths_of(s.read(0.0, ALL)) - 0.15)
        s = StretchSensors(ROBOT, World.model_validate({"sensors": EXACT | {"drift_sd_m": 0.001}}), rng)
        s.follow(0.0, np.full(9, 0.15))
        drift.append(lengths_of(s.read(240.0, ALL)) - 0.15)
    assert np.std(day) == pytest.approx(0.005, rel=0.1)
    assert np.std(noise) == pytest.approx(0.0005, rel=0.1)
    assert np.std(drift) == pytest.approx(0.002, rel=0.1), "four minutes: twice that of one"


def test_the_bow_is_a_parabola_that_ends() -> None:
    """Minus its size in the middle of the controller's range, plus its size at both ends and beyond."""
    pid = ROBOT.pid
    s = sensors(bow_sd_m=0.002)
    off = []
    for x in (0.0, 0.5, 1.0, 1.6):
        length = pid.min_length_m + x * pid.range_m
        s.follow(x + 0.1, np.full(9, length))
        off.append(lengths_of(s.read(0.0, ALL))[:6] - length)
    np.testing.assert_allclose(off[0], -off[1], atol=1e-12)
    np.testing.assert_allclose(off[0], off[2], atol=1e-12)
    np.testing.assert_allclose(off[2], off[3], atol=1e-12)
    assert np.std(off[0]) > 2e-4


def test_a_bench_calibration_finds_the_line_and_not_the_day() -> None:
    """Lines through the table of the bench are the nominal ones, to what rule, noise, bow and converter allow; today's
    offset is not in them, and two tables of one world are the same."""
    world = World.model_validate({"seed": 3, "sensors": {"day_sd_m": 0.05}})
    text = points_csv(ROBOT, world)
    assert text == points_csv(ROBOT, world)
    rows = np.array([[float(x) for x in row.split(",")[1:]] for row in text.splitlines()[1:]])
    slope, offset = nominal_calibration(ROBOT, world.sensors)
    for sensor in ALL:
        mine = rows[rows[:, 0] == sensor]
        assert len(mine) == 5
        m, b = np.polyfit(mine[:, 1] * 1e-3, mine[:, 2] * 1e-12, 1)
        length = mine[:, 1].mean() * 1e-3
        assert m == pytest.approx(slope[sensor], rel=0.05)
        assert (m * length + b - offset[sensor]) / slope[sensor] == pytest.approx(length, abs=0.003)


def test_a_stuck_sensor_sends_020_and_a_frozen_one_its_last_value() -> None:
    """Each only in its time; a jump adds its length."""
    faults = [
        {"kind": "sensor_stuck", "sensor": 1, "at_s": 1.0, "for_s": 1.0},
        {"kind": "sensor_frozen", "sensor": 2, "at_s": 1.0, "for_s": 1.0},
        {"kind": "sensor_jump", "sensor": 3, "at_s": 1.0, "by_m": 0.02},
    ]
    s = StretchSensors(ROBOT, World.model_validate({"sensors": EXACT, "faults": faults}), np.random.default_rng(0))
    read = []
    for k, t in enumerate((0.5, 1.5, 2.5)):
        s.follow(t, np.full(9, 0.10 + 0.01 * k))
        read.append(s.read(t, ALL))
    assert read[1][1] == 0.20
    assert read[1][2] == read[0][2] != read[2][2]
    np.testing.assert_allclose(lengths_of(read[1])[[0, 3]], [0.11, 0.13], atol=1e-9)
    np.testing.assert_allclose(lengths_of(read[2])[[1, 2]], 0.12, atol=1e-9)


def test_dropouts_repeat_at_their_rate() -> None:
    """As many samples as the world file says are the same as the one before."""
    s = sensors(dropout_share=0.1, noise_sd_m=0.001)
    s.follow(0.0, np.full(9, 0.15))
    read = np.array([s.read(0.0, ALL) for _ in range(2000)])
    assert (np.diff(read, axis=0) == 0).mean() == pytest.approx(0.1, abs=0.01)
