"""Identified values back into a robot description, where robot.toml has such a number."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify.free.catalogue import entries, unknown
from r2s2r_cli.stages.identify.free.entry import Entry
from schemas.robot import Robot

_PID = {
    "pid_p": "p", "pid_i": "i", "pid_d": "d", "pid_tolerance": "tolerance", "pid_min_length": "min_length_m",
    "pid_range": "range_m",
}  # fmt: skip
_LAWS = ("stiffness_n_per_m", "stiffness2_n_per_m2", "stiffness3_n_per_m3")


def with_values(robot: Robot, values: Mapping[str, float]) -> tuple[Robot, tuple[str, ...]]:
    """The robot with the values, and the names that robot.toml cannot hold (friction of single caps, speeds of one
    direction, lag, droop, slope, delays, effects), in the order of the catalogue.

    Values mean what they mean for `robot`: where it is written before, `rest_length` and the like are relative to it. A
    winch faster than its no-load speed keeps speed 1, and its no-load speed is raised. Where sites turn, the lengths
    at which winches end are measured anew in the rest pose. Raises UsageError for an unknown name, InputError where
    the robot would be none.
    """
    known = entries(robot)
    for name in values:
        if name not in known:
            raise unknown(name, tuple(known), "--fix")
    data, left = robot.model_dump(), []
    for name in sorted(values, key=list(known).index):
        if not _written(data, robot, known[name], float(values[name])):
            left.append(name)
    try:
        return Robot.model_validate(data), tuple(left)
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(
            "with these values it is no robot", where="robot.toml: " + ".".join(map(str, first["loc"])),
            expected=str(first["msg"]), received=str(first["input"])[:60], hint="r2s2r validate robot.toml",
        ) from error  # fmt: skip


def _written(data: dict[str, Any], robot: Robot, entry: Entry, value: float) -> bool:
    """Whether robot.toml has the number, which then is written into `data`."""
    family = entry.family
    if family == "motor_speed":
        _speed(data, robot, entry, value)
    elif family in _PID:
        data["pid"][_PID[family]] = value
    elif family == "restitution" or (family == "friction" and entry.element is None):
        data["contact"][family] = value
    elif family == "tendon_stiffness":
        for sensor, own in zip(data["sensors"], robot.sensors, strict=True):
            if own.stiffness_n_per_m > 0 and entry.element in (None, own.cable):
                sensor["stiffness_n_per_m"] = own.stiffness_n_per_m * (value / entry.nominal)
    elif family.split("_")[0] in ("stiffness", "damping", "rest"):
        _cables(data, robot, entry, value)
    elif family in ("mass", "com"):
        for rod, own_rod in _chosen(data["rods"], robot.rods, entry.element):
            for part, own_part in zip(rod["parts"], own_rod.parts, strict=True):
                if family == "mass":
                    part["mass_kg"] = own_part.mass_kg * (value / entry.nominal)
                else:
                    part["offset_m"] = own_part.offset_m + (value - entry.nominal)
    elif family == "attachment_phase":
        for cable in data["cables"]:
            cable["sites_m"] = tuple(
                _turned(site, value) if cap // 2 == entry.element else site
                for cap, site in zip(cable["caps"], cable["sites_m"], strict=True)
            )
    else:
        return False
    return True


def _speed(data: dict[str, Any], robot: Robot, entry: Entry, value: float) -> None:
    for motor, own in zip(data["motors"], robot.motors, strict=True):
        if entry.element in (None, own.cable):
            speed = own.speed * (value / entry.nominal)
            motor["speed"] = min(speed, 1.0)
            motor["no_load_rad_per_s"] = own.no_load_rad_per_s * max(speed, 1.0)


def _cables(data: dict[str, Any], robot: Robot, entry: Entry, value: float) -> None:
    """Stiffness, damping, rest length: of all cables, those of one kind, or one."""
    family, _, kind = entry.family.partition("_")
    for cable, own in _chosen(data["cables"], robot.cables, entry.element):
        if kind in ("actuated", "passive") and own.kind != kind:
            continue
        if family == "stiffness":
            for law in _LAWS:
                cable[law] = getattr(own, law) * (value / entry.nominal)
        elif family == "damping":
            own_damping = own.damping_n_s_per_m
            cable["damping_n_s_per_m"] = own_damping * (value / entry.nominal) if entry.nominal > 0 else value
        elif own.rest_length_m is not None:
            cable["rest_length_m"] = own.rest_length_m + (value - entry.nominal)


def _chosen(data: list[Any], own: tuple[Any, ...], element: int | None) -> list[tuple[dict[str, Any], Any]]:
    both = list(zip(data, own, strict=True))
    return both if element is None else [both[element]]


def _turned(site: tuple[float, float, float], angle: float) -> tuple[float, float, float]:
    """A point turned about z."""
    x, y, z = site
    c, s = math.cos(angle), math.sin(angle)
    return (c * x - s * y, s * x + c * y, z)
