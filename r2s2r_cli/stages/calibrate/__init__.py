"""`calibrate`: what is measured on the bench, beside the robot, turned into numbers of robot.toml.

Paper, "Robot Design" (a line per sensor) and "Offline Robot Measurements" (tendon curves, masses). Texts in, values
out; reading the files, writing the artifact and replacing robot.toml is the command's work.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import UsageError
from r2s2r_cli.nearest import nearest
from r2s2r_cli.stages.calibrate import data, report
from r2s2r_cli.stages.calibrate.apply import apply_changes, with_parts, with_sensor_line, with_tendon
from r2s2r_cli.stages.calibrate.drift import changes, spread, working_range
from r2s2r_cli.stages.calibrate.history import read_history
from r2s2r_cli.stages.calibrate.lines import GOOD
from r2s2r_cli.stages.calibrate.masses import mass_properties, read_masses
from r2s2r_cli.stages.calibrate.sensors import Points, SetFit, fit_sets, read_points
from r2s2r_cli.stages.calibrate.source import Source, near
from r2s2r_cli.stages.calibrate.tendon_checks import tendon_warnings
from r2s2r_cli.stages.calibrate.tendons import average, fit_curve, read_curves
from schemas.config import CalibrateSettings
from schemas.results_calibrate import (
    CalibrationReport,
    HistoryReport,
    PartsChange,
    RobotChanges,
    RodMass,
    SensorChange,
    TendonChange,
    TendonReport,
)
from schemas.robot import Robot

__all__ = ["Source", "apply_changes", "calibrate", "with_parts", "with_sensor_line", "with_tendon"]

CURVED = 0.5
"""A parabola that halves the residual is worth a warning: the sensor is curved, not noisy."""

CURVED_MIN_M = 1e-3
"""Residuals below 1 mm, the ruling of the rule they were set with, are not worth one."""


def calibrate(
    *,
    robot: Robot,
    points: Source | None = None,
    history: Source | None = None,
    tendons: Sequence[Source] = (),
    masses: Source | None = None,
    use: str | None = None,
    settings: CalibrateSettings | None = None,
) -> tuple[ArtifactData, CalibrationReport]:
    """Evaluate what the user measured; any subset of the four.

    use: name of the set of the points table whose lines go into robot.toml. A table with one set uses that; of several
    none is used unless it is named here. `report.changes` with `apply_changes` makes the new robot.toml.

    Raises UsageError for nothing to do or an unknown set, InputError for a file that cannot be used as it is.
    """
    if points is None and history is None and not tendons and masses is None:
        raise UsageError(
            "nothing to calibrate", where="calibrate", expected="--points, --history, --tendons or --masses",
            received="none of them", hint="r2s2r calibrate --points points.csv",
        )  # fmt: skip
    if use is not None and points is None:
        raise UsageError(
            "--use chooses a set of the points table, and there is none", where="--use", expected="--points",
            received=f"--use {use}", hint=f"r2s2r calibrate --points points.csv --use {use}",
        )  # fmt: skip
    settings = settings or CalibrateSettings()
    groups: dict[str, Group] = {}
    warnings: list[str] = []
    table = read_points(points, robot) if points is not None else None
    sets: tuple[SetFit, ...] = ()
    used, sensor_changes = None, {}
    if points is not None and table is not None:
        sets = fit_sets(table)
        used = _choose(points, sets, use, warnings)
        sensor_changes = _sensor_changes(sets, used)
        groups |= data.sensor_groups(table, sets, used)
        warnings += _sensor_warnings(sets)
    drift = _history(history, robot, table, settings, groups, warnings) if history is not None else None
    tendon = _tendons(tendons, robot, groups, warnings) if tendons else None
    rods, rod_changes = _masses(masses, robot, groups) if masses is not None else ((), {})
    result = CalibrationReport(
        sets=report.sensor_sets(table, sets) if table is not None else (),
        used=used,
        history=drift,
        tendons=tendon,
        masses=rods,
        changes=RobotChanges(
            sensors=sensor_changes,
            tendon=_tendon_change(tendon, robot) if tendon is not None else None,
            rods=rod_changes,
        ),
        warnings=tuple(warnings),
    )
    return ArtifactData("calibration", groups), result


def _choose(source: Source, sets: Sequence[SetFit], use: str | None, warnings: list[str]) -> str | None:
    known = [fitted.name for fitted in sets]
    if use is not None and use not in known:
        meant = nearest(use, known)
        chosen = shlex.quote(meant) if meant else report.CHOOSE
        raise UsageError(
            f"the points table has no set {use!r}" + near(use, known), where="--use", received=use,
            expected=report.choices((fitted.name, report.finite(fitted.rms)) for fitted in sets),
            hint=f"r2s2r calibrate --points {shlex.quote(source.name)} --use {chosen}",
        )  # fmt: skip
    if use is None and len(known) > 1:
        warnings.append(
            f"the points table has {len(known)} sets and none was chosen with --use, so the sensors in robot.toml "
            "stay as they are"
        )
        return None
    return use if use is not None else known[0]


def _sensor_changes(sets: Sequence[SetFit], used: str | None) -> dict[int, SensorChange]:
    chosen = next((fitted for fitted in sets if fitted.name == used), None)
    return {
        i: SensorChange(
            slope_f_per_m=fit.slope, offset_f=fit.offset, source=f"set {used}, rms {1e3 * fit.rms:.1f} mm"
        )
        for i, fit in enumerate(chosen.fits if chosen is not None else ())
        if fit.state == GOOD
    }  # fmt: skip


def _sensor_warnings(sets: Sequence[SetFit]) -> list[str]:
    found = []
    for fitted in sets:
        for i, fit in enumerate(fitted.fits):
            who = f"set {fitted.name}, sensor {i}"
            if fit.state != GOOD:
                what = report.LINE_STATES[fit.state]
                found.append(f"{who} is {what}; its line is not written to robot.toml")
            elif fit.rms > CURVED_MIN_M and fit.quadratic_rms < CURVED * fit.rms:
                found.append(
                    f"{who} is curved: a parabola leaves {1e3 * fit.quadratic_rms:.1f} mm of the line's "
                    f"{1e3 * fit.rms:.1f} mm"
                )
    return found


def _history(
    source: Source,
    robot: Robot,
    table: Points | None,
    settings: CalibrateSettings,
    groups: dict[str, Group],
    warnings: list[str],
) -> HistoryReport:
    history = read_history(source, len(robot.sensors))
    ranges = working_range(robot, table)
    found = changes(history, ranges, settings.swap_threshold_m)
    per_sensor = [spread(tuple(c for c in found if c.sensor == i)) for i in range(len(robot.sensors))]
    groups |= data.history_groups(history, found, ranges, per_sensor, settings.swap_threshold_m)
    result = report.history_report(history, found, ranges, per_sensor)
    if result.failed:
        warnings.append(f"{len(result.failed)} lines of the history are failed or suspect fits and were left out")
    if result.swaps:
        warnings.append(
            f"{len(result.swaps)} recalibrations moved a length by more than {1e3 * settings.swap_threshold_m:g} mm: "
            "a sensor or the robot was exchanged"
        )
    return result


def _tendons(sources: Sequence[Source], robot: Robot, groups: dict[str, Group], warnings: list[str]) -> TendonReport:
    curves = read_curves(sources, robot)
    fits = [fit_curve(curve) for curve in curves]
    mean = average(fits)
    groups |= data.tendon_groups(curves, fits, mean)
    for fit in fits:
        if not fit.monotone:
            warnings.append(f"tendon curve {fit.name}: its cubic falls somewhere on the measured range")
    warnings += tendon_warnings(curves, mean, robot)
    rests = [cable.rest_length_m for cable in robot.cables if cable.rest_length_m is not None]
    reach = robot.limits.cable_length_max_m - min(rests) if rests else 0.0
    if reach > mean.x_common:
        warnings.append(
            f"the tendons were measured to {1e3 * mean.x_common:.0f} mm, the limits in robot.toml let them stretch by "
            f"{1e3 * reach:.0f} mm: beyond the measurement the cubic is a guess"
        )
    result = report.tendon_report(curves, fits, mean)
    if not mean.monotone or result.k1_n_per_m <= 0:
        warnings.append("the average tendon curve falls on the measured range, so it is not written to robot.toml")
    elif not rests:
        warnings.append("robot.toml has no passive cable, so the tendon curve is not written to it")
    return result


def _tendon_change(tendon: TendonReport, robot: Robot) -> TendonChange | None:
    passive = any(cable.kind == "passive" for cable in robot.cables)
    if not passive or not tendon.monotone or tendon.k1_n_per_m <= 0:
        return None
    n = len(tendon.curves)
    return TendonChange(
        k1_n_per_m=tendon.k1_n_per_m,
        k2_n_per_m2=tendon.k2_n_per_m2,
        k3_n_per_m3=tendon.k3_n_per_m3,
        source=f"mean of {n} tendon curve{'s' if n > 1 else ''} to {1e3 * tendon.x_common_m:.0f} mm",
    )


def _masses(
    source: Source, robot: Robot, groups: dict[str, Group]
) -> tuple[tuple[RodMass, ...], dict[str, PartsChange]]:
    parts = read_masses(source, robot)
    numbers = {i: rod.name for i, rod in enumerate(robot.rods) if rod.name in parts}
    properties = {i: mass_properties(parts[name]) for i, name in numbers.items()}
    groups |= data.mass_groups({i: parts[name] for i, name in numbers.items()}, properties)
    rods = tuple(report.rod_mass(name, len(parts[name]), properties[i]) for i, name in numbers.items())
    return rods, {name: PartsChange(parts=some, source=f"weighed, {source.stem}") for name, some in parts.items()}
