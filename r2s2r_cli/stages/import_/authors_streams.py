"""Streams of the authors' recording from its frame records: commands, motors, sensors, inertial units, mocap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from r2s2r_cli.artifact import Group, Scalar
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.import_.authors_json import FULL_SPEED, MM, FrameRecord
from r2s2r_cli.stages.import_.run import finite_attributes
from schemas.robot import Robot

CHIP_NOT_READY_F = 0.20e-12
"""The boards send exactly 0.20 pF while the sensor chip is not initialised."""
_EPS = 1e-6


@dataclass(frozen=True)
class Streams:
    """Groups by stream, attributes of the run, and what is to be said about them."""

    groups: dict[str, Group] = field(default_factory=dict)
    attributes: dict[str, Scalar] = field(default_factory=dict)
    missing: dict[str, int] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)


def build_streams(records: Sequence[FrameRecord], t: np.ndarray, robot: Robot, where: str) -> Streams:
    """All streams that the records hold. t: stamps since the start [s], shape (frame,). Raises InputError."""
    streams = Streams()
    _controller(records, streams)
    _motors(records, t, robot, where, streams)
    _sensors(records, t, robot, where, streams)
    _imu(records, t, streams)
    _mocap(records, t, robot, streams)
    return streams


def _controller(records: Sequence[FrameRecord], streams: Streams) -> None:
    """Attributes from `info` of the first frame; a change within the run is reported."""
    info = records[0].info
    changed = sorted({key for record in records for key, value in record.info.items() if info.get(key) != value})
    if changed:
        streams.warnings.append(f"info changes within the run ({', '.join(changed)}): the first frame's is stored")
    # The newer host leaves RANGE at 0 and gives one range to cables 0, 2, 4 and one to 1, 3, 5.
    ranges = {info.get(key, 0.0) for key in ("RANGE", "RANGE024", "RANGE135")} - {0.0}
    if len(ranges) > 1:
        streams.warnings.append("cables have different ranges (RANGE024, RANGE135): pid_range is left open")
    speed = info.get("max_speed", 0.0)
    streams.attributes.update(
        finite_attributes(
            pid_min_length=info["min_length"] * MM if "min_length" in info else None,
            pid_range=ranges.pop() * MM if len(ranges) == 1 else None,
            pid_tolerance=info.get("tol"),
            pid_p=info.get("P"),
            pid_i=info.get("I"),
            pid_d=info.get("D"),
            motor_speed=speed / FULL_SPEED if speed > 0 else None,
        )
    )


def _motors(records: Sequence[FrameRecord], t: np.ndarray, robot: Robot, where: str, streams: Streams) -> None:
    """`commands` and `motors`. Motor k drives the k-th actuated cable; speed over its maximum, +1 reels in."""
    n_motors = len(robot.actuated)
    _check_numbers([max(record.motors, default=-1) for record in records], n_motors, "motors", robot, where)
    if not any(record.motors for record in records):
        streams.warnings.append("no frame holds motors: there are no commands, so no target intervals")
        return
    keys = ("position", "target", "speed", "encoder_counts", "encoder_length", "done")
    values = np.full((len(records), n_motors, len(keys)), np.nan)
    for row, record in enumerate(records):
        for motor, entry in record.motors.items():
            values[row, motor] = [entry[key] for key in keys]
    column = {key: values[:, :, i] for i, key in enumerate(keys)}
    streams.missing["motor"] = int(np.isnan(column["target"]).sum())
    maximum = np.array([record.info.get("max_speed", 0.0) for record in records])[:, None]
    speed = np.divide(column["speed"], maximum, out=np.full_like(column["speed"], np.nan), where=maximum > 0)
    over = np.argwhere(np.abs(speed) > 1 + _EPS)
    if len(over):
        row, motor = (int(i) for i in over[0])
        raise InputError(
            "a motor is faster than the maximum speed of its frame",
            where=f"{where}, frame at {t[row]:.3f} s: motors.{motor}.speed",
            expected=f"at most info.max_speed = {maximum[row, 0]:g}",
            received=f"{column['speed'][row, motor]:g}",
            hint="correct info.max_speed: without it the commands have no scale",
        )
    commands = {"t": t, "target": column["target"]}
    motors = {"t": t, "position": column["position"]}
    if np.isfinite(speed).any():
        commands["control"] = motors["speed"] = speed
    else:
        streams.warnings.append("no speed or no info.max_speed: the control is not known")
    if np.isfinite(column["done"]).all():
        commands["done"] = column["done"] != 0
    for key, name in (("encoder_counts", "encoder"), ("encoder_length", "encoder_length")):
        if np.isfinite(column[key]).any():
            motors[name] = column[key]
    outside = (column["target"] < -_EPS) | (column["target"] > 1 + _EPS)
    if outside.any():
        streams.warnings.append(f"{int(outside.any(axis=1).sum())} frames have a target outside 0 .. 1")
    streams.groups["commands"] = Group(datasets=commands)
    streams.groups["motors"] = Group(datasets=motors)


def _sensors(records: Sequence[FrameRecord], t: np.ndarray, robot: Robot, where: str, streams: Streams) -> None:
    """`sensors`: sensor j is the j-th of robot.toml."""
    if not any(record.sensors for record in records):
        return
    n_sensors = len(robot.sensors)
    _check_numbers([max(record.sensors, default=-1) for record in records], n_sensors, "sensors", robot, where)
    values = np.full((len(records), n_sensors, 2), np.nan)
    for row, record in enumerate(records):
        for sensor, entry in record.sensors.items():
            values[row, sensor] = entry
    capacitance, length = values[:, :, 0], values[:, :, 1]
    streams.missing["capacitance"] = int(np.isnan(capacitance).sum())
    not_ready = int(np.isclose(capacitance, CHIP_NOT_READY_F, rtol=1e-9, atol=0.0).sum())
    if not_ready:
        streams.warnings.append(f"{not_ready} capacitances are exactly 0.20 pF: the sensor chip was not initialised")
    datasets = {
        "t": t,
        "capacitance": capacitance,
        "length": length,
        "cable": np.array([sensor.cable for sensor in robot.sensors], dtype=np.int64),
    }
    streams.groups["sensors"] = Group(datasets=datasets)


def _imu(records: Sequence[FrameRecord], t: np.ndarray, streams: Streams) -> None:
    """`imu`: one row a board and frame."""
    odd = sum(record.odd_imu for record in records)
    if odd:
        streams.warnings.append(f"{odd} imu entries are neither accelerometer nor gyroscope: left out")
    rows = [(t[i], board, *values) for i, record in enumerate(records) for board, values in record.imu.items()]
    if not rows:
        return
    table = np.array(rows)
    streams.groups["imu"] = Group(
        datasets={"t": table[:, 0], "board": table[:, 1].astype(np.uint8), "a_B": table[:, 2:5], "w_WB": table[:, 5:8]}
    )


def _mocap(records: Sequence[FrameRecord], t: np.ndarray, robot: Robot, streams: Streams) -> None:
    """`mocap`: marker c is end cap c, in the frame of the motion capture."""
    if not any(record.mocap for record in records):
        return
    p_ME = np.full((len(records), robot.n_caps, 3), np.nan)
    others: set[int] = set()
    for row, record in enumerate(records):
        for marker, point in record.mocap.items():
            if marker < robot.n_caps:
                p_ME[row, marker] = point
            else:
                others.add(marker)
    if others:
        streams.warnings.append(f"markers {sorted(others)} are no end caps: left out")
    streams.missing["marker"] = int(np.isnan(p_ME).any(axis=2).sum())
    streams.groups["mocap"] = Group(datasets={"t": t, "p_ME": p_ME})


def _check_numbers(highest: Sequence[int], count: int, what: str, robot: Robot, where: str) -> None:
    worst = max(highest)
    if worst >= count:
        raise InputError(
            f"the recording and the robot differ in their number of {what}",
            where=where,
            expected=f"{what} 0 .. {count - 1}: robot {robot.name} has {count}",
            received=f"{what} 0 .. {worst}",
            hint="import it into a project of the robot that it was recorded from (robot.toml)",
        )
