"""Settings that contradict the data, named before any physics: units, order of caps and cables, signs, commands of
another run, rate, gain."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Run
from r2s2r_cli.stages.diagnose.parity.finding import Mismatch
from r2s2r_cli.stages.diagnose.parity.mismatch_commands import of_another_run
from r2s2r_cli.stages.diagnose.parity.mismatch_drive import order_of_motors, rate, signs, standing
from r2s2r_cli.stages.diagnose.parity.mismatch_order import order_of_caps, order_of_sensors
from r2s2r_cli.stages.diagnose.parity.series import Series, series
from schemas.robot import Robot

UNITS = {1000.0: "millimetres", 100.0: "centimetres", 39.37: "inches", 0.001: "kilometres"}
NEAR = 0.15
"""Relative distance within which a ratio is that of a unit."""
WHOLE = 1.5
"""Commands beyond this are not in units of the largest."""


def mismatches(
    runs: Sequence[Run], robot: Robot, speed: float, healthy: Sequence[Run] = ()
) -> tuple[list[Mismatch], list[str]]:  # fmt: skip
    """What is plainly set wrong, most basic first, and what could not be looked at. speed: nominal, of the winches
    [m/s]. healthy: runs from when nothing was wrong: a speed that was right then is no wrong number now, but an effect.

    A wrong unit makes everything after it meaningless, and so does a wrong order: the search ends at the first stage
    with a mismatch.
    """
    found, missing = _in_stages(runs, robot, speed)
    if healthy and [one.kind for one in found] == ["rate"] and not _in_stages(healthy, robot, speed)[0]:
        return [], missing
    return found, missing


def _in_stages(runs: Sequence[Run], robot: Robot, speed: float) -> tuple[list[Mismatch], list[str]]:
    many = tuple(series(run, robot) for run in runs)
    missing: list[str] = []
    stages: tuple[Callable[[Sequence[Series], Robot, float, list[str]], list[Mismatch]], ...] = (
        _units, order_of_caps, order_of_sensors, order_of_motors, signs, standing, of_another_run, rate,
    )  # fmt: skip
    for stage in stages:
        found = stage(many, robot, speed, missing)
        if found:
            return found, missing
    return [], missing


def _units(runs: Sequence[Series], robot: Robot, speed: float, missing: list[str]) -> list[Mismatch]:
    del speed, missing
    found = []
    rods = [
        np.nanmedian(np.linalg.norm(one.p_WE[:, 2 * k + 1] - one.p_WE[:, 2 * k], axis=-1)) / rod.length_m
        for one in runs for k, rod in enumerate(robot.rods)
    ]  # fmt: skip
    if unit := _unit(float(np.nanmedian(rods))):
        found.append(Mismatch(
            "unit", f"the end caps are in {unit}, not metres", f"rods of {robot.rods[0].length_m:g} m",
            f"{float(np.nanmedian(rods)) * robot.rods[0].length_m:g}", "r2s2r import run.csv   # columns cap0_x_mm ...",
        ))  # fmt: skip
        return found
    lengths = [np.nanmedian(one.sensed / one.seen) for one in runs if one.has_sensors]
    if lengths and (unit := _unit(float(np.nanmedian(lengths)))):
        found.append(Mismatch(
            "unit", f"the cable sensors read {unit}, not metres", "lengths like the distances of their caps",
            f"{float(np.nanmedian(lengths)):g} times those", "r2s2r import run.csv   # columns length0_mm ...",
        ))  # fmt: skip
    largest = max((float(np.nanmax(np.abs(one.run.caps.control))) for one in runs), default=0.0)
    if largest > WHOLE:
        found.append(Mismatch(
            "gain", f"motor commands go up to {largest:g}: they are not shares of the largest command", "-1 to 1",
            f"{largest:g}", "r2s2r import run.csv   # control divided by the largest command",
        ))  # fmt: skip
    return found


def _unit(ratio: float) -> str | None:
    return next((name for size, name in UNITS.items() if abs(ratio / size - 1) < NEAR), None)
