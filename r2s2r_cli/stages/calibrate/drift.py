"""Drift: how far a recalibration moves the length that one and the same capacitance means."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.calibrate.history import GOOD, History
from r2s2r_cli.stages.calibrate.sensors import Points
from schemas.robot import Robot

RECALIBRATED, CARRIED_OVER, SWAP = 0, 1, 2
SHORT_S = 2 * 86400.0
"""Recalibrations at most this far apart are reported on their own: little but the measurement itself has changed."""


@dataclass(frozen=True)
class WorkingRange:
    """Shortest and longest length of each sensor [m], shape (sensor, 2), and where that is known from."""

    lengths: np.ndarray
    source: str


@dataclass(frozen=True)
class Change:
    """One usable line against the usable line before it, of the same file and sensor.

    `before`: entry at which the earlier line was measured (not where it was last copied). `change` [m]: new minus old
    length in the middle of the working range; `change_max` [m]: largest size over the range. `elapsed` [s].
    `state`: code of schemas.calibration.CHANGE_STATES.
    """

    sensor: int
    before: int
    after: int
    elapsed: float
    change: float
    change_max: float
    state: int


@dataclass(frozen=True)
class Spread:
    """Size of the changes of some recalibrations, carried-over lines left out. NaN for none.

    `median`, `p90` [m per recalibration]; `median_rate` [m/s]; `median_elapsed` [s]; `n`, of these `swaps`.
    """

    n: int
    swaps: int
    median: float
    p90: float
    median_rate: float
    median_elapsed: float


def working_range(robot: Robot, points: Points | None) -> WorkingRange:
    """Lengths over which lines are compared: those of the points table, else the robot's.

    From the robot: actuated cables move over the range of the controller; a passive cable lies between its rest length
    and the longest cable length of the limits.
    """
    if points is not None:
        found = [points.length[points.sensor == sensor] for sensor in range(len(robot.sensors))]
        return WorkingRange(np.array([[x.min(), x.max()] for x in found]), "lengths in the points table")
    lengths = []
    for sensor in robot.sensors:
        cable = robot.cables[sensor.cable]
        if cable.rest_length_m is None:
            lengths.append([robot.pid.min_length_m, robot.pid.min_length_m + robot.pid.range_m])
        else:
            lengths.append([cable.rest_length_m, robot.limits.cable_length_max_m])
    return WorkingRange(np.array(lengths), "robot.toml: controller range, rest and largest cable length")


def changes(history: History, ranges: WorkingRange, swap_threshold: float) -> tuple[Change, ...]:
    """Every change from one usable line to the next of the same file and sensor, ordered by sensor and date.

    swap_threshold [m]: a change in the middle of the range that is larger is called a swap (schemas.config).
    """
    found = []
    for sensor in range(history.slope.shape[1]):
        for file in dict.fromkeys(history.files):
            before: int | None = None
            for entry, name in enumerate(history.files):
                if name != file or history.state[entry, sensor] != GOOD:
                    continue
                if before is None:
                    before = entry
                    continue
                change = _change(history, ranges.lengths[sensor], sensor, before, entry, swap_threshold)
                found.append(change)
                if change.state != CARRIED_OVER:
                    before = entry
    return tuple(found)


def spread(of: tuple[Change, ...]) -> Spread:
    """Median and 90th percentile of the sizes of the changes; lines that were only copied do not count."""
    measured = [change for change in of if change.state != CARRIED_OVER]
    if not measured:
        nan = float("nan")
        return Spread(0, 0, nan, nan, nan, nan)
    size = np.array([abs(change.change) for change in measured])
    elapsed = np.array([change.elapsed for change in measured])
    return Spread(
        n=len(measured),
        swaps=sum(change.state == SWAP for change in measured),
        median=float(np.median(size)),
        p90=float(np.quantile(size, 0.9)),
        median_rate=float(np.median(size / elapsed)),
        median_elapsed=float(np.median(elapsed)),
    )


def _change(
    history: History, lengths: np.ndarray, sensor: int, before: int, after: int, swap_threshold: float
) -> Change:
    slope = history.slope[[before, after], sensor]
    offset = history.offset[[before, after], sensor]
    # The difference is linear in the length, so its largest size is at one end of the range.
    grid = np.array([lengths[0], lengths.mean(), lengths[1]])
    moved = (slope[0] * grid + offset[0] - offset[1]) / slope[1] - grid
    same = bool(slope[0] == slope[1] and offset[0] == offset[1])
    state = CARRIED_OVER if same else SWAP if abs(moved[1]) > swap_threshold else RECALIBRATED
    return Change(
        sensor=sensor,
        before=before,
        after=after,
        elapsed=float(history.time[after] - history.time[before]),
        change=0.0 if same else float(moved[1]),
        change_max=0.0 if same else float(np.abs(moved).max()),
        state=state,
    )
