"""The table of lengths and capacitances: what is accepted, and what is refused with line and hint."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.sensors import fit_sets, read_points
from r2s2r_cli.stages.calibrate.source import Source
from schemas.robot import Robot
from tests.stages.calibrate.conftest import HEADER, source

Make = Callable[..., str]


def refused(text: str | bytes, robot: Robot) -> InputError:
    """The error that a table raises."""
    data = text if isinstance(text, bytes) else text.encode()
    with pytest.raises(InputError) as caught:
        read_points(Source("points.csv", data), robot)
    error = caught.value
    assert error.where.startswith("points.csv") and error.expected and error.received and error.hint
    return error


def test_planted_lines_come_back_per_set_and_sensor(points_text: Make, robot: Robot) -> None:
    """Two sets of nine sensors give the planted slope and the planted offsets, in SI."""
    points = read_points(source(points_text(sets=("b", "a"))), robot)
    sets = fit_sets(points)
    assert [fitted.name for fitted in sets] == ["b", "a"]
    for fitted in sets:
        assert fitted.rms < 1e-7
        for sensor, fit in enumerate(fitted.fits):
            assert fit.slope == pytest.approx(3e-11, rel=1e-6)
            assert fit.offset == pytest.approx((16 + sensor / 8) * 1e-12, rel=1e-6)


def test_units_in_the_header_mean_the_same_table(points_text: Make, robot: Robot) -> None:
    """Metres and farads in columns of that name give the same points as millimetres and picofarads."""
    text = points_text()
    rows = [row.split(",") for row in text.split()[1:]]
    si = ["set,sensor_id,length_m,capacitance_F", *(f"{s},{i},{float(x) / 1e3!r},{c}e-12" for s, i, x, c in rows)]
    one, other = read_points(source(text), robot), read_points(source("\n".join(si)), robot)
    np.testing.assert_allclose(one.length, other.length, rtol=1e-12)
    np.testing.assert_allclose(one.capacitance, other.capacitance, rtol=1e-12)


def test_a_table_without_sets_is_one_set_named_by_its_file(points_text: Make, robot: Robot) -> None:
    """Without a set column the stem of the file names the set; byte-order mark and CRLF do not matter."""
    text = "\n".join(row.split(",", 1)[1] for row in points_text().split())
    points = read_points(Source("bench/may 3.csv", b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode()), robot)
    assert points.sets == ("may 3",)


def test_the_set_rms_pools_all_points_of_live_sensors(points_text: Make, robot: Robot) -> None:
    """Sets with a dead sensor: it is flagged, and its points are not in the pooled rms."""
    text = points_text(flat=(4,)).replace("one,2,120.0,19.850000", "one,2,120.0,19.900000")
    (fitted,) = fit_sets(read_points(source(text), robot))
    assert [fit.state for fit in fitted.fits] == [0, 0, 0, 0, 1, 0, 0, 0, 0]
    residual = np.concatenate([fit.residual for i, fit in enumerate(fitted.fits) if i != 4])
    assert len(residual) == 40
    assert fitted.rms == pytest.approx(np.sqrt(np.mean(residual**2)))


def test_a_sensor_that_never_started_is_dead(points_text: Make, robot: Robot) -> None:
    """All readings 0.20 pF, as a board sends without its chip: dead, and the other sensors are calibrated."""
    rows = [
        ",".join([*row.split(",")[:3], "0.20"]) if row.startswith("one,7") else row for row in points_text().split()
    ]
    (fitted,) = fit_sets(read_points(source("\n".join(rows)), robot))
    assert [i for i, fit in enumerate(fitted.fits) if fit.state == 1] == [7]


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        (HEADER, "set,sensor_id,length_cm,capacitance_pF", "did you mean length_m"),
        (HEADER, "set,sensor_id,length_mm,length_m", "two columns hold the length"),
        (HEADER, "set,sensor_id,sensor,capacitance_pF", "the length is missing"),
        (HEADER, "set,sensor,length_mm,capacitance_pF", "the sensor id is missing"),
        (HEADER, "set;sensor_id;length_mm;capacitance_pF", "separated by semicolons"),
        (HEADER, "set,sensor_id,length_m,capacitance_pF", "a length that this robot's cables cannot have"),
        (HEADER, "set,sensor_id,length_mm,capacitance_F", "a capacitance that no such sensor has"),
        ("19.000000", "nan", "not a number"),
        ("19.000000", "inf", "not a number"),
        ("19.000000", "1_9", "not a number"),
        ("19.000000", "19.0 pF", "not a number"),
        ("19.000000", "", "not a number"),
        ("19.000000", "-19.0", "a capacitance that no such sensor has"),
        ("19.000000", "1e400", "not a number"),
        ("19.000000", "19,0", "another number of values"),
        ("one,0,100.0,", "one,9,100.0,", "no such sensor"),
        ("one,0,100.0,", "one,-1,100.0,", "not a whole number"),
        ("one,0,100.0,", "one,0.0,100.0,", "not a whole number"),
        ("one,0,100.0,", ",0,100.0,", "a name is missing"),
        ("one,0,100.0,", '"one,0,100.0,', "cannot be read as CSV"),
        ("one,0,100.0,19.000000", "one,0,100.0,0.20", "not initialised"),
        ("one,0,120.0,19.600000", "one,0,100.0,19.000000", "stands in the table twice"),
    ],
)
def test_a_wrong_table_is_refused_with_its_line(points_text: Make, robot: Robot, old: str, new: str, what: str) -> None:
    """Every kind of damage raises InputError that says what is wrong and in which line."""
    text = points_text()
    assert old in text
    error = refused(text.replace(old, new, 1), robot)
    assert what in error.what
    assert "line" in error.where


def test_missing_sensor_single_point_and_equal_lengths_are_refused(points_text: Make, robot: Robot) -> None:
    """A sensor without points, with one point, or with two lengths only cannot be calibrated."""
    rows = points_text().split()
    without = [row for row in rows if not row.startswith("one,5")]
    assert "sensor 5" in refused("\n".join(without), robot).where
    assert "too few lengths" in refused("\n".join([*without, "one,5,100,19"]), robot).what
    same = [*without, *(f"one,5,100,{19 + i / 10}" for i in range(5))]
    assert refused("\n".join(same), robot).received == "5 points at 1 different length"


@pytest.mark.parametrize("data", [b"", b"\n\n", HEADER.encode(), b"\xd0\xcf\x11\xe0xls", b"a\x00b,c\n1,2\n"])
def test_what_is_no_table_is_refused(robot: Robot, data: bytes) -> None:
    """Empty files, a header only, spreadsheet binaries: refused with a hint, never a traceback."""
    refused(data, robot)


def test_two_names_for_one_sensor_are_refused(robot: Robot) -> None:
    """A sensor id that has two sensor names is a mistake in one of the two columns."""
    text = "sensor_id,sensor,length_mm,capacitance_pF\n0,A,100,19\n0,B,120,19.6\n"
    assert "two names" in refused(text, robot).what


def test_a_robot_without_sensors_cannot_be_calibrated(points_text: Make, robot: Robot) -> None:
    """robot.toml without [[sensors]] is named as the place to change."""
    with pytest.raises(InputError, match="no sensors"):
        read_points(source(points_text()), robot.model_copy(update={"sensors": ()}))
