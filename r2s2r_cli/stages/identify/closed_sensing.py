"""What the controller reads of its cables, measured on the log: when it saw a cable arrive, and how long that was.

A motor that stops, or a target that is followed by the next, says that the controller read this cable at the edge of
its tolerance. The camera says how long it was. Read at the same moment they would agree, but for the sensor: the moment
(camera_delay, see `closed_clock`) shows where reeling in and paying out disagree, the sensor's error where they agree.
Nothing is simulated, and only training intervals are looked at.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.sensed import columns_of
from schemas.robot import Robot

FEWEST = 8
"""Arrivals, of cables that are reeled in and of such that are paid out together, from which something is said."""
SPREAD = 5e-3
"""[m] An arrival is seen so well: noise of two caps, and a cable that runs 5 mm between two rows of a log."""
APART = 4e-3
"""[m] Sd of the error of one sensor about that of all: of a linear calibration (robots.md: 1.2 to 3.9 mm)."""
DOF = 4.0
"""Of the Student t of an arrival: a tracker jumps."""
STEP = 0.01
"""[s] between the moments that are tried."""
RUNNING = 0.5
"""A command above this runs the motor."""


@dataclass(frozen=True)
class Sensing:
    """camera_delay: a frame stamped t shows what the controller read at t - camera_delay [s]. bias: reading minus
    distance of the cap centres [m], (actuated,). arrivals: what it rests on; 0: nothing was measured, as given, unless
    by_camera: the camera saw the sensors err.
    """

    camera_delay: float
    bias: np.ndarray
    arrivals: int = 0
    by_camera: bool = False


@dataclass(frozen=True)
class Arrival:
    """cable: number among the winched ones; reading: of the controller then, as it counts [m]; t: when, on the clock of
    the log [s]; way: +1 reeled in, -1 paid out."""

    run: RunData
    cable: int
    reading: float
    t: float
    way: float


def measured_sensing(
    robot: Robot, runs: Sequence[RunData], train: Sequence[Selection], *, camera_delay: float, most: float
) -> Sensing:
    """Of the training intervals. camera_delay [s]: where nothing can be said; most: it is not above that [s].

    The two are found together, by the least sum of Student t losses over the moments that are tried.
    """
    seen = arrivals(robot, runs, train)
    n = len(robot.actuated)
    if len(seen) < FEWEST or len({one.way for one in seen}) < 2:
        return Sensing(camera_delay, np.zeros(n))
    tried = np.arange(0.0, max(most, 0.0) + 0.5 * STEP, STEP)
    reading = np.array([one.reading for one in seen])
    cable = np.array([one.cable for one in seen])
    best: tuple[float, float, np.ndarray] | None = None
    for delay in tried:
        error = reading - np.array([_length(robot, one, delay) for one in seen])
        cost, bias = _biases(error, cable, n)
        if best is None or cost < best[0]:
            best = cost, float(delay), bias
    assert best is not None  # noqa: S101 - 0 is always tried
    return Sensing(best[1], best[2], len(seen))


def seen_by_camera(
    robot: Robot, runs: Sequence[RunData], train: Sequence[Selection]
) -> tuple[np.ndarray, float | None]:
    """Errors of the sensors of the winched cables as the camera showed them in the runs that are trained on: mean over
    those runs [m], (actuated,), NaN where none says it; and how late they read, by the clock of the frames [s], None
    where none says it. Nothing rests on the moments at which cables arrived, of which there are few."""
    named = {one.run for one in train}
    mine = [run for run in runs if run.name in named]
    errors = np.full((len(mine), len(robot.actuated)), np.nan)
    for row, run in enumerate(mine):
        if run.sensor_bias is not None:
            own = np.array([s.cable for s in robot.sensors]) if run.sensor_cable is None else run.sensor_cable
            errors[row] = columns_of(run.sensor_bias, own, robot.actuated)
    known = np.isfinite(errors)
    mean = np.where(known, errors, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    late = [run.sensor_delay for run in mine if run.sensor_delay is not None]
    return np.where(known.any(axis=0), mean, np.nan), float(np.mean(late)) if late else None


def arrivals(robot: Robot, runs: Sequence[RunData], train: Sequence[Selection]) -> list[Arrival]:
    """Of all cables that ran to their target in the selected intervals, timeouts left out."""
    named, pid = {run.name: run for run in runs}, robot.pid
    found = []
    for one in train:
        run = named[one.run]
        for number in one.intervals:
            first, last = int(run.intervals.first[number - 1]), int(run.intervals.last[number - 1])
            rows = np.flatnonzero((run.t_command >= run.t[first] - 1e-9) & (run.t_command <= run.t[last] + 1e-9))
            if not len(rows) or run.t[last] - run.t[first] > pid.step_timeout_s - 1.0 / pid.rate_hz:
                continue
            for k, target in enumerate(run.intervals.target[number - 1]):
                on = rows[np.abs(run.control[rows, k]) > RUNNING]
                # Motors that run in the last row of a run, or of an interval cut short, have not arrived.
                if not len(on) or on[-1] + 1 >= len(run.t_command) or not run.intervals.complete[number - 1]:
                    continue
                way = float(np.sign(run.control[on[-1], k]))
                edge = float(target) + way * pid.tolerance
                t = 0.5 * float(run.t_command[on[-1]] + run.t_command[on[-1] + 1])
                found.append(Arrival(run, k, pid.min_length_m + pid.range_m * edge, t, way))
    return found


def _length(robot: Robot, one: Arrival, delay: float) -> float:
    """Distance of the cap centres that the camera shows `delay` after the arrival [m]."""
    a, b = robot.cables[robot.actuated[one.cable]].caps
    t = one.run.t
    at = int(np.clip(np.searchsorted(t, one.t + delay), 1, len(t) - 1))
    length = np.linalg.norm(one.run.observed[at - 1 : at + 1, a] - one.run.observed[at - 1 : at + 1, b], axis=-1)
    return float(np.interp(one.t + delay, t[at - 1 : at + 1], length))


def _biases(error: np.ndarray, cable: np.ndarray, n: int) -> tuple[float, np.ndarray]:
    """Loss, and the error of each sensor (n,) [m]: one for all, and what each differs from it, by re-weighting."""
    weight = np.ones(len(error))
    common, own = 0.0, np.zeros(n)
    for _ in range(20):
        common = float(np.sum(weight * (error - own[cable])) / np.sum(weight))
        for k in range(n):
            mine = cable == k
            precision = np.sum(weight[mine]) / SPREAD**2
            own[k] = np.sum(weight[mine] * (error[mine] - common)) / SPREAD**2 / (precision + APART**-2)
        left = ((error - common - own[cable]) / SPREAD) ** 2
        weight = (DOF + 1) / (DOF + left)
    loss = 0.5 * (DOF + 1) * float(np.sum(np.log1p(left / DOF))) + 0.5 * float(np.sum((own / APART) ** 2))
    return loss, common + own
