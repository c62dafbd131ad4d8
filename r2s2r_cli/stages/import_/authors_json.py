"""JSON of the authors' recorder: one file a frame, and the camera configuration. Strict, with file and position.

Units of the source: capacitance pF, lengths mm, acceleration g, rate deg/s, speed of the host's scale -99 .. 99.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from r2s2r_cli.errors import InputError, quoted
from r2s2r_cli.stages.import_.files import clipped, decode, shown

PF, MM = 1e-12, 1e-3
G_M_PER_S2 = 9.80665
DEG = math.pi / 180.0
FULL_SPEED = 99.0
"""Speed of the wire protocol that means full duty (PWM = 255 speed / 99)."""
MAX_STAMP_S = 1e11
_ACCELEROMETER = ("acceleromter", "accelerometer")
"""The recorder writes it without its second e."""


@dataclass(frozen=True)
class FrameRecord:
    """One frame, SI. Absent or null values are NaN, absent parts empty."""

    t: float
    """Stamp [s], of the control message."""
    info: Mapping[str, float]
    """As in the file: mm, host speeds."""
    motors: Mapping[int, Mapping[str, float]]
    """By motor: position, target, speed (host scale), done (0, 1), encoder_counts, encoder_length [m]."""
    sensors: Mapping[int, tuple[float, float]]
    """By sensor: capacitance [F], length [m]."""
    imu: Mapping[int, tuple[float, ...]]
    """By board: specific force [m/s^2] x, y, z, then angular velocity [rad/s] x, y, z."""
    mocap: Mapping[int, tuple[float, float, float]]
    """By marker: position [m]."""
    odd_imu: int
    """Boards whose entry has another form than accelerometer and gyroscope."""


def parse_json(data: bytes, where: str, what: str) -> dict[str, Any]:
    """A JSON object; keys must not repeat. NaN is read (Python writes it), infinities are not.

    Raises InputError with line and column.
    """
    text = decode(data, what, where)
    try:
        tree = json.loads(text, parse_constant=_constant, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise InputError(
            f"{what} is not JSON",
            where=f"{where}:{error.lineno}:{error.colno}",
            expected="one JSON object",
            received=error.msg,
            hint=f"python3 -m json.tool {quoted(where)}",
        ) from error
    except (ValueError, RecursionError) as error:
        reason = "nested too deep" if isinstance(error, RecursionError) else str(error)
        raise InputError(
            f"{what} is not usable JSON",
            where=where + _infinity(text),
            expected="objects of plain numbers, each key once",
            received=clipped(reason),
            hint=f"python3 -m json.tool {quoted(where)}",
        ) from error
    if not isinstance(tree, dict):
        raise InputError(
            f"{what} is not a JSON object",
            where=where,
            expected="an object: { ... }",
            received=type(tree).__name__,
            hint=f"cat {quoted(where)}",
        )
    return tree


def parse_frame(data: bytes, where: str) -> FrameRecord:
    """One frame file. Raises InputError with the file and the key of what is wrong."""
    tree = parse_json(data, where, "the frame's JSON")
    header = _part(tree, "header", where)
    if "secs" not in header:
        raise _wrong(where, "header.secs", "a stamp in seconds", "nothing")
    t = number(header["secs"], f"{where}: header.secs")
    if not abs(t) <= MAX_STAMP_S:
        raise _wrong(where, "header.secs", "a stamp in seconds", f"{t:g}")
    info = {
        key: number(value, f"{where}: info.{key}")
        for key, value in _part(tree, "info", where).items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }
    boards = _numbered(tree, "imu", where)
    read = {board: _imu(entry, f"{where}: imu.{board}") for board, entry in boards.items()}
    return FrameRecord(
        t=t,
        info=info,
        motors={i: _motor(entry, f"{where}: motors.{i}") for i, entry in _numbered(tree, "motors", where).items()},
        sensors={
            i: (
                number(entry.get("capacitance"), f"{where}: sensors.{i}.capacitance") * PF,
                number(entry.get("length"), f"{where}: sensors.{i}.length") * MM,
            )
            for i, entry in _numbered(tree, "sensors", where).items()
        },
        imu={board: values for board, values in read.items() if values is not None},
        mocap=_mocap(tree, where),
        odd_imu=sum(values is None for values in read.values()),
    )


def number(value: object, where: str) -> float:
    """A JSON number; null is NaN. Raises InputError for anything else, infinities included."""
    if value is None:
        return math.nan
    # Compared before it is converted: an integer of 400 digits fits no float, and says so by an OverflowError.
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300:
        return float(value)
    if isinstance(value, float) and math.isnan(value):
        return value
    raise InputError(
        "a value is not a number",
        where=where,
        expected="a finite number, or null for what was not received",
        received=clipped(json.dumps(value)),
        hint="correct the value, or take this frame's files out",
    )


def _motor(entry: Mapping[str, Any], where: str) -> dict[str, float]:
    keys = ("position", "target", "speed", "encoder_counts", "encoder_length")
    values = {key: number(entry.get(key), f"{where}.{key}") for key in keys}
    values["encoder_length"] *= MM
    done = entry.get("done")
    values["done"] = float(done) if isinstance(done, bool) else number(done, f"{where}.done")
    return values


def _imu(entry: Mapping[str, Any], where: str) -> tuple[float, ...] | None:
    """Accelerometer and gyroscope of one board; None for the older forms (Euler angles, quaternion)."""
    key = next((name for name in _ACCELEROMETER if name in entry), None)
    if key is not None:
        parts = (_xyz(entry[key], f"{where}.{key}"), _xyz(entry.get("gyroscope"), f"{where}.gyroscope"))
    elif "ax" in entry:
        flat = {name: number(entry.get(name), f"{where}.{name}") for name in ("ax", "ay", "az", "gx", "gy", "gz")}
        parts = ((flat["ax"], flat["ay"], flat["az"]), (flat["gx"], flat["gy"], flat["gz"]))
    else:
        return None
    return (*(a * G_M_PER_S2 for a in parts[0]), *(w * DEG for w in parts[1]))


def _mocap(tree: Mapping[str, Any], where: str) -> dict[int, tuple[float, float, float]]:
    """Markers that were seen; null, or `cond` false, is a marker that was not."""
    seen = {}
    part = tree.get("mocap") or {}
    if isinstance(part, dict):
        part = {key: value for key, value in part.items() if value is not None}
    for marker, entry in _numbered({"mocap": part}, "mocap", where).items():
        if entry.get("cond") is not False:
            x, y, z = _xyz(entry, f"{where}: mocap.{marker}")
            seen[marker] = (x * MM, y * MM, z * MM)
    return seen


def _xyz(entry: object, where: str) -> tuple[float, float, float]:
    if entry is None:
        return math.nan, math.nan, math.nan
    if not isinstance(entry, dict):
        raise _wrong(where, "", 'an object {"x": ..., "y": ..., "z": ...}', json.dumps(entry))
    return (
        number(entry.get("x"), f"{where}.x"),
        number(entry.get("y"), f"{where}.y"),
        number(entry.get("z"), f"{where}.z"),
    )


def _part(tree: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    """An object of the frame; absent or null is empty."""
    part = tree.get(key)
    if part is None:
        return {}
    if not isinstance(part, dict):
        raise _wrong(where, key, "an object", json.dumps(part))
    return part


def _numbered(tree: Mapping[str, Any], key: str, where: str) -> dict[int, Mapping[str, Any]]:
    """An object whose keys are numbers 0, 1, ... and whose values are objects."""
    entries = {}
    for name, entry in _part(tree, key, where).items():
        if not (name.isascii() and name.isdigit() and len(name) <= 4):
            raise _wrong(where, f"{key}.{shown(name)}", "a number as key", shown(name))
        if not isinstance(entry, dict):
            raise _wrong(where, f"{key}.{name}", "an object", json.dumps(entry))
        entries[int(name)] = entry
    return dict(sorted(entries.items()))


def _constant(name: str) -> float:
    if name == "NaN":
        return math.nan
    raise ValueError(f"{name} is not a JSON number")


def _infinity(text: str) -> str:
    """`:line:column` of the first Infinity, which the parser reports without its place; else empty."""
    at = text.find("Infinity")
    return f":{text.count(chr(10), 0, at) + 1}:{at - text.rfind(chr(10), 0, at)}" if at >= 0 else ""


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"the key {shown(key)} stands twice")
        found[key] = value
    return found


def _wrong(where: str, key: str, expected: str, received: str) -> InputError:
    return InputError(
        "a frame is not as the recorder writes it",
        where=f"{where}: {key}" if key else where,
        expected=expected,
        received=clipped(received),
        hint=f"python3 -m json.tool {quoted(where.split(': ')[0])}",
    )
