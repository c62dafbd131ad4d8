"""What the cable sensors of a recording say, and of which cables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.devices.lengths import readings
from schemas.robot import Robot


def sensed_lengths(sensors: Group, robot: Robot) -> tuple[np.ndarray, np.ndarray] | None:
    """Lengths of the samples [m], (sample, sensor), and the cable of each sensor, (sensor,). NaN: not received.

    The recording's own lengths; of a sensor for which it has not one (it was not calibrated yet, or the program that
    recorded writes none) its capacitances, through the line that robot.toml has of its cable. Which cables they are of
    the recording says; one that does not has the sensors of robot.toml, in their order. None where there is neither,
    or where nobody says of which cables they are.
    """
    there = {name: sensors[name] for name in ("length", "capacitance") if name in sensors}
    length, capacitance = there.get("length"), there.get("capacitance")
    values = capacitance if length is None else length
    if values is None:
        return None
    cable = sensors["cable"] if "cable" in sensors else np.array([s.cable for s in robot.sensors], dtype=np.int64)
    if len(cable) != values.shape[1]:
        return None
    if capacitance is None:
        return values, cable
    without = np.ones(len(cable), dtype=bool) if length is None else ~np.isfinite(length).any(axis=0)
    if not without.any():
        return values, cable
    lines = {s.cable: (s.slope_f_per_m or np.nan, np.nan if s.offset_f is None else s.offset_f) for s in robot.sensors}
    own = [lines.get(int(one), (np.nan, np.nan)) for one in cable]
    slope, offset = np.array(own, dtype=float).reshape(-1, 2).T
    return np.where(without, (readings(capacitance) - offset) / slope, values), cable


def columns_of(values: np.ndarray, cable: np.ndarray, wanted: Sequence[int]) -> np.ndarray:
    """Numbers of sensors (..., sensor) in the order of the wanted cables, (..., wanted); NaN where no sensor measures
    one. cable: of each sensor, (sensor,)."""
    found = np.full((*values.shape[:-1], len(wanted)), np.nan)
    for i, one in enumerate(wanted):
        column = np.flatnonzero(cable == one)
        if len(column):
            found[..., i] = values[..., column[0]]
    return found
