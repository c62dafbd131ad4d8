"""The dated history: failed fits, drift in closed form, copied lines, swaps, damaged files."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.drift import (
    CARRIED_OVER,
    RECALIBRATED,
    SWAP,
    WorkingRange,
    changes,
    spread,
    working_range,
)
from r2s2r_cli.stages.calibrate.history import GOOD, NEGATIVE, SUSPECT, ZERO, History, flag_slopes, read_history
from r2s2r_cli.stages.calibrate.source import Source
from schemas.robot import Robot

DAY = 86400.0
RANGE = WorkingRange(np.array([[0.1, 0.2]]), "planted")


def entry(day: int, slope: float = 0.03, offset: float = 16.0, n: int = 9, **more: Any) -> dict[str, Any]:
    """One dated set, the same line for all sensors."""
    return {"file": "a.json", "commit": "c", "date": f"2025-01-{day:02d} 12:00:00", "m_pF_per_mm": [slope] * n,
            "b_pF": [offset] * n, **more}  # fmt: skip


def read(entries: Any) -> History:
    """The history of nine sensors from JSON values."""
    return read_history(Source("history.json", json.dumps(entries).encode()), 9)


def one_sensor(*lines: tuple[float, float, float], files: tuple[str, ...] | None = None) -> History:
    """A history of one sensor: (day, slope [pF/mm], offset [pF]) per entry."""
    table = np.array(lines)
    slope = table[:, 1:2] * 1e-9
    names = files or ("a.json",) * len(lines)
    return History(names, ("",) * len(lines), table[:, 0] * DAY, slope, table[:, 2:] * 1e-12, flag_slopes(slope))


def test_units_become_si_and_entries_are_sorted() -> None:
    """pF/mm and pF become F/m and F; entries stand in the order of file and date."""
    history = read([entry(9, 0.04), entry(2, 0.03), entry(5, file="A.json")])
    assert history.files == ("A.json", "a.json", "a.json")
    np.testing.assert_allclose(history.slope[:, 0], [3e-11, 3e-11, 4e-11], rtol=1e-12)
    np.testing.assert_allclose(history.offset, 1.6e-11, rtol=1e-12)
    assert history.time[2] - history.time[1] == 7 * DAY


def test_zones_of_dates_are_respected() -> None:
    """A date with a zone is that moment; one without is UTC."""
    history = read([entry(1, date="2025-01-01T12:00:00+02:00"), entry(1, date="2025-01-01 12:00:00")])
    assert history.time[1] - history.time[0] == 7200.0


def test_failed_and_suspect_slopes_are_told_apart() -> None:
    """Zero, negative, too small and too large slopes get their codes; slopes near the median are good."""
    slope = np.array([[3e-11], [3.3e-11], [2.7e-11], [9e-26], [-5e-27], [-3e-11], [1.5e-11], [6e-11]])
    assert flag_slopes(slope)[:, 0].tolist() == [GOOD, GOOD, GOOD, ZERO, ZERO, NEGATIVE, SUSPECT, SUSPECT]


def test_two_slopes_have_no_median_to_be_suspect_against() -> None:
    """With two sets nobody can say which one is wrong."""
    assert flag_slopes(np.array([[3e-11], [9e-11]]))[:, 0].tolist() == [GOOD, GOOD]
    assert flag_slopes(np.array([[3e-11], [9e80]]))[:, 0].tolist() == [GOOD, SUSPECT]


def test_a_shifted_offset_is_the_length_change_in_closed_form() -> None:
    """Offset up by d at equal slope m: the same capacitance means d / m less, everywhere on the range."""
    (change,) = changes(one_sensor((0, 0.03, 16.0), (4, 0.03, 16.3)), RANGE, 0.05)
    assert change.change == pytest.approx(-0.3 / 0.03 * 1e-3)
    assert change.change_max == pytest.approx(0.3 / 0.03 * 1e-3)
    assert change.state == RECALIBRATED and change.elapsed == 4 * DAY


def test_a_changed_slope_counts_most_at_the_end_of_the_range() -> None:
    """C = m L read with m': L (m/m' - 1), in the middle 0.15 m, at most at 0.2 m."""
    (change,) = changes(one_sensor((0, 0.03, 0.0), (1, 0.025, 0.0)), RANGE, 0.05)
    assert change.change == pytest.approx(0.15 * 0.2)
    assert change.change_max == pytest.approx(0.2 * 0.2)


def test_copied_lines_are_no_measurements() -> None:
    """An equal line is carried over: it is not in the spread, and the next change counts from where it was measured."""
    history = one_sensor((0, 0.03, 16.0), (3, 0.03, 16.0), (10, 0.03, 16.15))
    first, second = changes(history, RANGE, 0.05)
    assert first.state == CARRIED_OVER and first.change == 0.0
    assert (second.before, second.after, second.elapsed) == (0, 2, 10 * DAY)
    found = spread((first, second))
    assert found.n == 1 and found.median == pytest.approx(5e-3)
    assert found.median_rate == pytest.approx(5e-3 / (10 * DAY))


def test_failed_fits_are_stepped_over() -> None:
    """The change goes from the usable line before a failed fit to the usable line after it."""
    (change,) = changes(one_sensor((0, 0.03, 16.0), (1, 0.0, 23.0), (2, 0.03, 16.06)), RANGE, 0.05)
    assert (change.before, change.after) == (0, 2)


def test_sets_of_different_files_are_not_compared() -> None:
    """Two files, two robots or two ways to calibrate: no change between them."""
    history = one_sensor((0, 0.03, 16.0), (1, 0.03, 12.0), files=("a.json", "b.json"))
    assert changes(history, RANGE, 0.05) == ()
    assert spread(()).n == 0 and np.isnan(spread(()).median)


@pytest.mark.parametrize(("shift", "state"), [(1.49, RECALIBRATED), (1.51, SWAP), (-1.51, SWAP)])
def test_a_swap_is_a_change_beyond_the_threshold(shift: float, state: int) -> None:
    """1.5 pF at 0.03 pF/mm are 50 mm: just below is drift, just above is a swap, in both directions."""
    (change,) = changes(one_sensor((0, 0.03, 16.0), (1, 0.03, 16.0 + shift)), RANGE, 0.05)
    assert change.state == state


def test_median_and_percentile_of_planted_changes() -> None:
    """Changes of 1 to 10 mm: median 5.5 mm, 90th percentile 9.1 mm."""
    steps = np.cumsum([0, *(0.03 * k * (-1) ** k for k in range(1, 11))])
    history = one_sensor(*((day, 0.03, 16.0 + step) for day, step in enumerate(steps)))
    found = spread(changes(history, RANGE, 0.05))
    assert found.n == 10
    assert found.median == pytest.approx(5.5e-3)
    assert found.p90 == pytest.approx(9.1e-3)


def test_the_working_range_of_the_robot(robot: Robot) -> None:
    """Without a points table: actuated cables over the controller's range, passive ones from their rest length up."""
    ranges = working_range(robot, None)
    low, rest = robot.pid.min_length_m, robot.cables[6].rest_length_m or 0.0
    np.testing.assert_allclose(ranges.lengths[:6], [[low, low + robot.pid.range_m]] * 6)
    np.testing.assert_allclose(ranges.lengths[6:], [[rest, robot.limits.cable_length_max_m]] * 3)


@pytest.mark.parametrize(
    ("entries", "what"),
    [
        ([entry(1, n=8)], "not one number per sensor"),
        ([entry(1, n=10)], "not one number per sensor"),
        ([entry(1, m_pF_per_mm="0.03")], "not one number per sensor"),
        ([entry(1, b_pF=[None] * 9)], "not a finite number"),
        ([entry(1, b_pF=["16"] * 9)], "not a finite number"),
        ([entry(1, b_pF=[True] * 9)], "not a finite number"),
        ([entry(1, b_pF=[10**400] * 9)], "not a finite number"),
        ([entry(1, date="14.1.2025")], "not a date"),
        ([entry(1, date="0001-01-01T00:00:00+14:00")], "not a date"),
        ([entry(1, date="9999-12-31T23:59:59-14:00")], "not a date"),
        ([entry(1, date=20250114)], "not a text"),
        ([entry(1, m_pf_per_mm=[])], "did you mean m_pF_per_mm"),
        ([{"date": "2025-01-01"}], "m_pF_per_mm is missing"),
        ([entry(1), entry(1)], "same file and date"),
        ([entry(1, 0.0)], "no entry has a usable slope"),
        ([entry(1, 3e-8)], "no entry has a usable slope"),
        ([1], "not an object"),
        ([], "not a list"),
        ({"a": 1}, "not a list"),
        ("text", "not a list"),
    ],
)
def test_a_wrong_history_is_refused(entries: Any, what: str) -> None:
    """Every kind of damage raises InputError with place, expectation and hint."""
    with pytest.raises(InputError) as caught:
        read(entries)
    assert what in caught.value.what
    assert caught.value.where.startswith("history.json") and caught.value.expected and caught.value.hint


@pytest.mark.parametrize(
    "data", [b"", b"[", b"[NaN]", b"[-Infinity]", b"[" * 100_000, b"\xff\xfe", b"[1" + b"0" * 9999 + b"]"]
)
def test_what_is_no_json_is_refused(data: bytes) -> None:
    """Broken JSON, NaN, endless nesting and endless numbers: refused, never a traceback."""
    with pytest.raises(InputError) as caught:
        read_history(Source("history.json", data), 9)
    assert caught.value.hint
