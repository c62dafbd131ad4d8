"""Cable sensors, IMU and battery of a recording."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.checks.base import AGAIN, Found, beyond, check, number, worst
from r2s2r_cli.checks.subjects import Run
from r2s2r_cli.devices.lengths import FROZEN_SAMPLES, NOT_INITIALISED, frozen

_EXACT_F = 1e-18
"""Rounding of 0.20 pF read as text and scaled."""
CAPACITANCE_F = (0.1e-12, 1e-9)
"""Stretch sensors have 10-40 pF; outside this the numbers are not farads (pF and nF stored as they came)."""
FROZEN_TIMES = 10
"""So many times as long as ever before: a sensor of few digits says the same now and then, too."""
LOST_SHARE = 0.5
GRAVITY_M_PER_S2 = (8.0, 12.0)
"""Median size of the specific force of a robot that mostly lies still: 9.81 within 20 %, so that g and mg stand out."""
_KINDS = ("recording",)


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="no capacitance is exactly 0.20 pF",
    why="the firmware sends 0.20 while its sensor chip is not initialised: it is no measurement",
    fix="switch the board off and on, check the wires of the sensor chip, then record again",
)
def sensor_chip_initialised(run: Run) -> Iterator[Found]:
    """Sensors that say 0.20 pF."""
    for sensor, values in _columns(run, "capacitance"):
        bad = np.abs(values - NOT_INITIALISED) < _EXACT_F
        if bad.any():
            yield Found(run.at("sensors", "capacitance"), f"the chip of sensor {sensor} was not initialised",
                        "a measurement", f"0.20 pF in {int(bad.sum())} of {len(values)} samples")  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="capacitances are in farads",
    why="picofarads taken for farads give lengths of billions of metres",
    fix=f"{AGAIN}   # first give the unit of the capacitances in the source as the format asks",
)
def capacitance_in_farads(run: Run) -> Iterator[Found]:
    """Capacitances that no stretch sensor has."""
    for sensor, values in _columns(run, "capacitance"):
        median = float(np.median(values))
        if beyond(np.array(median), *CAPACITANCE_F) > 0:
            yield Found(run.at("sensors", "capacitance"), f"sensor {sensor} has a capacitance of another unit",
                        "0.1 pF .. 1000 pF", f"median {number(median, 1e12)} pF")  # fmt: skip


@check(
    "warning",
    Run,
    kinds=_KINDS,
    what="no sensor says exactly the same throughout the run, or for its last 20 samples and ten times as long as ever "
    "before, while another one moves",
    why="a sensor that stands still is torn off, shorted or its board hangs",
    fix="check the wires of the named sensor; calibrate it again before trusting its lengths",
)
def sensors_move(run: Run) -> Iterator[Found]:
    """Sensors that stand still throughout the run, or from some sample on."""
    for name in ("capacitance", "length"):
        columns = dict(_columns(run, name))
        still = [n for n, values in columns.items() if frozen(values)]
        if len(still) == len(columns):
            continue  # nothing moved: the robot stood still
        for sensor, values in columns.items():
            if name == "capacitance" and abs(values[-1] - NOT_INITIALISED) < _EXACT_F:
                continue  # sensor_chip_initialised says it better
            count, before = _held(values)
            if sensor in still:
                said = f"the same value in all {len(values)} samples"
            elif count >= max(FROZEN_SAMPLES, FROZEN_TIMES * before) and _moved(columns, sensor, count):
                said = f"the same value in the last {count} of {len(values)} samples"
            else:
                continue
            yield Found(run.at("sensors", name), f"sensor {sensor} is frozen", "values that move as others do", said)


@check(
    "warning",
    Run,
    kinds=_KINDS,
    what="every sensor was received in at least half of the samples",
    why="lengths are interpolated over short gaps only; the rest is missing in the estimate",
    fix="bring the robot nearer to the access point, or check the board of the named sensor",
)
def sensors_received(run: Run) -> Iterator[Found]:
    """Sensors that were mostly lost."""
    for name in ("capacitance", "length"):
        values = run.array("sensors", name)
        if values is None or not len(values):
            continue
        lost = _lost(np.isnan(values), run.array("sensors", "board"))
        for sensor in np.flatnonzero(lost > LOST_SHARE).tolist():
            yield Found(run.at("sensors", name), f"sensor {sensor} was mostly not received",
                        f"at least {100 * (1 - LOST_SHARE):g} % of the samples",
                        f"{100 * (1 - lost[sensor]):.3g} %")  # fmt: skip


@check(
    "warning",
    Run,
    kinds=_KINDS,
    what="sensor lengths stay within the robot's cable limits",
    why="a length that the robot cannot have is a sensor out of calibration, or another unit",
    fix="r2s2r calibrate --points points.csv   # a fresh table of lengths and capacitances",
)
def sensor_lengths_in_limits(run: Run) -> Iterator[Found]:
    """Lengths that the robot cannot have."""
    length = run.array("sensors", "length")
    if length is not None and run.robot is not None:
        limits = run.robot.limits
        outside = beyond(length, limits.cable_length_min_m, limits.cable_length_max_m)
        for sensor in np.flatnonzero((outside > 0).any(axis=0)).tolist():
            low, high = number(limits.cable_length_min_m, 1e3), number(limits.cable_length_max_m, 1e3)
            yield Found(run.at("sensors", "length"), f"sensor {sensor} says a length that the robot cannot have",
                        f"{low} .. {high} mm", worst(length[:, sensor], outside[:, sensor], ("sample",), scale=1e3,
                        unit="mm"))  # fmt: skip


@check(
    "error",
    Run,
    what="every sensor names a cable of the robot, and no cable has two",
    why="its length would be compared with another cable",
    fix=f"{AGAIN}   # first compare [[sensors]] in robot.toml with the wiring",
    kinds=("recording", "estimate"),
)
def sensor_cables_exist(run: Run) -> Iterator[Found]:
    """Cable numbers that are not there, or there twice."""
    for stream, name in (("sensors", "cable"), ("frames", "sensor_cable")):
        cable = run.array(stream, name)
        if cable is None:
            continue
        count = len(run.robot.cables) if run.robot is not None else None
        bad = (cable < 0) | (cable >= count if count is not None else False)
        expected = f"0 .. {count - 1}" if count is not None else "0 or more"
        if bad.any():
            yield Found(run.at(stream, name), "a sensor names a cable that is not there", expected,
                        worst(cable, bad.astype(float), ("sensor",)))  # fmt: skip
        elif len(np.unique(cable)) < len(cable):
            twice = [int(c) for c in np.unique(cable) if (cable == c).sum() > 1]
            yield Found(run.at(stream, name), "two sensors name the same cable", "one sensor a cable",
                        f"cable {', '.join(map(str, twice))} twice")  # fmt: skip


@check(
    "warning",
    Run,
    kinds=_KINDS,
    what="the median specific force of every board is that of gravity, within 20 %",
    why="another size is another unit (g, mg) or a dead accelerometer",
    fix="give accelerations in m/s^2 in the source; 1 g = 9.80665 m/s^2",
)
def gravity_is_seen(run: Run) -> Iterator[Found]:
    """Accelerations in another unit."""
    force, board = run.array("imu", "a_B"), run.array("imu", "board")
    if force is None or board is None:
        return
    size = np.linalg.norm(force, axis=-1)
    for index in np.unique(board).tolist():
        own = size[(board == index) & np.isfinite(size)]
        if len(own) and beyond(np.array(np.median(own)), *GRAVITY_M_PER_S2) > 0:
            yield Found(run.at("imu", "a_B"), f"board {index} does not feel gravity", "a median of 8 .. 12 m/s^2",
                        f"{number(float(np.median(own)))} m/s^2")  # fmt: skip


def _held(values: np.ndarray) -> tuple[int, int]:
    """For how many samples the last value has been said at the end, and what is the longest that any was before."""
    ends = np.append(np.flatnonzero(np.diff(values)) + 1, len(values))
    held = np.diff(ends, prepend=0)
    return int(held[-1]), int(held[:-1].max(initial=0))


def _moved(columns: dict[int, np.ndarray], sensor: int, count: int) -> bool:
    """Whether another sensor moved in the share of the run that is a sensor's last `count` samples."""
    share = count / len(columns[sensor])
    return any(
        np.ptp(values[len(values) - max(1, int(share * len(values))) :]) > 0
        for other, values in columns.items() if other != sensor
    )  # fmt: skip


def _lost(missing: np.ndarray, board: np.ndarray | None) -> np.ndarray:
    """Share of the samples that a sensor is missing in, (sensor,); of its own board where they take turns.

    missing: (sample, sensor), bool. board: that sent each sample, None where all come at once.
    """
    if board is None:
        return np.asarray(missing.mean(axis=0))
    found = np.ones(missing.shape[1])
    for sensor in range(missing.shape[1]):
        own = np.isin(board, np.unique(board[~missing[:, sensor]]))
        if own.any():
            found[sensor] = missing[own, sensor].mean()
    return found


def _columns(run: Run, name: str) -> Iterator[tuple[int, np.ndarray]]:
    """(sensor, its received samples) of one dataset of `sensors`; sensors that were never received are left out."""
    values = run.array("sensors", name)
    for sensor in range(0 if values is None else values.shape[1]):
        received = values[np.isfinite(values[:, sensor]), sensor]  # type: ignore[index]
        if len(received):
            yield sensor, received
