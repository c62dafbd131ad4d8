"""The dated history of calibrations: read, brought to SI, and failed fits flagged."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any, NoReturn

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.source import Source, near

ZERO_SLOPE_F_PER_M = 1e-13
"""0.01 pF (the last digit that the boards send) over 100 mm of stretch: below it a slope is zero."""

MAX_SLOPE_F_PER_M = 1e-8
"""10 pF/mm, 300 times a real sensor: suspect, however few sets there are to compare with."""

MAX_NUMBER = 1e100
"""Larger numbers are damage, not failed fits."""

SUSPECT_FACTOR = 1.6
"""A slope this far from the sensor's median is suspect. In the 17 real sets that this was chosen on, 142 slopes lie
between 0.76 and 1.39 of the median and five lie outside 0.53 to 1.79, with nothing between."""

MIN_FOR_MEDIAN = 3
"""Positive slopes of a sensor below which its median says nothing, and none of them is called suspect."""

GOOD, ZERO, NEGATIVE, SUSPECT = 0, 1, 2, 3
_KEYS = ("file", "commit", "date", "m_pF_per_mm", "b_pF")
_EXAMPLE = '[{"file": "...", "commit": "...", "date": "2025-01-14 18:27:20", "m_pF_per_mm": [...], "b_pF": [...]}]'


@dataclass(frozen=True)
class History:
    """Dated sets of lines, sorted by file and date.

    `files`, `commits`: one text per entry. `time` [unix s], shape (entry,). `slope` [F/m], `offset` [F] and `state`
    (code of schemas.calibration.HISTORY_STATES), shape (entry, sensor).
    """

    files: tuple[str, ...]
    commits: tuple[str, ...]
    time: np.ndarray
    slope: np.ndarray
    offset: np.ndarray
    state: np.ndarray

    def label(self, entry: int) -> str:
        """`2025-01-14 calibration/calibration.json`: date and file of an entry."""
        return f"{date_text(self.time[entry])} {self.files[entry]}".strip()


def date_text(time: float) -> str:
    """The UTC date of a unix time, `2025-01-14`."""
    return datetime.fromtimestamp(time, UTC).strftime("%Y-%m-%d")


def read_history(source: Source, n_sensors: int) -> History:
    """Read a JSON list of {file, commit, date, m_pF_per_mm, b_pF} (file and commit optional).

    Lists have one number per sensor, in the order of robot.toml. A date without zone is read as UTC.
    Raises InputError with the number and date of the entry, and for a history without one usable slope.
    """
    entries = _load(source)
    rows = [_entry(entry, f"{source.name}, entry {i}", n_sensors) for i, entry in enumerate(entries, start=1)]
    rows.sort(key=lambda row: (row[0], row[2]))
    for earlier, later in pairwise(rows):
        if earlier[0] == later[0] and earlier[2] == later[2]:
            raise InputError(
                "two entries have the same file and date", where=f"{source.name}, {later[0]} {date_text(later[2])}",
                expected="one entry per file and date", received="two", hint="remove one of the two entries",
            )  # fmt: skip
    slope = np.array([row[3] for row in rows]) * 1e-9
    offset = np.array([row[4] for row in rows]) * 1e-12
    state = flag_slopes(slope)
    if not (state == GOOD).any():
        raise InputError(
            "no entry has a usable slope", where=source.name,
            expected=f"slopes above {1e9 * ZERO_SLOPE_F_PER_M:g} pF/mm (real sensors: 0.02 to 0.05)",
            received=f"a largest slope of {1e9 * slope.max():.3g} pF/mm", hint="give m_pF_per_mm in pF per mm",
        )  # fmt: skip
    files, commits = tuple(row[0] for row in rows), tuple(row[1] for row in rows)
    return History(files, commits, np.array([row[2] for row in rows]), slope, offset, state)


def flag_slopes(slope: np.ndarray) -> np.ndarray:
    """State codes of slopes [F/m], shape (entry, sensor): zero, negative, or far off the sensor's own median."""
    state = np.zeros(slope.shape, dtype=np.uint8)
    state[slope < 0] = NEGATIVE
    state[np.abs(slope) < ZERO_SLOPE_F_PER_M] = ZERO
    state[slope > MAX_SLOPE_F_PER_M] = SUSPECT
    for sensor in range(slope.shape[1]):
        positive = state[:, sensor] == GOOD
        if positive.sum() >= MIN_FOR_MEDIAN:
            ratio = slope[:, sensor] / np.median(slope[positive, sensor])
            far = (ratio > SUSPECT_FACTOR) | (ratio < 1 / SUSPECT_FACTOR)
            state[positive & far, sensor] = SUSPECT
    return state


_Row = tuple[str, str, float, list[float], list[float]]


def _load(source: Source) -> list[Any]:
    def refuse(constant: str) -> NoReturn:
        raise InputError(
            "not a finite number in the history", where=source.name, expected="finite numbers", received=constant,
            hint="remove the entry, or the fit that failed",
        )  # fmt: skip

    try:
        entries = json.loads(source.text(), parse_constant=refuse)
    except json.JSONDecodeError as error:
        raise InputError(
            "the history is not valid JSON", where=f"{source.name}, line {error.lineno}, column {error.colno}",
            expected=_EXAMPLE, received=error.msg, hint="correct the file at that place",
        ) from None  # fmt: skip
    except (RecursionError, ValueError) as error:
        raise InputError(
            "the history cannot be read", where=source.name, expected=_EXAMPLE, received=str(error)[:120],
            hint="give a plain list of entries with ordinary numbers",
        ) from None  # fmt: skip
    if not isinstance(entries, list) or not entries:
        raise InputError(
            "the history is not a list of entries", where=source.name, expected=_EXAMPLE,
            received="an empty list" if entries == [] else _kind(entries), hint="put the dated sets into one JSON list",
        )  # fmt: skip
    return entries


def _entry(entry: Any, where: str, n_sensors: int) -> _Row:
    if not isinstance(entry, dict):
        raise InputError(
            "an entry of the history is not an object", where=where, expected=_EXAMPLE[1:-1], received=_kind(entry),
            hint="give every entry as one JSON object",
        )  # fmt: skip
    for key in entry:
        if key not in _KEYS:
            raise InputError(
                "unknown key" + near(key, _KEYS), where=where, expected=", ".join(_KEYS), received=key[:80],
                hint="rename or remove the key",
            )  # fmt: skip
    for key in ("date", "m_pF_per_mm", "b_pF"):
        if key not in entry:
            raise InputError(
                f"the key {key} is missing", where=where, expected=", ".join(_KEYS), received=", ".join(entry),
                hint=f"add {key} to the entry",
            )  # fmt: skip
    for key in ("file", "commit", "date"):
        if not isinstance(entry.get(key, ""), str):
            raise InputError(
                "not a text", where=f"{where}, {key}", expected="a text", received=_kind(entry[key]),
                hint="put the value into double quotes",
            )  # fmt: skip
    time = _time(entry["date"], where)
    where = f"{where} ({entry['date']})"
    slope = _numbers(entry["m_pF_per_mm"], f"{where}, m_pF_per_mm", n_sensors)
    offset = _numbers(entry["b_pF"], f"{where}, b_pF", n_sensors)
    return entry.get("file", ""), entry.get("commit", ""), time, slope, offset


def _time(text: str, where: str) -> float:
    try:
        date = datetime.fromisoformat(text)
        time = (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
        date_text(time)  # its zone may lead out of the years that there are
    except (ValueError, OverflowError):
        raise InputError(
            "not a date", where=f"{where}, date", expected="an ISO date, 2025-01-14 18:27:20", received=repr(text)[:80],
            hint="write the date as year-month-day hours:minutes:seconds",
        ) from None  # fmt: skip
    return time


def _numbers(values: Any, where: str, n_sensors: int) -> list[float]:
    if not isinstance(values, list) or len(values) != n_sensors:
        raise InputError(
            "not one number per sensor", where=where, expected=f"a list of {n_sensors} numbers",
            received=f"{len(values)} entries" if isinstance(values, list) else _kind(values),
            hint="give one number per sensor, in the order of the [[sensors]] tables of robot.toml",
        )  # fmt: skip
    for i, value in enumerate(values):
        number = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < MAX_NUMBER
        if not number or not math.isfinite(value):
            raise InputError(
                "not a finite number", where=f"{where}, sensor {i}", expected="a finite number",
                received=repr(value)[:80], hint="remove the entry, or correct the number",
            )  # fmt: skip
    return [float(value) for value in values]


def _kind(value: Any) -> str:
    return {dict: "an object", list: "a list", str: "a text", bool: "true or false", type(None): "null"}.get(
        type(value), "a number"
    )
