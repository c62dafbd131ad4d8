"""Capacitance -> length: the table of measured points, and one line per set and sensor.

Paper, "Robot Design": each sensor is calibrated individually by a linear model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.lines import DEAD, MIN_LENGTHS, LineFit, fit_line, rms
from r2s2r_cli.stages.calibrate.source import Column, Source, read_table
from schemas.robot import Robot

EXAMPLE = "file,sensor_id,sensor,length_mm,capacitance_pF"
_COLUMNS = (
    Column("set", {"file": 1, "set": 1}, kind="text", required=False),
    Column("sensor id", {"sensor_id": 1}, kind="integer"),
    Column("sensor name", {"sensor": 1, "sensor_name": 1}, kind="text", required=False),
    Column("length", {"length_mm": 1e-3, "length_m": 1.0}),
    Column("capacitance", {"capacitance_pF": 1e-12, "capacitance_F": 1.0}),
)

UNIT_MARGIN = 10**0.5
"""A wrong unit is off by 10 at least: lengths may leave the robot's limits by this factor, no further."""

CAPACITANCE_MIN_F, CAPACITANCE_MAX_F = 1e-14, 1e-8
"""0.01 pF (last digit that is sent) to 10 nF (sensors read 15 to 25 pF): beyond it the unit is wrong."""

NOT_STARTED_F = 0.2e-12
"""What a board sends for a sensor chip that was not initialised: exactly 0.20 pF."""


@dataclass(frozen=True)
class Points:
    """The table in SI. Arrays of shape (point,): `set` (index into `sets`), `sensor`, `length` [m], `capacitance` [F],
    `line` (of the source file, 1-based). `names`: what the table calls each sensor, empty where it does not say."""

    sets: tuple[str, ...]
    names: tuple[str, ...]
    set: np.ndarray
    sensor: np.ndarray
    length: np.ndarray
    capacitance: np.ndarray
    line: np.ndarray


@dataclass(frozen=True)
class SetFit:
    """One set: a fit per sensor, and the residual rms in length [m] pooled over all points of its live sensors."""

    name: str
    fits: tuple[LineFit, ...]
    rms: float


def read_points(source: Source, robot: Robot) -> Points:
    """Read and check the points table. Sensor ids are positions in `robot.sensors`; every set has all of them.

    Raises InputError with line, expectation and hint.
    """
    n_sensors = len(robot.sensors)
    if n_sensors == 0:
        raise InputError(
            "the robot has no sensors", where="robot.toml", received="none",
            expected="one [[sensors]] table per sensor",
            hint="add [[sensors]] tables to robot.toml, in the order of the sensor ids",
        )  # fmt: skip
    table = read_table(source, _COLUMNS, EXAMPLE)
    names = table.values.get("set", (source.stem,) * len(table.lines))
    sets = tuple(dict.fromkeys(str(name) for name in names))
    points = Points(
        sets=sets,
        names=_sensor_names(source, table.values["sensor id"], table.values.get("sensor name"), table.lines, n_sensors),
        set=np.array([sets.index(str(name)) for name in names]),
        sensor=np.array(table.values["sensor id"], dtype=np.int64),
        length=np.array(table.values["length"], dtype=np.float64),
        capacitance=np.array(table.values["capacitance"], dtype=np.float64),
        line=np.array(table.lines),
    )
    _check_lengths(source, points, robot, table.headers["length"])
    _check_capacitances(source, points, table.headers["capacitance"])
    _check_duplicates(source, points)
    _check_sensors(source, points, n_sensors)
    return points


def fit_sets(points: Points) -> tuple[SetFit, ...]:
    """A line per set and sensor."""
    return tuple(_fit_set(points, i) for i in range(len(points.sets)))


def _fit_set(points: Points, number: int) -> SetFit:
    fits = []
    for sensor in range(len(points.names)):
        rows = (points.set == number) & (points.sensor == sensor)
        fits.append(fit_line(points.length[rows], points.capacitance[rows]))
    live = [fit.residual for fit in fits if fit.state != DEAD]
    return SetFit(points.sets[number], tuple(fits), rms(np.concatenate(live)) if live else float("nan"))


def _sensor_names(
    source: Source, ids: tuple, names: tuple | None, lines: tuple[int, ...], n_sensors: int
) -> tuple[str, ...]:
    known: dict[int, str] = {}
    for row, (sensor, line) in enumerate(zip(ids, lines, strict=True)):
        if sensor >= n_sensors:
            raise InputError(
                "the robot has no such sensor", where=f"{source.name}, line {line}, column sensor_id",
                expected=f"0 to {n_sensors - 1}, the positions of the [[sensors]] tables in robot.toml",
                received=str(sensor), hint="correct the sensor id, or add the sensor to robot.toml",
            )  # fmt: skip
        if names is not None and known.setdefault(sensor, names[row]) != names[row]:
            raise InputError(
                f"sensor {sensor} has two names", where=f"{source.name}, line {line}", expected=known[sensor],
                received=names[row], hint="give every row of one sensor_id the same sensor name",
            )  # fmt: skip
    return tuple(known.get(sensor, "") for sensor in range(n_sensors))


def _check_lengths(source: Source, points: Points, robot: Robot, header: str) -> None:
    low = robot.limits.cable_length_min_m / UNIT_MARGIN
    high = robot.limits.cable_length_max_m * UNIT_MARGIN
    for row in np.flatnonzero((points.length < low) | (points.length > high))[:1]:
        raise InputError(
            "a length that this robot's cables cannot have", where=f"{source.name}, line {points.line[row]}, {header}",
            expected=f"{1e3 * low:.0f} to {1e3 * high:.0f} mm", received=f"{1e3 * points.length[row]:.6g} mm",
            hint="name the column by its unit, length_mm or length_m, or correct the row",
        )  # fmt: skip


def _check_capacitances(source: Source, points: Points, header: str) -> None:
    wrong = (points.capacitance < CAPACITANCE_MIN_F) | (points.capacitance > CAPACITANCE_MAX_F)
    for row in np.flatnonzero(wrong)[:1]:
        raise InputError(
            "a capacitance that no such sensor has", where=f"{source.name}, line {points.line[row]}, {header}",
            expected=f"{1e12 * CAPACITANCE_MIN_F:g} to {1e12 * CAPACITANCE_MAX_F:g} pF",
            received=f"{1e12 * points.capacitance[row]:.6g} pF",
            hint="name the column by its unit, capacitance_pF or capacitance_F, or correct the row",
        )  # fmt: skip


def _check_duplicates(source: Source, points: Points) -> None:
    seen: dict[tuple[int, int, float, float], int] = {}
    columns = (points.set, points.sensor, points.length, points.capacitance, points.line)
    for number, sensor, length, capacitance, line in zip(*(column.tolist() for column in columns), strict=True):
        first = seen.setdefault((number, sensor, length, capacitance), line)
        if first != line:
            raise InputError(
                "a point stands in the table twice", where=f"{source.name}, line {line}",
                expected="each measured point once (a repeated length may have another capacitance)",
                received=f"the values of line {first}", hint=f"remove line {line}",
            )  # fmt: skip


def _check_sensors(source: Source, points: Points, n_sensors: int) -> None:
    for number, name in enumerate(points.sets):
        for sensor in range(n_sensors):
            rows = np.flatnonzero((points.set == number) & (points.sensor == sensor))
            where = f"{source.name}, set {name}, sensor {sensor}"
            if len(rows) == 0:
                raise InputError(
                    "a sensor of the robot has no points", where=where, received="none",
                    expected=f"points of all {n_sensors} sensors", hint=f"measure sensor {sensor}, add its rows",
                )  # fmt: skip
            lengths = len(np.unique(points.length[rows]))
            if lengths < MIN_LENGTHS:
                raise InputError(
                    "too few lengths for a line that can be checked",
                    where=f"{where}, lines {', '.join(map(str, points.line[rows]))}"[:160],
                    expected=f"points at {MIN_LENGTHS} different lengths or more",
                    received=f"{len(rows)} points at {lengths} different length{'s' if lengths > 1 else ''}",
                    hint="measure the sensor at five lengths over its working range",
                )  # fmt: skip
            silent = np.isclose(points.capacitance[rows], NOT_STARTED_F, rtol=1e-9, atol=0)
            if silent.any() and not silent.all():
                raise InputError(
                    "the sensor chip was not initialised at some of the points",
                    where=f"{where}, line {points.line[rows[silent][0]]}", expected="a measured capacitance",
                    received="0.20 pF, which the board sends before its chip answers",
                    hint="restart the board and measure these rows again",
                )  # fmt: skip
