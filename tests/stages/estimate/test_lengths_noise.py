"""Cable lengths from caps and sensors; noise of held coordinates."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.artifact import Group
from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.estimate.lengths import cap_distances, sensor_lengths
from r2s2r_cli.stages.estimate.noise import MIN_NOISE, observation_noise
from r2s2r_cli.stages.frames import noise_sd
from schemas.robot import Sensor
from tests.stages.estimate.builders import threebar
from tests.stages.estimate.planted import planted


def test_distances_and_their_deviation_in_closed_form() -> None:
    """3-4-5 triangle: length 5, variance the sum of both caps along the line, nothing from across."""
    p = np.array([[[0.0, 0.0, 0.0], [0.3, 0.4, 0.0]]])
    along = np.array([0.6, 0.8, 0.0])
    cov = np.stack([4e-6 * np.outer(along, along), 9e-6 * np.outer(along, along) + np.diag([0, 0, 1.0])])[None]
    length, sd = cap_distances(p, cov, np.array([[0, 1]]))
    assert float(length[0, 0]) == pytest.approx(0.5)
    assert float(sd[0, 0]) == pytest.approx(np.sqrt(13e-6))


def test_deviation_of_lengths_is_that_of_random_caps() -> None:
    """Scatter of the distance between scattered caps equals the predicted deviation to 5 %."""
    rng = np.random.default_rng(0)
    root = 0.002 * rng.normal(size=(2, 3, 3))
    cov = root @ np.swapaxes(root, 1, 2)
    p = np.array([[0.0, 0.0, 0.0], [0.15, 0.05, 0.1]])
    drawn = p + np.einsum("cij,ncj->nci", root, rng.normal(size=(20000, 2, 3)))
    scatter = np.std(np.linalg.norm(drawn[:, 1] - drawn[:, 0], axis=-1))
    _, sd = cap_distances(p[None], cov[None], np.array([[0, 1]]))
    assert float(sd[0, 0]) == pytest.approx(scatter, rel=0.05)


def test_sensor_lengths_are_interpolated_and_gaps_left_open() -> None:
    """A linear length is met exactly between readings; outside them and in long gaps there is none."""
    robot = threebar()
    stamps = np.array([0.0, 0.1, 0.2, 1.0, 1.1])
    lengths = np.outer(0.1 + 0.05 * stamps, np.ones(len(robot.sensors)))
    lengths[1, 0] = np.nan
    t = np.array([0.05, 0.15, 0.5, 1.05, 1.2])
    found = sensor_lengths(t, Group({"t": stamps, "length": lengths}), robot, 0.25)
    assert found is not None
    assert found.length[[0, 1, 3], 0] == pytest.approx(0.1 + 0.05 * t[[0, 1, 3]])
    assert np.isnan(found.length[[2, 4]]).all()
    assert found.cable.tolist() == [sensor.cable for sensor in robot.sensors]


def test_a_reading_at_the_stamp_of_a_frame_counts_whatever_gap_lies_beside_it() -> None:
    """Frames at the very stamps of readings, before, after and between gaps of 0.8 s, have the readings."""
    robot = threebar()
    stamps = np.array([0.0, 0.8, 1.6, 1.7])
    lengths = np.outer(0.1 + 0.05 * stamps, np.ones(len(robot.sensors)))
    found = sensor_lengths(np.array([0.0, 0.4, 0.8, 1.6, 1.7]), Group({"t": stamps, "length": lengths}), robot, 0.25)
    assert found is not None
    assert found.length[[0, 2, 3, 4]] == pytest.approx(lengths)
    assert np.isnan(found.length[1]).all()


def test_capacitances_of_some_cables_go_through_their_own_lines() -> None:
    """A recording that says of which cables its two columns are: each by the line of that cable, not of its place."""
    robot = threebar()
    lines = {k: (30e-12 + 1e-12 * k, 12e-12) for k in range(9)}
    sensors = [s.model_copy(update={"slope_f_per_m": lines[s.cable][0], "offset_f": 12e-12}) for s in robot.sensors]
    robot = robot.model_copy(update={"sensors": tuple(sensors)})
    t = np.linspace(0, 1, 20)
    raw = np.column_stack([np.full(20, 12e-12 + lines[k][0] * length) for k, length in ((7, 0.11), (2, 0.15))])
    found = sensor_lengths(t, Group({"t": t, "capacitance": raw, "cable": np.array([7, 2])}), robot, 0.25)
    assert found is not None and found.cable.tolist() == [7, 2]
    assert found.length == pytest.approx(np.tile([0.11, 0.15], (20, 1)))


def test_capacitances_go_through_the_calibrated_lines() -> None:
    """Capacitance = slope length + offset is inverted for calibrated sensors; others give no length."""
    robot = threebar()
    sensors = [s.model_copy(update={"slope_f_per_m": 30e-12, "offset_f": 12e-12}) for s in robot.sensors]
    sensors[3] = Sensor(cable=sensors[3].cable)
    robot = robot.model_copy(update={"sensors": tuple(sensors)})
    t = np.linspace(0, 1, 20)
    capacitance = np.full((20, len(sensors)), 12e-12 + 30e-12 * 0.142)
    found = sensor_lengths(t, Group({"t": t, "capacitance": capacitance}), robot, 0.25)
    assert found is not None
    others = np.delete(found.length, 3, axis=1)
    assert others == pytest.approx(0.142)
    assert np.isnan(found.length[:, 3]).all()


def test_uncalibrated_sensors_give_nothing() -> None:
    """Capacitances without a line are no lengths."""
    robot = threebar().model_copy(update={"sensors": tuple(Sensor(cable=k) for k in range(9))})
    t = np.linspace(0, 1, 20)
    assert sensor_lengths(t, Group({"t": t, "capacitance": np.full((20, 9), 1e-11)}), robot, 0.25) is None


def test_a_held_coordinate_gets_the_median_noise() -> None:
    """A coordinate that the source pins is marked, and counts as good as the others, not as good as it is quiet."""
    sample = planted(0)
    p = sample.observed.copy()
    p[:, 5, 2] = 0.0135 + 1e-5 * np.sin(np.arange(len(p)))
    sd, held = observation_noise(sample.t, p, Group({}), where="caps")
    assert np.argwhere(held).tolist() == [[5, 2]]
    assert sd[5, 2] == pytest.approx(np.median(noise_sd(sample.t, p)))


def test_the_noise_of_the_recording_is_taken() -> None:
    """What `import` measured is used as it stands; unknown noise is an error."""
    sample = planted(0)
    sd, held = observation_noise(sample.t, sample.observed, Group({"noise_sd": sample.noise_sd}), where="caps")
    assert np.array_equal(sd, sample.noise_sd)
    assert not np.any(held)
    with pytest.raises(NumericalError, match="noise"):
        observation_noise(sample.t, sample.observed, Group({"noise_sd": np.full((6, 3), np.nan)}), where="caps")


def test_an_exact_log_has_the_least_noise() -> None:
    """Noise of 0, as a simulated log has it, becomes the floor, and no coordinate counts as held."""
    sample = planted(0)
    sd, held = observation_noise(sample.t, sample.p_WE, Group({"noise_sd": np.zeros((6, 3))}), where="caps")
    assert np.all(sd == MIN_NOISE)
    assert not np.any(held)
