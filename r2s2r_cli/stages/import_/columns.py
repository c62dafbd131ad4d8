"""Columns of the trajectory CSV: which a robot needs, and what their names say about the unit."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import InputError, quoted
from r2s2r_cli.stages.import_ import clock
from r2s2r_cli.stages.import_.checks import UNITS
from r2s2r_cli.stages.import_.files import clipped, in_place, nearest_name, shown
from r2s2r_cli.stages.import_.table import Table
from schemas.results_import import LengthUnit
from schemas.robot import Robot

_CAP = re.compile(r"cap(\d{1,4})_([xyz])_(m|dm|cm|mm)", re.ASCII)
_NUMBERED = re.compile(r"(cap|target|control|length)(\d{1,4})(?:_.*)?", re.ASCII)
_LENGTH = re.compile(r"length(\d{1,4})_(m|dm|cm|mm)", re.ASCII)


@dataclass(frozen=True)
class Columns:
    """Where each quantity stands: indices of columns of the table."""

    unit: LengthUnit
    """Of cap and length columns: m, dm, cm or mm."""
    t: int
    caps: np.ndarray
    """Shape (cap, xyz)."""
    target: np.ndarray
    """Shape (actuated,)."""
    control: np.ndarray | None
    """Shape (actuated,), None where the file has no control."""
    length: np.ndarray
    """Shape (sensor,); empty where the file has no lengths."""
    length_cable: np.ndarray
    """Cable of each length column, shape (sensor,)."""


def find_columns(table: Table, robot: Robot) -> Columns:
    """Match the header with the robot.

    Needed: `t_s`, `cap<i>_{x,y,z}_<unit>` for every cap, `target<k>` for every actuated cable. Optional:
    `control<k>` for all of them, `length<j>_<unit>` for any cables. The unit is m, dm, cm or mm, one for the whole
    file. Any order. Raises InputError for missing and unknown columns, and numbers of caps or cables that differ.
    """
    where = f"{table.where}:1"
    index = {name: i for i, name in enumerate(table.names)}
    unit = _unit(table.names, where)
    n_caps, n_actuated, n_cables = robot.n_caps, len(robot.actuated), len(robot.cables)
    caps = [[f"cap{cap}_{axis}_{unit}" for axis in "xyz"] for cap in range(n_caps)]
    target = [f"target{k}" for k in range(n_actuated)]
    control = [f"control{k}" for k in range(n_actuated)]
    length = [f"length{j}_{unit}" for j in range(n_cables)]
    needed = ["t_s", *(name for cap in caps for name in cap), *target]
    has_control = any(name in index for name in control)
    if has_control:
        needed += control
    _check_counts(table.names, where, robot)
    known = [*needed, *([] if has_control else control), *length]
    for i, name in enumerate(table.names):
        if name not in known:
            if name.lower() in clock.COLUMNS and "t_s" not in index:
                raise _other_clock(name, i, where, table.where)
            near = "t_s" if name.lower() in clock.ALIASES and "t_s" not in index else nearest_name(name, known)
            raise InputError(
                f"unknown column {shown(name)}" + (f" (did you mean {near!r}?)" if near else ""),
                where=f"{where}, column {i + 1}",
                expected=f"t_s, cap0_x_{unit} .. cap{n_caps - 1}_z_{unit}, target0 .. target{n_actuated - 1}, "
                f"control0 .., length0_{unit} ..",
                received=shown(name),
                hint=f"sed -i.bak -E '1s/(^|,) *{name} *(,|$)/\\1{near}\\2/' {quoted(table.where)}"
                if near and re.fullmatch(r"\w+", name)
                else f"{in_place(table.where, f'cut -d, --complement -f{i + 1}')}   # takes it out",
            )
    absent = [name for name in needed if name not in index]
    if absent:
        raise InputError(
            f"the column {absent[0]} is missing" + (f", and {len(absent) - 1} more" if absent[1:] else ""),
            where=where,
            expected=", ".join(absent[:8]),
            received=clipped(", ".join(table.names)),
            hint="add it to the header and to every row; docs/guides/import.md lists the columns",
        )
    lengths = [(j, index[name]) for j, name in enumerate(length) if name in index]
    return Columns(
        unit=unit,
        t=index["t_s"],
        caps=np.array([[index[name] for name in cap] for cap in caps]),
        target=np.array([index[name] for name in target], dtype=int),
        control=np.array([index[name] for name in control], dtype=int) if has_control else None,
        length=np.array([column for _, column in lengths], dtype=int),
        length_cable=np.array([cable for cable, _ in lengths], dtype=np.int64),
    )


def _other_clock(name: str, i: int, where: str, file: str) -> InputError:
    unit = clock.COLUMNS[name.lower()]
    return InputError(
        f"the stamps are in {unit}",
        where=f"{where}, column {i + 1}",
        expected="a column t_s, in seconds",
        received=shown(name),
        hint=clock.to_seconds(name, unit, file),
    )


def _unit(names: tuple[str, ...], where: str) -> LengthUnit:
    """The one length unit of the file; metres where no column says any."""
    found: dict[LengthUnit, str] = {}
    for name in names:
        match = _CAP.fullmatch(name) or _LENGTH.fullmatch(name)
        if match:
            found.update({unit: name for unit in UNITS if unit == match[match.re.groups]})
    if len(found) > 1:
        raise InputError(
            "the columns mix units of length",
            where=where,
            expected=f"one of {', '.join(UNITS)} in all cap and length columns",
            received=", ".join(sorted(found.values())),
            hint="convert the file to metres, and end those columns in _m",
        )
    return next(iter(found), "m")


def _check_counts(names: tuple[str, ...], where: str, robot: Robot) -> None:
    """Refuse a file with more caps, motors or cables than the robot has, and say which is which."""
    counts = {
        "cap": (robot.n_caps, "end caps"),
        "target": (len(robot.actuated), "actuated cables"),
        "control": (len(robot.actuated), "actuated cables"),
        "length": (len(robot.cables), "cables"),
    }
    highest: dict[str, int] = {}
    for name in names:
        match = _NUMBERED.fullmatch(name)
        if match:
            highest[match[1]] = max(highest.get(match[1], 0), int(match[2]))
    for kind, number in highest.items():
        count, word = counts[kind]
        short = kind in ("cap", "target") and number + 1 < count
        if number >= count or short:
            raise InputError(
                f"the file and the robot differ in their number of {word}",
                where=where,
                expected=f"{kind}0 .. {kind}{count - 1}: robot {robot.name} has {count} {word}",
                received=f"{kind}0 .. {kind}{number}",
                hint="import it into a project of the robot that it was recorded from (robot.toml)",
            )
